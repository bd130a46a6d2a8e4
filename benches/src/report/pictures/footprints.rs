//! Filter footprints of texture lookups, on a checkered plane that reaches the horizon.

use anyhow::Result;
use canted_obb::Affine;
use canted_renderer::{Integrator, Lod, Pattern, Settings};
use canted_scene::{
    Camera, Encoding, Instance, Light, Material, MaterialId, Mesh, MeshId, Part, Scene, Texture, TextureId, TextureRef,
    Wrap,
};

use super::methods;
use super::race::{self, Clock, Racer};
use super::reference::{self, Reference};
use super::stage::Stage;
use crate::report::{effort::Effort, model::Chapter};

const LODS: [(&str, Lod); 3] = [("texels", Lod::None), ("cone", Lod::Cone), ("ellipse", Lod::Aniso)];

/// Adds the comparison of footprints; returns its finding.
pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<String> {
    let stage = Stage::new("checkered plane", plane(), effort)?;
    let settings = |lod, pattern, n| Settings { lod, ..stage.settings(Integrator::Path, pattern, n, 0) };
    // Without filtering, the mean of many samples is the truth; filtering adds a bias, which the error includes.
    let truth = settings(Lod::None, Pattern::Sobol, effort.pick(8, 256, 2048));
    let reference = Reference::new(&stage, &truth, 8)?;
    let racers: Vec<Racer<'_>> = LODS
        .iter()
        .map(|&(name, lod)| Racer {
            name: name.to_owned(),
            reference: &reference,
            build: &stage.build,
            settings: settings(lod, Pattern::Stratified, 1),
            render: Box::new(|settings| reference::film(&stage, settings)),
        })
        .collect();
    let samples = methods::samples(effort);
    let courses = race::race(&racers, &samples, methods::n_seeds(effort))?;
    race::show(chapter, &stage.sized(), &courses, &samples, Clock::Processor);
    let one = |k: usize| race::mean(&courses[k].reached[0].mse);
    let best = race::best(&courses.iter().collect::<Vec<_>>(), Clock::Processor).unwrap_or_default();
    Ok(format!(
        "On a checkered plane, one sample with an elliptical footprint has {} times the error (MSE) of one with a single texel, and \
         at {} samples {best}.",
        crate::report::samples::number(one(2) / one(0)),
        samples[samples.len() - 1]
    ))
}

/// A plane of 200 by 200 checks under a sky, seen from eye height.
fn plane() -> Scene {
    const SIDE: u32 = 64;
    let texel = |i: u32| if (i % SIDE / (SIDE / 2)) ^ (i / SIDE / (SIDE / 2)) == 0 { [40; 4] } else { [230; 4] };
    let texture = Texture {
        name: "checks".to_owned(),
        width: SIDE,
        height: SIDE,
        texels: (0..SIDE * SIDE).map(texel).map(|[r, g, b, _]| [r, g, b, 255]).collect(),
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: canted_scene::Magnification::Linear,
    };
    let corners = [[-100.0, 0.0], [100.0, 0.0], [100.0, 200.0], [-100.0, 200.0f32]];
    let mesh = Mesh {
        name: "plain".to_owned(),
        positions: corners.map(|[x, z]| [x, 0.0, z]).to_vec(),
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        uvs: Some(corners.map(|[x, z]| [0.5 * x, 0.5 * z]).to_vec()),
        parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
        ..Mesh::default()
    };
    let material = Material {
        name: "checks".to_owned(),
        base_color: [1.0; 3],
        base_color_texture: Some(TextureRef::new(TextureId(0))),
        specular: 0.0,
        ..Material::default()
    };
    Scene {
        meshes: vec![mesh],
        instances: vec![Instance {
            mesh: MeshId(0),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        }],
        materials: vec![material],
        textures: vec![texture],
        lights: vec![Light::Sun { direction: [0.6, -0.8, 0.0], irradiance: [2.0; 3] }],
        environment: Some([0.4, 0.5, 0.6].into()),
        camera_names: vec![String::new()],
        cameras: vec![Camera::pinhole([0.0, 1.7, 0.0], [0.0, 0.5, 12.0], [0.0, 1.0, 0.0], 50.0)],
        warnings: vec![],
        files: vec![],
    }
}
