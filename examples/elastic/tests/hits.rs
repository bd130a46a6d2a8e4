//! Every frame's hits equal a loop over all triangles, for every way to update.

mod common;

use std::time::Duration;

use canted_obb::PrimId;
use canted_renderer::{Tracer, UpdateOptions, UpdatePolicy};
use canted_scene::Scene;
use canted_trace::{Hit, InstanceId, Kernel, Ray, ScaledRay, Watertight};
use common::Random;
use elastic::{Material, Stage, torus};

/// The oracle: the kernel on every triangle of every mesh, each of which is placed once where it is.
fn loop_over(scene: &Scene, ray: &Ray) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let prepared = Watertight::prepare(&ray);
    let mut best: Option<Hit> = None;
    for (instance, mesh) in (0..).map(InstanceId).zip(&scene.meshes) {
        for (primitive, triangle) in (0..).map(PrimId).zip(&mesh.triangles) {
            let record = Watertight::record(triangle.map(|i| mesh.positions[i as usize]));
            if let Some(hit) = Watertight::intersect(&prepared, &ray, &record, ray.t_max) {
                let hit = Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side };
                if best.is_none_or(|best| hit.before(&best)) {
                    best = Some(hit);
                }
            }
        }
    }
    best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
}

/// Rays of any length from all around towards the body, and onto edges and vertices of it.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounds; indices")]
fn rays(random: &mut Random, scene: &Scene) -> Vec<Ray> {
    let mesh = &scene.meshes[0];
    let mut rays = Vec::new();
    for i in 0..60 {
        let origin = random.vector(3.0).map(|x| x as f32);
        let vertex = mesh.positions[(0.5 * (random.next() + 1.0) * mesh.positions.len() as f64) as usize];
        let blur = if i % 3 == 0 { 0.0 } else { 0.2 };
        let length = 10_f64.powf(6.0 * random.next());
        let target = std::array::from_fn::<f64, 3, _>(|k| f64::from(vertex[k]) + blur * random.next());
        let direction = std::array::from_fn(|k| (length * (target[k] - f64::from(origin[k]))) as f32);
        rays.push(Ray::new(origin, direction));
        rays.push(Ray::new(vertex, [0.0, if i % 2 == 0 { -1.0 } else { 1.0 }, -0.0]));
    }
    rays
}

/// The numbers of rays that hit, and of those whose answers differ from the loop's.
fn compare(stage: &Stage, rays: &[Ray]) -> (usize, usize) {
    let structure = &stage.prepared.structure;
    let (mut n_hits, mut n_differences) = (0, 0);
    for ray in rays {
        let want = loop_over(&stage.scene, ray);
        let is_equal =
            structure.closest_hit(ray, &mut ()) == want && structure.occluded(ray, &mut ()) == want.is_some();
        n_hits += usize::from(want.is_some());
        n_differences += usize::from(!is_equal);
    }
    (n_hits, n_differences)
}

#[test]
fn hits_of_every_frame_equal_a_loop() {
    // It hits the floor at the seventh frame.
    const N_FRAMES: [(UpdatePolicy, usize); 3] =
        [(UpdatePolicy::Auto, 60), (UpdatePolicy::Refit, 14), (UpdatePolicy::Rebuild, 14)];
    let mesh = torus([0.45, 0.2], [24, 12], 1.0, 0.5);
    for (policy, n_frames) in N_FRAMES {
        let mut random = Random(11);
        let mut stage = Stage::new(&mesh, 0.1, &Material::RUBBER).unwrap();
        let (mut refits, mut rebuilds) = (0, 0);
        for frame in 0..n_frames {
            let options = UpdateOptions { policy, trace_time: Duration::from_millis(100) };
            let (n_steps, updates) = stage.advance(1.0 / 24.0, &options).unwrap();
            assert!(n_steps > 0);
            (refits, rebuilds) = (refits + updates.refits, rebuilds + updates.rebuilds);
            let rays = rays(&mut random, &stage.scene);
            let (n_hits, n_differences) = compare(&stage, &rays);
            assert!(n_hits > rays.len() / 3, "only {n_hits} of {} rays hit", rays.len());
            assert_eq!(n_differences, 0, "frame {frame}, {policy:?}");
        }
        let expected = match policy {
            UpdatePolicy::Auto => refits + rebuilds == n_frames,
            UpdatePolicy::Refit => (refits, rebuilds) == (n_frames, 0),
            UpdatePolicy::Rebuild => (refits, rebuilds) == (0, n_frames),
        };
        assert!(expected, "{policy:?}: {refits} refits, {rebuilds} rebuilds");
        // The same check must reject a BVH of the last frame.
        let old = stage.scene.meshes[0].positions.clone();
        stage.scene.meshes[0].positions = old.into_iter().map(|[x, y, z]| [x, y + 0.05, z]).collect();
        assert!(compare(&stage, &rays(&mut random, &stage.scene)).1 > 0, "an old BVH passes");
    }
}

#[test]
fn stages_that_cannot_be_made_are_errors() {
    let error = |spacing: f64| {
        let mesh = torus([0.45, 0.2], [24, 12], 1.0, 0.5);
        Stage::new(&mesh, spacing, &Material::RUBBER).map(|_| ()).unwrap_err().to_string()
    };
    for spacing in [0.0, -1.0, f64::NAN, 1e-6] {
        assert_eq!(error(spacing), format!("spacing {spacing} m of phyxels: use a larger one"));
    }
    assert!(error(2.0).contains("use a smaller spacing"), "{}", error(2.0));
}
