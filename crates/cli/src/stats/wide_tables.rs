//! The tables of the wide BVHs, as text and as JSON.

use std::fmt::Write;

use canted_wide::{NodeKind, SimdPath};
use serde_json::{Value, json};

use super::wide::{Level, Row, WideStats};
use crate::process;

/// Below this ratio of predicted costs, the reason states a percentage instead of a factor.
const ABOUT_EQUAL: f64 = 1.05;

pub(super) fn json(stats: &WideStats) -> Value {
    json!({
        "simd": SimdPath::detect().name(),
        "one_level": level_json(&stats.one),
        "two_level": level_json(&stats.bottom),
    })
}

fn level_json(level: &Level) -> Value {
    let presets: Vec<Value> = rows(level)
        .map(|(name, row)| {
            json!({
                "preset": name,
                "predicted_aligned_cost": row.aligned_cost,
                "predicted_cost": row.cost,
                "nodes": row.n_nodes(),
                "aligned_share": row.share(NodeKind::Aligned),
                "oriented_share": row.share(NodeKind::Oriented),
                "rotated": row.n_rotated,
                "max_angle_degrees": row.max_angle_rad.to_degrees(),
                "depth": row.depth,
                "node_bytes": row.node_bytes,
                "block_bytes": row.block_bytes,
                "bytes_per_triangle": row.bytes_per_triangle(),
                "build_ms": row.build_ms,
                "reason": reason(level, row),
            })
        })
        .collect();
    json!({ "bvhs": level.n_bvhs, "presets": presets })
}

fn rows(level: &Level) -> impl Iterator<Item = (&'static str, &Row)> {
    level.rows.iter().map(|(preset, row)| (preset.name(), row))
}

/// One table per level, each with a reason per preset.
pub(super) fn text(out: &mut String, stats: &WideStats) {
    level_text(out, "one level", &stats.one);
    level_text(out, "two levels, bottom", &stats.bottom);
}

fn level_text(out: &mut String, title: &str, level: &Level) {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\nWide BVH, {title} (predicted cost of a ray that enters the root, in aligned node visits)\n\
         {:<14}{:>13}{:>9}{:>9}{:>9}{:>10}{:>9}{:>7}{:>11}{:>11}{:>9}{:>10}",
        "",
        "aligned cost",
        "cost",
        "nodes",
        "aligned",
        "oriented",
        "rotated",
        "depth",
        "node mem",
        "leaf mem",
        "B/tri",
        "build ms"
    );
    for (name, row) in rows(level) {
        let percent = |kind| format!("{:.1}%", 100.0 * row.share(kind));
        let _ = writeln!(
            out,
            "{name:<14}{:>13.2}{:>9.2}{:>9}{:>9}{:>10}{:>9}{:>7}{:>11}{:>11}{:>9.1}{:>10.2}",
            row.aligned_cost,
            row.cost,
            row.n_nodes(),
            percent(NodeKind::Aligned),
            percent(NodeKind::Oriented),
            format!("{}/{}", row.n_rotated, level.n_bvhs),
            row.depth,
            process::human(row.node_bytes as u64),
            process::human(row.block_bytes as u64),
            row.bytes_per_triangle(),
            row.build_ms
        );
    }
    for (name, row) in rows(level) {
        let _ = writeln!(out, "{name}: {}", reason(level, row));
    }
}

/// The reason for the kinds of nodes, in a sentence.
fn reason(level: &Level, row: &Row) -> String {
    if row.n_nodes() == 0 {
        return "the root is a leaf".to_owned();
    }
    let degrees = row.max_angle_rad.to_degrees();
    let rotated = match (row.n_rotated, level.n_bvhs) {
        (0, _) => String::new(),
        (_, 1) => format!("; the mesh is rotated by {degrees:.0} degrees"),
        (1, n) => format!("; 1 of {n} meshes is rotated, by {degrees:.0} degrees"),
        (rotated, n) => format!("; {rotated} of {n} meshes are rotated, by at most {degrees:.0} degrees"),
    };
    let share = row.share(NodeKind::Oriented);
    // The builder chooses the cheaper kind of node, so the ratio is at least 1.
    let ratio = row.aligned_cost / row.cost;
    if share == 0.0 {
        return format!("aligned nodes are cheapest: no node is oriented{rotated}");
    }
    let more = if ratio < ABOUT_EQUAL {
        format!("{:.1} % more", 100.0 * (ratio - 1.0))
    } else {
        format!("{ratio:.1} times as much")
    };
    format!("aligned nodes alone would cost {more}: {} of nodes are oriented{rotated}", percent(share))
}

/// A nonzero fraction in words.
fn percent(share: f64) -> String {
    if share < 0.005 { "less than 1 %".to_owned() } else { format!("{:.0} %", 100.0 * share) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason_of(row: Row) -> String {
        reason(&Level { n_bvhs: 1, rows: vec![] }, &row)
    }

    #[test]
    fn the_reason_follows_the_numbers() {
        let row = Row { nodes: [10, 90], aligned_cost: 39.0, cost: 10.0, ..Row::default() };
        let many = "aligned nodes alone would cost 3.9 times as much: 90 % of nodes are oriented";
        assert_eq!(reason_of(row), many);
        let rotated = Row { n_rotated: 1, max_angle_rad: 0.5, nodes: [100, 0], cost: 39.0, ..row };
        let none = "aligned nodes are cheapest: no node is oriented; the mesh is rotated by 29 degrees";
        assert_eq!(reason_of(rotated), none);
        assert_eq!(reason_of(Row { nodes: [0; 2], ..row }), "the root is a leaf");
    }

    #[test]
    fn a_small_gain_is_a_percentage() {
        let row = Row { nodes: [999, 1], aligned_cost: 100.0, ..Row::default() };
        let few = "aligned nodes alone would cost 4.9 % more: less than 1 % of nodes are oriented";
        assert_eq!(reason_of(Row { cost: 100.0 / 1.049, ..row }), few);
        let above = reason_of(Row { cost: 94.0, ..row });
        assert!(above.starts_with("aligned nodes alone would cost 1.1 times as much: "), "{above}");
    }
}
