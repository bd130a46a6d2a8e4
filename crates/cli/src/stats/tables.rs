//! The tables, as text and as JSON.

use std::fmt::Write;

use canted_lbvh::Strategy;
use canted_scene::Scene;
use serde_json::{Value, json};

use super::measure::{Level, Measured, Passes, Row};
use super::{device, wide, wide_tables};
use crate::{left_out, memory, options::strategy_name};

/// All numbers as JSON.
pub(super) fn json(
    name: &str,
    scene: &Scene,
    measured: &Measured,
    wide: &wide::Measured,
    left_out: &Value,
    device: Option<&device::Measured>,
) -> String {
    let mut all = json!({
        "scene": name,
        "meshes": scene.meshes.len(),
        "instances": scene.instances.len(),
        "vertices": n_vertices(scene),
        "unique_triangles": scene.n_unique_triangles(),
        "placed_triangles": scene.n_placed_triangles(),
        "one_level": level_json(&measured.one),
        "two_level": { "bottom": level_json(&measured.bottom), "top": level_json(&measured.top) },
        "wide": wide_tables::json(wide),
        "left_out": left_out,
    });
    if let Some(device) = device {
        all["device"] = device.json();
    }
    all.to_string()
}

fn level_json(level: &Level) -> Value {
    let Passes { gather_ms, codes_ms, sort_ms, tree_ms } = level.passes;
    let rows: Vec<Value> = rows(level)
        .map(|(strategy, row)| {
            json!({
                "volumes": strategy_name(strategy),
                "nodes": row.nodes,
                "volume_sum": row.volume,
                "area_sum": row.area,
                "volume_ratio_to_aabb": ratio(row.volume, level.rows[0].volume),
                "area_ratio_to_aabb": ratio(row.area, level.rows[0].area),
                "leaning_share": leaning_share(row),
                "sah": row.sah,
                "depth": row.depth,
                "node_bytes": row.bytes,
                "boxes_ms": row.boxes_ms,
                "layout_ms": row.layout_ms,
            })
        })
        .collect();
    json!({ "gather_ms": gather_ms, "codes_ms": codes_ms, "sort_ms": sort_ms, "tree_ms": tree_ms, "strategies": rows })
}

fn rows(level: &Level) -> impl Iterator<Item = (Strategy, &Row)> {
    Strategy::ALL.into_iter().zip(&level.rows)
}

#[expect(clippy::cast_precision_loss, reason = "a share is shown with a few digits")]
fn leaning_share(row: &Row) -> f64 {
    row.leaning as f64 / (row.nodes as f64).max(1.0)
}

/// `a / b`, where two zeros are equal: flat scenes have no volume.
fn ratio(a: f64, b: f64) -> f64 {
    if a == b { 1.0 } else { a / b }
}

fn n_vertices(scene: &Scene) -> usize {
    scene.meshes.iter().map(|mesh| mesh.positions.len()).sum()
}

/// All numbers as tables for people.
pub(super) fn text(
    name: &str,
    scene: &Scene,
    measured: &Measured,
    wide: &wide::Measured,
    left_out: &Value,
    device: Option<&device::Measured>,
) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{name}: {} meshes, {} instances, {} vertices, {} triangles ({} placed)",
        scene.meshes.len(),
        scene.instances.len(),
        n_vertices(scene),
        scene.n_unique_triangles(),
        scene.n_placed_triangles()
    );
    boxes(&mut out, "one level", &measured.one);
    boxes(&mut out, "two levels, bottom", &measured.bottom);
    boxes(&mut out, "two levels, top", &measured.top);
    wide_tables::text(&mut out, wide);
    passes(&mut out, measured);
    let _ = writeln!(out, "\nLeft out of pictures: {}", left_out::text(left_out));
    if let Some(device) = device {
        device.text(&mut out);
    }
    out
}

/// Sums and quality of each strategy; then the volume of each over that of each other (row over column).
fn boxes(out: &mut String, title: &str, level: &Level) {
    let _ = writeln!(out, "\nBoxes, {title} (scene scaled to the unit cube)");
    if level.rows[0].nodes == 0 {
        let _ = writeln!(out, "  no inner node");
        return;
    }
    let _ = writeln!(
        out,
        "{:<14}{:>9}{:>12}{:>8}{:>12}{:>8}{:>9}{:>9}{:>7}{:>11}",
        "", "nodes", "volume", "ratio", "area", "ratio", "leaning", "SAH", "depth", "memory"
    );
    let aabb = level.rows[0];
    for (strategy, row) in rows(level) {
        let _ = writeln!(
            out,
            "{:<14}{:>9}{:>12.5}{:>8.5}{:>12.4}{:>8.4}{:>8.2}%{:>9.3}{:>7}{:>11}",
            strategy_name(strategy),
            row.nodes,
            row.volume,
            ratio(row.volume, aabb.volume),
            row.area,
            ratio(row.area, aabb.area),
            100.0 * leaning_share(row),
            row.sah,
            row.depth,
            memory::human(row.bytes as u64)
        );
    }
    let _ = write!(out, "{:<14}", "row / column");
    for strategy in Strategy::ALL {
        let _ = write!(out, "{:>14}", strategy_name(strategy));
    }
    for (strategy, row) in rows(level) {
        let _ = write!(out, "\n{:<14}", strategy_name(strategy));
        for (_, column) in rows(level) {
            let _ = write!(out, "{:>14.5}", ratio(row.volume, column.volume));
        }
    }
    out.push('\n');
}

/// Milliseconds a pass.
fn passes(out: &mut String, measured: &Measured) {
    let _ = write!(out, "\nMilliseconds a pass, {} threads\n{:<20}", rayon::current_num_threads(), "");
    for title in ["gather", "codes", "sort", "nodes", "layout"] {
        let _ = write!(out, "{title:>9}");
    }
    for strategy in Strategy::ALL {
        let _ = write!(out, "{:>14}", strategy_name(strategy));
    }
    for (title, level) in
        [("one level", &measured.one), ("bottom levels", &measured.bottom), ("top level", &measured.top)]
    {
        let Passes { gather_ms, codes_ms, sort_ms, tree_ms } = level.passes;
        let _ = write!(out, "\n{title:<20}");
        for ms in [gather_ms, codes_ms, sort_ms, tree_ms, level.rows[0].layout_ms] {
            let _ = write!(out, "{ms:>9.2}");
        }
        for row in &level.rows {
            let _ = write!(out, "{:>14.2}", row.boxes_ms);
        }
    }
}
