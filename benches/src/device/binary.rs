//! Rays through binary BVHs that the device builds, by volumes.

use std::fmt::Write;

use anyhow::Result;
use canted_bvh2::Bvh2;
use canted_gpu::{
    SceneInput, TracedScene,
    build::{BuildConfig, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Strategy, VolumeConfig};
use canted_trace::{Counts, InstanceId, Ray, Watertight};
use canted_wide::{Config, Preset};

use super::{Bench, rays};
use crate::{models, wide::sets::Kind};

/// An ordinary scene, and one of thin diagonal parts.
const SCENES: [&str; 2] = ["sponza", "truss"];

/// Bytes of an aligned and of an oriented node of a WideBvh.
const NODE_BYTES: [f64; 2] = [256.0, 512.0];

/// Bytes of a tested triangle, and of a ray and its hit.
const TRIANGLE_BYTES: f64 = 36.0;
const RAY_BYTES: f64 = 32.0 + 20.0;

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Rays through what the device builds\n\nThe same rays, on a software driver a quarter of them, through the WideBvh of preset balanced, which the CPU builds, and \
         through binary BVHs that the device builds over a radix tree of 63-bit codes, by volumes. Million rays per second of device \
         time. In italics what bandwidth allows without any cache: bytes of the nodes and triangles \
         that a ray visits on the CPU, and of ray and hit.\n\n| scene | rays | BVH | rate | *without caches* |\n| --- | --- | --- | --- | --- |"
    );
    for name in SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let (corners, _) = lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
        let wide = rays::build(&model, &Config::preset(Preset::Balanced))?;
        let sets = rays::sets(&model, &wide, bench).map(|set| if bench.is_software() { quarter(&set) } else { set });
        let mut rows = vec![(
            "wide".to_owned(),
            TracedScene::new(&bench.gpu, SceneInput::upload([&wide])),
            Kind::ALL.map(|_| f64::NAN),
        )];
        let kinds = Kind::ALL.into_iter().zip(&sets);
        for ((_, set), expected) in kinds.clone().zip(&mut rows[0].2) {
            let counts = wide.traversal_counts(set);
            let nodes = NODE_BYTES.iter().zip(counts.nodes).map(|(bytes, n)| bytes * per(n, set)).sum::<f64>();
            *expected = nodes + 8.0 * TRIANGLE_BYTES * per(counts.blocks, set) + RAY_BYTES;
        }
        for strategy in STRATEGIES {
            let config = BuildConfig { bits: Bits::B63, strategy };
            let traced = TracedScene::new(&bench.gpu, SceneInput::build([&corners], config));
            // The same BVH on the CPU.
            let volumes = VolumeConfig { strategy, fallback: true };
            let config = canted_bvh2::BuildConfig { bits: Bits::B63, volumes };
            let on_cpu = Bvh2::build(&model.mesh.positions, &model.mesh.triangles, &config)?;
            let each = kinds.clone().map(|(kind, set)| bytes_of_a_ray(&on_cpu, kind, set, strategy));
            let each: Vec<f64> = each.collect();
            rows.push((format!("{strategy:?}"), traced, [each[0], each[1], each[2]]));
        }
        for (k, (kind, set)) in kinds.enumerate() {
            for (bvh, traced, bytes_each) in &rows {
                let _ = write!(out, "| {name} | {} | {bvh} |", kind.name());
                match traced {
                    Ok(traced) => {
                        let _ = write!(out, " {:.2} |", rays::cast(bench, traced, kind, set)?.rate(set.len()));
                    }
                    Err(_) => out.push_str(" - |"),
                }
                let _ = writeln!(out, " *{:.2}* |", bench.bandwidth.rate(bytes_each[k]));
            }
        }
    }
    Ok(())
}

/// Bytes that a ray reads and writes without caches: half of a node for each tested box.
fn bytes_of_a_ray(bvh: &Bvh2<Watertight>, kind: Kind, set: &[Ray], strategy: Strategy) -> f64 {
    let box_bytes = if strategy == Strategy::Aabb { 32.0 } else { 64.0 };
    let mut counts = Counts::default();
    for ray in set {
        if kind == Kind::Occlusion {
            bvh.occluded_with(ray, InstanceId(0), &mut counts);
        } else {
            bvh.closest_hit_with(ray, InstanceId(0), &mut counts);
        }
    }
    box_bytes * per(counts.boxes, set) + TRIANGLE_BYTES * per(counts.triangles, set) + RAY_BYTES
}

/// Every fourth square of rays: software drivers take minutes for all of them.
fn quarter(set: &[Ray]) -> Vec<Ray> {
    set.chunks(64).step_by(4).flatten().copied().collect()
}

/// A count for each ray.
#[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
fn per(n: u64, set: &[Ray]) -> f64 {
    n as f64 / set.len().max(1) as f64
}
