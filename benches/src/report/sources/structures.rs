//! Structures of two theses. The BIH thesis: structures rebuilt for each picture (its table 1) and primitives per leaf (its charts 1
//! and 2). Novak's thesis: a fast builder compared with an SAH builder (his tables), and bytes.

use anyhow::{Result, ensure};
use canted_bih::{Bih, BihConfig, BoxBih, LeafSize};
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::Mesh;
use canted_kdtree::{KdTraversal, KdTree};
use canted_lbvh::Leaf;
use canted_obb::Aabb;
use canted_sah::{Builder, Split, TopDownConfig};
use canted_wide::{Config, Costs, Preset, TriangleBvh};

use super::{Found, one_thread, scaffold, scenes};
use crate::{
    models::{self, Model},
    report::{
        model::{Axis, Cell, Chapter, Effort, Point, Series, Table},
        samples::{Samples, faster, first, number},
    },
    timing,
    wide::engine::{self, Engine},
};

/// Table 1: scene, triangles, and build and trace milliseconds of a BIH with leaves of up to 1, 5 and 10, and of a
/// kd-tree with ropes.
const THEIRS: [(&str, usize, [[f64; 2]; 4]); 3] = [
    ("Hornbug", 1_800, [[1.7, 15.0], [0.8, 13.5], [0.6, 13.5], [12.3, 7.2]]),
    ("Alien", 32_000, [[30.5, 47.5], [14.5, 41.5], [11.7, 41.3], [180.0, 36.0]]),
    ("Dino", 107_000, [[120.0, 47.0], [67.0, 42.0], [54.0, 44.0], [672.0, 22.3]]),
];

const STRUCTURES: [&str; 4] = ["BIH, leaves of 1", "BIH, leaves of 5", "BIH, leaves of 10", "kd-tree with ropes"];

/// Our structures of table 1; the first four are theirs.
const OURS: [Kind; 10] = [
    Kind::Bih(1),
    Kind::Bih(5),
    Kind::Bih(10),
    Kind::KdTree(KdTraversal::Ropes),
    Kind::Bih(0),
    Kind::KdTree(KdTraversal::Stack),
    Kind::Binary(Builder::Lbvh),
    SWEPT,
    Kind::Wide(Preset::Dynamic),
    Kind::Wide(Preset::Balanced),
];

pub(super) fn rebuilt(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let found = table_1(chapter, effort)?;
    charts(chapter, effort)?;
    Ok(found)
}

fn table_1(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = ["source", "scene", "triangles", "structure", "build", "picture", "both", "pictures per second"];
    let bytes = ["nodes", "references", "triangles, bytes"];
    let mut table = Table::new(
        "Structures rebuilt for each picture (the BIH thesis's table 1)",
        &head.into_iter().chain(bytes).collect::<Vec<_>>(),
    );
    let mut row =
        |[source, scene, n, structure]: [&str; 4], [build, picture]: [Samples; 2], bytes: Option<[usize; 3]>| {
            let both = build.with(&picture, |a, b| a + b);
            let mut cells = [source, scene, n, structure].map(Cell::text).to_vec();
            let rate = number(1e3 / both.median());
            cells.extend([build, picture, both].map(|samples| Cell::measured(samples, "ms")));
            cells.push(Cell::text(rate));
            cells.extend((0..3).map(|i| Cell::text(bytes.map_or_else(|| "–".to_owned(), |bytes| megabytes(bytes[i])))));
            table.rows.push(cells);
        };
    let ours = OURS.iter().map(|kind| kind.name());
    let mut series: Vec<Series> =
        std::iter::once("BIH thesis".to_owned()).chain(ours).map(|name| Series::dots(name, vec![])).collect();
    for (scene, n, structures) in THEIRS {
        for (structure, [build, picture]) in STRUCTURES.into_iter().zip(structures) {
            row(["BIH thesis", scene, &n.to_string(), structure], [build.into(), picture.into()], None);
            let label = format!("{scene}, {structure}");
            series[0].points.push(Point::new(label, build, picture));
        }
    }
    let (mut found, mut first_of, mut gains) = (Found::default(), vec![], vec![]);
    for (name, model, theirs) in subjects_of(chapter, effort)? {
        let n = model.mesh.triangles.len();
        let took = measure(&model, &OURS, effort)?;
        if let Some(theirs) = theirs {
            let pairs = |of: fn(&Took) -> f64, their: fn([f64; 2]) -> f64| {
                theirs.into_iter().zip(&took).map(|(theirs, took)| [their(theirs), of(took)]).collect::<Vec<_>>()
            };
            found.compared.extend([
                pairs(|took| took.build.median(), |[build, _]| build),
                pairs(|took| took.picture.median(), |[_, picture]| picture),
                pairs(|took| took.both().median(), |[build, picture]| build + picture),
            ]);
        }
        let [one, ropes] = [&took[0], &took[3]];
        gains.push(format!(
            "{} of {n} triangles {} and {} times",
            name,
            number(ropes.build.median() / one.build.median()),
            number(one.picture.median() / ropes.picture.median())
        ));
        let names: Vec<String> = took.iter().map(|took| took.kind.name()).collect();
        let both: Vec<(&str, Samples)> = names.iter().map(|name| &name[..]).zip(took.iter().map(Took::both)).collect();
        first_of.push(format!("{name} of {n} triangles with {} ({} among theirs)", first(&both), first(&both[..4])));
        for ((took, structure), series) in took.into_iter().zip(&names).zip(&mut series[1..]) {
            let label = format!("{name}, {n} triangles");
            series.points.push(Point::new(label, took.build.clone(), took.picture.clone()));
            row(["ours", name, &n.to_string(), structure], [took.build, took.picture], Some(took.bytes));
        }
    }
    found.says = format!("Rebuilt for each picture, fastest are {}; in the thesis the BIH.", first_of.join("; "));
    table.says = format!(
        "The thesis: a BIH with leaves of 1 builds 5.6 to 7.2 times as fast as a kd-tree with ropes and traces at most 2.1 times as slowly. Here, built so \
         much faster and traced so much slower: {}.",
        gains.join(", ")
    );
    chapter.tables.push(table);
    chapter.plot(
        "Structures rebuilt for each picture: picture over build",
        Axis::log("build, ms"),
        Axis::log("picture, ms"),
        series,
    );
    Ok(found)
}

fn megabytes(bytes: usize) -> String {
    let bytes = bytes as f64;
    format!("{} MB", number(bytes * 1e-6))
}

/// A scene, its model, and the thesis's times of a scene with as many triangles.
type Subject = (&'static str, Model, Option<[[f64; 2]; 4]>);

/// Scaffolds of their sizes, and their models that are available.
fn subjects_of(chapter: &mut Chapter, effort: Effort) -> Result<Vec<Subject>> {
    let sizes = effort.pick(&[8][..], &[11, 15, 17], &[11, 15, 17]);
    let mut all: Vec<Subject> =
        sizes.iter().zip(THEIRS).map(|(&log2, (.., theirs))| ("scaffold", scaffold(log2), Some(theirs))).collect();
    let names = effort.pick(&[][..], &["bunny"], &["bunny", "dragon_871k"]);
    if !names.is_empty() {
        all.extend(scenes(effort, names, chapter)?.into_iter().map(|(name, model)| (name, model, None)));
    }
    Ok(all)
}

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
                points.push(Point::new(scene.clone(), most, *rate));
            }
        }
        let best = (1..=MOST.len()).max_by(|&a, &b| rates[a].total_cmp(&rates[b])).unwrap_or(1);
        found.push(format!(
            "{scene}: {} is best, {} times the rate of 1; the automatic choice reaches {} of the best",
            MOST[best - 1],
            number(rates[best] / rates[1]),
            number(rates[0] / rates[best])
        ));
        series.push(Series::line(format!("BIH, {scene}"), points));
    }
    table.says = format!(
        "The thesis: leaves of 5 to 30 give 11 to 88 % more pictures per second than leaves of 1, and a fifth of the memory. Here, {}.",
        found.join("; ")
    );
    chapter.tables.push(table);
    chapter.plot(
        "Pictures per second over primitives per leaf, built anew for each",
        Axis::log("maximum primitives per leaf"),
        Axis::log("pictures per second"),
        series,
    );
    Ok(())
}

/// A structure and how it is built.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// With at most this many triangles per leaf; 0 chooses.
    Bih(u32),
    KdTree(KdTraversal),
    Binary(Builder),
    Wide(Preset),
    /// The preset `fast` with at most this many triangles per leaf.
    WideLeaf(usize),
}

pub(super) const SWEPT: Kind =
    Kind::Binary(Builder::TopDown(TopDownConfig { split: Split::Sweep, ..TopDownConfig::BINNED }, None));

impl Kind {
    pub(super) fn name(self) -> String {
        match self {
            Self::Bih(0) => "BIH, leaves chosen".to_owned(),
            Self::Bih(n) => format!("BIH, leaves of {n}"),
            Self::KdTree(KdTraversal::Stack) => "kd-tree with a stack".to_owned(),
            Self::KdTree(KdTraversal::Ropes) => "kd-tree with ropes".to_owned(),
            Self::Binary(Builder::Lbvh) => "Bvh2, radix tree".to_owned(),
            Self::Binary(_) => "Bvh2, full SAH sweep".to_owned(),
            Self::Wide(preset) => format!("WideBvh, {preset:?}").to_lowercase().replace("widebvh", "WideBvh"),
            Self::WideLeaf(n) => format!("WideBvh, fast, leaves of {n}"),
        }
    }

    /// The structure, and bytes of its nodes, references and triangles.
    fn build(self, mesh: &Mesh) -> Result<(Box<dyn Engine>, [usize; 3])> {
        let (positions, triangles) = (&mesh.positions[..], &mesh.triangles[..]);
        // The numbers of the triangles are in their blocks.
        let wide = |config: Config| -> Result<(Box<dyn Engine>, [usize; 3])> {
            let of = TriangleBvh::build_with(positions, triangles, config)?;
            let (nodes, references) = (of.sizes().node_bytes, 4 * of.n_primitives());
            let bytes = [nodes, references, of.sizes().leaf_bytes - references];
            Ok((Box::new(of), bytes))
        };
        Ok(match self {
            Self::Bih(n) => {
                let leaf_size = if n == 0 { LeafSize::Auto } else { LeafSize::AtMost(n) };
                let config = BihConfig { leaf_size, ..BihConfig::default() };
                let of = Bih::build(positions, triangles, &config)?;
                let memory = of.memory();
                (Box::new(of), [memory.nodes, memory.references, memory.triangles])
            }
            Self::KdTree(traversal) => {
                let config = canted_kdtree::KdTreeConfig { traversal, ..canted_kdtree::KdTreeConfig::default() };
                let of = KdTree::build(positions, triangles, &config)?;
                let memory = of.memory();
                (Box::new(of), [memory.nodes + memory.ropes, memory.references, memory.triangles])
            }
            Self::Binary(builder) => {
                let (corners, bounds) = canted_lbvh::triangle_corners(positions, triangles)?;
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                let tree = canted_sah::build(&boxes, &bounds, &builder);
                let of = Bvh2::over(tree, &corners, &bounds, &Bvh2Config::default());
                let (nodes, references) = (of.pairs().n_bytes(), 4 * of.n_triangles());
                let bytes = [nodes, references, of.n_bytes() - nodes - references];
                (Box::new(of), bytes)
            }
            Self::Wide(preset) => wide(Config::preset(preset))?,
            Self::WideLeaf(max_leaf) => {
                let usual = Config::preset(Preset::Fast);
                wide(Config { costs: Costs { max_leaf, ..usual.costs }, ..usual })?
            }
        })
    }
}

/// The measurements of one structure.
pub(super) struct Took {
    pub(super) kind: Kind,
    /// Milliseconds.
    pub(super) build: Samples,
    /// Milliseconds of all camera rays.
    pub(super) picture: Samples,
    /// Nodes, references, triangles.
    pub(super) bytes: [usize; 3],
}

impl Took {
    pub(super) fn both(&self) -> Samples {
        self.build.with(&self.picture, |build, picture| build + picture)
    }
}

/// Builds and traces every structure on one thread, in turn. All must have the same hits.
pub(super) fn measure(model: &Model, kinds: &[Kind], effort: Effort) -> Result<Vec<Took>> {
    one_thread(|| measure_here(model, kinds, effort))?
}

fn measure_here(model: &Model, kinds: &[Kind], effort: Effort) -> Result<Vec<Took>> {
    // Four views together have the pixels of one picture of twice the width and height.
    let rays = models::camera(model, effort.pick(16, 128, 128));
    let rounds = effort.pick(2, 3, 5);
    let mut built = vec![];
    let mut builds = vec![vec![]; kinds.len()];
    for round in 0..=rounds {
        for (kind, builds) in kinds.iter().zip(&mut builds) {
            let (structure, took) = timing::time(|| kind.build(&model.mesh));
            let structure = structure?;
            if round > 0 {
                builds.push(took.cpu * 1e3);
            } else {
                built.push(structure);
            }
        }
    }
    let (engines, bytes): (Vec<Box<dyn Engine>>, Vec<[usize; 3]>) = built.into_iter().unzip();
    let (seconds, hits) = engine::closest(&engines, &rays, rounds);
    for (kind, hits_of_kind) in kinds.iter().zip(&hits) {
        let n = hits_of_kind.iter().zip(&hits[0]).filter(|(a, b)| a != b).count();
        ensure!(n == 0, "{n} hits of '{}' differ from those of '{}'", kind.name(), kinds[0].name());
    }
    let took = kinds.iter().zip(builds).zip(seconds).zip(bytes).map(|(((&kind, build), seconds), bytes)| Took {
        kind,
        build: build.into(),
        picture: Samples::from(engine::cpu(&seconds)).scaled(1e3),
        bytes,
    });
    Ok(took.collect())
}

/// A BIH from boxes alone, from triangles, and trees whose build clips triangles (the BIH thesis's 3.1.3).
pub(super) fn from_boxes(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "A BIH from boxes alone, and builds from primitives (the BIH thesis's 3.1.3)",
        &["scene", "triangles", "built from", "build", "over boxes alone", "camera rays", "over the BIH"],
    );
    let mut subjects = vec![("scaffold", scaffold(effort.pick(8, 15, 17)))];
    let names = effort.pick(&[][..], &["bunny"], &["bunny", "sponza"]);
    if !names.is_empty() {
        subjects.extend(scenes(effort, names, chapter)?);
    }
    let kinds = [Kind::Bih(1), Kind::KdTree(KdTraversal::Ropes)];
    let mut found = vec![];
    for (name, model) in &subjects {
        let took = measure(model, &kinds, effort)?;
        let (corners, _) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let config = BihConfig { leaf_size: LeafSize::AtMost(1), ..BihConfig::default() };
        let mut ms = vec![];
        for round in 0..=took[0].build.values().len() {
            let (built, seconds) = one_thread(|| timing::time(|| BoxBih::build(&boxes, &config)))?;
            built?;
            if round > 0 {
                ms.push(seconds.cpu * 1e3);
            }
        }
        let alone = Samples::from(ms);
        let n = boxes.len().to_string();
        let over = |of: &Samples, other: &Samples| number(of.median() / other.median());
        let rows = [
            ("boxes alone", &alone, None),
            ("triangles: their boxes, and triangles in the order of leaves", &took[0].build, Some(&took[0].picture)),
            ("triangles clipped to cells: kd-tree with ropes", &took[1].build, Some(&took[1].picture)),
        ];
        for (from, build, rays) in rows {
            let mut row = [*name, &n, from].map(Cell::text).to_vec();
            row.extend([Cell::measured(build.clone(), "ms"), Cell::text(over(build, &alone))]);
            match rays {
                Some(ms) => {
                    row.extend([Cell::measured(ms.clone(), "ms"), Cell::text(over(ms, &took[0].picture))]);
                }
                None => row.extend(["–"; 2].map(Cell::text)),
            }
            table.rows.push(row);
        }
        found.push(format!(
            "{name} of {n} triangles {} times as fast as from their triangles and {} times as fast as a kd-tree that clips them, whose rays take {} times as long",
            over(&took[0].build, &alone),
            over(&took[1].build, &alone),
            over(&took[1].picture, &took[0].picture)
        ));
    }
    table.says = format!(
        "The thesis quotes that a build that reads boxes alone is two to three times as fast as one that reads primitives, with almost no loss for rays. Planes of a \
         BIH are ends of boxes in either build, so both have the same nodes. Here, boxes alone: {}.",
        found.join("; ")
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

/// Novak's scenes: triangles if known, megabytes of the tree built on the CPU and of the one built on the GPU.
const NOVAK_SCENES: [(&str, Option<usize>, [f64; 2]); 6] = [
    ("scene 1", None, [59.0, 66.0]),
    ("scene 2", None, [94.0, 125.0]),
    ("scene 3", None, [106.0, 162.0]),
    ("scene 4", Some(1_099_995), [213.0, 302.0]),
    ("scene 5", Some(1_468_284), [251.0, 347.0]),
    ("scene 6", Some(2_880_000), [372.0, 446.0]),
];

/// By scene and machine: build and frame milliseconds of the GPU's radix tree, then of the CPU's SAH tree.
const NOVAK_MS: [[[f64; 4]; 3]; 6] = [
    [[153.02, 34.82, 218.87, 62.52], [18.04, 4.89, 167.81, 7.49], [19.21, 5.73, 167.85, 9.11]],
    [[186.15, 117.22, 582.61, 231.91], [35.13, 17.35, 477.59, 21.91], [37.77, 21.26, 476.81, 25.18]],
    [[197.33, 117.28, 1271.21, 155.82], [77.11, 7.74, 1033.91, 14.38], [81.56, 10.94, 1033.98, 17.63]],
    [[466.33, 62.13, 2745.89, 95.72], [222.04, 5.82, 2241.39, 8.63], [231.86, 8.21, 2241.89, 11.58]],
    [[539.11, 134.82, 3774.12, 272.22], [181.62, 32.31, 3063.49, 44.55], [192.71, 36.19, 3063.46, 49.74]],
    [[792.15, 891.92, 9359.67, 896.72], [371.08, 368.45, 7263.72, 319.68], [384.16, 386.65, 7264.15, 347.55]],
];

const MACHINES: [&str; 3] = ["GTX 950", "RTX 2080 Ti", "RX Vega 64"];

pub(super) fn builders(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = [
        "source",
        "scene",
        "triangles",
        "fast: build",
        "picture",
        "SAH: build",
        "picture",
        "build gain",
        "picture gain",
        "pictures until SAH is ahead",
    ];
    let mut times = Table::new("A fast builder compared with an SAH builder (Novak's tables)", &head);
    let mut memory = Table::new(
        "Bytes of BVHs (Novak's memory)",
        &["source", "scene", "triangles", "fast", "SAH", "fast, per triangle", "SAH, per triangle"],
    );
    let mut series: Vec<Series> = MACHINES
        .iter()
        .map(|machine| format!("Novak, {machine}"))
        .chain(["ours".to_owned()])
        .map(|name| Series::dots(name, vec![]))
        .collect();
    let point = |scene: &str, (build, picture): (f64, f64)| Point::new(scene, build, picture);
    for ((scene, n_triangles, megabytes), machines) in NOVAK_SCENES.into_iter().zip(NOVAK_MS) {
        let n = n_triangles.map_or_else(|| "lost".to_owned(), |n| n.to_string());
        for ((machine, ms), series) in MACHINES.iter().zip(machines).zip(&mut series) {
            let gains = novak_row(&mut times, [&format!("Novak, {machine}"), scene, &n], ms.map(Samples::from));
            series.points.push(point(scene, gains));
        }
        // The first column belongs to the CPU.
        memory.rows.push(novak_bytes(["Novak", scene, &n], n_triangles, [megabytes[1] * 1e6, megabytes[0] * 1e6]));
    }
    let (mut says, mut gains_of) = (String::new(), vec![]);
    for &log2 in effort.pick(&[8][..], &[15, 17], &[15, 17, 20, 21]) {
        let model = scaffold(log2);
        let n_triangles = model.mesh.triangles.len();
        let n = n_triangles.to_string();
        let took = measure(&model, &[Kind::Binary(Builder::Lbvh), SWEPT], effort)?;
        let [fast, sah] = [&took[0], &took[1]];
        says = format!(
            "On a scaffold of {n} triangles {}; {}.",
            faster(("the radix tree's build", &fast.build), ("the SAH build", &sah.build)),
            faster(("the SAH tree's picture", &sah.picture), ("the radix tree's", &fast.picture)),
        );
        let ms = [&fast.build, &fast.picture, &sah.build, &sah.picture].map(Samples::clone);
        let gains = novak_row(&mut times, ["ours", "scaffold", &n], ms);
        series[MACHINES.len()].points.push(point("scaffold", gains));
        gains_of.push(format!("{} with {n} triangles", number(gains.1)));
        let sizes = [0, 1].map(|i| took[i].bytes.iter().sum::<usize>() as f64);
        memory.rows.push(novak_bytes(["ours", "scaffold", &n], Some(n_triangles), sizes));
    }
    chapter.plot(
        "SAH compared with a fast builder: picture gain over build cost",
        Axis::log("SAH build over fast build"),
        Axis::log("fast picture over SAH picture"),
        series,
    );
    times.says = format!(
        "On Novak's machines, pictures through the fast tree are faster than through the SAH tree in all but two of 18 cases, so the SAH builder never pays. That \
         does not hold here: picture gains of the SAH tree are {}.",
        gains_of.join(", ")
    );
    "Novak's fast tree takes more memory than his SAH tree, whose leaves hold several triangles; here both have a triangle per leaf and the same size."
        .clone_into(&mut memory.says);
    chapter.tables.extend([times, memory]);
    Ok(says.into())
}

/// Adds a row; returns build gain and picture gain.
fn novak_row(table: &mut Table, [source, scene, n]: [&str; 3], ms: [Samples; 4]) -> (f64, f64) {
    let [build, picture, sah_build, sah_picture] = ms.each_ref().map(Samples::median);
    let gain = picture - sah_picture;
    let is_noise = ms[1].differs_by_noise(&ms[3]);
    let crossing = match (is_noise, gain > 0.0) {
        (true, _) => "noise".to_owned(),
        (false, true) => number(((sah_build - build) / gain).ceil()),
        (false, false) => "never".to_owned(),
    };
    let [a, b, c, d] = ms.map(|samples| Cell::measured(samples, "ms"));
    let [source, scene, n] = [source, scene, n].map(Cell::text);
    let gains = (sah_build / build, picture / sah_picture);
    let [build_gain, picture_gain] = [gains.0, gains.1].map(|gain| Cell::text(number(gain)));
    table.rows.push(vec![source, scene, n, a, b, c, d, build_gain, picture_gain, Cell::text(crossing)]);
    gains
}

fn novak_bytes([source, scene, n]: [&str; 3], n_triangles: Option<usize>, sizes: [f64; 2]) -> Vec<Cell> {
    let mut cells = [source, scene, n].map(Cell::text).to_vec();
    cells.extend(sizes.map(|size| Cell::text(format!("{} MB", number(size * 1e-6)))));
    let each = |size: f64| n_triangles.map_or_else(|| "–".to_owned(), |n| format!("{} B", number(size / n as f64)));
    cells.extend(sizes.map(|size| Cell::text(each(size))));
    cells
}
