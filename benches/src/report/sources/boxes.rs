//! Volumes of boxes without a top level (the dissertation's table 4, parts 1 and 2) and box tests (its figures 12 and
//! 13).

use anyhow::Result;
use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{Bits, Costs, Domain, Strategy, VolumeConfig};
use canted_trace::{Counts, InstanceId, Watertight};

use super::orders::{Found, Pairs};
use super::scenes;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::number,
};
use crate::wide::sets;

/// The dissertation: scene, strategy, sum of volumes relative to axis-aligned boxes, percentage of oriented nodes.
const THEIRS: [(&str, Strategy, f64, f64); 6] = [
    ("bunny", Strategy::PcaUnbounded, 17.7811 / 19.5222, 97.2488),
    ("bunny", Strategy::PcaBounded, 19.3396 / 19.5222, 76.0658),
    ("bunny", Strategy::Quaternion, 19.4029 / 19.5222, 71.6519),
    ("sponza", Strategy::PcaUnbounded, 5.22532 / 5.33077, 77.9693),
    ("sponza", Strategy::PcaBounded, 5.25907 / 5.33077, 54.0539),
    ("sponza", Strategy::Quaternion, 5.31018 / 5.33077, 52.8521),
];

/// The result of one strategy on a scene.
struct Row {
    strategy: Strategy,
    /// Sum of volumes relative to axis-aligned boxes.
    volume: f64,
    oriented_percent: f64,
    /// Box tests per camera ray.
    boxes: f64,
}

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Volumes without a top level (table 4, 1 and 2): sums relative to axis-aligned, oriented nodes, box tests per camera ray",
        &[
            "scene",
            "triangles",
            "strategy",
            "volume, theirs",
            "volume, ours",
            "oriented, theirs",
            "oriented, ours",
            "box tests, ours",
        ],
    );
    let (mut series, mut best, mut compared, mut never_exceeds) = (vec![], None, vec![], true);
    for (name, model) in scenes(effort, &["bunny", "sponza"], chapter)? {
        let rows = rows(&model, effort)?;
        let (mut volumes, mut oriented) = (vec![], vec![]);
        never_exceeds &= rows.iter().all(|row| row.volume <= 1.0);
        for row in &rows {
            let theirs = THEIRS.iter().find(|(scene, strategy, ..)| *scene == name && *strategy == row.strategy);
            if let Some(&(_, _, volume, percent)) = theirs {
                volumes.push([volume, row.volume]);
                oriented.push([percent, row.oriented_percent]);
            }
            let or_dash = |value: Option<String>| Cell::text(value.unwrap_or_else(|| "–".to_owned()));
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(model.mesh.triangles.len().to_string()),
                Cell::text(format!("{:?}", row.strategy)),
                or_dash(theirs.map(|(_, _, volume, _)| format!("{volume:.3}"))),
                Cell::text(format!("{:.3}", row.volume)),
                or_dash(theirs.map(|(_, _, _, percent)| format!("{percent:.1}%"))),
                Cell::text(format!("{:.1}%", row.oriented_percent)),
                Cell::text(number(row.boxes)),
            ]);
        }
        if !volumes.is_empty() {
            // Axis-aligned boxes are the unit.
            volumes.push([1.0, 1.0]);
        }
        compared.extend([volumes, oriented]);
        let point =
            |row: &Row| Point { label: format!("{:?}", row.strategy), x: row.volume.into(), y: row.boxes.into() };
        series.push(Series { name: name.to_owned(), points: rows.iter().map(point).collect(), is_joined: false });
        let fewest = rows
            .iter()
            .min_by(|a, b| a.boxes.total_cmp(&b.boxes))
            .map(|row| (name, row.strategy, row.boxes / rows[0].boxes));
        best = best.or(fewest);
    }
    chapter.plots.push(Plot {
        title: "Box tests over sum of volumes, by strategy (figures 12 and 13 as numbers)".to_owned(),
        x: Axis::linear("sum of volumes relative to axis-aligned boxes"),
        y: Axis::linear("box tests per camera ray"),
        series,
    });
    let holds = |holds: bool| if holds { "holds" } else { "does not hold" };
    let order = Pairs::of(&compared);
    table.says = format!(
        "The dissertation claims that every kind of oriented box lowers the sum of volumes, unbounded principal axes the most. Here, {} of {} pairs of \
         strategies have its order; that no strategy exceeds axis-aligned boxes {}.",
        order.n_same,
        order.n_all,
        holds(never_exceeds)
    );
    chapter.tables.push(table);
    let says = best.map_or_else(String::new, |(name, strategy, share)| {
        format!("On {name} {strategy:?} has the fewest box tests, {} times those of axis-aligned boxes.", number(share))
    });
    Ok(Found { says, compared })
}

#[expect(clippy::cast_precision_loss, reason = "counts of rays and nodes")]
fn rows(model: &crate::models::Model, effort: Effort) -> Result<Vec<Row>> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let codes = canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
    let tree = canted_lbvh::radix(canted_lbvh::sort_by_code(&codes, Bits::B63));
    let sorted = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
    let rays = sets::camera(model, effort.pick(16, 128, 128));
    let mut rows: Vec<Row> = vec![];
    let mut aligned_volume = 1.0;
    for strategy in Strategy::ALL {
        let volumes = canted_lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
        let sums = canted_lbvh::tree_cost(&tree, &volumes, &sorted, &Costs::default(), 1.0);
        let blas = Bvh2::<Watertight>::new(tree.clone(), &volumes, sorted.clone(), &bounds, PairOrder::DepthFirst);
        let mut counts = Counts::default();
        for ray in &rays {
            blas.closest_hit_with(ray, InstanceId(0), &mut counts);
        }
        if strategy == Strategy::Aabb {
            aligned_volume = sums.volume;
        }
        rows.push(Row {
            strategy,
            volume: sums.volume / aligned_volume,
            oriented_percent: 100.0 * sums.n_oriented as f64 / sums.n_nodes as f64,
            boxes: counts.boxes as f64 / rays.len() as f64,
        });
    }
    Ok(rows)
}
