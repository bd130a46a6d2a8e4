//! Traversal speed: `obvhs`'s BVH2 traversed by `obvhs` and by us, and the savings of oriented boxes.

use std::{fmt::Write, hint::black_box, time::Duration};

use anyhow::Result;
use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{DIFFUSE_SEED, RayData, SurfacePoint, diffuse};
use canted_lbvh::{Bits, Strategy, VolumeConfig};
use canted_tlas::Blas;
use canted_trace::{Counts, Hit, InstanceId, MollerTrumbore, Ray, Watertight};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2 as ObvhsBvh2, builder::build_bvh2_from_tris},
    ray::{Ray as ObvhsRay, RayHit},
    triangle::Triangle,
};

use crate::{
    interleave::{Contender, Timing, run},
    models::{self, Model},
};

const PEER_SCENES: [&str; 7] = ["bunny", "sponza", "dragon_871k", "country_kitchen", "scaffold", "truss", "grid"];
const ORIENTED_SCENES: [&str; 6] = ["scaffold", "hair_ribbons", "hair_thin_tubes", "truss", "eiffel", "sponza"];
/// Pixels along a view's side.
const RESOLUTION: u32 = 128;

/// Converts a fixture's ray.
pub(crate) fn ray(data: &RayData) -> Ray {
    Ray { origin: data.origin, direction: data.direction, t_min: 0.0, t_max: data.t_max }
}

/// Camera rays, and diffuse rays from where they hit.
fn rays(model: &Model) -> Result<[Vec<Ray>; 2]> {
    let camera: Vec<Ray> = model.camera_rays(RESOLUTION).iter().map(ray).collect();
    let mesh = &model.mesh;
    let blas = Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &BuildConfig::default())?;
    let points: Vec<SurfacePoint> = camera
        .iter()
        .filter_map(|ray| Some(surface_point(model, ray, &blas.closest_hit(ray)?)))
        .filter(|point| point.normal != [0.0; 3])
        .collect();
    let scattered = diffuse(&points, mesh.diagonal(), DIFFUSE_SEED);
    Ok([camera, scattered.iter().map(ray).collect()])
}

/// The hit point, with the normal that faces the ray.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how points are stored")]
pub(crate) fn surface_point(model: &Model, ray: &Ray, hit: &Hit) -> SurfacePoint {
    let [a, b, c] = model.mesh.corners(hit.primitive.index());
    let sub = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let (ab, ac) = (sub(b, a), sub(c, a));
    let normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    let along: f64 = normal.iter().zip(ray.direction).map(|(n, d)| n * f64::from(d)).sum();
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let side = if along > 0.0 { -1.0 } else { 1.0 } / if length > 0.0 { length } else { 1.0 };
    SurfacePoint { position: ray.at(f64::from(hit.t)).map(|x| x as f32), normal: normal.map(|n| (n * side) as f32) }
}

/// Measures both comparisons and writes the section.
pub(crate) fn section(out: &mut String, rounds: usize) -> Result<()> {
    compared_with_obvhs(out, rounds)?;
    oriented(out, rounds)
}

fn compared_with_obvhs(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## Traversal compared with obvhs\n\nOne thread, closest hit. One `obvhs` BVH (`medium_build`, one primitive per leaf), \
         traversed by `obvhs` with its Möller-Trumbore test over triangles in leaf order, and by our binary traversal with the \
         Möller-Trumbore and watertight tests; last our own BVH (PLOC and reinsertion). Million rays per second; ratio to the first \
         of the same round.\n\n\
         | scene | rays | obvhs traversal | our traversal, Möller-Trumbore | our traversal, watertight | our BVH, watertight |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    for name in PEER_SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available | | | | |");
            continue;
        };
        let mesh = &model.mesh;
        let (corners, bounds) = canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?;
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let theirs: Vec<Triangle> = corners.iter().map(|c| triangle(*c)).collect();
        let bvh = build_bvh2_from_tris(&theirs, params, &mut Duration::default());
        let in_leaf_order: Vec<Triangle> = bvh.primitive_indices.iter().map(|&i| theirs[i as usize]).collect();
        let tree = canted_renderer::obvhs_tree(&corners, params)?;
        let config = BuildConfig::default();
        let fast = Bvh2::<MollerTrumbore>::over(tree.clone(), &corners, &bounds, &config);
        let sure = Bvh2::<Watertight>::over(tree, &corners, &bounds, &config);
        let own = crate::models::binary_tree(&corners, &bounds);
        let own = Bvh2::<Watertight>::over(own, &corners, &bounds, &config);
        for (kind, rays) in ["camera", "diffuse"].into_iter().zip(rays(&model)?) {
            let timings = run(
                rounds,
                vec![
                    Contender::new("obvhs", || trace_obvhs(&bvh, &in_leaf_order, &rays)),
                    Contender::new("fast", || trace_all(&fast, &rays)),
                    Contender::new("sure", || trace_all(&sure, &rays)),
                    Contender::new("own", || trace_all(&own, &rays)),
                ],
            );
            let _ = write!(out, "| {name} | {kind} |");
            for timing in &timings {
                out.push_str(&rate(timing, rays.len(), timing.name != "obvhs"));
            }
            out.push('\n');
        }
    }
    Ok(())
}

fn triangle(corners: [[f32; 3]; 3]) -> Triangle {
    let [v0, v1, v2] = corners.map(glam::Vec3A::from_array);
    Triangle { v0, v1, v2 }
}

fn trace_obvhs(bvh: &ObvhsBvh2, triangles: &[Triangle], rays: &[Ray]) {
    for ray in rays {
        let ray = ObvhsRay::new(ray.origin.into(), ray.direction.into(), 0.0, ray.t_max);
        let mut hit = RayHit::none();
        bvh.ray_traverse(ray, &mut hit, |ray, i| triangles[i].intersect(ray));
        black_box(hit);
    }
}

fn trace_all(blas: &impl Blas, rays: &[Ray]) {
    for ray in rays {
        black_box(blas.closest_hit_with(ray, InstanceId(0), &mut ()));
    }
}

fn oriented(out: &mut String, rounds: usize) -> Result<()> {
    out.push_str(
        "\n## What oriented boxes save\n\nOur binary BVH (PLOC and reinsertion), one thread, watertight: box tests + triangle tests \
         per ray, and million rays per second with the ratio to axis-aligned boxes of the same round.\n\n| scene | rays |",
    );
    for strategy in Strategy::ALL {
        let _ = write!(out, " {strategy:?} |");
    }
    let _ = writeln!(out, "\n| --- | --- |{}", " --- |".repeat(Strategy::ALL.len()));
    for name in ORIENTED_SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let mesh = &model.mesh;
        let (corners, bounds) = canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?;
        let tree = crate::models::binary_tree(&corners, &bounds);
        let trees: Vec<_> = Strategy::ALL
            .into_iter()
            .map(|strategy| {
                let volumes = VolumeConfig { strategy, fallback: true };
                let config = BuildConfig { bits: Bits::B63, volumes };
                Bvh2::<Watertight>::over(tree.clone(), &corners, &bounds, &config)
            })
            .collect();
        for (kind, rays) in ["camera", "diffuse"].into_iter().zip(rays(&model)?) {
            let rays = &rays;
            let contenders = trees.iter().map(|blas| Contender::new("", move || trace_all(blas, rays))).collect();
            let timings = run(rounds, contenders);
            let _ = write!(out, "| {name} | {kind} |");
            for (blas, timing) in trees.iter().zip(&timings) {
                let mut counts = Counts::default();
                for ray in rays {
                    blas.closest_hit_with(ray, InstanceId(0), &mut counts);
                }
                #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
                let each = |n: u64| n as f64 / rays.len() as f64;
                let _ = write!(
                    out,
                    " {:.1} + {:.2};{}",
                    each(counts.boxes),
                    each(counts.triangles),
                    rate(timing, rays.len(), true)
                );
            }
            out.push('\n');
        }
    }
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
fn rate(timing: &Timing, n: usize, with_ratio: bool) -> String {
    let ratio = if with_ratio { format!(", {:.2}x", timing.speed_ratio) } else { String::new() };
    format!(" {:.2} (±{:.0} %){ratio} |", n as f64 / timing.median() * 1e-6, 100.0 * timing.spread())
}
