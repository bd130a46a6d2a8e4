//! Hashes of scenes, so that parts of different pictures are not joined.

use canted_film::Hash;
use canted_scene::{Curves, Environment, EnvironmentImage, Material, Mesh, MeshClose, Scene, Texture};
use rayon::prelude::*;

/// A hash of everything in a scene that pictures depend on, except light: equal for different scenes with probability 2⁻⁶⁴.
///
/// Names and warnings are not included, because they differ between machines.
#[must_use]
pub fn scene_hash(scene: &Scene) -> u64 {
    let mut hash = Hash::default();
    hash.word(geometry_hash(scene));
    hash.word(material_hash(scene));
    hash.finish()
}

/// The part of [`scene_hash`] that poses change: meshes and instances.
#[must_use]
pub fn geometry_hash(Scene { meshes, instances, .. }: &Scene) -> u64 {
    let mut hash = Hash::default();
    for part in meshes.par_iter().map(of_mesh).collect::<Vec<_>>() {
        hash.word(part);
    }
    hash.debug(instances);
    hash.finish()
}

/// The part of [`scene_hash`] that all poses share: materials and textures.
#[must_use]
pub fn material_hash(Scene { materials, textures, .. }: &Scene) -> u64 {
    let mut hash = Hash::default();
    for part in textures.par_iter().map(of_texture).collect::<Vec<_>>() {
        hash.word(part);
    }
    for material in materials {
        hash.debug(&Material { name: String::new(), ..material.clone() });
    }
    hash.finish()
}

/// A hash of the lights, the environment and the background.
#[must_use]
pub fn light_hash(scene: &Scene) -> u64 {
    let mut hash = Hash::default();
    hash.debug(&scene.lights);
    match &scene.environment {
        Some(Environment::Image(EnvironmentImage { name: _, width, height, texels, scale, turn_degrees })) => {
            hash.debug(&(width, height, scale, turn_degrees));
            hash.floats(texels);
        }
        environment => hash.debug(environment),
    }
    if let Some(background) = &scene.background {
        hash.floats(&[*background]);
    }
    hash.finish()
}

fn of_mesh(mesh: &Mesh) -> u64 {
    // Without `..`, so that a new field cannot be forgotten.
    let Mesh { name: _, positions, triangles, normals, tangents, uvs, second_uvs, colors, parts, curves, close } = mesh;
    let mut hash = Hash::default();
    hash.floats(positions);
    hash.words(triangles.iter().flatten().copied());
    hash.floats(normals.as_deref().unwrap_or_default());
    hash.floats(tangents.as_deref().unwrap_or_default());
    hash.floats(uvs.as_deref().unwrap_or_default());
    hash.floats(second_uvs.as_deref().unwrap_or_default());
    hash.floats(colors.as_deref().unwrap_or_default());
    hash.debug(parts);
    if let Some(Curves { radii, segments, shape }) = curves {
        hash.words(radii.iter().map(|radius| radius.to_bits()));
        hash.debug(segments);
        hash.debug(shape);
    }
    if let Some(MeshClose { positions, normals, tangents, radii }) = close {
        hash.floats(positions);
        hash.floats(normals.as_deref().unwrap_or_default());
        hash.floats(tangents.as_deref().unwrap_or_default());
        hash.words(radii.iter().flatten().map(|radius| radius.to_bits()));
    }
    hash.finish()
}

fn of_texture(texture: &Texture) -> u64 {
    let Texture { name: _, width, height, texels, encoding, wrap, magnification } = texture;
    let mut hash = Hash::default();
    hash.debug(&(width, height, encoding, wrap, magnification));
    hash.words(texels.iter().map(|&texel| u32::from_le_bytes(texel)));
    hash.finish()
}

#[cfg(test)]
mod tests {
    use canted_scene::{Instance, Light, builtin};

    use super::*;

    #[test]
    fn changes_of_the_picture_change_the_hash() {
        let scene = builtin();
        let changes: [fn(&mut Scene); 9] = [
            |scene| scene.meshes[0].positions[0][1] += 1e-3,
            |scene| scene.meshes[0].close = Some(MeshClose { positions: vec![[0.5; 3]], ..MeshClose::default() }),
            |scene| scene.meshes[0].triangles[7].swap(0, 1),
            |scene| scene.meshes[0].triangles.swap(3, 4),
            |scene| scene.meshes[0].uvs = Some(vec![[0.5; 2]]),
            |scene| scene.meshes.swap(0, 1),
            |scene| scene.materials[0].base_color[2] *= 0.5,
            |scene| {
                let copy: Instance = scene.instances[0];
                scene.instances.push(copy);
            },
            |scene| scene.materials.truncate(1),
        ];
        let mut hashes = vec![scene_hash(&scene)];
        for change in changes {
            let mut changed = scene.clone();
            change(&mut changed);
            hashes.push(scene_hash(&changed));
        }
        let n = hashes.len();
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), n);
    }

    #[test]
    fn names_and_warnings_are_not_hashed_and_light_is_hashed_separately() {
        let scene = builtin();
        let mut other = scene.clone();
        other.meshes[0].name += " elsewhere";
        other.materials[0].name += " elsewhere";
        other.warnings.push("something".to_owned());
        other.lights.push(Light::Point { position: [1.0; 3], intensity: [1.0; 3] });
        assert_eq!(scene_hash(&other), scene_hash(&scene));
        assert_ne!(light_hash(&other), light_hash(&scene));
    }
}
