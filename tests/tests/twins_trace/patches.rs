//! Bicubic patches: what the device calls certain is the CPU's answer, in every class of rays and patches.

use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{HostBvh, Options, Outcome, Source, TracedScene, block_on};
use canted_obb::Affine;
use canted_tests::closed::placements;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{BezierPatch, Intersect, Ray, RoundCubic};
use canted_wide::{Config, Moving, TriangleBvh, WideBvh};

use super::gpu;
use super::segments::{Tally, of_kind, plus, unit, vector};
use super::setup::build;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(certain_hits_on_patches_are_the_cpus),
        needs_device(with_negative_bounds_certain_hits_on_patches_are_wrong),
        needs_device(patches_among_others_in_instances_answer_as_on_the_cpu),
        needs_device(a_closed_surface_leaves_few_rays_to_the_cpu),
    ]
}

/// Patches of every shape: gentle, strongly bent, with a collapsed edge, with coincident control points, folded, flat, crossing themselves, tiny, a line, a point, with equal
/// corners.
fn sheets(rng: &mut SplitMix64, n: usize, scale: f32, offset: [f32; 3]) -> Vec<BezierPatch> {
    let one = |i: usize| {
        let (first, along, across) = (vector(rng), vector(rng), vector(rng));
        let size = [0.3, 0.3, 1e-3, 0.05][i % 4];
        let bend = [0.1, 0.0, 0.5, 1.5, 0.02][i / 4 % 5];
        let grid = |u: f32, v: f32| plus(plus(first, size * u, along), size * v, across);
        let shape = i / 20 % 9;
        let mut points = [[[0.0_f32; 3]; 4]; 4];
        for (u, row) in points.iter_mut().enumerate() {
            for (v, point) in row.iter_mut().enumerate() {
                let (u, v) = (u as f32 / 3.0, v as f32 / 3.0);
                let on_grid = match shape {
                    // A collapsed edge.
                    3 => grid(u * v, v),
                    // A fold along v.
                    4 => grid([0.0, 1.0, 1.0, 0.0][(3.0 * u).round() as usize], v),
                    5 => grid(u, 0.0),
                    6 if i.is_multiple_of(3) => first,
                    _ => grid(u, v),
                };
                *point = plus(on_grid, bend * size, vector(rng));
            }
        }
        match shape {
            // The edge is one point, however bent the rest.
            3 => points = points.map(|[_, b, c, d]| [first, b, c, d]),
            7 => points[1][1] = points[0][0],
            // A balloon: all corners are one point.
            8 => [points[0][0], points[0][3], points[3][0], points[3][3]] = [first; 4],
            _ => {}
        }
        BezierPatch { points: points.map(|row| row.map(|p| plus(offset, scale, p))) }
    };
    (0..n).map(one).collect()
}

/// Rays at points inside, at edges and corners and within roundings of them, at the middle lines, along tangents, from the surface, and with ends near it.
fn rays(rng: &mut SplitMix64, sheets: &[BezierPatch], n: usize, scale: f32) -> Vec<Ray> {
    let one = |i: usize| {
        let sheet = &sheets[rng.below(sheets.len())];
        let mut place = |i: usize| match i % 6 {
            0 => 0.0,
            1 => 1.0 - 1e-6 * unit(rng).abs(),
            2 => 0.5 + 1e-7 * unit(rng),
            _ => 0.5 + 0.5 * unit(rng),
        };
        let at = [place(i / 2), place(i / 12)].map(f64::from);
        let [point, by_u, by_v] = sheet.at(at).map(|v| v.map(|x| x as f32));
        let near = if i.is_multiple_of(5) { 1e-6 * scale } else { 0.0 };
        let mut target = plus(point, near, vector(rng));
        let mut origin = plus(point, scale * [0.5, 3.0, 100.0][i % 3], vector(rng));
        match i / 18 % 8 {
            // Along a tangent.
            0 => {
                let turn = unit(rng);
                origin = plus(plus(target, 3.0, by_u), 3.0 * turn, by_v);
            }
            1 => origin = plus(point, 1e-3 * scale, vector(rng)),
            2 => target = plus(point, 0.05 * scale, vector(rng)),
            3 => origin = point,
            _ => {}
        }
        let direction = [0, 1, 2].map(|k| (target[k] - origin[k]) * [1.0, 1.0, 1e-3, 1e4][i / 108 % 4]);
        let mut ray = Ray::new(origin, direction);
        if i / 7 % 6 == 3 {
            let along = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
            let way = (0..3).map(|k| (point[k] - origin[k]).powi(2)).sum::<f32>().sqrt();
            let t = way / along * (1.0 + 1e-6 * unit(rng));
            if t.is_finite() {
                (ray.t_min, ray.t_max) = if i.is_multiple_of(2) { (0.0, t) } else { (t, f32::INFINITY) };
            }
        }
        ray
    };
    (0..n).map(one).collect()
}

/// A patch as the shutter closes.
fn moved(sheet: &BezierPatch) -> BezierPatch {
    let [a, b] = [sheet.points[0][0], sheet.points[3][3]];
    let away = [0, 1, 2].map(|k| 0.25 * (b[k] - a[k]));
    BezierPatch { points: sheet.points.map(|row| row.map(|p| plus(p, 1.0, away))) }
}

fn of_clouds(n_rays: usize, bound_scale: f64, mut each: impl FnMut(&str, &Tally)) {
    let cloud = |n_rays| {
        move |number, scale, offset| {
            let mut rng = SplitMix64::new(170 + number);
            let sheets = sheets(&mut rng, 480, scale, offset);
            let rays = rays(&mut rng, &sheets, n_rays, scale);
            (sheets, rays)
        }
    };
    of_kind("patches", cloud(n_rays), bound_scale, Clone::clone, &mut each);
    let moving = |sheet: &BezierPatch| Moving { open: *sheet, close: moved(sheet) };
    of_kind("moving patches", cloud(n_rays / 4), bound_scale, moving, &mut each);
}

#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn certain_hits_on_patches_are_the_cpus() {
    let mut n_hits = 0;
    of_clouds(6000, 1.0, |name, tally| {
        eprintln!("{name}: {tally:?}");
        n_hits += tally.n_hits;
        assert_eq!(tally.n_wrong, 0, "{name}: {tally:?}");
        // At 1e7 a rounding of a coordinate is as large as a patch of size 1; points that move err by some roundings.
        let is_rounded = name.contains("scale 1e0, offset [1") || name.contains("moving") && name.contains("offset [1");
        assert!(is_rounded || 10 * tally.n_hits > tally.n_rays && tally.n_misses > 30, "{name}: {tally:?}");
        assert!(tally.n_left > 10, "{name}: {tally:?}");
    });
    assert!(n_hits > 20_000, "{n_hits}");
}

/// The comparison must find hits and misses that are called certain without reason.
fn with_negative_bounds_certain_hits_on_patches_are_wrong() {
    let mut n_wrong = std::collections::BTreeMap::<String, usize>::new();
    of_clouds(2400, -1.0, |name, tally| {
        let kind = name.split(',').next().unwrap_or_default().to_owned();
        *n_wrong.entry(kind).or_default() += tally.n_wrong;
    });
    assert!(n_wrong.len() == 2 && n_wrong.values().all(|n| *n > 0), "{n_wrong:?}");
}

/// Patches, curves and triangles in one scene, each placed many times: mirrored, sheared, tiny and far.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn patches_among_others_in_instances_answer_as_on_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(180);
    let sheets = sheets(&mut rng, 240, 1.0, [0.0; 3]);
    let patches = WideBvh::over(sheets.clone()).unwrap();
    let tubes = sheets.iter().map(|sheet| RoundCubic { points: sheet.points[1], radii: [0.01; 4] });
    let cubics = WideBvh::over(tubes.collect()).unwrap();
    let triangles: TriangleBvh = build(&canted_fixtures::displaced_icosphere(3, 2), &Config::default());
    let mirror = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0]] };
    let places = placements().into_iter().map(|place| place.world_from_object).chain([mirror, Affine::IDENTITY]);
    let instances: Vec<Instance> = places
        .flat_map(|at| [0, 0, 1, 2].map(|mesh| Instance::new(mesh, at)))
        .enumerate()
        .filter(|(i, _)| i % 4 != 1)
        .map(|(_, instance)| instance)
        .collect();
    let all: Vec<Ray> = instances
        .iter()
        .filter(|instance| instance.blas == 0)
        .flat_map(|instance| {
            let map = &instance.world_from_object;
            let placed = |ray: &Ray| {
                let end = map.point(plus(ray.origin, 1.0, ray.direction));
                let origin = map.point(ray.origin);
                Ray::new(origin, [0, 1, 2].map(|k| end[k] - origin[k]))
            };
            rays(&mut rng, &sheets, 1500, 1.0).iter().map(placed).collect::<Vec<_>>()
        })
        .filter(|ray| ray.direction != [0.0; 3])
        .collect();
    let host: [HostBvh<'_>; 3] = [(&patches).into(), (&cubics).into(), (&triangles).into()];
    let scene = block_on(TracedScene::new(&gpu, Source::tlas(host, &instances), Options::default())).unwrap();
    let bottom: Vec<Box<dyn Intersect>> = vec![Box::new(patches), Box::new(cubics), Box::new(triangles)];
    let tlas = Tlas::new(bottom, &instances, TopConfig::default()).unwrap();
    let mut tally = Tally::default();
    tally.certain(&gpu, &scene, &tlas, &all, 1.0);
    tally.queries(&gpu, &scene, &tlas, &all);
    eprintln!("{tally:?}");
    assert_eq!(tally.n_wrong, 0, "{tally:?}");
    assert!(tally.n_hits > 5000 && tally.n_misses > 20, "{tally:?}");
    let mut of_negative = Tally::default();
    of_negative.certain(&gpu, &scene, &tlas, &all, -1.0);
    assert!(of_negative.n_wrong > 0, "{of_negative:?}");
}

/// Six patches around a cube whose control points are moved to a sphere, many times, seen whole: few rays are left to the CPU, and parameters are its own.
#[expect(clippy::print_stderr, reason = "the counts are reported")]
fn a_closed_surface_leaves_few_rays_to_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(190);
    let mut sheets = vec![];
    for _ in 0..200 {
        let (center, radius) = (vector(&mut rng), 0.1);
        for face in 0..6 {
            let axis = face % 3;
            let side = if face < 3 { 1.0 } else { -1.0 };
            let place = |k: usize| [-1.0, -0.4, 0.4, 1.0][k];
            let points = [0, 1, 2, 3].map(|i| {
                [0, 1, 2, 3].map(|j| {
                    let mut cube = [0.0; 3];
                    cube[axis] = side;
                    cube[(axis + 1) % 3] = place(i);
                    cube[(axis + 2) % 3] = side * place(j);
                    let length = cube.iter().map(|x: &f32| x * x).sum::<f32>().sqrt();
                    plus(center, radius / length, cube)
                })
            });
            sheets.push(BezierPatch { points });
        }
    }
    let bvh = WideBvh::over(sheets).unwrap();
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&bvh), Options::default())).unwrap();
    let rays: Vec<Ray> = (0..20_000)
        .map(|_| {
            let origin = [3.0, 0.2, 0.1];
            let target = vector(&mut rng);
            Ray::new(origin, [0, 1, 2].map(|k| target[k] - origin[k]))
        })
        .collect();
    let mut tally = Tally::default();
    tally.queries(&gpu, &scene, &bvh, &rays);
    eprintln!("{tally:?}");
    assert_eq!(tally.n_wrong, 0, "{tally:?}");
    assert!(tally.n_hits > 5000 && tally.n_left * 20 < tally.n_rays && tally.off < 1e-5, "{tally:?}");
    let mut off = 0.0_f32;
    for (ray, outcome) in rays.iter().zip(block_on(scene.closest_hits(&gpu, &rays)).unwrap()) {
        if let (Outcome::Complete(Some(hit)), Some(cpu)) = (outcome, bvh.closest_hit(ray)) {
            // What grazes has parameters that are not known well.
            off = if off < 1.0 { off.max((hit.u - cpu.u).abs().min((hit.v - cpu.v).abs())) } else { off };
        }
    }
    eprintln!("parameters differ by {off:e}");
    assert!(off < 1e-2, "{off}");
}
