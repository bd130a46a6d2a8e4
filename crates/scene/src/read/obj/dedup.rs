//! Deduplicates meshes: an exactly translated copy becomes an instance.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use canted_obb::Affine;

use crate::{Instance, Mesh, MeshId, Scene};

/// The first mesh of each shape hash.
#[derive(Default)]
pub(super) struct MeshDedup {
    first: HashMap<u64, MeshId>,
}

impl MeshDedup {
    /// Adds an instance to the scene, and the mesh unless it is an exact translation of the first mesh with its hash.
    ///
    /// `None` for more than 2^32 meshes.
    pub(super) fn add(&mut self, mesh: Mesh, first_primitive: u32, scene: &mut Scene) -> Option<()> {
        let next = MeshId(u32::try_from(scene.meshes.len()).ok()?);
        let first = *self.first.entry(shape_hash(&mesh)).or_insert(next);
        let copied = scene.meshes.get(first.0 as usize).and_then(|original| translation(original, &mesh));
        let mut world_from_object = Affine::IDENTITY;
        let id = if let Some(translation) = copied {
            world_from_object.columns[3] = translation;
            first
        } else {
            scene.meshes.push(mesh);
            next
        };
        scene.instances.push(Instance { mesh: id, world_from_object, world_from_object_close: None, first_primitive });
        Some(())
    }
}

/// Vertices relative to the first one; equal for exactly translated meshes, as `f64` differences are exact there.
fn relative(mesh: &Mesh) -> impl Iterator<Item = [f64; 3]> {
    let first = mesh.positions.first().copied().unwrap_or_default().map(f64::from);
    mesh.positions.iter().map(move |&position| std::array::from_fn(|k| f64::from(position[k]) - first[k]))
}

/// A translation-invariant hash.
fn shape_hash(mesh: &Mesh) -> u64 {
    let mut hasher = DefaultHasher::new();
    mesh.triangles.hash(&mut hasher);
    for part in &mesh.parts {
        part.material.hash(&mut hasher);
    }
    for position in relative(mesh) {
        // -0.0 and 0.0 are equal and must have equal hashes.
        position.map(|x| (x + 0.0).to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

/// The exact `f32` translation from `original` to `copy`, if there is one.
fn translation(original: &Mesh, copy: &Mesh) -> Option<[f32; 3]> {
    let same_surface = original.triangles == copy.triangles
        && original.parts == copy.parts
        && original.normals == copy.normals
        && original.uvs == copy.uvs
        && original.colors == copy.colors;
    if !same_surface || !relative(original).eq(relative(copy)) {
        return None;
    }
    let mut pairs = original.positions.iter().zip(&copy.positions);
    let (&from, &to) = pairs.next()?;
    let moved: [f64; 3] = std::array::from_fn(|k| f64::from(to[k]) - f64::from(from[k]));
    #[expect(clippy::cast_possible_truncation, reason = "compared with the exact value")]
    let translation = moved.map(|x| x as f32);
    let is_exact = translation.map(f64::from) == moved
        && pairs.all(|(from, to)| (0..3).all(|k| f64::from(to[k]) - f64::from(from[k]) == moved[k]));
    is_exact.then_some(translation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MaterialId, Part};

    fn triangle(positions: [[f32; 3]; 3], material: u32) -> Mesh {
        Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2]],
            parts: vec![Part { first_triangle: 0, material: MaterialId(material) }],
            ..Mesh::default()
        }
    }

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[track_caller]
    fn adds(meshes: Vec<Mesh>, want: &[(u32, [f32; 3])]) {
        let (mut scene, mut dedup) = (Scene::default(), MeshDedup::default());
        for (k, mesh) in (0..).zip(meshes) {
            dedup.add(mesh, 10 * k, &mut scene).unwrap();
        }
        let got: Vec<_> = scene.instances.iter().map(|i| (i.mesh.0, i.world_from_object.columns[3])).collect();
        assert_eq!(got, want);
        assert!(scene.instances.iter().zip(0..).all(|(instance, k)| instance.first_primitive == 10 * k));
    }

    #[test]
    fn exact_copies_become_instances() {
        let moved = CORNERS.map(|[x, y, z]| [x + 3.0, y - 4.5, z - 0.0]);
        adds(vec![triangle(CORNERS, 0), triangle(moved, 0)], &[(0, [0.0; 3]), (0, [3.0, -4.5, 0.0])]);
    }

    #[test]
    fn other_shapes_materials_and_inexact_copies_stay_meshes() {
        let bent = [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.0, 1.0, 1e-6]];
        adds(vec![triangle(CORNERS, 0), triangle(CORNERS, 1)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        adds(vec![triangle(CORNERS, 0), triangle(bent, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        // The translation 2^25 + 1 is not representable in `f32`.
        let (far, farther) = (-1.0, 33_554_432.0);
        let at = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        adds(vec![triangle(at(far), 0), triangle(at(farther), 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn copies_that_lose_detail_by_rounding_stay_meshes() {
        // All differences to the far triangle round to the same number, but only one triangle has an area.
        let near = [[1e-10, 0.0, 0.0], [2e-10, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let far = [[1e10, 0.0, 0.0], [1e10, 0.0, 0.0], [1e10, 1.0, 0.0]];
        adds(vec![triangle(near, 0), triangle(far, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn negative_zero_equals_zero() {
        let mut negative = CORNERS;
        negative[0] = [-0.0, 0.0, -0.0];
        adds(vec![triangle(CORNERS, 0), triangle(negative, 0)], &[(0, [0.0; 3]), (0, [0.0; 3])]);
    }
}
