//! Split rules, axis rules, spatial splits, and a radix tree below an SAH top (Novak's 2.1 and 6.1, Lauterbach's hybrid).

use anyhow::Result;
use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{
    Corners, Costs, Leaf, Strategy, Tree, VolumeConfig, Volumes,
    stages::{self, Stage},
};
use canted_obb::{Aabb, Obb};
use canted_sah::{Axes, Builder, PlocConfig, SpatialConfig, Split, TopDownConfig};
use canted_trace::{Hit, TriangleTest, pad_aabb};

use super::{Found, one_thread, scaffold, scenes};
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
    Clustered,
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
            Self::Clustered => "clustering (PLOC)".to_owned(),
            Self::Reinserted => "radix tree, reinserted".to_owned(),
            Self::SahTop => "radix trees below an SAH top".to_owned(),
            Self::Spatial => "spatial splits (sbvh)".to_owned(),
        }
    }

    /// The tree, its leaves in leaf order as triangles, the volumes of its nodes, and the boxes of its leaves where these are parts of triangles.
    fn build(self, corners: &[Corners], bounds: &Aabb) -> (Tree, Volumes, Option<Vec<Obb>>) {
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let (tree, parts) = stages::stage(STAGES[0], || self.tree(corners, &boxes, bounds));
        let config = VolumeConfig { strategy: Strategy::Aabb, fallback: true };
        let volumes = stages::stage(STAGES[1], || match &parts {
            Some(parts) => canted_lbvh::volumes(&tree, parts, &config),
            None => canted_lbvh::volumes(&tree, &canted_lbvh::in_leaf_order(corners, &tree.leaves), &config),
        });
        (tree, volumes, parts)
    }

    /// The tree, and the boxes of its leaves where these are parts of triangles.
    fn tree(self, corners: &[Corners], boxes: &[Aabb], bounds: &Aabb) -> (Tree, Option<Vec<Obb>>) {
        let builder = match self {
            Self::Object(split, axes) => Builder::TopDown(TopDownConfig { split, axes, ..TopDownConfig::BINNED }, None),
            Self::Radix => Builder::Lbvh,
            Self::Clustered => Builder::Ploc(PlocConfig::NEAR, None),
            Self::Reinserted => Builder::Reinserted(Default::default()),
            Self::SahTop => Builder::Hybrid,
            Self::Spatial => {
                let (mut tree, references) = canted_sah::spatial(corners, &SpatialConfig::default());
                let part = |leaf: &canted_obb::PrimId| {
                    let reach = boxes[references.primitives[leaf.index()].index()].reach();
                    Obb::from_aabb(&pad_aabb(&references.boxes[leaf.index()], reach))
                };
                let parts: Vec<Obb> = tree.leaves.iter().map(part).collect();
                tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
                return (tree, Some(parts));
            }
        };
        (canted_sah::build(boxes, bounds, &builder), None)
    }
}

/// The stages of a build: the topology, the boxes of its nodes, and the form that rays traverse.
const STAGES: [&str; 3] = ["tree", "boxes", "layout"];

/// The measurements of one way.
struct Took {
    way: Way,
    build: Samples,
    /// Milliseconds of each of [`STAGES`].
    stages: [Samples; 3],
    /// Milliseconds of camera rays, diffuse rays and occlusion rays, and how many there are.
    rays: [Samples; 3],
    n_rays: [usize; 3],
    sah: f64,
    /// References per triangle.
    references: f64,
    n_bytes: usize,
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
    let [camera, diffuse, _] = took.rays.each_ref().map(|ms| Cell::measured(ms.clone(), "ms"));
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

/// Milliseconds of each of [`STAGES`]; builders record stages of their own inside of the first.
fn by_stage(recorded: &[Stage]) -> [f64; 3] {
    let ms =
        |name: &str| recorded.iter().filter(|stage| stage.name == name).map(|stage| stage.seconds * 1e3).sum::<f64>();
    let others = ["the rest", STAGES[1], STAGES[2]].map(ms);
    let all: f64 = recorded.iter().map(|stage| stage.seconds * 1e3).sum();
    [all - others.iter().sum::<f64>(), others[1], others[2]]
}

/// A BVH with what is known of its tree.
struct Built {
    bvh: Bvh2,
    sah: f64,
    references: f64,
}

fn built(way: Way, (corners, bounds): (&[Corners], &Aabb), unit: f64, wants_cost: bool) -> Built {
    let (tree, volumes, parts) = way.build(corners, bounds);
    let sorted = canted_lbvh::in_leaf_order(corners, &tree.leaves);
    let costs = Costs::default();
    // A reference of a split triangle is charged for its part of the triangle.
    let sah = match parts {
        _ if !wants_cost => f64::NAN,
        Some(parts) => canted_lbvh::tree_cost(&tree, &volumes, &parts, &costs, unit).sah,
        None => canted_lbvh::tree_cost(&tree, &volumes, &sorted, &costs, unit).sah,
    };
    let references = tree.leaves.len() as f64 / corners.len() as f64;
    let layout = || Bvh2::new(tree, &volumes, sorted, bounds, PairOrder::DepthFirst, TriangleTest::Watertight);
    Built { bvh: stages::stage(STAGES[2], layout), sah, references }
}

fn measure(model: &Model, ways: &[Way], effort: Effort) -> Result<Vec<Took>> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let (rounds, unit) = (effort.pick(2, 3, 5), model.mesh.diagonal());
    let mut builds = vec![vec![]; ways.len()];
    let mut of_stages: Vec<[Vec<f64>; 3]> = vec![Default::default(); ways.len()];
    let (mut engines, mut known): (Vec<Box<dyn Engine>>, _) = (vec![], vec![]);
    for round in 0..rounds {
        for ((&way, builds), of_stages) in ways.iter().zip(&mut builds).zip(&mut of_stages) {
            let ((built, recorded), took) =
                timing::time(|| stages::recorded(|| built(way, (&corners, &bounds), unit, round == 0)));
            // The first round also computes costs.
            if round == 0 {
                known.push((built.sah, built.references, built.bvh.n_bytes()));
                engines.push(Box::new(built.bvh));
                continue;
            }
            builds.push(took.cpu * 1e3);
            for (stage, ms) in by_stage(&recorded).into_iter().zip(of_stages) {
                ms.push(stage);
            }
        }
    }
    let camera = models::camera(model, effort.pick(16, 128, 128));
    let (of_camera, hits) = engine::closest(&engines, &camera, rounds);
    same_hits(ways, &hits)?;
    let [diffuse, occlusion] = models::secondary(model, &camera, &hits[0]);
    let (of_diffuse, hits) = engine::closest(&engines, &diffuse, rounds);
    same_hits(ways, &hits)?;
    let (of_occlusion, answers) = engine::answers(&engines, &occlusion, rounds, true);
    for (way, answers_of_way) in ways.iter().zip(&answers) {
        anyhow::ensure!(*answers_of_way == answers[0], "occlusion with '{}' differs", way.name());
    }
    let ms = |seconds: &[timing::Seconds]| Samples::from(engine::cpu(seconds)).scaled(1e3);
    let took = ways.iter().zip(builds).zip(of_stages).zip(known).enumerate();
    let took = took.map(|(i, (((&way, build), of_stages), (sah, references, n_bytes)))| Took {
        way,
        build: build.into(),
        stages: of_stages.map(Samples::from),
        rays: [ms(&of_camera[i]), ms(&of_diffuse[i]), ms(&of_occlusion[i])],
        n_rays: [&camera, &diffuse, &occlusion].map(Vec::len),
        sah,
        references,
        n_bytes,
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

/// The builders of the one table, the fast ones first.
const BUILDERS: [Way; 9] = [
    Way::Radix,
    Way::SahTop,
    Way::Clustered,
    Way::Reinserted,
    Way::Object(Split::Median, Axes::Longest),
    Way::Object(Split::Midpoint, Axes::Longest),
    BINNED,
    Way::Object(Split::Sweep, Axes::All),
    Way::Spatial,
];

/// All builders on each scene: stages, rays of each type, bytes, SAH cost and hits (Novak 34).
pub(super) fn one_table(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Builders in one table (Novak's chapter 7): stages (wall time), rays by type, bytes, SAH cost, hits; million rays per second, one thread",
        &[
            "scene",
            "triangles",
            "builder",
            "tree",
            "boxes",
            "layout",
            "camera",
            "diffuse",
            "occlusion",
            "bytes per triangle",
            "SAH cost",
            "hits",
        ],
    );
    let mut subjects = vec![("scaffold", scaffold(effort.pick(8, 15, 17)))];
    let names = effort.pick(&[][..], &["sponza"], &["bunny", "sponza", "dragon_871k", "country_kitchen"]);
    if !names.is_empty() {
        subjects.extend(scenes(effort, names, chapter)?);
    }
    if effort == Effort::Full {
        subjects.push(("large scaffold", scaffold(21)));
    }
    let mut found = vec![];
    for (name, model) in &subjects {
        let n = model.mesh.triangles.len();
        let took = one_thread(|| measure(model, &BUILDERS, effort))??;
        for took in &took {
            let rates = took.rays.iter().zip(took.n_rays);
            let mut row = [*name, &n.to_string(), &took.way.name()].map(Cell::text).to_vec();
            row.extend(took.stages.iter().map(|ms| Cell::measured(ms.clone(), "ms")));
            row.extend(rates.map(|(ms, n)| Cell::text(number(n as f64 * 1e-3 / ms.median()))));
            let bytes = took.n_bytes as f64 / n as f64;
            row.extend([number(bytes), number(took.sah), "equal".to_owned()].map(Cell::text));
            table.rows.push(row);
        }
        let best = |of: &dyn Fn(&Took) -> f64| {
            took.iter().min_by(|a, b| of(a).total_cmp(&of(b))).map_or_else(String::new, |took| took.way.name())
        };
        found.push(format!(
            "{name} of {n} triangles: built first by {}, least SAH cost by {}, fastest camera rays by {}",
            best(&|took| took.build.median()),
            best(&|took| took.sah),
            best(&|took| took.rays[0].median())
        ));
    }
    table.says = format!(
        "Novak promises times by stage and gives none, counts rays of one type, and gives no SAH cost. Every builder has the same hits here. {}.",
        found.join("; ")
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_inside_of_the_tree_count_as_the_tree() {
        let stage = |name, ms: f64| Stage { name, seconds: ms * 1e-3, serial_seconds: 0.0 };
        let recorded = [
            stage("tree", 1.0),
            stage("splitting", 8.0),
            stage("boxes", 2.0),
            stage("layout", 4.0),
            stage("the rest", 32.0),
        ];
        assert_eq!(by_stage(&recorded).map(f64::round), [9.0, 2.0, 4.0]);
    }
}
