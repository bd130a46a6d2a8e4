//! Sixty frames of moving instances and deforming meshes, updated on the device: its hits are those of the CPU in every frame.

use canted_fixtures::{
    Mesh,
    device_tests::{Test, needs_device},
    icosphere,
};
use canted_gpu::{
    Gpu,
    build::{Topology, WideConfig},
};
use canted_lbvh::Strategy;
use canted_obb::Affine;
use canted_renderer::{
    BvhKind, DeviceFrames, Levels, SceneBvh, SceneBvhConfig, UpdateOptions, UpdatePolicy, traced_frame,
};
use canted_scene::{Instance, MaterialId, MeshId, Part, Scene};
use canted_tests::{
    rays,
    scenes::{self, baked},
};
use canted_trace::{Intersect, Ray};

use super::{
    gpu,
    reference::{Tally, World, error_of_instance, error_of_one_level},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(sixty_frames_have_the_hits_of_the_cpu),
        needs_device(many_meshes_that_deform_have_the_hits_of_the_cpu),
        needs_device(a_frame_that_lags_is_seen),
    ]
}

const N_FRAMES: u32 = 60;

fn reach(mesh: &Mesh) -> f64 {
    mesh.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs()))
}

/// Meshes and transforms of a frame: the first mesh deforms in every second frame, the second in every tenth, the third never. A third of
/// the instances stand still, and nothing moves in every fifth frame.
fn state(frame: u32) -> (Vec<Mesh>, Vec<(usize, Affine)>) {
    let of = |number: u32| f32::from(u16::try_from(number).unwrap());
    let waves = |mut mesh: Mesh, time: f32| {
        mesh.positions.iter_mut().for_each(|p| p[2] += 0.3 * (2.0 * p[0] + time).sin() * (1.0 + p[1] * 0.2));
        mesh
    };
    let meshes = vec![
        waves(icosphere(2), of(frame / 2)),
        waves(scenes::room(3, 12).off_axis(), of(frame / 10) * 0.1),
        scenes::needles().remove(0).mesh,
    ];
    let one = |i: u32| {
        let time = if i.is_multiple_of(3) { 0.0 } else { of(frame - frame / 5) * 0.07 };
        let (s, c) = (of(i) + time).sin_cos();
        let size = [1.0, 0.3, -0.8][i as usize % 3] * 3.0 / [1.0, 4.0, 30.0][i as usize / 4 % 3];
        let shift = [of(i % 4) * 7.0 + time, of(i / 4) * 6.0, s];
        let columns = [[size * c, size * s, 0.0], [-size * s, size * c, 0.1 * size], [0.0, 0.0, size * 0.9], shift];
        (i as usize / 4 % 3, Affine { columns })
    };
    (meshes, (0..12).map(one).collect())
}

fn scene(meshes: &[Mesh], placed: &[(usize, Affine)]) -> Scene {
    let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
    let mesh = |mesh: &Mesh| canted_scene::Mesh {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
        parts: parts.clone(),
        ..canted_scene::Mesh::default()
    };
    let instance = |&(mesh, world_from_object): &(usize, Affine)| Instance {
        mesh: MeshId(u32::try_from(mesh).unwrap()),
        world_from_object,
        world_from_object_close: None,
        first_primitive: 0,
    };
    Scene {
        meshes: meshes.iter().map(mesh).collect(),
        instances: placed.iter().map(instance).collect(),
        materials: vec![canted_scene::Material::default()],
        ..Scene::default()
    }
}

/// Compares a frame with the CPU.
fn compare(
    gpu: &Gpu,
    (meshes, placed): &(Vec<Mesh>, Vec<(usize, Affine)>),
    bvh: &SceneBvh,
    traced: &canted_gpu::TracedScene,
    is_flat: bool,
    tally: &mut Tally,
) -> Result<(), String> {
    let there: Vec<Mesh> = placed.iter().map(|(mesh, map)| baked(&meshes[*mesh], map)).collect();
    let all_rays: Vec<Ray> = (0..)
        .zip(&there)
        .flat_map(|(i, mesh)| [rays::of_all_classes(mesh, 1, i), rays::from_inside(mesh, 12, i)].concat())
        .collect();
    let farthest = there.iter().map(reach).fold(0.0, f64::max);
    let world = World {
        corners: &|instance, primitive| {
            let (mesh, map) = &placed[instance as usize];
            match is_flat {
                true => there[instance as usize].corners(primitive as usize),
                false => meshes[*mesh].corners(primitive as usize).map(|p| map.point_f64(p)),
            }
        },
        error: &|ray, instance| {
            let (mesh, map) = &placed[instance as usize];
            match is_flat {
                true => error_of_one_level(ray, farthest),
                false => error_of_instance(ray, map, reach(&meshes[*mesh])),
            }
        },
    };
    world.check_all(gpu, traced, &all_rays, |ray| bvh.closest_hit(ray), tally)
}

fn sixty_frames_have_the_hits_of_the_cpu() {
    let gpu = gpu();
    let binary = |volumes| SceneBvhConfig { kind: BvhKind::Bvh2, volumes, ..SceneBvhConfig::default() };
    let eight = SceneBvhConfig::default();
    let wide = |topology, strategy| Some(WideConfig { topology, strategy, ..WideConfig::default() });
    for (config, wide, levels, policy) in [
        (eight, None, Levels::Two, UpdatePolicy::Auto),
        (eight, None, Levels::One, UpdatePolicy::Refit),
        (binary(Strategy::Aabb), None, Levels::Two, UpdatePolicy::Refit),
        (binary(Strategy::Combined), None, Levels::Two, UpdatePolicy::Rebuild),
        (binary(Strategy::Dop), None, Levels::One, UpdatePolicy::Auto),
        (eight, wide(Topology::Ploc, Strategy::Combined), Levels::Two, UpdatePolicy::Refit),
        (eight, wide(Topology::Radix, Strategy::Aabb), Levels::Two, UpdatePolicy::Rebuild),
        (eight, wide(Topology::Radix, Strategy::Combined), Levels::One, UpdatePolicy::Auto),
    ] {
        let name = format!("{config:?}, {wide:?}, {levels:?}, {policy:?}");
        let first = state(0);
        let config = SceneBvhConfig { levels, ..config };
        let mut bvh = SceneBvh::build(&scene(&first.0, &first.1), &config).unwrap();
        let mut frames = DeviceFrames::new(policy);
        if let Some(wide) = wide {
            frames = frames.with_wide(wide);
        }
        let mut tally = Tally::default();
        for frame in 0..N_FRAMES {
            let state = state(frame);
            let scene = scene(&state.0, &state.1);
            let options = UpdateOptions { policy, ..UpdateOptions::default() };
            bvh.update(&scene, &options).unwrap();
            let traced = traced_frame(&gpu, &scene, &bvh, &mut frames).unwrap();
            compare(&gpu, &state, &bvh, &traced, levels == Levels::One, &mut tally)
                .unwrap_or_else(|error| panic!("{name}, frame {frame}: {error}"));
        }
        tally.report(&name);
        // The device updated its BVHs, and built them once.
        let updates = frames.updates();
        let is_of_device = wide.is_some() || config.kind == BvhKind::Bvh2;
        match levels {
            _ if !is_of_device => assert_eq!(updates.whole, 0, "{name}: {updates:?}"),
            Levels::Two => {
                assert_eq!((updates.whole, updates.refits + updates.rebuilds), (1, 29 + 5), "{name}: {updates:?}");
                assert!(updates.top_rebuilds > 40 && updates.top_rebuilds < N_FRAMES as usize, "{name}: {updates:?}");
            }
            _ => assert_eq!(updates.whole, 1, "{name}: {updates:?}"),
        }
    }
}

/// Many meshes that change in one frame are updated together.
fn many_meshes_that_deform_have_the_hits_of_the_cpu() {
    let gpu = gpu();
    let of = |number: u32| f32::from(u16::try_from(number).unwrap());
    let state = |frame: u32| {
        let mesh = |number: u32| {
            let mut mesh = icosphere(1);
            mesh.positions.iter_mut().for_each(|p| p[0] += 0.1 * (of(number) + of(frame) + 3.0 * p[1]).sin());
            mesh
        };
        let placed = |number: u32| {
            let columns =
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.2], [0.0, 0.0, 1.0], [of(number % 5) * 2.5, of(number / 5) * 2.5, 0.0]];
            (number as usize, Affine { columns })
        };
        ((0..20).map(mesh).collect::<Vec<_>>(), (0..20).map(placed).collect::<Vec<_>>())
    };
    let config = SceneBvhConfig { levels: Levels::Two, ..SceneBvhConfig::default() };
    for (strategy, policy) in [(Strategy::Combined, UpdatePolicy::Refit), (Strategy::Aabb, UpdatePolicy::Rebuild)] {
        let first = state(0);
        let mut bvh = SceneBvh::build(&scene(&first.0, &first.1), &config).unwrap();
        let wide = WideConfig { strategy, ..WideConfig::default() };
        let mut frames = DeviceFrames::new(policy).with_wide(wide);
        let mut tally = Tally::default();
        for frame in 0..4 {
            let state = state(frame);
            let scene = scene(&state.0, &state.1);
            bvh.update(&scene, &UpdateOptions { policy, ..UpdateOptions::default() }).unwrap();
            let before = gpu.traffic();
            let traced = traced_frame(&gpu, &scene, &bvh, &mut frames).unwrap();
            let n_dispatches = (gpu.traffic() - before).n_dispatches;
            assert!(frame == 0 || n_dispatches < 1000, "{strategy:?}: {n_dispatches} dispatches for twenty meshes");
            compare(&gpu, &state, &bvh, &traced, false, &mut tally)
                .unwrap_or_else(|error| panic!("{strategy:?}, frame {frame}: {error}"));
        }
        tally.report(&format!("many meshes, {strategy:?}, {policy:?}"));
        let updates = frames.updates();
        assert_eq!((updates.whole, updates.refits + updates.rebuilds, updates.top_rebuilds), (1, 60, 3), "{updates:?}");
    }
}

/// The comparison sees a frame that was not updated.
fn a_frame_that_lags_is_seen() {
    let gpu = gpu();
    let (before, after) = (state(3), state(8));
    let config = SceneBvhConfig { levels: Levels::Two, ..SceneBvhConfig::default() };
    let bvh = SceneBvh::build(&scene(&after.0, &after.1), &config).unwrap();
    let old = SceneBvh::build(&scene(&before.0, &before.1), &config).unwrap();
    let mut frames = DeviceFrames::default();
    let traced = traced_frame(&gpu, &scene(&before.0, &before.1), &old, &mut frames).unwrap();
    compare(&gpu, &after, &bvh, &traced, false, &mut Tally::default()).expect_err("the old frame is not seen");
}
