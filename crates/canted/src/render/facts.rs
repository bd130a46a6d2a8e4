//! Facts about a run, for people and for programs.

use std::time::Duration;

use anyhow::Result;
use canted_obb::Obb;
use canted_renderer::{Film, Level, Prepared, Settings, Structure};
use canted_scene::Scene;
use canted_wide::{LaneKernel, NodeKind, SimdPath};
use serde_json::{Value, json};

use crate::{left_out, memory, options::strategy_name, output};

/// A fact and its name.
pub(super) type Fact = (&'static str, Value);

/// What was built, and of what.
pub(super) fn built<K: LaneKernel>(scene: &Scene, prepared: &Prepared<K>, load_time: Duration) -> Vec<Fact> {
    let two = matches!(prepared.structure, Structure::Two(_));
    let levels = prepared.structure.bottom();
    let mut facts = vec![
        ("meshes", json!(scene.meshes.len())),
        ("instances", json!(scene.instances.len())),
        ("unique_triangles", json!(scene.n_unique_triangles())),
        ("placed_triangles", json!(scene.n_placed_triangles())),
        ("levels", json!(if two { 2 } else { 1 })),
        ("volumes", json!(volumes_of(levels))),
        ("structure_bytes", json!(prepared.structure.n_bytes())),
        ("load_seconds", json!(load_time.as_secs_f64())),
        ("build_seconds", json!(prepared.build_time.as_secs_f64())),
    ];
    if levels.iter().any(|level| matches!(level, Level::Wide(_))) {
        facts.push(("simd", json!(SimdPath::detect().name())));
    }
    facts
}

/// What was sampled, in how long.
pub(super) fn of_film(film: &Film, settings: &Settings, time: Duration) -> Vec<Fact> {
    #[expect(clippy::cast_precision_loss, reason = "rays and samples are fewer than 2^53")]
    let [n_rays, n_samples] = [film.n_rays(), film.n_samples()].map(|n| n as f64);
    let mut facts = vec![
        ("samples_per_pixel", json!(settings.range().len())),
        ("integrator", json!(format!("{:?}", settings.integrator).to_lowercase())),
        ("bounces", json!(settings.bounces)),
        ("rays", json!(film.n_rays())),
        ("rays_per_second", json!(n_rays / time.as_secs_f64())),
        ("dropped_samples", json!(film.n_dropped())),
    ];
    if settings.part.is_some() {
        facts.push(("samples", json!(format!("{:?}", settings.range()))));
    }
    if settings.noise.is_some() {
        let n_pixels = f64::from(settings.width) * f64::from(settings.height);
        facts.push(("noise_reached", json!(film.error())));
        facts.push(("mean_samples_per_pixel", json!(n_samples / n_pixels)));
    }
    facts
}

/// What boxes the bottom levels have, in words; all levels are of one kind.
fn volumes_of<K: LaneKernel>(levels: &[Level<K>]) -> String {
    let mut nodes = [0; NodeKind::ALL.len()];
    let mut turned = 0;
    for level in levels {
        match level {
            Level::Binary(_, strategy) => return strategy_name(*strategy).to_owned(),
            Level::Wide(wide) => {
                let of_one = wide.sizes().nodes;
                nodes = std::array::from_fn(|i| nodes[i] + of_one[i]);
                turned += usize::from(wide.frame() != Obb::IDENTITY_FRAME);
            }
        }
    }
    let n: usize = nodes.iter().sum();
    let leaning = n - nodes[NodeKind::Box as usize];
    let words = match (levels.len(), n) {
        (0, _) => return "none".to_owned(),
        (_, 0) => "wide, leaves only".to_owned(),
        _ => format!("wide, {leaning} of {n} nodes lean"),
    };
    match (levels.len(), turned) {
        (_, 0) => words,
        (1, _) => format!("{words}, mesh turned"),
        (n, turned) => format!("{words}, {turned} of {n} meshes turned"),
    }
}

/// Prints the facts, as JSON or a line each.
pub(super) fn report(facts: &[Fact], as_json: bool) -> Result<()> {
    if as_json {
        let object: serde_json::Map<String, Value> =
            facts.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
        return output::to_stdout(&Value::Object(object).to_string());
    }
    for (key, value) in facts {
        let text = match (*key, value) {
            (key, Value::Number(n)) if key.ends_with("_bytes") => memory::human(n.as_u64().unwrap_or(0)),
            (key, Value::Number(n)) if key.ends_with("seconds") => format!("{:.3} s", n.as_f64().unwrap_or(0.0)),
            ("rays_per_second", Value::Number(n)) => format!("{:.2} M", n.as_f64().unwrap_or(0.0) * 1e-6),
            ("noise_reached", Value::Number(n)) => format!("{:.5}", n.as_f64().unwrap_or(0.0)),
            ("noise_reached", Value::Null) => "unknown".to_owned(),
            (_, Value::Number(n)) if n.is_f64() => format!("{:.2}", n.as_f64().unwrap_or(0.0)),
            ("size", Value::Array(sides)) => format!("{} x {}", sides[0], sides[1]),
            ("left_out", parts) => left_out::text(parts),
            (_, Value::String(text)) => text.clone(),
            (_, other) => other.to_string(),
        };
        output::to_stdout(&format!("{:<24} {text}", key.replace('_', " ").replace(" bytes", "")))?;
    }
    Ok(())
}
