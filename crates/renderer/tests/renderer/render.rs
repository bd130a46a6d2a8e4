//! Rendering: determinism across threads and tiles, invalid samples, progress, cancellation, errors.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use canted_film::{Aovs, Film};
use canted_fixtures::{self as fixtures, SplitMix64};
use canted_obb::Affine;
use canted_renderer::{
    BottomLevel, CameraError, Heatmap, Levels, Measure, RenderError, SceneBvh, SceneBvhConfig, Settings, Surfaces,
    UpdateOptions, UpdatePolicy, Updates, environment_of, heatmap, render,
};
use canted_scene::{AnimatedScene, Camera, Light, Material, Projection, ReadOptions, Scene};
use canted_trace::{Counts, Hit, Intersect, Ray};
use canted_wide::SimdPath;

use crate::common::{
    BruteForce, box_on_floor, camera, cuboid, film, film_of, floor, gray, mesh, place, scene, settings, sphere, under,
};

const SETTINGS: Settings = Settings {
    width: 37,
    height: 23,
    integrator: canted_renderer::Integrator::Hybrid,
    samples: 5,
    bounces: 2,
    seed: 9,
    pattern: canted_renderer::Pattern::Stratified,
    filter: canted_film::Filter::BOX,
    lod: canted_renderer::Lod::Aniso,
    energy_compensation: true,
    hemisphere: canted_renderer::Hemisphere::Cosine,
    ao_radius: None,
    cull: canted_renderer::Cull::Auto,
    clamp: None,
    means_only: false,
    sums: canted_renderer::SampleSums::Host,
    tile: 32,
    part: None,
    noise: None,
    aovs: Aovs::NONE,
};

#[test]
fn threads_and_tiles_do_not_change_the_image() {
    let (stage, view) = box_on_floor(5.0, 50.0);
    let with = |threads, tile| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| film(&stage, &view, &Settings { tile, ..SETTINGS }))
    };
    let reference = with(1, 1);
    for (threads, tile) in [(1, 32), (2, 8), (3, 7), (5, 1000), (2, u32::MAX), (2, 0)] {
        assert_eq!(with(threads, tile), reference, "{threads} threads, tiles of {tile}");
    }
    assert_ne!(film(&stage, &view, &Settings { seed: 10, ..SETTINGS }), reference, "the seed has an effect");
}

/// Ray counts: on a bare plane each sample traces a camera ray, a shadow ray and a bounce.
#[test]
fn rays_are_counted() {
    let mut plane = scene(vec![floor(100.0, 0.0, 0)], vec![gray(0.5)]);
    let view = camera([0.0, 5.0, 5.0], [0.0; 3], 20.0);
    assert_eq!(film(&plane, &view, &settings(4, 4, 3, 2)).n_rays(), 4 * 4 * 3 * 2);
    plane.lights = vec![Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] }];
    assert_eq!(film(&plane, &view, &settings(4, 4, 3, 2)).n_rays(), 4 * 4 * 3 * 3);
}

/// A material with NaN values affects only the samples that hit it.
#[test]
fn invalid_samples_are_dropped() {
    let poison = |emission| {
        let (mut stage, view) = box_on_floor(5.0, 50.0);
        stage.materials[1].emission = [0.0, emission, 0.0];
        film(&stage, &view, &SETTINGS)
    };
    let clean = poison(0.0);
    assert_eq!((clean.n_dropped(), clean.first_dropped()), (0, None));
    for emission in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let film = poison(emission);
        assert!(film.n_dropped() > 0);
        // The first of them in scanline order is reported.
        let [x, y] = film.first_dropped().unwrap();
        let (before, from) = film.pixels().split_at((y * SETTINGS.width + x) as usize);
        assert!(x < SETTINGS.width && from[0].n_dropped > 0 && before.iter().all(|pixel| pixel.n_dropped == 0));
        let (mut n_partly, mut n_same) = (0, 0);
        for (pixel, clean) in film.pixels().iter().zip(clean.pixels()) {
            assert_eq!(pixel.n_samples + pixel.n_dropped, SETTINGS.samples);
            assert!(pixel.mean().iter().all(|x| x.is_finite()));
            if pixel.n_dropped == 0 {
                assert_eq!(pixel, clean);
                n_same += 1;
            } else if pixel.n_samples > 0 {
                n_partly += 1;
            }
        }
        assert!(n_same > 100 && n_partly > 10, "{n_same} {n_partly}");
    }
}

#[test]
fn progress_counts_every_tile_once() {
    let (stage, view) = box_on_floor(5.0, 50.0);
    let heard = Mutex::new(Vec::new());
    let tell = |done, all| heard.lock().unwrap().push((done, all));
    let settings = Settings { tile: 8, ..SETTINGS };
    render(&stage, &BruteForce::new(&stage), &view, &settings, &tell, &AtomicBool::new(false)).unwrap();
    let mut heard = heard.into_inner().unwrap();
    heard.sort_unstable();
    assert_eq!(heard, (1..=15).map(|done| (done, 15)).collect::<Vec<_>>());
}

#[test]
fn cancelling_stops_the_work() {
    let (stage, view) = box_on_floor(5.0, 50.0);
    let cancel = AtomicBool::new(false);
    let n_heard = std::sync::atomic::AtomicUsize::new(0);
    let stop_at_once = |_, _| {
        n_heard.fetch_add(1, Ordering::Relaxed);
        cancel.store(true, Ordering::Relaxed);
    };
    let settings = Settings { tile: 1, ..SETTINGS };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let result = pool.install(|| render(&stage, &BruteForce::new(&stage), &view, &settings, &stop_at_once, &cancel));
    assert_eq!(result, Err(RenderError::Cancelled));
    // Each thread may have had a tile in progress.
    assert!(n_heard.load(Ordering::Relaxed) <= 2);
}

#[test]
fn invalid_settings_are_rejected() {
    let (stage, view) = box_on_floor(5.0, 50.0);
    let refused = |settings: Settings, view: &Camera| -> RenderError {
        let result: Result<Film, _> =
            render(&stage, &BruteForce::new(&stage), view, &settings, &|_, _| (), &AtomicBool::new(false));
        result.unwrap_err()
    };
    assert_eq!(refused(Settings { width: 0, ..SETTINGS }, &view), RenderError::Size { width: 0, height: 23 });
    let huge = RenderError::Size { width: 1 << 17, height: 1 << 17 };
    assert_eq!(refused(Settings { width: 1 << 17, height: 1 << 17, ..SETTINGS }, &view), huge);
    assert_eq!(refused(Settings { samples: 0, ..SETTINGS }, &view), RenderError::NoSamples);
    for radius in [0.0, -1.0] {
        let error = refused(Settings { ao_radius: Some(radius), ..SETTINGS }, &view);
        assert_eq!(error.to_string(), format!("ambient occlusion radius {radius} is not above zero"));
    }
    assert!(matches!(refused(Settings { ao_radius: Some(f32::NAN), ..SETTINGS }, &view), RenderError::AoRadius { .. }));
    let filter = canted_film::Filter::Gaussian(-1.0);
    let error = refused(Settings { filter, ..SETTINGS }, &view);
    assert_eq!(error.to_string(), "pixel filter radius -1 is not finite and above zero");
    let blind = Camera { projection: Projection::Perspective { fov_degrees: 0.0 }, ..view };
    assert_eq!(refused(SETTINGS, &blind), RenderError::Camera(CameraError::FieldOfView { degrees: 0.0 }));
}

#[test]
fn empty_scene_shows_its_environment() {
    let empty = Scene { environment: Some([0.25, 0.5, 0.75].into()), ..Scene::default() };
    let film = film(&empty, &camera([0.0; 3], [0.0, 0.0, -1.0], 40.0), &SETTINGS);
    assert!(film.picture().pixels.iter().all(|&pixel| pixel == [0.25, 0.5, 0.75]));
}

#[test]
fn default_environment_is_white_only_without_other_lights() {
    let bare = Scene::default();
    assert_eq!(*environment_of(&bare), [1.0; 3].into());
    let lit = Scene { lights: vec![Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] }], ..bare.clone() };
    assert_eq!(*environment_of(&lit), [0.0; 3].into());
    let emissive = Scene { materials: vec![Material { emission: [1.0, 0.0, 0.0], ..gray(0.5) }], ..bare.clone() };
    assert_eq!(*environment_of(&emissive), [0.0; 3].into());
    assert_eq!(*environment_of(&Scene { environment: Some([0.5; 3].into()), ..lit }), [0.5; 3].into());
}

// Sequences of 60 frames: hits and pictures of an updated structure are those of a new one, bit for bit.
//
// The falling elastic body is in `examples/elastic`, where the frames of the program are in the tests of `canted-cli`.

const N_FRAMES: u16 = 60;

/// Rays between random points of the box around the scene and beyond it.
fn rays(scene: &Scene, n: usize, seed: u64) -> Vec<Ray> {
    let bounds = scene.bounds_world();
    let mut rng = SplitMix64::new(seed);
    let greatest = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(0.0, f32::max);
    let mut point = |out: f32| -> [f32; 3] {
        std::array::from_fn(|k| {
            // Rays to a flat scene start outside of its plane.
            let size = (bounds.max[k] - bounds.min[k]).max(out * greatest);
            bounds.min[k] - out * size + (1.0 + 2.0 * out) * size * rng.unit() as f32
        })
    };
    let ray = |_| {
        let (from, to) = (point(0.5), point(0.0));
        Ray::new(from, std::array::from_fn(|k| to[k] - from[k]))
    };
    (0..n).map(ray).collect()
}

fn hits(tracer: &dyn Intersect, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tracer.closest_hit(ray)).collect()
}

/// The hits of each BVH over triangles, on a path.
fn hits_below(prepared: &SceneBvh, rays: &[Ray], path: SimdPath) -> Vec<Option<Hit>> {
    let of_one = |bvh: &BottomLevel| {
        let BottomLevel::Wide(wide) = bvh else { panic!("the default is wide") };
        let wide = wide.clone().with_path(path);
        rays.iter().map(|ray| wide.closest_hit(ray)).collect::<Vec<_>>()
    };
    prepared.bottom().iter().flat_map(of_one).collect()
}

/// Follows a sequence in one and in two levels.
#[track_caller]
fn follows(name: &str, mut frame_of: impl FnMut(u16) -> Scene) {
    for (levels, policy) in [(Levels::One, UpdatePolicy::Auto), (Levels::Two, UpdatePolicy::Refit)] {
        let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
        let mut updated = SceneBvh::build(&frame_of(0), &config).unwrap();
        let (mut all, mut n_hits) = (Updates::default(), 0);
        for frame in 1..N_FRAMES {
            let now = frame_of(frame);
            let options = UpdateOptions { policy, trace_time: std::time::Duration::from_millis(5) };
            let old = (frame == 30).then(|| hits(&updated, &rays(&now, 120, frame.into())));
            all += updated.update(&now, &options).unwrap();
            let fresh = SceneBvh::build(&now, &config).unwrap();
            let rays = rays(&now, 120, frame.into());
            let ours = hits(&updated, &rays);
            assert!(ours == hits(&fresh, &rays), "{name}, {levels:?}, frame {frame}");
            n_hits += ours.iter().flatten().count();
            // The comparison can fail: before the update, hits are others.
            assert!(old.is_none_or(|old| old != ours), "{name}, {levels:?}");
            if frame % 10 != 9 {
                continue;
            }
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let [a, b] = [&updated, &fresh].map(|prepared| hits_below(prepared, &rays, path));
                assert!(a == b, "{name}, {levels:?}, frame {frame}, {}", path.name());
            }
            let bounds = now.bounds_world();
            let middle = std::array::from_fn(|k| 0.5 * (bounds.min[k] + bounds.max[k]));
            let eye = std::array::from_fn(|k| middle[k] + [1.1, 0.8, 1.3][k] * (bounds.max[k] - bounds.min[k]));
            let (view, settings) = (camera(eye, middle, 50.0), settings(16, 12, 1, 1));
            let film = |structure| film_of(&now, structure, &view, &settings);
            assert_eq!(film(&updated), film(&fresh), "{name}, {levels:?}, frame {frame}");
        }
        assert!(n_hits > 300, "{name}: {n_hits} hits");
        assert!(all.refits + all.rebuilds + all.top_refits >= 55, "{name}, {levels:?}: {all:?}");
        assert_eq!(all.whole, 0);
    }
}

#[test]
fn a_twisted_scaffold() {
    let still = fixtures::scaffold_of(1, false, 3);
    follows("scaffold", |frame| {
        let positions = still.positions.iter().map(|&[x, y, z]| {
            let (sin, cos) = (0.04 * f32::from(frame) * z).sin_cos();
            [cos * x - sin * y, sin * x + cos * y, z]
        });
        under([1.0, 0.9, 0.8], scene(vec![mesh(positions.collect(), still.triangles.clone(), 0)], vec![gray(0.5)]))
    });
}

#[test]
fn exploding_instances() {
    follows("explosion", |frame| {
        let meshes = vec![cuboid([-0.1; 3], [0.1, 0.2, 0.1], 0), sphere([0.0; 3], 0.1, 1, 0)];
        let mut scene = scene(meshes, vec![gray(0.5)]);
        scene.instances.clear();
        let mut rng = SplitMix64::new(5);
        let mut number = move || rng.unit() as f32 - 0.5;
        for i in 0..60 {
            let (away, spin) = ([(); 3].map(|()| number()), number());
            let (sin, cos) = (spin * f32::from(frame)).sin_cos();
            let at = away.map(|x| x * (0.5 + 0.05 * f32::from(frame)));
            let map = Affine { columns: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.1, 1.0], at] };
            scene.instances.push(place(i % 2, map));
        }
        scene.environment = Some([1.0, 0.9, 0.8].into());
        scene
    });
}

/// Skinned and morphed models.
#[test]
fn animated_models() {
    let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let scenes = PathBuf::from(std::env::var("CANTED_SCENES").unwrap_or_else(|_| scenes.to_owned()));
    for (file, rate) in [("gltf/Fox.glb", 24.0), ("gltf/CesiumMan.glb", 30.0), ("gltf/SimpleMorph.gltf", 15.0)] {
        let path = scenes.join(file);
        if !path.is_file() {
            canted_fixtures::skip::<()>("animated_models", format_args!("missing file {}", path.display()));
            continue;
        }
        let (mut animated, first) = AnimatedScene::open(&path, &ReadOptions::default()).unwrap();
        assert!(animated.is_animated());
        follows(file, |frame| {
            let mut scene = first.clone();
            animated.pose(f32::from(frame) / rate, &mut scene).unwrap();
            scene.environment = Some([1.0, 0.9, 0.8].into());
            scene
        });
    }
}

/// Node 0 rotates, its child slides along it and changes its size, and a copy stands still; two seconds.
const ARMS: &str = r#"{
    "asset": { "version": "2.0" },
    "buffers": [{ "byteLength": 276, "uri": "arms.bin" }],
    "bufferViews": [
        { "buffer": 0, "byteOffset": 0, "byteLength": 144 }, { "buffer": 0, "byteOffset": 144, "byteLength": 12 },
        { "buffer": 0, "byteOffset": 156, "byteLength": 48 }, { "buffer": 0, "byteOffset": 204, "byteLength": 36 },
        { "buffer": 0, "byteOffset": 240, "byteLength": 36 }
    ],
    "accessors": [
        { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 12, "min": [0, 0, 0], "max": [2, 2, 2] },
        { "bufferView": 1, "componentType": 5126, "type": "SCALAR", "count": 3, "min": [0], "max": [2] },
        { "bufferView": 2, "componentType": 5126, "type": "VEC4", "count": 3 },
        { "bufferView": 3, "componentType": 5126, "type": "VEC3", "count": 3 },
        { "bufferView": 4, "componentType": 5126, "type": "VEC3", "count": 3 }
    ],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
    "nodes": [{ "mesh": 0, "children": [1] }, { "mesh": 0 }, { "mesh": 0, "translation": [-1, -1, -2] }],
    "animations": [{
        "channels": [
            { "sampler": 0, "target": { "node": 0, "path": "rotation" } },
            { "sampler": 1, "target": { "node": 1, "path": "translation" } },
            { "sampler": 2, "target": { "node": 1, "path": "scale" } }
        ],
        "samplers": [{ "input": 1, "output": 2 }, { "input": 1, "output": 3 }, { "input": 1, "output": 4 }]
    }]
}"#;

#[test]
fn animated_nodes() {
    let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let mut floats: Vec<f32> = faces.as_flattened().iter().flat_map(|&i: &usize| corners[i]).collect();
    floats.extend([0.0, 1.0, 2.0]);
    floats.extend([0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8, 0.0, 0.6, 0.8, 0.0]);
    floats.extend([2.0, 0.0, 0.0, 3.0, 0.0, 0.5, 1.0, 0.5, 0.0]);
    floats.extend([1.0, 1.0, 1.0, 0.5, 1.5, 1.0, 1.0, 1.0, 2.0]);
    let folder = std::env::temp_dir().join(format!("canted-arms-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("arms.gltf"), ARMS).unwrap();
    std::fs::write(folder.join("arms.bin"), floats.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>()).unwrap();
    let opened = AnimatedScene::open(&folder.join("arms.gltf"), &ReadOptions::default());
    std::fs::remove_dir_all(&folder).unwrap();
    let (mut animated, first) = opened.unwrap();
    assert!(animated.is_animated());
    follows("nodes", |frame| {
        let mut scene = first.clone();
        animated.pose(f32::from(frame) / 30.0, &mut scene).unwrap();
        scene.environment = Some([1.0, 0.9, 0.8].into());
        scene
    });
}

/// The brute-force tracer counts one box test per instance and tests every triangle, so counts are known.
fn known() -> Scene {
    scene(vec![floor(1.0, 0.0, 0), sphere([0.0; 3], 0.5, 1, 0)], vec![gray(0.5)])
}

fn draw(size: [u32; 2], measure: Measure, full_scale: u32) -> Heatmap {
    let scene = known();
    let view = camera([1.0, 2.0, 3.0], [0.0; 3], 40.0);
    heatmap(&Surfaces::new(&scene), &BruteForce::new(&scene), &view, size, measure, full_scale).unwrap()
}

#[test]
fn sums_and_means_match_the_counters() {
    let map = draw([20, 10], Measure::Boxes, 128);
    assert_eq!(map.counts.len(), 200);
    assert!(map.counts.iter().all(|counts| *counts == Counts { boxes: 2, triangles: 34 }));
    assert_eq!(map.total(), Counts { boxes: 400, triangles: 6800 });
    assert_eq!(map.mean(), [2.0, 34.0]);
}

#[test]
fn colors_follow_the_fixed_scale() {
    // Too small for a legend: every pixel shows its count.
    let color = |measure, full_scale| {
        let picture = draw([8, 8], measure, full_scale).picture;
        assert!(picture.pixels.iter().all(|pixel| *pixel == picture.pixels[0]));
        picture.pixels[0]
    };
    assert_eq!(color(Measure::Boxes, 4), color(Measure::Triangles, 68), "half scale in both directions");
    assert_ne!(color(Measure::Boxes, 4), color(Measure::Triangles, 4));
    assert_eq!(color(Measure::Triangles, 34), color(Measure::Triangles, 1), "full scale and above");
}

#[test]
fn legend_covers_only_the_lower_left_corner() {
    let (plain, width, height) = (draw([8, 8], Measure::Boxes, 4).picture.pixels[0], 320, 180);
    let picture = draw([width, height], Measure::Boxes, 4).picture;
    assert_eq!((picture.width, picture.height), (width, height));
    let covered = |x, y| picture.pixels[picture.index(x, y)] != plain;
    assert!(covered(0, height - 1));
    assert!((0..height).all(|y| (160..width).all(|x| !covered(x, y))));
    assert!((0..90).all(|y| (0..width).all(|x| !covered(x, y))));
    // The numbers are white, and the color bar covers the entire range.
    let has = |color: [f32; 3]| picture.pixels.contains(&color);
    let shown = |full_scale| draw([8, 8], Measure::Triangles, full_scale).picture.pixels[0];
    assert!(has([1.0; 3]) && has(shown(1)) && has([0.0; 3]));
    let left_end = picture.pixels[picture.index(4, height - 5)];
    let least = shown(u32::MAX);
    // 34 of 2^32 tests on a scale of eight steps, each below 1 in sRGB, where the slope of the curve is at most 2.4;
    // such dark colors are rounded by at most half as much as one.
    let bound = 34.0 / 2.0_f32.powi(32) * 8.0 * 2.4 + 0.5 * f32::EPSILON;
    assert!((0..3).all(|k| (left_end[k] - least[k]).abs() <= bound), "{left_end:?} {least:?}");
}
