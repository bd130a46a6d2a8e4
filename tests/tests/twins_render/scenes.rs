//! Scenes of every feature, and pictures of them on the CPU and on a device, compared.

use std::sync::atomic::AtomicBool;

use canted_film::Film;
use canted_gpu::Gpu;
use canted_obb::Affine;
use canted_renderer::{DevicePicture, Levels, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces, frame, render};
use canted_scene::{
    AlphaMode, Camera, Encoding, Environment, EnvironmentImage, Instance, Light, Magnification, Material, MaterialId,
    Mesh, MeshId, Part, Scene, Texture, TextureId, TextureRef, Wrap,
};

pub(super) fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    let parts = vec![Part { first_triangle: 0, material: MaterialId(material) }];
    Mesh { positions, triangles, parts, ..Mesh::default() }
}

/// A box with outward front faces.
fn cuboid(half: [f32; 3], material: u32) -> Mesh {
    let corner = |i: usize| std::array::from_fn(|k| if i >> k & 1 == 1 { half[k] } else { -half[k] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh((0..8).map(corner).collect(), triangles, material)
}

pub(super) fn instance(mesh: u32, columns: [[f32; 3]; 4]) -> Instance {
    let world_from_object = Affine { columns };
    Instance { mesh: MeshId(mesh), world_from_object, world_from_object_close: None, first_primitive: 0 }
}

/// A gray room open to the front, with a rotated block, a sheared and mirrored block with smooth normals, and an emissive block; a
/// light of each kind, and a dim environment.
pub(super) fn room() -> (Scene, Camera) {
    let grey = Material { base_color: [0.7, 0.7, 0.7], ..Material::default() };
    let red = Material { base_color: [0.8, 0.2, 0.1], ..Material::default() };
    let glowing = Material { emission: [2.0, 1.5, 0.5], ..Material::default() };
    let mut smooth = cuboid([1.0; 3], 1);
    smooth.normals = Some(smooth.positions.iter().map(|p| p.map(|x| x / 3.0_f32.sqrt())).collect());
    let mut walls = cuboid([3.0, 2.0, 3.0], 0);
    // The face towards the camera is open.
    walls.triangles.retain(|t| !t.iter().all(|&i| walls.positions[i as usize][2] > 0.0));
    let meshes = vec![walls, cuboid([1.0; 3], 1), smooth, cuboid([0.3; 3], 2)];
    let (s, c) = 0.4_f32.sin_cos();
    let instances = vec![
        instance(0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]]),
        instance(1, [[0.7 * c, 0.0, -0.7 * s], [0.0, 1.2, 0.0], [0.7 * s, 0.0, 0.7 * c], [1.2, -0.8, -0.7]]),
        instance(2, [[-0.6, 0.1, 0.0], [0.2, 0.6, 0.1], [0.0, -0.1, 0.6], [-1.3, -1.2, 0.5]]),
        instance(3, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-0.2, -1.7, 1.5]]),
    ];
    let down = [0.0, -1.0, 0.0];
    let lights = vec![
        Light::Point { position: [-2.0, 1.0, 1.0], intensity: [3.0, 3.0, 4.0] },
        Light::Spot { position: [2.0, 1.8, 1.0], direction: down, intensity: [6.0; 3], cos_inner: 0.9, cos_outer: 0.7 },
        Light::Sphere { center: [0.3, 0.5, -1.5], radius: 0.3, radiance: [4.0, 3.0, 2.0] },
        Light::Disk { center: [0.0, 1.9, 0.0], normal: down, radius: 0.6, radiance: [5.0; 3] },
        Light::Sun { direction: [0.6, -0.48, -0.64], irradiance: [0.5; 3] },
    ];
    assert!(
        (0..Light::KINDS.len()).all(|kind| lights.iter().any(|light| light.kind() == kind)),
        "a light of each kind"
    );
    let materials = vec![grey, red, glowing];
    let environment = Some([0.2, 0.3, 0.4].into());
    let scene = Scene { meshes, instances, materials, lights, environment, ..Scene::default() };
    (scene, Camera::pinhole([0.0, 0.0, 8.0], [0.0, -0.2, 0.0], [0.0, 1.0, 0.0], 38.0))
}

/// The room with four walls, seen from outside: all materials are single-sided, and walls face inwards.
pub(super) fn dollhouse() -> (Scene, Camera) {
    let (mut scene, _) = room();
    scene.materials.iter_mut().for_each(|material| material.double_sided = false);
    let mut walls = cuboid([3.0, 2.0, 3.0], 0);
    walls.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    scene.meshes[0] = walls;
    (scene, Camera::pinhole([5.0, 4.0, 8.0], [0.0, -0.6, 0.0], [0.0, 1.0, 0.0], 38.0))
}

/// A sky with a bright spot and a dark ground.
pub(super) fn sky() -> Environment {
    let (width, height) = (16, 8);
    let texel = |i: u32| match (i % width, i / width) {
        (9, 2) => [30.0, 25.0, 20.0],
        (_, 6..) => [0.0; 3],
        (x, y) => [0.2, 0.1 * f32::from(u8::try_from(y).unwrap_or(0)), 0.02 * f32::from(u8::try_from(x).unwrap_or(0))],
    };
    let texels = (0..width * height).map(texel).collect();
    let name = "sky".to_owned();
    Environment::Image(EnvironmentImage { name, width, height, texels, scale: [1.0; 3], turn_degrees: 30.0 })
}

/// A texture of blocks of four texels; `texel` gives the bytes by column and row of the block.
fn texture(encoding: Encoding, texel: impl Fn(u8, u8) -> [u8; 4]) -> Texture {
    let of = |i: u8| texel(i % 16 / 4, i / 16 / 4);
    let (wrap, magnification) = ([Wrap::Repeat, Wrap::Mirror], Magnification::Linear);
    let texels = (0..=255).map(of).collect();
    Texture { name: "blocks".to_owned(), width: 16, height: 16, texels, encoding, wrap, magnification }
}

/// A floor with varying color, roughness and normals under a partly emissive screen with holes.
pub(super) fn textured() -> (Scene, Camera) {
    let quad = |z: f32, half: f32, material: u32| {
        let corners = vec![[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
        let uvs = vec![[-0.3, 0.0], [1.7, 0.0], [1.7, 2.0], [-0.3, 2.0]];
        Mesh { uvs: Some(uvs), ..mesh(corners, vec![[0, 1, 2], [0, 2, 3]], material) }
    };
    let slot = |texture: u32| Some(TextureRef::new(TextureId(texture)));
    let floor = Material {
        base_color_texture: slot(0),
        metallic: 1.0,
        specular: 1.0,
        metallic_roughness_texture: slot(1),
        normal_texture: slot(2),
        ..Material::default()
    };
    let screen = Material {
        emission: [2.0; 3],
        emission_texture: slot(0),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        alpha_texture: slot(3),
        ..Material::default()
    };
    let pane = Material {
        specular: 0.5,
        transmission: 1.0,
        transmission_texture: slot(1),
        roughness: 0.1,
        thin_walled: true,
        alpha_mode: AlphaMode::Blend,
        alpha: 0.7,
        ..Material::default()
    };
    let tilt = [[1.0, 0.0, 0.0], [0.0, 0.8, 0.6], [0.0, -0.6, 0.8], [0.0; 3]];
    let scene = Scene {
        meshes: vec![quad(-1.0, 3.0, 0), quad(1.0, 0.9, 1), quad(0.0, 1.2, 2)],
        instances: vec![instance(0, tilt), instance(1, tilt), instance(2, tilt)],
        materials: vec![floor, screen, pane],
        textures: vec![
            Texture {
                magnification: Magnification::Nearest,
                ..texture(Encoding::Srgb, |x, y| [60 * x, 60 * y, 200, 255])
            },
            texture(Encoding::Linear, |x, y| [100 * (x % 2), 80 * y, 60 * x, 255]),
            texture(Encoding::Linear, |x, y| [108 + 10 * x, 108 + 10 * y, 240, 255]),
            texture(Encoding::Linear, |x, y| [0, 0, 0, 255 * ((x + y) % 2)]),
        ],
        environment: Some([0.3, 0.3, 0.4].into()),
        ..Scene::default()
    };
    (scene, Camera::pinhole([0.5, -3.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0], 45.0))
}

/// The same scene with every second instance rotated, sheared and shifted while the shutter is open.
pub(super) fn in_motion((mut scene, camera): (Scene, Camera)) -> (Scene, Camera) {
    for instance in scene.instances.iter_mut().skip(1).step_by(2) {
        let mut close = instance.world_from_object;
        for [x, y, z] in &mut close.columns {
            (*x, *y, *z) = (*x - 0.3 * *y + 0.1, *y + 0.2 * *x, 1.1 * *z);
        }
        instance.world_from_object_close = Some(close);
    }
    (scene, camera)
}

/// Relative difference of a pixel, above a floor of a twentieth of white, that rounding explains: ten bounces of 30 roundings of
/// 2⁻²³ each are `2⁻¹⁵`; texture lookups with f32 coordinates may have eight times that.
pub(super) const ROUNDING: f64 = 1.0 / 4096.0;

/// Bound of `|Σd|/√Σd²`, exceeded by chance once in 10⁷ sums.
const DRIFT: f64 = 6.0;

/// Side of a block in pixels.
const BLOCK: usize = 8;

/// Differences between pictures that should be equal.
#[derive(Debug)]
pub(super) struct Difference {
    /// Share of pixels that differ by more than [`ROUNDING`].
    pub(super) astray: f64,
    /// Relative difference of the means.
    pub(super) of_means: f64,
    /// `|Σd|/√Σd²` over diverging pixels: of all of them, and of the worst block.
    pub(super) drift: [f64; 2],
}

impl Difference {
    /// Fails if more than a share of the pixels diverges, the means differ by more than `of_means`, or the divergence is biased.
    #[track_caller]
    pub(super) fn check(&self, name: &str, limits: [f64; 2]) {
        assert!(self.is_within(limits), "{name}: {self:?}");
    }

    /// Fails for pictures that the widest limits of the comparisons of curves admit as pictures of one scene.
    #[track_caller]
    pub(super) fn check_detects(&self, name: &str) {
        assert!(!self.is_within([0.5, 0.02]), "{name}: {self:?}");
    }

    fn is_within(&self, [astray, of_means]: [f64; 2]) -> bool {
        self.astray <= astray && self.of_means <= of_means && self.drift.iter().all(|&drift| drift <= DRIFT)
    }
}

pub(super) fn scene_bvh(scene: &Scene, levels: Levels) -> SceneBvh {
    SceneBvh::build(scene, &SceneBvhConfig { levels, ..SceneBvhConfig::default() }).unwrap()
}

/// The scene's camera, or one that shows all of it.
pub(super) fn frame_of(scene: &Scene) -> Camera {
    let bvh = scene_bvh(scene, Levels::Auto);
    scene.cameras.first().copied().unwrap_or_else(|| frame(scene, &bvh, 64.0 / 36.0))
}

pub(super) fn on_device(gpu: &Gpu, scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Film {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = DevicePicture::new(gpu, &surfaces, bvh, camera, settings).unwrap();
    let cancel = AtomicBool::new(false);
    let monitor = Monitor::quiet(&cancel);
    picture.render(vec![], &monitor).unwrap()
}

pub(super) fn on_cpu(scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Film {
    render(scene, &bvh, camera, settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

/// Renders the scene on both devices and compares.
pub(super) fn compared(gpu: &Gpu, scene: &Scene, camera: &Camera, levels: Levels, settings: &Settings) -> Difference {
    let bvh = scene_bvh(scene, levels);
    let ours = on_device(gpu, scene, &bvh, camera, settings);
    difference(&ours, &on_cpu(scene, &bvh, camera, settings))
}

pub(super) fn difference(ours: &Film, theirs: &Film) -> Difference {
    let width = theirs.width() as usize;
    let columns = width.div_ceil(BLOCK);
    let n_blocks = columns * (theirs.height() as usize).div_ceil(BLOCK);
    let (mut n_astray, mut sums) = (0_u32, [0.0; 2]);
    let (mut all, mut blocks) = (Drift::default(), vec![Drift::default(); n_blocks]);
    for (index, (a, b)) in ours.pixels().iter().zip(theirs.pixels()).enumerate() {
        assert_eq!(a.n_taken(), b.n_taken());
        let (a, b) = (a.mean(), b.mean());
        if (0..3).any(|k| (a[k] - b[k]).abs() > ROUNDING * (b[k].abs() + 0.05)) {
            n_astray += 1;
            let apart = a.iter().sum::<f64>() - b.iter().sum::<f64>();
            all.add(apart);
            blocks[index / width / BLOCK * columns + index % width / BLOCK].add(apart);
        }
        sums[0] += a.iter().sum::<f64>();
        sums[1] += b.iter().sum::<f64>();
    }
    let n = theirs.pixels().len() as f64;
    Difference {
        astray: f64::from(n_astray) / n,
        of_means: (sums[0] / sums[1] - 1.0).abs(),
        drift: [all.value(), blocks.iter().map(Drift::value).fold(0.0, f64::max)],
    }
}

#[derive(Clone, Default)]
struct Drift {
    sum: f64,
    squares: f64,
}

impl Drift {
    fn add(&mut self, apart: f64) {
        self.sum += apart;
        self.squares += apart * apart;
    }

    fn value(&self) -> f64 {
        if self.squares > 0.0 { self.sum.abs() / self.squares.sqrt() } else { 0.0 }
    }
}
