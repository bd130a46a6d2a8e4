//! The report and the tables of binary BVHs, as text and as JSON.

use std::fmt::Write;

use canted_lbvh::Strategy;
use canted_renderer::{LevelChoice, LevelReason};
use canted_scene::Scene;
use serde_json::{Value, json};

use super::{
    binary::{BinaryStats, Level, Passes, Row},
    motion::Motion,
    planes::PlaneStats,
    wide::{self, WideStats},
};
use crate::{output, process, render};

/// Everything that `canted stats` prints.
pub(super) struct Report<'a> {
    pub(super) name: &'a str,
    pub(super) scene: &'a Scene,
    pub(super) binary: BinaryStats,
    pub(super) wide: WideStats,
    pub(super) planes: PlaneStats,
    pub(super) not_needed: Value,
    /// How many levels `canted render` gives the scene, and why.
    pub(super) levels: LevelChoice,
    /// Updates between frames of an animated file.
    pub(super) motion: Option<Motion>,
    /// Measurements on a GPU as JSON and as tables.
    pub(super) gpu: Option<(Value, String)>,
}

impl Report<'_> {
    /// One JSON object.
    pub(super) fn json(&self) -> String {
        let Self { name, scene, binary, wide, planes, not_needed, levels, motion, gpu } = self;
        let mut all = json!({
            "scene": name,
            "meshes": scene.meshes.len(),
            "instances": scene.instances.len(),
            "vertices": n_vertices(scene),
            "unique_triangles": scene.n_unique_triangles(),
            "placed_triangles": scene.n_placed_triangles(),
            "placed_segments": scene.n_placed_segments(),
            "one_level": level_json(&binary.one),
            "two_level": { "bottom": level_json(&binary.bottom), "top": level_json(&binary.top) },
            "wide": wide::json(wide),
            "planes": planes.json(),
            "not_needed": not_needed,
            "levels": levels_json(levels),
        });
        if let Some(motion) = motion {
            all["motion"] = motion.json();
        }
        if let Some((gpu, _)) = gpu {
            all["device"] = gpu.clone();
        }
        all.to_string()
    }

    /// Tables.
    pub(super) fn text(&self) -> String {
        let Self { name, scene, binary, wide, planes, not_needed, levels, motion, gpu } = self;
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{name}: {} meshes, {} instances, {} vertices, {} triangles ({} with instances){}",
            scene.meshes.len(),
            scene.instances.len(),
            n_vertices(scene),
            scene.n_unique_triangles(),
            scene.n_placed_triangles(),
            match scene.n_placed_segments() {
                0 => String::new(),
                n => format!(", {n} segments of curves"),
            }
        );
        volumes(&mut out, "one level", &binary.one);
        volumes(&mut out, "two levels, bottom", &binary.bottom);
        volumes(&mut out, "two levels, top", &binary.top);
        wide::text(&mut out, wide);
        if output::is_verbose() {
            wide::stages_text(&mut out, wide);
        }
        planes.text(&mut out);
        passes(&mut out, binary);
        let _ = writeln!(out, "\nLevels of BVHs to render the scene: {levels}");
        let _ = writeln!(out, "Not needed to render the scene: {}", render::parts_text(not_needed));
        if let Some(motion) = motion {
            out.push_str(&motion.text());
        }
        if let Some((_, gpu)) = gpu {
            out.push_str(gpu);
        }
        out
    }
}

fn level_json(level: &Level) -> Value {
    let Passes { gather_ms, codes_ms, sort_ms, tree_ms } = level.passes;
    let rows: Vec<Value> = rows(level)
        .map(|(strategy, row)| {
            json!({
                "volumes": strategy.name(),
                "nodes": row.nodes,
                "volume_sum": row.volume,
                "area_sum": row.area,
                "volume_ratio_to_aabb": ratio(row.volume, level.rows[0].volume),
                "area_ratio_to_aabb": ratio(row.area, level.rows[0].area),
                "oriented_share": oriented_share(row),
                "sah": row.sah,
                "depth": row.depth,
                "node_bytes": row.bytes,
                "volumes_ms": row.volumes_ms,
                "layout_ms": row.layout_ms,
            })
        })
        .collect();
    json!({ "gather_ms": gather_ms, "codes_ms": codes_ms, "sort_ms": sort_ms, "tree_ms": tree_ms, "strategies": rows })
}

fn rows(level: &Level) -> impl Iterator<Item = (Strategy, &Row)> {
    Strategy::ALL.into_iter().zip(&level.rows)
}

fn oriented_share(row: &Row) -> f64 {
    row.oriented as f64 / (row.nodes as f64).max(1.0)
}

/// `a / b`, and 1 for two zeros: flat scenes have no volume.
fn ratio(a: f64, b: f64) -> f64 {
    if a == b { 1.0 } else { a / b }
}

fn n_vertices(scene: &Scene) -> usize {
    scene.meshes.iter().map(|mesh| mesh.positions.len()).sum()
}

/// The number of levels, why, and what was predicted.
fn levels_json(choice: &LevelChoice) -> Value {
    let mut levels = json!({ "number": if choice.is_one { 1 } else { 2 }, "reason": choice.reason.name() });
    if let LevelReason::Predicted(costs) = choice.reason {
        levels["predicted"] = json!({ "one": costs.one, "two": costs.two });
    }
    levels
}

/// Sums and costs of each strategy, then the ratio of the volume sums of each pair.
fn volumes(out: &mut String, title: &str, level: &Level) {
    let _ = writeln!(out, "\nBinary BVH, {title} (scene scaled to the unit cube)");
    if level.rows[0].nodes == 0 {
        let _ = writeln!(out, "  no inner nodes");
        return;
    }
    let _ = writeln!(
        out,
        "{:<14}{:>9}{:>12}{:>8}{:>12}{:>8}{:>9}{:>9}{:>7}{:>11}",
        "", "nodes", "volume", "ratio", "area", "ratio", "oriented", "SAH", "depth", "memory"
    );
    let aabb = level.rows[0];
    for (strategy, row) in rows(level) {
        let _ = writeln!(
            out,
            "{:<14}{:>9}{:>12.5}{:>8.5}{:>12.4}{:>8.4}{:>8.2}%{:>9.3}{:>7}{:>11}",
            strategy.name(),
            row.nodes,
            row.volume,
            ratio(row.volume, aabb.volume),
            row.area,
            ratio(row.area, aabb.area),
            100.0 * oriented_share(row),
            row.sah,
            row.depth,
            process::human(row.bytes as u64)
        );
    }
    let _ = write!(out, "{:<14}", "volume ratio");
    for strategy in Strategy::ALL {
        let _ = write!(out, "{:>14}", strategy.name());
    }
    for (strategy, row) in rows(level) {
        let _ = write!(out, "\n{:<14}", strategy.name());
        for (_, column) in rows(level) {
            let _ = write!(out, "{:>14.5}", ratio(row.volume, column.volume));
        }
    }
    out.push('\n');
}

/// Times of the build passes.
fn passes(out: &mut String, stats: &BinaryStats) {
    let _ = write!(out, "\nBuild times in milliseconds, {} threads\n{:<20}", rayon::current_num_threads(), "");
    for title in ["gather", "codes", "sort", "nodes", "layout"] {
        let _ = write!(out, "{title:>9}");
    }
    for strategy in Strategy::ALL {
        let _ = write!(out, "{:>14}", strategy.name());
    }
    for (title, level) in [("one level", &stats.one), ("bottom levels", &stats.bottom), ("top level", &stats.top)] {
        let Passes { gather_ms, codes_ms, sort_ms, tree_ms } = level.passes;
        let _ = write!(out, "\n{title:<20}");
        for ms in [gather_ms, codes_ms, sort_ms, tree_ms, level.rows[0].layout_ms] {
            let _ = write!(out, "{ms:>9.2}");
        }
        for row in &level.rows {
            let _ = write!(out, "{:>14.2}", row.volumes_ms);
        }
    }
    out.push('\n');
}
