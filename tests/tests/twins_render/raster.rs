//! The raster pass compared with primary rays through pixel centers.
//!
//! A rasterizer snaps vertices to a grid of 1/256 of a pixel, after f32 rounding of some 2⁻²² of the picture's width. A pixel center
//! that close to an edge may be on either side of it; elsewhere both methods give the same triangle.

use std::sync::atomic::AtomicBool;

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::Gpu;
use canted_renderer::{
    Cull, DevicePicture, FirstHit, HitFilter, Integrator, Levels, Lod, Monitor, SceneBvh, Settings, Surface,
    SurfaceInfo, Surfaces, View,
};
use canted_scene::{Camera, Scene};
use canted_trace::{Hit, Intersect};

use super::{gpu, scenes};
use crate::scenes::{frame_of, scene_bvh};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(the_raster_pass_matches_primary_rays),
        needs_device(another_point_or_color_is_detected),
        needs_device(rasterized_first_hits_change_no_picture),
        needs_device(first_hits_of_paths_are_not_rasterized),
    ]
}

const SIZE: [u32; 2] = [96, 54];

/// Greatest distance of the rasterizer's edges from their position, in pixels: half a grid step along each axis, twice for the two
/// ends of an edge, and as much again for f32 rounding.
const EDGE: f64 = 1.0 / 64.0;

/// Error of positions and distances, relative to the reach of scene and eye, including views from straight above: some dozen
/// roundings of the ray and the triangle.
const ROUNDING: f64 = 64.0 * f32::EPSILON as f64;

fn settings() -> Settings {
    let [width, height] = SIZE;
    Settings { width, height, samples: 1, lod: Lod::Aniso, integrator: Integrator::Hybrid, ..Settings::default() }
}

/// The surfaces seen by primary rays.
struct Rays<'a> {
    view: View,
    surfaces: &'a Surfaces<'a>,
    bvh: &'a SceneBvh,
}

impl Rays<'_> {
    /// The first hit through a position of the picture, in pixels, with its surface.
    fn seen(&self, at: [f64; 2]) -> Option<(Hit, Surface)> {
        let ray = self.view.ray(at);
        let hit =
            self.bvh.closest_hit_with(&ray, &mut HitFilter::new(self.surfaces).culling(Cull::Auto, &self.view))?;
        Some((hit, self.surfaces.at_time(&hit, ray.direction, 0.0, self.view.cone(at, 0))))
    }

    /// Whether all rays around a center, as close as the rasterizer's edges may be, hit the same as the one through it.
    fn is_within(&self, [x, y]: [f64; 2]) -> bool {
        let same = |hit: Option<(Hit, Surface)>| hit.map(|(hit, _)| (hit.instance, hit.primitive));
        let here = same(self.seen([x, y]));
        let around =
            [[EDGE, 0.0], [-EDGE, 0.0], [0.0, EDGE], [0.0, -EDGE], [EDGE, EDGE], [-EDGE, -EDGE], [EDGE, -EDGE]];
        around.iter().chain(&[[-EDGE, EDGE]]).all(|[dx, dy]| same(self.seen([x + dx, y + dy])) == here)
    }
}

/// Height of a triangle relative to its longest edge in world space, and how much its instance's transform amplifies the rounding of normals.
fn shape(scene: &Scene, hit: &Hit) -> [f64; 2] {
    let instance = &scene.instances[hit.instance.0 as usize];
    let mesh = &scene.meshes[instance.mesh.0 as usize];
    let [a, b, c] = mesh.triangles[hit.primitive.0 as usize]
        .map(|i| instance.world_from_object.point(mesh.positions[i as usize]).map(f64::from));
    let sub = |p: [f64; 3], q: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| p[k] - q[k]) };
    let cross = |p: [f64; 3], q: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|k| p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3])
    };
    let length = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let longest = [sub(b, a), sub(c, b), sub(a, c)].map(length).into_iter().fold(0.0, f64::max);
    // Norm of the matrix times that of its inverse, whose rows are cofactors divided by the determinant.
    let [x, y, z, _] = instance.world_from_object.columns.map(|column| column.map(f64::from));
    let norm = |columns: [[f64; 3]; 3]| length(columns.map(length));
    let determinant: f64 = cross(x, y).iter().zip(z).map(|(a, b)| a * b).sum();
    let condition = norm([x, y, z]) * norm([cross(x, y), cross(y, z), cross(z, x)]) / determinant.abs();
    [length(cross(sub(b, a), sub(c, a))) / longest, condition]
}

/// What is wrong with a pixel beyond rounding, if anything.
fn differs(
    scene: &Scene,
    seen: &SurfaceInfo,
    hit: &Hit,
    surface: &Surface,
    direction: [f32; 3],
    reach: f64,
) -> Option<&'static str> {
    if (seen.instance, seen.primitive) != (hit.instance, hit.primitive) {
        return Some("triangle");
    }
    let cosine: f64 = (0..3).map(|k| f64::from(direction[k]) * surface.normal[k]).sum::<f64>().abs();
    let near = |a: [f32; 3], b: [f64; 3], bound: f64| (0..3).all(|k| (f64::from(a[k]) - b[k]).abs() <= bound);
    let moved = ROUNDING * reach / cosine.max(1e-3);
    if !near(seen.position, surface.position, moved) || f64::from((seen.distance - hit.t).abs()) > moved {
        return Some("position");
    }
    let [height, condition] = shape(scene, hit);
    // The share of the triangle by which the position moves. Its corners tilt the triangle by as much, and so the shading normal.
    let share = moved / height;
    let turn = share + ROUNDING * condition;
    if !near(seen.normal, surface.normal, turn) || !near(seen.shading_normal, surface.shading_normal, 4.0 * turn) {
        return Some("normal");
    }
    // Textures change over their full range within a quarter of a block, of which there are eight along a triangle.
    let color = surface.bsdf.base_color.map(f64::from);
    if near(seen.albedo, color, 32.0 * turn) { None } else { Some("albedo") }
}

/// Pixels that differ where rays exclude it, and the share of pixels on edges.
fn wrong(gpu: &Gpu, scene: &Scene, camera: &Camera, levels: Levels, spoil: fn(&mut SurfaceInfo)) -> (Vec<String>, f64) {
    let settings = settings();
    let bvh = scene_bvh(scene, levels);
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let [width, height] = SIZE;
    let rays = Rays { view: View::new(camera, width, height).unwrap(), surfaces: &surfaces, bvh: &bvh };
    let picture = DevicePicture::new(gpu, &surfaces, &bvh, camera, &settings).unwrap();
    let drawn = picture.first_surfaces().unwrap();
    let reach = scene.bounds_world().reach().max(camera.eye.iter().fold(0.0, |most, x| x.abs().max(most)));
    let (mut wrong, mut n_edges) = (vec![], 0.0);
    for (k, seen) in (0..).zip(drawn.pixels) {
        let at = [f64::from(k % width) + 0.5, f64::from(k / width) + 0.5];
        if !rays.is_within(at) {
            n_edges += 1.0;
            continue;
        }
        let found = match (seen, rays.seen(at)) {
            (None, None) => None,
            (Some(mut seen), Some((hit, surface))) => {
                spoil(&mut seen);
                let direction = rays.view.ray(at).direction;
                differs(scene, &seen, &hit, &surface, direction, reach.into())
                    .map(|what| format!("{what} at {at:?}: {seen:?} {hit:?} {surface:?}"))
            }
            (seen, expected) => Some(format!("at {at:?}: {seen:?} {expected:?}")),
        };
        wrong.extend(found);
    }
    (wrong, n_edges / f64::from(width * height))
}

#[track_caller]
fn check(gpu: &Gpu, scene: &Scene, camera: &Camera, levels: Levels) {
    let (wrong, edges) = wrong(gpu, scene, camera, levels, |_| ());
    assert!(wrong.is_empty() && edges < 0.5, "{} wrong, {edges} on edges: {}", wrong.len(), wrong[0]);
}

fn the_raster_pass_matches_primary_rays() {
    let gpu = gpu();
    let builtin = canted_scene::builtin();
    let (room, room_camera) = scenes::room();
    let (dollhouse, dollhouse_camera) = scenes::dollhouse();
    let (mut textured, textured_camera) = scenes::textured();
    // Hits of blended surfaces are random, and random numbers may differ between both methods.
    textured.materials[2].alpha = 1.0;
    for levels in [Levels::One, Levels::Two] {
        check(&gpu, &builtin, &frame_of(&builtin), levels);
        check(&gpu, &room, &room_camera, levels);
        check(&gpu, &dollhouse, &dollhouse_camera, levels);
        check(&gpu, &textured, &textured_camera, levels);
    }
    // From inside, so that triangles extend behind the eye.
    let inside = Camera::pinhole([0.2, 0.1, 0.3], [1.0, -0.5, -1.0], [0.0, 1.0, 0.0], 80.0);
    check(&gpu, &room, &inside, Levels::One);
}

fn another_point_or_color_is_detected() {
    let gpu = gpu();
    let (scene, camera) = scenes::textured();
    let n_wrong = |spoil: fn(&mut SurfaceInfo)| wrong(&gpu, &scene, &camera, Levels::One, spoil).0.len();
    assert!(n_wrong(|seen| seen.position[0] += 0.002) > 1000);
    assert!(n_wrong(|seen| seen.shading_normal[1] += 0.01) > 1000);
    assert!(n_wrong(|seen| seen.albedo[2] += 0.02) > 1000);
    assert!(n_wrong(|seen| seen.primitive.0 ^= 1) > 1000);
}

/// Rays that start at what a raster pass saw give the picture of rays that are traced at once: with alpha tests, which may reject
/// the guess, with instances that move away from it, and from inside.
fn rasterized_first_hits_change_no_picture() {
    let gpu = gpu();
    let cancel = AtomicBool::new(false);
    let monitor = Monitor::quiet(&cancel);
    let settings = Settings { samples: 3, ..settings() };
    for (scene, camera) in [scenes::textured(), scenes::dollhouse(), scenes::in_motion(scenes::room())] {
        for levels in [Levels::One, Levels::Two] {
            let is_flat = levels == Levels::One;
            if is_flat && scene.has_motion() {
                continue;
            }
            let bvh = scene_bvh(&scene, levels);
            let surfaces = Surfaces::with_lod(&scene, settings.lod);
            let film = |first_hit: FirstHit| {
                let picture = DevicePicture::new(&gpu, &surfaces, &bvh, &camera, &settings).unwrap();
                let (picture, used) = picture.with_first_hit(first_hit).unwrap();
                assert_eq!(used, first_hit);
                assert_eq!(picture.without_streams(), (used == FirstHit::Raster).then_some("a raster pass"));
                picture.render(vec![], &monitor).unwrap()
            };
            assert!(film(FirstHit::Raster) == film(FirstHit::Trace), "{levels:?}");
        }
    }
}

fn first_hits_of_paths_are_not_rasterized() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let settings = Settings { integrator: Integrator::Path, ..settings() };
    let bvh = scene_bvh(&scene, Levels::One);
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let picture = || DevicePicture::new(&gpu, &surfaces, &bvh, &camera, &settings).unwrap();
    let error = picture().with_first_hit(FirstHit::Raster).err().expect("a path is not rasterized");
    assert!(error.to_string().contains("the path integrator are not rasterized"), "{error}");
    assert_eq!(picture().with_first_hit(FirstHit::Auto).unwrap().1, FirstHit::Trace);
}
