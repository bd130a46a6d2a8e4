//! Pictures on a device: required resources, sharing with the CPU, and failures.

mod both;
mod needs;

use std::sync::atomic::AtomicBool;

use canted_film::Film;
use canted_gpu::Gpu;
use canted_obb::Affine;
use canted_renderer::{
    DeviceError, DevicePicture, Levels, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces, render,
};
use canted_scene::{
    AlphaMode, Camera, Encoding, Instance, Light, Material, MaterialId, Mesh, MeshId, Part, Scene, Texture, TextureId,
    TextureRef, Wrap,
};

pub(crate) use canted_tests::device::gpu;

pub(crate) fn small() -> Settings {
    Settings { width: 40, height: 30, samples: 4, tile: 8, ..Settings::default() }
}

/// A view from the front, slightly above.
pub(crate) fn camera() -> Camera {
    Camera::pinhole([0.2, 0.7, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0)
}

/// Calls `ask` with a device picture of the scene.
pub(crate) fn with_picture<R>(
    gpu: &Gpu,
    scene: &Scene,
    levels: Levels,
    settings: &Settings,
    ask: impl FnOnce(&DevicePicture<'_>) -> R,
) -> Result<R, DeviceError> {
    let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
    let bvh = SceneBvh::build(scene, &config).unwrap();
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    Ok(ask(&DevicePicture::new(gpu, &surfaces, &bvh, &camera(), settings)?))
}

/// The CPU's picture.
pub(crate) fn on_cpu(scene: &Scene, settings: &Settings) -> Film {
    let bvh = SceneBvh::build(scene, &SceneBvhConfig::default()).unwrap();
    render(scene, &bvh, &camera(), settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

/// A monitor that ignores reports.
pub(crate) fn silent(cancel: &AtomicBool) -> Monitor<'_> {
    Monitor::quiet(cancel)
}

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([both::tests(), needs::tests()])
}

fn instance(mesh: u32, columns: [[f32; 3]; 4]) -> Instance {
    Instance {
        mesh: MeshId(mesh),
        world_from_object: Affine { columns },
        world_from_object_close: None,
        first_primitive: 0,
    }
}

const AXES: [[f32; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];

/// Two triangles under a directional light: no texture, no normals, one level, opaque.
pub(crate) fn bare() -> Scene {
    let mesh = Mesh {
        positions: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
        ..Mesh::default()
    };
    Scene {
        meshes: vec![mesh],
        instances: vec![instance(0, AXES)],
        materials: vec![Material::default()],
        lights: vec![Light::Sun { direction: [0.0, -0.6, -0.8], irradiance: [2.0; 3] }],
        environment: Some([0.2, 0.3, 0.4].into()),
        ..Scene::default()
    }
}

/// A texture of `side` by `side` texels in all colors, a quarter of them transparent.
pub(crate) fn texture(side: u32) -> Texture {
    let texel = |i: u32| {
        let [red, green, blue] = [3, 5, 7].map(|k| u8::try_from(i * k % 256).unwrap());
        [red, green, blue, if i % 4 == 1 { 0 } else { 255 }]
    };
    Texture {
        name: "checks".to_owned(),
        width: side,
        height: side,
        texels: (0..side * side).map(texel).collect(),
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: canted_scene::Magnification::Nearest,
    }
}

/// The same with textures on both sides of a mirrored instance, normals, tangents, holes and more kinds of lights.
pub(crate) fn full() -> Scene {
    let mut scene = bare();
    let mesh = &mut scene.meshes[0];
    mesh.uvs = Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    mesh.normals = Some(vec![[0.0, 0.0, 1.0]; 4]);
    mesh.tangents = Some(vec![[1.0, 0.0, 0.0, 1.0]; 4]);
    mesh.colors = Some(vec![[0.9, 1.0, 0.8, 1.0]; 4]);
    let texture_ref = Some(TextureRef::new(TextureId(0)));
    scene.materials[0] = Material {
        base_color_texture: texture_ref,
        normal_texture: texture_ref,
        alpha_texture: texture_ref,
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    };
    scene.textures = vec![texture(16)];
    scene.instances.push(instance(0, [[-1.0, 0.0, 0.0], [0.0, 0.9, 0.1], [0.0, -0.1, 0.9], [0.3, 0.2, -0.8]]));
    scene.lights.push(Light::Sphere { center: [0.0, 2.0, 1.0], radius: 0.2, radiance: [5.0; 3] });
    scene.cameras = Vec::<Camera>::new();
    scene
}
