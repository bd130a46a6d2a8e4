//! Pictures: the same bytes for any number of threads, tile size, volumes and builder.
//!
//! One and two levels give the same picture up to rounding, because object space rounds each ray again. Not covered here: correct
//! content of pictures, and files (both tested by `canted-renderer`), the program's options.

use std::sync::atomic::AtomicBool;

use canted_film::Picture;
use canted_fixtures::{Rotation, SplitMix64, grid, icosphere, torus};
use canted_lbvh::Strategy;
use canted_obb::Affine;
use canted_renderer::{Builder, BvhKind, Levels, SceneBvh, SceneBvhConfig, Settings, render};
use canted_scene::{Camera, Instance, Light, Material, MaterialId, Mesh, MeshId, Part, Scene};
use canted_tests::scenes::affine;
use canted_wide::Preset;

fn mesh(mesh: canted_fixtures::Mesh, material: u32) -> Mesh {
    let parts = vec![Part { first_triangle: 0, material: MaterialId(material) }];
    Mesh { positions: mesh.positions, triangles: mesh.triangles, parts, ..Mesh::default() }
}

/// Hills, with rings and spheres above them as rotated, stretched and mirrored instances.
fn scene() -> Scene {
    let meshes = vec![mesh(grid(5, [20, 20]), 0), mesh(torus(16, 8), 1), mesh(icosphere(2), 2)];
    let material = |base_color| Material { base_color, ..Material::default() };
    let materials = vec![
        material([0.3, 0.6, 0.2]),
        material([0.8, 0.3, 0.2]),
        Material { emission: [0.2, 0.1, 0.0], ..material([0.5; 3]) },
    ];
    let ground = Affine::scale([8.0, 8.0, 4.0]).then(&Affine::translation([-4.0, -4.0, -1.0]));
    let mut instances = vec![Instance {
        mesh: MeshId(0),
        world_from_object: ground,
        world_from_object_close: None,
        first_primitive: 0,
    }];
    let mut first_primitive = u32::try_from(meshes[0].triangles.len()).unwrap();
    let mut rng = SplitMix64::new(12);
    for i in 0..12 {
        let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
        let scale: [f64; 3] = std::array::from_fn(|k| (0.3 + 0.4 * rng.unit()) * if k == i % 4 { -1.0 } else { 1.0 });
        let shift = [3.0 * rng.signed(), 3.0 * rng.signed(), 0.5 + rng.unit()];
        let world_from_object = affine(&turn, scale, shift.map(|x| x as f32));
        let mesh = MeshId(u32::try_from(1 + i % 2).unwrap());
        instances.push(Instance { mesh, world_from_object, world_from_object_close: None, first_primitive });
        first_primitive += u32::try_from(meshes[mesh.0 as usize].triangles.len()).unwrap();
    }
    let lights = vec![
        Light::Sun { direction: [0.48, 0.36, -0.8], irradiance: [2.0, 1.9, 1.7] },
        Light::Point { position: [-2.0, 1.0, 4.0], intensity: [5.0, 6.0, 8.0] },
    ];
    Scene { meshes, instances, materials, lights, environment: Some([0.3, 0.4, 0.6].into()), ..Scene::default() }
}

const CAMERA: Camera = Camera::pinhole([5.0, -6.0, 4.0], [0.0, 0.0, 0.3], [0.0, 0.0, 1.0], 45.0);

/// The size is not a multiple of any tile size below.
const SETTINGS: Settings = Settings {
    width: 93,
    height: 61,
    integrator: canted_renderer::Integrator::Hybrid,
    samples: 4,
    bounces: 2,
    seed: 3,
    pattern: canted_renderer::Pattern::Stratified,
    filter: canted_film::Filter::BOX,
    lod: canted_renderer::Lod::Aniso,
    cull: canted_renderer::Cull::Auto,
    clamp: None,
    energy_compensation: true,
    hemisphere: canted_renderer::Hemisphere::Cosine,
    ao_radius: None,
    means_only: false,
    sums: canted_renderer::SampleSums::Host,
    tile: 32,
    part: None,
    noise: None,
    aovs: canted_film::Aovs::NONE,
};

/// One level of axis-aligned boxes over the radix tree.
fn base() -> SceneBvhConfig {
    binary(Levels::One, Strategy::Aabb, Some(Builder::Lbvh))
}

fn binary(levels: Levels, volumes: Strategy, builder: Option<Builder>) -> SceneBvhConfig {
    SceneBvhConfig { levels, kind: BvhKind::Bvh2, volumes, builder, ..SceneBvhConfig::default() }
}

/// Builds and renders in its own thread pool.
fn picture(n_threads: usize, config: SceneBvhConfig, settings: &Settings) -> Picture {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    pool.install(|| {
        let scene = scene();
        let bvh = SceneBvh::build(&scene, &config).unwrap();
        let film = render(&scene, &bvh, &CAMERA, settings, &|_, _| (), &AtomicBool::new(false)).unwrap();
        assert_eq!(film.n_dropped(), 0);
        film.picture()
    })
}

fn bits(picture: &Picture) -> Vec<u32> {
    picture.pixels.iter().flatten().map(|x| x.to_bits()).collect()
}

#[test]
fn threads_and_tiles_change_no_byte() {
    for levels in [Levels::One, Levels::Two] {
        let config = binary(levels, Strategy::Combined, Some(Builder::Lbvh));
        let want = bits(&picture(1, config, &SETTINGS));
        for n_threads in 1..=4 {
            for tile in [1, 7, 32, 1000] {
                let settings = Settings { tile, ..SETTINGS };
                assert!(bits(&picture(n_threads, config, &settings)) == want, "{n_threads} threads, tiles of {tile}");
            }
        }
    }
}

#[test]
fn volumes_and_builders_change_no_byte() {
    for levels in [Levels::One, Levels::Two] {
        let want = bits(&picture(2, SceneBvhConfig { levels, ..base() }, &SETTINGS));
        let builders = [Builder::Ploc, Builder::Lbvh, Builder::Sah, Builder::Obvhs].map(Some);
        for builder in builders.into_iter().chain([None]) {
            let wide = SceneBvhConfig { levels, preset: Preset::Balanced, builder, ..SceneBvhConfig::default() };
            for config in Strategy::ALL.map(|volumes| binary(levels, volumes, builder)).into_iter().chain([wide]) {
                assert!(bits(&picture(2, config, &SETTINGS)) == want, "{config:?}");
            }
        }
    }
}

#[test]
fn presets_change_no_byte() {
    for levels in [Levels::One, Levels::Two] {
        let want = bits(&picture(2, SceneBvhConfig { levels, ..base() }, &SETTINGS));
        for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
            let config = SceneBvhConfig { levels, preset, ..SceneBvhConfig::default() };
            for n_threads in [1, 3] {
                assert!(bits(&picture(n_threads, config, &SETTINGS)) == want, "{config:?}");
            }
        }
    }
}

#[test]
fn another_seed_or_a_longer_path_changes_the_picture() {
    let want = bits(&picture(2, base(), &SETTINGS));
    for settings in [Settings { seed: 4, ..SETTINGS }, Settings { bounces: 1, ..SETTINGS }] {
        assert!(bits(&picture(2, base(), &settings)) != want, "{settings:?}");
    }
    // The picture is not blank: it has more than a hundred colors.
    let mut colors = want;
    colors.sort_unstable();
    colors.dedup();
    assert!(colors.len() > 100, "{} colors", colors.len());
}

/// A pixel differs by more than rounding if one of its rays passes an edge on the other side.
///
/// Rounding moves a ray by at most `HIT_ERROR`, 1.2e-6, of the scene's size. A sample has at most 15 rays (camera and two
/// bounces, each with two lights, ambient and its continuation), and a ray passes fewer than a hundred edges. So fewer than
/// `4 · 15 · 100 · 1.2e-6`, one in 138, of the pixels can differ.
const PIXELS_PAST_AN_EDGE: f64 = 1.0 / 138.0;

/// Elsewhere only the point light's term depends on the hit position, which moves by `HIT_ERROR` of a scene twelve across,
/// 1.5e-5. The light is at least two away, so squared distance and cosine change by 3e-5 together.
const PIXEL_ROUNDING: f64 = 1e-4;

/// Fraction of pixels that differ by more than rounding.
fn differing(a: &Picture, b: &Picture) -> f64 {
    let differ = |(p, q): &(&[f32; 3], &[f32; 3])| {
        (0..3).any(|k| f64::from((p[k] - q[k]).abs()) > PIXEL_ROUNDING * f64::from(p[k].max(q[k])))
    };
    a.pixels.iter().zip(&b.pixels).filter(differ).count() as f64 / a.pixels.len() as f64
}

#[test]
fn one_and_two_levels_agree_up_to_rounding() {
    let one = picture(2, base(), &SETTINGS);
    let two = picture(2, SceneBvhConfig { levels: Levels::Two, ..base() }, &SETTINGS);
    let share = differing(&one, &two);
    assert!(share <= PIXELS_PAST_AN_EDGE, "{share} of the pixels differ");
    let reseeded = picture(2, base(), &Settings { seed: 4, ..SETTINGS });
    assert!(differing(&one, &reseeded) > 0.25);
}
