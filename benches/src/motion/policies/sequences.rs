//! Sequences of scenes that move: generated ones, and the glTF sample model Fox where it is available.

use anyhow::Result;
use canted_fixtures::{self as fixtures, SplitMix64};
use canted_obb::Affine;
use canted_renderer::{UpdateOptions, UpdatePolicy};
use canted_scene::{AnimatedScene, Instance, Mesh, MeshId, ReadOptions, Scene};
use elastic::{Material, Stage, torus};

/// Frames per second of the fox and of the elastic body.
pub(in crate::motion) const FPS: u16 = 24;

/// The scene of each frame.
pub(super) struct Sequence {
    pub(super) name: &'static str,
    pub(super) frames: Vec<Scene>,
    /// Camera and target; `None` looks at everything.
    pub(super) view: Option<[[f64; 3]; 2]>,
}

/// All sequences, and the names of those whose model is not available; `is_quick` makes them smaller.
pub(super) fn all(n_frames: u16, is_quick: bool) -> Result<(Vec<Sequence>, Vec<&'static str>)> {
    let mut all = vec![
        twisted(n_frames, if is_quick { 12 } else { 15 }),
        morphed(n_frames, if is_quick { 4 } else { 6 }),
        exploding(n_frames, if is_quick { 200 } else { 2_000 }),
        elastic_body(n_frames, if is_quick { [48, 16] } else { [192, 64] })?,
    ];
    let mut missing = vec![];
    match fox(n_frames)? {
        Some(fox) => all.insert(1, fox),
        None => missing.push("skinned fox"),
    }
    Ok((all, missing))
}

/// A scaffold twisted by two degrees more in each frame.
fn twisted(n_frames: u16, log2_triangles: u32) -> Sequence {
    let still = fixtures::scaffold_of(1, false, fixtures::scaffold_nodes(log2_triangles));
    let [least, greatest] = still.bounds();
    let height = (greatest[2] - least[2]).max(f32::MIN_POSITIVE);
    let at = |frame: u16| {
        let twist = |&[x, y, z]: &[f32; 3]| {
            let (sin, cos) = (f32::from(2 * frame).to_radians() * (z - least[2]) / height).sin_cos();
            [cos * x - sin * y, sin * x + cos * y, z]
        };
        alone(still.positions.iter().map(twist).collect(), &still.triangles)
    };
    Sequence { name: "twisted scaffold", frames: (0..n_frames).map(at).collect(), view: None }
}

/// A sphere that grows bumps and loses them again, as a morph target moves it.
fn morphed(n_frames: u16, level: u32) -> Sequence {
    let (round, bumpy) = (fixtures::icosphere(level), fixtures::displaced_icosphere(3, level));
    let at = |frame: u16| {
        let weight = 4.0 * (std::f32::consts::PI * f32::from(frame) / f32::from(n_frames)).sin();
        let both = round.positions.iter().zip(&bumpy.positions);
        let positions = both.map(|(a, b)| std::array::from_fn(|k| a[k] + weight * (b[k] - a[k])));
        alone(positions.collect(), &round.triangles)
    };
    Sequence { name: "morphing sphere", frames: (0..n_frames).map(at).collect(), view: None }
}

/// Instances of two meshes that fly apart and spin.
#[expect(clippy::cast_possible_truncation, reason = "random directions")]
fn exploding(n_frames: u16, n: u32) -> Sequence {
    let mesh = |mesh: fixtures::Mesh| Mesh {
        positions: mesh.positions.iter().map(|p| p.map(|x| 0.02 * x)).collect(),
        triangles: mesh.triangles,
        ..Mesh::default()
    };
    let meshes = vec![mesh(fixtures::icosphere(2)), mesh(fixtures::displaced_icosphere(1, 3))];
    let at = |frame: u16| {
        let (mut rng, mut first_primitive) = (SplitMix64::new(5), 0);
        let instances = (0..n).map(|i| {
            let (away, spin) = (rng.signed3().map(|x| x as f32), rng.signed() as f32);
            let (sin, cos) = (0.3 * spin * f32::from(frame)).sin_cos();
            let at = away.map(|x| x * (0.5 + 0.05 * f32::from(frame) * (1.0 + spin)));
            let place = Instance {
                mesh: MeshId(i % 2),
                world_from_object: Affine { columns: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0], at] },
                world_from_object_close: None,
                first_primitive,
            };
            first_primitive += u32::try_from(meshes[i as usize % 2].triangles.len()).expect("few triangles");
            place
        });
        Scene { instances: instances.collect(), meshes: meshes.clone(), ..Scene::default() }
    };
    Sequence { name: "exploding instances", frames: (0..n_frames).map(at).collect(), view: None }
}

/// The elastic ring of `examples/elastic`, which falls and bounces.
fn elastic_body(n_frames: u16, segments: [u32; 2]) -> Result<Sequence> {
    let mut stage = Stage::new(&torus([0.45, 0.2], segments, 1.25, 0.5), 0.08, &Material::RUBBER)?;
    let options = UpdateOptions { policy: UpdatePolicy::Refit, ..UpdateOptions::default() };
    let mut frames = vec![stage.scene.clone()];
    for _ in 1..n_frames {
        stage.advance(1.0 / f64::from(FPS), &options)?;
        frames.push(stage.scene.clone());
    }
    Ok(Sequence { name: "falling elastic body", frames, view: Some([[1.3, 1.25, 3.6], [0.0, 0.62, 0.0]]) })
}

/// The run cycle of the fox.
fn fox(n_frames: u16) -> Result<Option<Sequence>> {
    let path = crate::models::folder().join("gltf/Fox.glb");
    if !path.is_file() {
        return Ok(None);
    }
    let options = ReadOptions { animation: Some("Run".to_owned()), ..ReadOptions::default() };
    let (mut animated, mut scene) = AnimatedScene::open(&path, &options)?;
    let mut frames = vec![];
    for frame in 0..n_frames {
        animated.pose(f32::from(frame) / f32::from(FPS), &mut scene)?;
        frames.push(scene.clone());
    }
    Ok(Some(Sequence { name: "skinned fox", frames, view: None }))
}

/// A scene of one mesh.
fn alone(positions: Vec<[f32; 3]>, triangles: &[[u32; 3]]) -> Scene {
    let instance = Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    };
    let mesh = Mesh { positions, triangles: triangles.to_vec(), ..Mesh::default() };
    Scene { meshes: vec![mesh], instances: vec![instance], ..Scene::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sequence_moves_and_keeps_its_triangles() {
        for Sequence { name, frames, .. } in all(3, true).unwrap().0 {
            for (a, b) in frames.iter().zip(&frames[1..]) {
                let triangles =
                    |scene: &Scene| scene.meshes.iter().map(|mesh| mesh.triangles.clone()).collect::<Vec<_>>();
                let positions =
                    |scene: &Scene| scene.meshes.iter().map(|mesh| mesh.positions.clone()).collect::<Vec<_>>();
                assert_eq!(triangles(a), triangles(b), "{name}");
                assert!(positions(a) != positions(b) || a.instances != b.instances, "{name}");
            }
        }
    }
}
