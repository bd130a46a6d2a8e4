//! The tables of wide trees, as text and as JSON.

use std::fmt::Write;

use canted_wide::{NodeKind, SimdPath};
use serde_json::{Value, json};

use super::wide::{Level, Measured, Row};
use crate::memory;

/// Below this ratio of predicted costs words speak of per cents, not of times.
const ABOUT_EQUAL: f64 = 1.05;

/// All numbers as JSON.
pub(super) fn json(measured: &Measured) -> Value {
    json!({
        "simd": SimdPath::detect().name(),
        "one_level": level_json(&measured.one),
        "two_level": level_json(&measured.bottom),
    })
}

fn level_json(level: &Level) -> Value {
    let presets: Vec<Value> = rows(level)
        .map(|(name, row)| {
            json!({
                "preset": name,
                "predicted_boxes_only": row.boxes_only,
                "predicted_as_built": row.as_built,
                "nodes": row.n_nodes(),
                "box_share": row.share(NodeKind::Aligned),
                "lean_share": row.share(NodeKind::Oriented),
                "turned": row.turned,
                "greatest_angle_degrees": row.angle_rad.to_degrees(),
                "depth": row.depth,
                "node_bytes": row.node_bytes,
                "block_bytes": row.block_bytes,
                "bytes_per_triangle": row.bytes_per_triangle(),
                "build_ms": row.build_ms,
                "because": because(level, row),
            })
        })
        .collect();
    json!({ "trees": level.trees, "presets": presets })
}

fn rows(level: &Level) -> impl Iterator<Item = (&'static str, &Row)> {
    level.rows.iter().map(|(preset, row)| (preset.name(), row))
}

/// A table a level, and the reason of each preset's choice.
pub(super) fn text(out: &mut String, measured: &Measured) {
    level_text(out, "one level", &measured.one);
    level_text(out, "two levels, bottom", &measured.bottom);
}

fn level_text(out: &mut String, title: &str, level: &Level) {
    // Writing to a String cannot fail.
    let _ =
        writeln!(out, "\nWide trees, {title} (costs: box nodes that a ray visits which enters the root, predicted)");
    let _ = writeln!(
        out,
        "{:<14}{:>10}{:>10}{:>9}{:>9}{:>9}{:>8}{:>7}{:>11}{:>11}{:>9}{:>10}",
        "", "boxes only", "as built", "nodes", "box", "lean", "turned", "depth", "of nodes", "of blocks", "B/tri", "ms"
    );
    for (name, row) in rows(level) {
        let percent = |kind| format!("{:.1}%", 100.0 * row.share(kind));
        let _ = writeln!(
            out,
            "{name:<14}{:>10.2}{:>10.2}{:>9}{:>9}{:>9}{:>8}{:>7}{:>11}{:>11}{:>9.1}{:>10.2}",
            row.boxes_only,
            row.as_built,
            row.n_nodes(),
            percent(NodeKind::Aligned),
            percent(NodeKind::Oriented),
            format!("{}/{}", row.turned, level.trees),
            row.depth,
            memory::human(row.node_bytes as u64),
            memory::human(row.block_bytes as u64),
            row.bytes_per_triangle(),
            row.build_ms
        );
    }
    for (name, row) in rows(level) {
        let _ = writeln!(out, "{name}: {}", because(level, row));
    }
}

/// Why the nodes are what they are, in a sentence.
fn because(level: &Level, row: &Row) -> String {
    if row.n_nodes() == 0 {
        return "no node: the root is a leaf".to_owned();
    }
    let turned = match row.turned {
        0 => String::new(),
        n => {
            let of = if level.trees == 1 { "the mesh is".to_owned() } else { format!("{n} of {} are", level.trees) };
            format!("; {of} turned, by {:.0} degrees at most", row.angle_rad.to_degrees())
        }
    };
    let share = row.leaning_share();
    let how_many = if share > 0.0 { format!("{} of nodes lean", percent(share)) } else { "no node leans".to_owned() };
    // Costs never rise: the collapse takes the cheapest kind.
    let times = row.boxes_only / row.as_built;
    if share == 0.0 {
        format!("box nodes predicted as cheap as any: {how_many}{turned}")
    } else if times < ABOUT_EQUAL {
        format!("box nodes predicted only {:.1} % dearer: {how_many}{turned}", 100.0 * (times - 1.0))
    } else {
        format!("leaning boxes predicted {times:.1} times cheaper: {how_many}{turned}")
    }
}

/// A share above 0 in words: one that rounding would hide is said to be small.
fn percent(share: f64) -> String {
    if share < 0.005 { "less than 1 %".to_owned() } else { format!("{:.0} %", 100.0 * share) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(row: Row) -> String {
        because(&Level { trees: 1, rows: vec![] }, &row)
    }

    #[test]
    fn reasons_follow_the_numbers() {
        let row = Row { nodes: [3, 97], boxes_only: 39.0, as_built: 10.0, ..Row::default() };
        assert_eq!(said(row), "leaning boxes predicted 3.9 times cheaper: 97 % of nodes lean");
        let turned = Row { turned: 1, angle_rad: 0.5, nodes: [100, 0], as_built: 39.0, ..row };
        let said_of_turned =
            "box nodes predicted as cheap as any: no node leans; the mesh is turned, by 29 degrees at most";
        assert_eq!(said(turned), said_of_turned);
        assert_eq!(said(Row { nodes: [0; 2], ..row }), "no node: the root is a leaf");
    }

    #[test]
    fn reasons_at_both_sides_of_about_equal() {
        let row = Row { nodes: [999, 1], boxes_only: 100.0, ..Row::default() };
        let few = "box nodes predicted only 4.9 % dearer: less than 1 % of nodes lean";
        assert_eq!(said(Row { as_built: 100.0 / 1.049, ..row }), few);
        assert_eq!(
            said(Row { as_built: 94.0, ..row }).split(':').next(),
            Some("leaning boxes predicted 1.1 times cheaper")
        );
    }
}
