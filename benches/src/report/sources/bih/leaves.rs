//! Primitives per leaf: the BIH thesis's charts, as far as their text survives.

use anyhow::Result;

use super::super::{
    builders::scaffold,
    scenes,
    structures::{Kind, measure},
};
use super::megabytes;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::number,
};

/// The charts: scene, structure, maximum primitives per leaf, pictures per second, megabytes.
const CHARTS: [(&str, &str, &str, &str, &str); 10] = [
    ("Dino", "BIH", "1", "5.9", "–"),
    ("Dino", "BIH", "30", "11.1", "–"),
    ("Alien", "BIH", "1", "12.8", "–"),
    ("Alien", "BIH", "10", "18.9", "–"),
    ("Hornbug", "BIH", "1", "59.9", "–"),
    ("Hornbug", "BIH", "5", "69.9", "–"),
    ("Dragon", "BIH", "1", "–", "26.6"),
    ("Dragon", "BIH", "20", "–", "5.2"),
    ("Dragon", "kd-tree", "–", "–", "14"),
    ("Dragon", "kd-tree with ropes", "–", "–", "41"),
];

/// Greatest numbers of triangles per leaf that are swept.
const MOST: [u32; 6] = [1, 2, 5, 10, 20, 30];

/// Chart 1, pictures per second, and chart 2, memory, over the maximum primitives per leaf.
pub(super) fn charts(chapter: &mut Chapter, effort: Effort) -> Result<()> {
    let mut table = Table::new(
        "Primitives per leaf (the BIH thesis's charts 1 and 2)",
        &["source", "scene", "structure", "maximum per leaf", "pictures per second", "memory"],
    );
    for (scene, structure, most, rate, size) in CHARTS {
        let memory = if size == "–" { size.to_owned() } else { format!("{size} MB") };
        table.rows.push(
            ["BIH thesis", scene, structure, most, rate].into_iter().chain([&memory[..]]).map(Cell::text).collect(),
        );
    }
    let mut subjects = vec![("scaffold", scaffold(effort.pick(8, 15, 17)))];
    let names = effort.pick(&[][..], &["bunny"], &["bunny", "sponza"]);
    if !names.is_empty() {
        subjects.extend(scenes(effort, names, chapter)?);
    }
    let (mut series, mut found) = (vec![], vec![]);
    for (name, model) in subjects {
        let n = model.mesh.triangles.len();
        let scene = format!("{name}, {n} triangles");
        let bihs = [0].into_iter().chain(MOST).map(Kind::Bih);
        let kinds: Vec<Kind> = bihs.chain(MOST.map(|most| Kind::WideLeaf(most as usize))).collect();
        let took = measure(&model, &kinds, effort)?;
        let rates: Vec<f64> = took.iter().map(|took| 1e3 / took.both().median()).collect();
        let mut points = vec![];
        for (took, rate) in took.iter().zip(&rates) {
            let (structure, most) = match took.kind {
                Kind::WideLeaf(most) => ("WideBvh, fast", most.to_string()),
                Kind::Bih(0) => ("BIH", "chosen".to_owned()),
                Kind::Bih(most) => ("BIH", most.to_string()),
                _ => continue,
            };
            let samples = took.both().with(&took.both(), |ms, _| 1e3 / ms);
            let mut row = ["ours", &scene, structure, &most].map(Cell::text).to_vec();
            row.extend([Cell::measured(samples, ""), Cell::text(megabytes(took.bytes.iter().sum()))]);
            table.rows.push(row);
            if let (Kind::Bih(1..), Ok(most)) = (took.kind, most.parse::<f64>()) {
                points.push(Point { label: scene.clone(), x: most.into(), y: (*rate).into() });
            }
        }
        let best = (1..=MOST.len()).max_by(|&a, &b| rates[a].total_cmp(&rates[b])).unwrap_or(1);
        found.push(format!(
            "{scene}: {} is best, {} times the rate of 1; the automatic choice reaches {} of the best",
            MOST[best - 1],
            number(rates[best] / rates[1]),
            number(rates[0] / rates[best])
        ));
        series.push(Series { name: format!("BIH, {scene}"), points, is_joined: true });
    }
    table.says = format!(
        "The thesis: leaves of 5 to 30 give 11 to 88 % more pictures per second than leaves of 1, and a fifth of the memory. Here, {}.",
        found.join("; ")
    );
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: "Pictures per second over primitives per leaf, built anew for each".to_owned(),
        x: Axis::log("maximum primitives per leaf"),
        y: Axis::log("pictures per second"),
        series,
    });
    Ok(())
}
