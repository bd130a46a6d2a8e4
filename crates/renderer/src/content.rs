//! Numbers that tell one scene from another, so that pieces of different pictures are not joined.

use std::fmt::{Debug, Write};

use canted_scene::{Environment, EnvironmentImage, Material, Mesh, Scene, Texture};
use rayon::prelude::*;

/// A number that two scenes share only if they look the same under the same light, but for an accident of 1 in 2⁶⁴.
///
/// It covers every array that pictures depend on, and neither names nor warnings: those differ from machine to machine.
#[must_use]
pub fn scene_hash(scene: &Scene) -> u64 {
    let Scene { meshes, instances, materials, textures, .. } = scene;
    let mut hash = Hash::default();
    for part in meshes.par_iter().map(of_mesh).collect::<Vec<_>>() {
        hash.word(part);
    }
    for part in textures.par_iter().map(of_texture).collect::<Vec<_>>() {
        hash.word(part);
    }
    hash.debug(instances);
    for material in materials {
        hash.debug(&Material { name: String::new(), ..material.clone() });
    }
    hash.finish()
}

/// The same for what shines from outside the surfaces: lights and environment.
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
    hash.finish()
}

fn of_mesh(mesh: &Mesh) -> u64 {
    // Without `..`: a new array must not be forgotten.
    let Mesh { name: _, positions, triangles, normals, tangents, uvs, second_uvs, colors, parts } = mesh;
    let mut hash = Hash::default();
    hash.floats(positions);
    hash.words(triangles.iter().flatten().copied());
    hash.floats(normals.as_deref().unwrap_or_default());
    hash.floats(tangents.as_deref().unwrap_or_default());
    hash.floats(uvs.as_deref().unwrap_or_default());
    hash.floats(second_uvs.as_deref().unwrap_or_default());
    hash.floats(colors.as_deref().unwrap_or_default());
    hash.debug(parts);
    hash.finish()
}

fn of_texture(texture: &Texture) -> u64 {
    let Texture { name: _, width, height, texels, encoding, wrap } = texture;
    let mut hash = Hash::default();
    hash.debug(&(width, height, encoding, wrap));
    hash.words(texels.iter().map(|&texel| u32::from_le_bytes(texel)));
    hash.finish()
}

/// A running hash of 64-bit words.
///
/// Each step is a bijection of the state for a given word, and of the word for a given state: contents of the same
/// length that differ in one word never collide.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hash {
    state: u64,
    n_words: u64,
}

impl Hash {
    /// Takes in a word.
    pub fn word(&mut self, word: u64) {
        // The finalizer of SplitMix64 (Steele et al. 2014), which moves only zero to itself; the constant moves zero.
        let x = (self.state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        self.state = x ^ (x >> 31);
        self.n_words += 1;
    }

    /// Takes in words, and how many they are.
    pub fn words(&mut self, words: impl IntoIterator<Item = u32>) {
        let before = self.n_words;
        for word in words {
            self.word(word.into());
        }
        self.word(self.n_words - before);
    }

    /// Takes in bytes, and how many they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.word(u64::from_le_bytes(word));
        }
        self.word(bytes.len() as u64);
    }

    /// The hash of what was taken in.
    #[must_use]
    pub fn finish(mut self) -> u64 {
        self.word(self.n_words);
        self.state
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) {
        self.words(values.iter().flatten().map(|x| x.to_bits()));
    }

    /// Small things by their text, which writes every field and floats exactly.
    fn debug(&mut self, value: &dyn Debug) {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(text, "{value:?}");
        self.bytes(text.as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use canted_scene::{Instance, Light, builtin};

    use super::*;

    #[test]
    fn whatever_changes_the_picture_changes_the_hash() {
        let scene = builtin();
        let changes: [fn(&mut Scene); 8] = [
            |scene| scene.meshes[0].positions[0][1] += 1e-3,
            |scene| scene.meshes[0].triangles[7].swap(0, 1),
            |scene| scene.meshes[0].triangles.swap(3, 4),
            |scene| scene.meshes[0].uvs = Some(vec![[0.5; 2]]),
            |scene| scene.meshes.swap(0, 1),
            |scene| scene.materials[0].base_color[2] *= 0.5,
            |scene| {
                let moved: Instance = scene.instances[0];
                scene.instances.push(moved);
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
    fn names_and_warnings_do_not_matter_and_light_has_its_own() {
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
