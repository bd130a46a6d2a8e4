//! Equal meshes are kept once: a copy moved by an exact translation becomes an instance.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use canted_obb::Affine;

use crate::{Instance, Mesh, MeshId, Scene};

/// The first mesh of each shape met so far.
#[derive(Default)]
pub(super) struct Shapes {
    first: HashMap<u64, MeshId>,
}

impl Shapes {
    /// Adds an instance to the scene, and the mesh where it is no exact copy of the first mesh of its shape.
    ///
    /// `None` for more meshes than 32 bits can number.
    pub(super) fn place(&mut self, mesh: Mesh, first_primitive: u32, scene: &mut Scene) -> Option<()> {
        let next = MeshId(u32::try_from(scene.meshes.len()).ok()?);
        let first = *self.first.entry(shape(&mesh)).or_insert(next);
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

/// A vertex relative to the first one. Exactly translated meshes agree in all of them, in `f64` as in real numbers.
fn relative(mesh: &Mesh) -> impl Iterator<Item = [f64; 3]> {
    let first = mesh.positions.first().copied().unwrap_or_default().map(f64::from);
    mesh.positions.iter().map(move |&position| std::array::from_fn(|k| f64::from(position[k]) - first[k]))
}

/// A hash that translation leaves as it is.
fn shape(mesh: &Mesh) -> u64 {
    let mut hasher = DefaultHasher::new();
    mesh.triangles.hash(&mut hasher);
    for part in &mesh.parts {
        part.material.hash(&mut hasher);
    }
    for position in relative(mesh) {
        // -0.0 equals 0.0, so both must hash alike.
        position.map(|x| (x + 0.0).to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

/// The translation that takes `original` to `copy`: all coordinate differences, in `f64`, are this `f32`.
fn translation(original: &Mesh, copy: &Mesh) -> Option<[f32; 3]> {
    let same_surface = original.triangles == copy.triangles
        && original.parts == copy.parts
        && original.normals == copy.normals
        && original.uvs == copy.uvs;
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
    fn placed(meshes: Vec<Mesh>, want: &[(u32, [f32; 3])]) {
        let (mut scene, mut shapes) = (Scene::default(), Shapes::default());
        for (k, mesh) in (0..).zip(meshes) {
            shapes.place(mesh, 10 * k, &mut scene).unwrap();
        }
        let got: Vec<_> = scene.instances.iter().map(|i| (i.mesh.0, i.world_from_object.columns[3])).collect();
        assert_eq!(got, want);
        assert!(scene.instances.iter().zip(0..).all(|(instance, k)| instance.first_primitive == 10 * k));
    }

    #[test]
    fn exact_copies_are_instances() {
        let moved = CORNERS.map(|[x, y, z]| [x + 3.0, y - 4.5, z - 0.0]);
        placed(vec![triangle(CORNERS, 0), triangle(moved, 0)], &[(0, [0.0; 3]), (0, [3.0, -4.5, 0.0])]);
    }

    #[test]
    fn other_shapes_materials_and_inexact_copies_are_meshes() {
        let bent = [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.0, 1.0, 1e-6]];
        placed(vec![triangle(CORNERS, 0), triangle(CORNERS, 1)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        placed(vec![triangle(CORNERS, 0), triangle(bent, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        // The copy is exact in real numbers, but 2^25 + 1 is no `f32`.
        let (far, farther) = (-1.0, 33_554_432.0);
        let at = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        placed(vec![triangle(at(far), 0), triangle(at(farther), 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn tiny_details_that_a_far_copy_would_lose_keep_it_apart() {
        // Differences from the far triangle round to one number, though only one of the two has an area.
        let near = [[1e-10, 0.0, 0.0], [2e-10, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let far = [[1e10, 0.0, 0.0], [1e10, 0.0, 0.0], [1e10, 1.0, 0.0]];
        placed(vec![triangle(near, 0), triangle(far, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn zero_has_one_shape_with_either_sign() {
        let mut negative = CORNERS;
        negative[0] = [-0.0, 0.0, -0.0];
        placed(vec![triangle(CORNERS, 0), triangle(negative, 0)], &[(0, [0.0; 3]), (0, [0.0; 3])]);
    }
}
