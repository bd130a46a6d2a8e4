//! Triangle checks shared by all readers: drops non-finite triangles, counts degenerate ones, reports both.

use std::path::Path;

use canted_obb::vector::{cross, sub};

use super::ReadError;
use super::polygon::{self, Cut};
use crate::Scene;

/// Counts of kept, degenerate and dropped elements.
#[derive(Debug, Default)]
pub(crate) struct MeshChecks {
    n_kept: usize,
    n_flat: usize,
    n_dropped: usize,
    /// Skipped faces with fewer than three corners.
    pub(crate) n_small_faces: usize,
    /// Polygons whose triangles may overlap, see [`Cut::Overlapping`].
    n_overlapping_faces: usize,
    /// Skinned vertices whose weights sum to zero.
    pub(crate) n_unweighted_vertices: usize,
}

impl MeshChecks {
    /// Triangulates a polygon into `triangles`, as corner numbers, without triangles that have a non-finite corner.
    pub(crate) fn triangulate(&mut self, polygon: &[[f32; 3]], triangles: &mut Vec<[usize; 3]>) {
        triangles.clear();
        self.n_overlapping_faces += usize::from(polygon::triangulate(polygon, triangles) == Cut::Overlapping);
        triangles.retain(|triangle| self.keeps(triangle.map(|k| polygon[k])));
    }

    /// Whether a triangle is kept: all corners are finite. Degenerate triangles are kept to preserve the numbering.
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

    /// Adds the counts of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.n_kept += other.n_kept;
        self.n_flat += other.n_flat;
        self.n_dropped += other.n_dropped;
        self.n_small_faces += other.n_small_faces;
        self.n_overlapping_faces += other.n_overlapping_faces;
        self.n_unweighted_vertices += other.n_unweighted_vertices;
    }

    /// Appends the warnings to the scene; fails if no triangle has a positive area.
    pub(crate) fn finish(self, path: &Path, scene: &mut Scene) -> Result<(), ReadError> {
        let Self { n_kept, n_flat, n_dropped, n_small_faces, n_overlapping_faces, n_unweighted_vertices } = self;
        if n_kept == 0 && n_dropped > 0 {
            return Err(ReadError::empty(path, format!("all {n_dropped} triangles have a non-finite vertex")));
        }
        if n_kept == 0 {
            return Err(ReadError::empty(path, "no triangles"));
        }
        if n_flat == n_kept {
            return Err(ReadError::empty(path, format!("all {n_kept} triangles are degenerate (zero area)")));
        }
        let counts = [
            (n_small_faces, "skipping faces with fewer than 3 vertices"),
            (n_overlapping_faces, "faces that intersect themselves or are too complex to triangulate exactly"),
            (n_unweighted_vertices, "vertices with zero joint weights, attached to the first joint of their skin"),
            (n_dropped, "skipping triangles with a non-finite vertex"),
            (n_flat, "degenerate triangles (zero area)"),
        ];
        let counted = counts.into_iter().filter(|&(count, _)| count > 0);
        scene.warnings.extend(counted.map(|(count, what)| format!("{what}: {count}")));
        let bounds = scene.bounds_world();
        if bounds.extent().into_iter().any(|side| side > f64::from(f32::MAX)) || bounds.area() > f64::from(f32::MAX) {
            scene
                .warnings
                .push(format!("coordinates up to {:e}: the surface area overflows single precision", bounds.reach()));
        }
        Ok(())
    }
}

/// Whether the cross product of two edges is zero in `f64`.
///
/// Exact if the coordinates on each axis span few powers of two, so that edges have at most 26 bits and products at most
/// 53. Otherwise rounding may hide a degenerate triangle; only warnings depend on it.
fn is_flat(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    cross(sub(b, a), sub(c, a)) == [0.0; 3]
}

/// A normalized shading normal; zero if it has no direction.
#[expect(clippy::cast_possible_truncation, reason = "components of a unit vector")]
pub(crate) fn unit_normal(normal: [f32; 3]) -> [f32; 3] {
    let normal = normal.map(f64::from);
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() { normal.map(|x| (x / length) as f32) } else { [0.0; 3] }
}

/// Texture coordinates; zero if not finite.
pub(crate) fn usable_uv(uv: [f32; 2]) -> [f32; 2] {
    if uv.iter().all(|x| x.is_finite()) { uv } else { [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn is_flat_matches_exact_integer_arithmetic(corners: [[i8; 3]; 3], exponent in -100_i32..100) {
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
            // Rounding each component to `f32` changes the length by at most half a unit in the last place of 1.
            prop_assert!(length == 0.0 || (length - 1.0).abs() <= f64::from(f32::EPSILON), "{length}");
        }
    }
}
