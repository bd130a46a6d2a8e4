//! Sequences of 60 frames: hits and pictures of an updated structure are those of a new one, bit for bit.
//!
//! The falling elastic body is in `examples/elastic`, where the frames of the program are in the tests of `canted-cli`.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use canted_fixtures::{self as fixtures, SplitMix64};
use canted_obb::Affine;
use canted_renderer::{
    Bvh, Levels, Prepared, StructureConfig, Tracer, UpdateOptions, UpdatePolicy, Updates, prepare, render,
};
use canted_scene::{AnimatedScene, ReadOptions, Scene};
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::SimdPath;

use crate::common::{camera, cuboid, grey, mesh, place, scene, settings, sphere};

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

fn hits(tracer: &impl Tracer, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tracer.closest_hit(ray, &mut ())).collect()
}

/// The hits of each BVH over triangles, on a path.
fn hits_below(prepared: &Prepared<Watertight>, rays: &[Ray], path: SimdPath) -> Vec<Option<Hit>> {
    let of_one = |bvh: &Bvh<Watertight>| {
        let Bvh::Wide(wide) = bvh else { panic!("the default is wide") };
        let wide = wide.clone().with_path(path);
        rays.iter().map(|ray| wide.closest_hit(ray)).collect::<Vec<_>>()
    };
    prepared.structure.bottom().iter().flat_map(of_one).collect()
}

/// Follows a sequence in one and in two levels.
#[track_caller]
fn follows(name: &str, mut frame_of: impl FnMut(u16) -> Scene) {
    for (levels, policy) in [(Levels::One, UpdatePolicy::Auto), (Levels::Two, UpdatePolicy::Refit)] {
        let config = StructureConfig { levels, ..StructureConfig::default() };
        let mut updated = prepare::<Watertight>(&frame_of(0), &config).unwrap();
        let (mut all, mut n_hits) = (Updates::default(), 0);
        for frame in 1..N_FRAMES {
            let now = frame_of(frame);
            let options = UpdateOptions { policy, trace_time: std::time::Duration::from_millis(5) };
            let old = (frame == 30).then(|| hits(&updated.structure, &rays(&now, 120, frame.into())));
            all += updated.update(&now, &options).unwrap();
            let fresh = prepare::<Watertight>(&now, &config).unwrap();
            let rays = rays(&now, 120, frame.into());
            let ours = hits(&updated.structure, &rays);
            assert!(ours == hits(&fresh.structure, &rays), "{name}, {levels:?}, frame {frame}");
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
            let film =
                |structure| render(&now, structure, &view, &settings, &|_, _| (), &AtomicBool::new(false)).unwrap();
            assert_eq!(film(&updated.structure), film(&fresh.structure), "{name}, {levels:?}, frame {frame}");
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
        let mut scene = scene(vec![mesh(positions.collect(), still.triangles.clone(), 0)], vec![grey(0.5)]);
        scene.environment = Some([1.0, 0.9, 0.8].into());
        scene
    });
}

#[test]
fn exploding_instances() {
    follows("explosion", |frame| {
        let meshes = vec![cuboid([-0.1; 3], [0.1, 0.2, 0.1], 0), sphere([0.0; 3], 0.1, 1, 0)];
        let mut scene = scene(meshes, vec![grey(0.5)]);
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
