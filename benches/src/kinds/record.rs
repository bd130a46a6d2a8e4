//! The measurements as JSON lines: one for each kind and engine.

use anyhow::Result;
use serde_json::json;

use super::subject::Measured;
use crate::wide::Record;

/// Adds a scene.
pub(super) fn add(record: &mut Record, measured: &Measured, seed: u64) -> Result<()> {
    for (i, (name, built)) in measured.engines.iter().enumerate() {
        let sets = measured.sets.iter().map(|set| {
            let cpu: Vec<f64> = set.seconds[i].iter().map(|seconds| seconds.cpu).collect();
            json!({ "rays": set.kind.name(), "n": set.n_rays, "cpu_s": cpu })
        });
        let check = measured.checks.get(i).map(|check| {
            let differences = check.differences.iter().map(|difference| {
                let bits = |v: [f32; 3]| v.map(f32::to_bits);
                json!({
                    "rays": difference.rays.name(),
                    "index": difference.index,
                    "origin_bits": bits(difference.ray.origin),
                    "direction_bits": bits(difference.ray.direction),
                    "t_max_bits": difference.ray.t_max.to_bits(),
                    "truth": format!("{:?}", difference.truth),
                    "found": difference.found,
                })
            });
            json!({ "looped": check.n_looped, "differences": differences.collect::<Vec<_>>() })
        });
        record.line(&json!({
            "kind": measured.kind.name,
            "family": measured.kind.family.name(),
            "seed": seed,
            "triangles": measured.n_triangles,
            "engine": name,
            "bytes": built.n_bytes,
            "build_one_thread_s": built.one_thread,
            "build_two_threads_s": built.two_threads,
            "sets": sets.collect::<Vec<_>>(),
            "check": check,
        }))?;
    }
    Ok(())
}
