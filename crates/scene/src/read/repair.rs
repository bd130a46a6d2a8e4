//! What every reader does with bad triangles: drop what is not finite, count what has no area, say so once.

use std::path::Path;

use super::ReadError;
use crate::Scene;

/// Counts of the triangles that a reader has seen, kept and dropped.
#[derive(Debug, Default)]
pub(crate) struct Repair {
    n_kept: usize,
    n_flat: usize,
    n_dropped: usize,
    /// Faces left out because they have fewer than three corners.
    pub(crate) n_small_faces: usize,
    /// Polygons that cross themselves or are too intricate to be cut well.
    pub(crate) n_tangled_faces: usize,
    /// Vertices of skins whose weights add up to zero.
    pub(crate) n_loose_vertices: usize,
}

impl Repair {
    /// Whether a triangle is kept: all its corners are finite. Flat ones are kept, so that the numbering stays the file's.
    pub(crate) fn keeps(&mut self, corners: [[f32; 3]; 3]) -> bool {
        let finite = corners.as_flattened().iter().all(|x| x.is_finite());
        if finite {
            self.n_kept += 1;
            self.n_flat += usize::from(is_flat(corners));
        } else {
            self.n_dropped += 1;
        }
        finite
    }

    /// Takes over the counts of another.
    pub(crate) fn add(&mut self, other: &Self) {
        self.n_kept += other.n_kept;
        self.n_flat += other.n_flat;
        self.n_dropped += other.n_dropped;
        self.n_small_faces += other.n_small_faces;
        self.n_tangled_faces += other.n_tangled_faces;
        self.n_loose_vertices += other.n_loose_vertices;
    }

    /// Adds the warnings to the scene; triangles without any area are an error, as are no triangles.
    pub(crate) fn finish(self, path: &Path, scene: &mut Scene) -> Result<(), ReadError> {
        let Self { n_kept, n_flat, n_dropped, n_small_faces, n_tangled_faces, n_loose_vertices } = self;
        if n_kept == 0 && n_dropped > 0 {
            return Err(ReadError::empty(
                path,
                format!("triangles, all with a corner that is not finite: {n_dropped}"),
            ));
        }
        if n_kept == 0 {
            return Err(ReadError::empty(path, "no triangle"));
        }
        if n_flat == n_kept {
            return Err(ReadError::empty(path, format!("triangles, all without area: {n_kept}")));
        }
        let counts = [
            (n_small_faces, "faces left out for fewer than three corners"),
            (n_tangled_faces, "faces cut though they cross themselves or are too intricate"),
            (n_loose_vertices, "vertices of weights that add up to zero follow the first joint of their skin"),
            (n_dropped, "triangles dropped for a corner that is not finite"),
            (n_flat, "triangles without area"),
        ];
        let counted = counts.into_iter().filter(|&(count, _)| count > 0);
        scene.warnings.extend(counted.map(|(count, what)| format!("{what}: {count}")));
        let bounds = scene.bounds_world();
        if bounds.extent().into_iter().any(|side| side > f64::from(f32::MAX)) || bounds.area() > f64::from(f32::MAX) {
            scene.warnings.push(format!(
                "coordinates up to {:e}: the area of the scene is beyond single precision",
                bounds.reach()
            ));
        }
        Ok(())
    }
}

/// Whether the cross product of two edges is zero in `f64`.
///
/// Exact where the three corners' coordinates on an axis span few powers of two, so that edges have at most 26 bits and
/// their products at most 53. Elsewhere a rounding may hide a flat triangle; only the warnings depend on it.
fn is_flat(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let edge = |to: [f64; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2]];
    let (u, v) = (edge(b), edge(c));
    u[1] * v[2] == u[2] * v[1] && u[2] * v[0] == u[0] * v[2] && u[0] * v[1] == u[1] * v[0]
}

/// A shading normal of unit length; zero where it has no direction.
#[expect(clippy::cast_possible_truncation, reason = "components of a unit vector")]
pub(crate) fn unit_normal(normal: [f32; 3]) -> [f32; 3] {
    let normal = normal.map(f64::from);
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() { normal.map(|x| (x / length) as f32) } else { [0.0; 3] }
}

/// Texture coordinates; zero where they are not finite.
pub(crate) fn usable_uv(uv: [f32; 2]) -> [f32; 2] {
    if uv.iter().all(|x| x.is_finite()) { uv } else { [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn flat_as_in_integers(corners: [[i8; 3]; 3], exponent in -100_i32..100) {
            let [a, b, c] = corners.map(|corner| corner.map(i64::from));
            let edge = |to: [i64; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2]];
            let (u, v) = (edge(b), edge(c));
            let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let scaled = corners.map(|corner| corner.map(|x| f32::from(x) * 2_f32.powi(exponent)));
            prop_assert_eq!(is_flat(scaled), cross == [0; 3]);
        }

        #[test]
        fn collinear_corners_are_flat(start: [i8; 3], step: [i8; 3], s: i8, t: i8) {
            let at = |s: i8| std::array::from_fn(|k| f32::from(start[k]) + f32::from(s) * f32::from(step[k]));
            prop_assert!(is_flat([at(0), at(s), at(t)]));
        }

        #[test]
        fn normals_are_unit_or_zero(bits: [u32; 3]) {
            let unit = unit_normal(bits.map(f32::from_bits)).map(f64::from);
            let length = unit.iter().map(|x| x * x).sum::<f64>().sqrt();
            // One rounding to `f32` of each component moves the end by at most half a unit in the last place of 1.
            prop_assert!(length == 0.0 || (length - 1.0).abs() <= f64::from(f32::EPSILON), "{length}");
        }
    }
}
