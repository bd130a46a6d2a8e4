//! What readers share about meshes: triangle checks, scenes of a single mesh, vertices split by attributes of faces, colors.

use std::collections::HashMap;
use std::path::Path;

use canted_obb::Affine;
use canted_obb::vector::{cross, normalized, sub, to_f32, to_f64};

use super::error::ReadError;
use super::polygon::{self, Cut};
use crate::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene};

/// Triangles of a part, of a file that is read in parts.
pub(crate) const PART: usize = 1 << 14;

/// Takes the triangles of a part.
pub(crate) type TakeTriangles<'a, E> = dyn FnMut(&[[[f32; 3]; 3]]) -> Result<(), E> + 'a;

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
    /// Memory of [`MeshChecks::cut`]: corners of the face, and its triangles by the numbers of corners.
    polygon: Vec<[f32; 3]>,
    cuts: Vec<[usize; 3]>,
}

impl MeshChecks {
    /// Appends the triangles of a face, without those that have a non-finite corner; a face with fewer than three corners is counted.
    pub(crate) fn cut<T: Copy>(&mut self, face: &[T], position: impl Fn(T) -> [f32; 3], triangles: &mut Vec<[T; 3]>) {
        if face.len() < 3 {
            self.n_small_faces += 1;
            return;
        }
        let (mut polygon, mut cuts) = (std::mem::take(&mut self.polygon), std::mem::take(&mut self.cuts));
        polygon.extend(face.iter().map(|&corner| position(corner)));
        self.n_overlapping_faces += usize::from(polygon::triangulate(&polygon, &mut cuts) == Cut::Overlapping);
        triangles.extend(cuts.iter().filter(|cut| self.keeps(cut.map(|k| polygon[k]))).map(|cut| cut.map(|k| face[k])));
        polygon.clear();
        cuts.clear();
        (self.polygon, self.cuts) = (polygon, cuts);
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

    /// What is counted, in words; fails if no triangle has a positive area.
    pub(crate) fn warnings(self, path: &Path) -> Result<Vec<String>, ReadError> {
        let Self { n_kept, n_flat, n_dropped, n_small_faces, n_overlapping_faces, n_unweighted_vertices, .. } = self;
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
        Ok(counted.map(|(count, what)| format!("{what}: {count}")).collect())
    }

    /// Appends the warnings to the scene; fails if no triangle has a positive area.
    pub(crate) fn finish(self, path: &Path, scene: &mut Scene) -> Result<(), ReadError> {
        scene.warnings.extend(self.warnings(path)?);
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
    let [a, b, c] = corners.map(to_f64);
    cross(sub(b, a), sub(c, a)) == [0.0; 3]
}

/// Normalizes a vector of any length to single precision; `None` if it has no direction.
pub(crate) fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    normalized(v).map(to_f32)
}

/// A normalized shading normal; zero if it has no direction.
pub(crate) fn unit_normal(normal: [f32; 3]) -> [f32; 3] {
    unit(to_f64(normal)).unwrap_or_default()
}

/// Texture coordinates; zero if not finite.
pub(crate) fn usable_uv(uv: [f32; 2]) -> [f32; 2] {
    if uv.iter().all(|x| x.is_finite()) { uv } else { [0.0; 2] }
}

/// Adds `mesh`, named after the file, and its materials to a scene without meshes, as PLY, STL and OFF files give it. Without parts, the
/// whole mesh has the first material.
pub(crate) fn single_mesh(
    path: &Path,
    mesh: Mesh,
    materials: Vec<Material>,
    checks: MeshChecks,
    mut scene: Scene,
) -> Result<Scene, ReadError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let whole = || vec![Part { first_triangle: 0, material: MaterialId(0) }];
    let parts = if mesh.parts.is_empty() { whole() } else { mesh.parts };
    if u32::try_from(mesh.triangles.len()).is_err() {
        return Err(ReadError::unsupported(path, "more than 2^32 triangles"));
    }
    scene.materials = materials;
    scene.meshes.push(Mesh { name, parts, ..mesh });
    let (mesh, world_from_object) = (MeshId(0), Affine::IDENTITY);
    scene.instances.push(Instance { mesh, world_from_object, world_from_object_close: None, first_primitive: 0 });
    checks.finish(path, &mut scene)?;
    Ok(scene)
}

/// A corner of a triangle: its vertex, its number among the corners of all faces, and its face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) vertex: u32,
    pub(crate) number: u32,
    pub(crate) face: u32,
}

/// A vertex where corners with equal attributes meet: its number in the file, and the bits of its texture coordinates and of its color.
type Key = (u32, [u32; 2], [u32; 4]);

/// Numbers vertices anew, so that each has one pair of texture coordinates and one color.
#[derive(Default)]
pub(crate) struct Split {
    numbers: HashMap<Key, u32>,
    /// By new number, a corner of the vertex.
    pub(crate) corners: Vec<Corner>,
}

impl Split {
    /// The triangles with new vertex numbers, in order of first use; `None` for more than 2^32 vertices.
    pub(crate) fn triangles(
        &mut self,
        triangles: &[[Corner; 3]],
        uvs: Option<&[[f32; 2]]>,
        colors: Option<&[[f32; 4]]>,
    ) -> Option<Vec<[u32; 3]>> {
        let mut split = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let mut numbers = [0; 3];
            for (corner, number) in triangle.iter().zip(&mut numbers) {
                let uv = uvs.map_or([0.0; 2], |uvs| uvs[corner.number as usize]);
                let color = colors.map_or([0.0; 4], |colors| colors[corner.face as usize]);
                let next = u32::try_from(self.corners.len()).ok()?;
                let key = (corner.vertex, uv.map(f32::to_bits), color.map(f32::to_bits));
                *number = *self.numbers.entry(key).or_insert(next);
                if *number == next {
                    self.corners.push(*corner);
                }
            }
            split.push(numbers);
        }
        Some(split)
    }
}

/// The mark of a vertex without a color; it becomes white.
pub(crate) const NO_COLOR: [f32; 3] = [f32::NAN; 3];

/// Decodes RGB colors to linear RGBA with alpha 1, each value divided by `max`.
///
/// PLY, OFF and OBJ do not state the encoding. Colors are taken as sRGB-encoded, as MeshLab and Blender write them.
///
/// Without `max` it is 255 if any value exceeds 1, else 1. Values that are not finite become 1, others are clamped. The error
/// is a warning: negative values are not colors (some files have normals in their place). `of` is what has a color: `vertex` or `face`.
pub(crate) fn linear_colors(of: &str, colors: Vec<[f32; 3]>, max: Option<f32>) -> Result<Vec<[f32; 4]>, String> {
    if let Some(at) = colors.iter().position(|color| color.iter().any(|&x| x < 0.0)) {
        let [r, g, b] = colors[at];
        return Err(format!("ignoring {of} colors: negative value at {of} {at}: {r} {g} {b}"));
    }
    let exceeds_one = || colors.iter().flatten().any(|&x| x > 1.0 && x.is_finite());
    let max = max.unwrap_or_else(|| if exceeds_one() { 255.0 } else { 1.0 });
    let decode = |x: f32| if x.is_finite() { decode((x / max).min(1.0)) } else { 1.0 };
    Ok(colors.into_iter().map(|[r, g, b]| [decode(r), decode(g), decode(b), 1.0]).collect())
}

/// The transfer function of sRGB (IEC 61966-2-1).
fn decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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

    #[test]
    fn scales_of_bytes_and_unit_numbers_agree() {
        let unit = linear_colors("vertex", vec![[0.0, 1.0, 0.2], NO_COLOR], None).unwrap();
        assert_eq!(unit[1], [1.0; 4]);
        assert_eq!(linear_colors("vertex", vec![[0.0, 255.0, 51.0], NO_COLOR], None).unwrap(), unit);
        assert_eq!(linear_colors("vertex", vec![[0.0, 65535.0, 13107.0], NO_COLOR], Some(65535.0)).unwrap(), unit);
        // 0.2 is 0.0331 in linear light, by the published table.
        assert!((unit[0][2] - 0.0331).abs() < 5e-5, "{}", unit[0][2]);
        assert_eq!(unit[0], [0.0, 1.0, unit[0][2], 1.0]);
        assert_eq!(linear_colors("vertex", vec![[300.0, 0.0, 0.0]], Some(255.0)).unwrap(), [[1.0, 0.0, 0.0, 1.0]]);
    }

    #[test]
    fn negative_values_are_not_colors() {
        let warning = linear_colors("vertex", vec![[0.0; 3], [0.0, -1.0, 0.0]], None).unwrap_err();
        assert_eq!(warning, "ignoring vertex colors: negative value at vertex 1: 0 -1 0");
    }
}
