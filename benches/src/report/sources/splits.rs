//! Split rules, axis rules, spatial splits, and a radix tree below an SAH top (Novak's 2.1 and 6.1, Lauterbach's hybrid).

use anyhow::Result;
use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{Corners, Costs, Leaf, Strategy, Tree, VolumeConfig, Volumes};
use canted_obb::{Aabb, Obb};
use canted_sah::{Axes, Builder, SpatialConfig, Split, TopDownConfig};
use canted_trace::{Hit, TriangleTest, pad_aabb};

use super::{Found, one_thread, scenes};
use crate::{
    models::{self, Model},
    report::{
        model::{Axis, Cell, Chapter, Effort, Point, Series, Table},
        samples::{Samples, number, percent},
    },
    timing,
    wide::engine::{self, Engine},
};

/// A way to split.
#[derive(Clone, Copy)]
enum Way {
    Object(Split, Axes),
    Radix,
    Reinserted,
    SahTop,
    Spatial,
}

impl Way {
    fn name(self) -> String {
        match self {
            Self::Object(split, axes) => {
                let split = match split {
                    Split::Binned { .. } => "binned SAH".to_owned(),
                    other => format!("{other:?}").to_lowercase(),
                };
                format!("{split}, {} axes", format!("{axes:?}").to_lowercase())
            }
            Self::Radix => "radix tree".to_owned(),
            Self::Reinserted => "radix tree, reinserted".to_owned(),
            Self::SahTop => "radix trees below an SAH top".to_owned(),
            Self::Spatial => "spatial splits (sbvh)".to_owned(),
        }
    }

    /// The tree, its leaves in leaf order as triangles, the volumes of its nodes, and the boxes of its leaves where these are parts of triangles.
    fn build(self, corners: &[Corners], bounds: &Aabb) -> (Tree, Volumes, Option<Vec<Obb>>) {
        let config = VolumeConfig { strategy: Strategy::Aabb, fallback: true };
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let tree = match self {
            Self::Object(split, axes) => {
                let config = TopDownConfig { split, axes, ..TopDownConfig::BINNED };
                canted_sah::build(&boxes, bounds, &Builder::TopDown(config, None))
            }
            Self::Radix => canted_sah::build(&boxes, bounds, &Builder::Lbvh),
            Self::Reinserted => canted_sah::build(&boxes, bounds, &Builder::Reinserted(Default::default())),
            Self::SahTop => canted_sah::build(&boxes, bounds, &Builder::Hybrid),
            Self::Spatial => {
                let (mut tree, references) = canted_sah::spatial(corners, &SpatialConfig::default());
                let part = |leaf: &canted_obb::PrimId| {
                    let reach = boxes[references.primitives[leaf.index()].index()].reach();
                    Obb::from_aabb(&pad_aabb(&references.boxes[leaf.index()], reach))
                };
                let parts: Vec<Obb> = tree.leaves.iter().map(part).collect();
                let volumes = canted_lbvh::volumes(&tree, &parts, &config);
                tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
                return (tree, volumes, Some(parts));
            }
        };
        let volumes = canted_lbvh::volumes(&tree, &canted_lbvh::in_leaf_order(corners, &tree.leaves), &config);
        (tree, volumes, None)
    }
}

/// The measurements of one way.
struct Took {
    way: Way,
    build: Samples,
    /// Milliseconds of camera rays and of diffuse rays.
    rays: [Samples; 2],
    sah: f64,
    /// References per triangle.
    references: f64,
}

const SPLITS: [Split; 3] = [Split::Midpoint, Split::Median, Split::Sweep];
const AXES: [Axes; 3] = [Axes::Longest, Axes::Cyclic, Axes::All];
const BINNED: Way = Way::Object(Split::Binned { bins: 32, sweep_threshold: 16 }, Axes::All);

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = [
        "scene",
        "triangles",
        "splits",
        "build",
        "camera rays",
        "diffuse rays",
        "SAH cost",
        "references per triangle",
        "hits",
    ];
    let mut rules = Table::new("Split rules and axis rules (Novak's 2.1 and 6.1)", &head);
    let mut tops = Table::new("A radix tree below an SAH top (Novak's 2.1, Lauterbach's hybrid)", &head);
    let mut spatial = Table::new("Spatial splits compared with object splits (Novak's 2.1)", &head);
    let (mut of_rules, mut of_tops, mut of_spatial, mut series) = (vec![], vec![], vec![], vec![]);
    for (name, model) in
        scenes(effort, effort.pick(&[][..], &["bunny", "sponza"], &["bunny", "sponza", "scaffold"]), chapter)?
    {
        let ways: Vec<Way> = SPLITS.into_iter().flat_map(|split| AXES.map(|axes| Way::Object(split, axes))).collect();
        let all: Vec<Way> =
            ways.iter().copied().chain([Way::Radix, Way::SahTop, Way::Reinserted, BINNED, Way::Spatial]).collect();
        let took = one_thread(|| measure(&model, &all, effort))??;
        let best = |of: &[Took]| {
            of.iter().min_by(|a, b| a.rays[0].median().total_cmp(&b.rays[0].median())).map(|took| took.way.name())
        };
        of_rules.push(format!("{name}: {}", best(&took[..ways.len()]).unwrap_or_default()));
        let [radix, top, reinserted, binned, split] = [0, 1, 2, 3, 4].map(|i| &took[ways.len() + i]);
        let gain = |a: &Took, b: &Took, i: usize| b.rays[i].median() / a.rays[i].median();
        of_tops.push(format!(
            "{name}: {} times the radix tree's camera rays per second for {} times its build (reinsertion: {} and {})",
            number(gain(top, radix, 0)),
            number(top.build.median() / radix.build.median()),
            number(gain(reinserted, radix, 0)),
            number(reinserted.build.median() / radix.build.median())
        ));
        of_spatial.push(format!(
            "{name}: {} {} camera rays per second and {} {} diffuse ones",
            percent(gain(split, binned, 0)),
            if gain(split, binned, 0) < 1.0 { "fewer" } else { "more" },
            percent(gain(split, binned, 1)),
            if gain(split, binned, 1) < 1.0 { "fewer" } else { "more" },
        ));
        let n = model.mesh.triangles.len();
        took[..ways.len()].iter().for_each(|took| rules.rows.push(row(name, n, took)));
        [radix, top, reinserted, binned].iter().for_each(|took| tops.rows.push(row(name, n, took)));
        [binned, split].iter().for_each(|took| spatial.rows.push(row(name, n, took)));
        let point = |took: &Took| Point::new(took.way.name(), took.build.clone(), took.rays[0].clone());
        series.push(Series::dots(name, took.iter().map(point).collect()));
    }
    rules.says = format!(
        "Novak suspects that one axis and few candidates cost his SAH builder quality. Fastest camera rays here, {}.",
        of_rules.join("; ")
    );
    tops.says = format!("Novak describes this hybrid without measuring it. Here, {}.", of_tops.join("; "));
    spatial.says = format!(
        "Novak describes spatial splits without measuring them; `--builder sbvh` uses them. Compared with binned object splits here, {}.",
        of_spatial.join("; ")
    );
    chapter.plot("Splits: camera rays over build", Axis::log("build, ms"), Axis::log("camera rays, ms"), series);
    let says = spatial.says.clone();
    chapter.tables.extend([rules, tops, spatial]);
    Ok(says.into())
}

fn row(scene: &str, n: usize, took: &Took) -> Vec<Cell> {
    let [camera, diffuse] = took.rays.each_ref().map(|ms| Cell::measured(ms.clone(), "ms"));
    vec![
        Cell::text(scene),
        Cell::text(n.to_string()),
        Cell::text(took.way.name()),
        Cell::measured(took.build.clone(), "ms"),
        camera,
        diffuse,
        Cell::text(number(took.sah)),
        Cell::text(number(took.references)),
        Cell::text("equal"),
    ]
}

fn measure(model: &Model, ways: &[Way], effort: Effort) -> Result<Vec<Took>> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let rounds = effort.pick(2, 3, 5);
    let mut builds = vec![vec![]; ways.len()];
    let (mut engines, mut sums): (Vec<Box<dyn Engine>>, _) = (vec![], vec![]);
    for round in 0..rounds {
        for (way, builds) in ways.iter().zip(&mut builds) {
            let ((bvh, sum), took) = timing::time(|| {
                let (tree, volumes, parts) = way.build(&corners, &bounds);
                let sorted = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
                let (costs, unit) = (Costs::default(), model.mesh.diagonal());
                // A reference of a split triangle is charged for its part of the triangle.
                let cost = (round == 0).then(|| match parts {
                    Some(parts) => canted_lbvh::tree_cost(&tree, &volumes, &parts, &costs, unit).sah,
                    None => canted_lbvh::tree_cost(&tree, &volumes, &sorted, &costs, unit).sah,
                });
                let n_references = tree.leaves.len();
                let bvh = Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst, TriangleTest::Watertight);
                (bvh, cost.map(|cost| (cost, n_references as f64 / corners.len() as f64)))
            });
            // The first round also computes costs.
            if let Some(sum) = sum {
                sums.push(sum);
                engines.push(Box::new(bvh));
            } else {
                builds.push(took.cpu * 1e3);
            }
        }
    }
    let camera = models::camera(model, effort.pick(16, 128, 128));
    let (of_camera, hits) = engine::closest(&engines, &camera, rounds);
    same_hits(ways, &hits)?;
    let [diffuse, _] = models::secondary(model, &camera, &hits[0]);
    let (of_diffuse, hits) = engine::closest(&engines, &diffuse, rounds);
    same_hits(ways, &hits)?;
    let ms = |seconds: &[timing::Seconds]| Samples::from(seconds.iter().map(|s| s.cpu * 1e3).collect::<Vec<_>>());
    let took = ways.iter().zip(builds).zip(sums).enumerate().map(|(i, ((&way, build), (sah, references)))| Took {
        way,
        build: build.into(),
        rays: [ms(&of_camera[i]), ms(&of_diffuse[i])],
        sah,
        references,
    });
    Ok(took.collect())
}

/// Hits do not depend on how a BVH is split.
fn same_hits(ways: &[Way], hits: &[Vec<Option<Hit>>]) -> Result<()> {
    for (way, of_way) in ways.iter().zip(hits) {
        let n = of_way.iter().zip(&hits[0]).filter(|(a, b)| a != b).count();
        anyhow::ensure!(n == 0, "{n} hits with '{}' differ from those with '{}'", way.name(), ways[0].name());
    }
    Ok(())
}
