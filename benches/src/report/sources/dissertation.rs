//! The dissertation: its scenes (table 3), volumes of boxes without a top level (table 4, parts 1 and 2) and with one (3a and
//! 3b), tests of camera rays in one level and in two (figures 12 and 13), and milliseconds of each pass of a build, on the CPU and on a
//! device (table 5 and figure 11).

use std::collections::HashMap;

use anyhow::{Result, ensure};
use canted_bvh2::{Bvh2, Bvh2Boxes, Bvh2Config, PairOrder};
use canted_fixtures::Mesh;
use canted_gpu::{
    AdapterKind, Choice, Gpu, Options, Source, TracedScene, block_on,
    build::{self, Passes, Primitives},
};
use canted_lbvh::{Bits, Costs, Domain, Strategy, Tree, TreeCost, VolumeConfig};
use canted_obb::{Aabb, Affine, Obb};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Counts, Intersect, Ray, TriangleTest};
use canted_wide::{Config, Preset, TriangleBvh};

use super::{Found, Pairs, one_thread, scenes};
use crate::{
    models::{self, Model},
    report::{
        model::{Axis, Cell, Chapter, Effort, Plot, Point, Series, Table},
        samples::{Samples, number},
    },
    timing,
    wide::engine::{self, Engine},
};

/// The dissertation's scenes: name, meshes, vertices, triangles, and our model of it.
const THEIR_SCENES: [(&str, usize, usize, usize, Option<&str>); 7] = [
    ("Breakfast room", 240, 961_508, 1_347_596, None),
    ("Buddha", 1, 549_409, 1_087_474, None),
    ("Dragon", 1, 438_976, 871_306, Some("dragon_871k")),
    ("Sponza", 393, 209_610, 262_267, Some("sponza")),
    ("Pirate ship", 29, 364_973, 155_689, None),
    ("Bunny", 1, 147_040, 144_046, Some("bunny")),
    ("Sibenik", 1_087, 155_179, 75_284, None),
];

/// Adds the table, without a finding.
pub(super) fn scenes_table(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = ["scene", "meshes, theirs", "vertices, theirs", "triangles, theirs", "meshes", "vertices", "triangles"];
    let mut table = Table::new("Scenes (table 3): theirs, and our models of them", &head);
    for (scene, n_meshes, n_vertices, n_triangles, ours) in THEIR_SCENES {
        let ours = ours.filter(|_| effort != Effort::Tiny).map(models::scene).transpose()?.flatten();
        let mut row = vec![Cell::text(scene)];
        row.extend([n_meshes, n_vertices, n_triangles].map(|n| Cell::text(n.to_string())));
        match ours {
            Some(scene) => {
                let sum = |of: fn(&canted_scene::Mesh) -> usize| scene.meshes.iter().map(of).sum::<usize>();
                let counts = [scene.meshes.len(), sum(|m| m.positions.len()), sum(|m| m.triangles.len())];
                row.extend(counts.map(|n| Cell::text(n.to_string())));
            }
            None => row.extend(["–"; 3].map(Cell::text)),
        }
        table.rows.push(row);
    }
    "Three of the seven models are available here; the Bunny of the dissertation has twice the triangles of the published one."
        .clone_into(&mut table.says);
    chapter.tables.push(table);
    Ok(Found::default())
}

/// The dissertation: scene, strategy, sum of volumes relative to axis-aligned boxes, percentage of oriented nodes.
const THEIR_VOLUMES: [(&str, Strategy, f64, f64); 6] = [
    ("bunny", Strategy::PcaUnbounded, 17.7811 / 19.5222, 97.2488),
    ("bunny", Strategy::PcaBounded, 19.3396 / 19.5222, 76.0658),
    ("bunny", Strategy::Quaternion, 19.4029 / 19.5222, 71.6519),
    ("sponza", Strategy::PcaUnbounded, 5.22532 / 5.33077, 77.9693),
    ("sponza", Strategy::PcaBounded, 5.25907 / 5.33077, 54.0539),
    ("sponza", Strategy::Quaternion, 5.31018 / 5.33077, 52.8521),
];

/// The result of one strategy on a scene.
struct VolumeRow {
    strategy: Strategy,
    /// Sum of volumes relative to axis-aligned boxes.
    volume: f64,
    oriented_percent: f64,
    /// Box tests per camera ray.
    boxes: f64,
}

pub(super) fn volumes(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
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
        let volume_rows = volume_rows(&model, effort)?;
        let (mut volumes, mut oriented) = (vec![], vec![]);
        never_exceeds &= volume_rows.iter().all(|row| row.volume <= 1.0);
        for row in &volume_rows {
            let theirs = THEIR_VOLUMES.iter().find(|(scene, strategy, ..)| *scene == name && *strategy == row.strategy);
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
            |row: &VolumeRow| Point { label: format!("{:?}", row.strategy), x: row.volume.into(), y: row.boxes.into() };
        series.push(Series::dots(name, volume_rows.iter().map(point).collect()));
        let fewest = volume_rows
            .iter()
            .min_by(|a, b| a.boxes.total_cmp(&b.boxes))
            .map(|row| (name, row.strategy, row.boxes / volume_rows[0].boxes));
        best = best.or(fewest);
    }
    chapter.plot(
        "Box tests over sum of volumes, by strategy (figures 12 and 13 as numbers)",
        Axis::linear("sum of volumes relative to axis-aligned boxes"),
        Axis::linear("box tests per camera ray"),
        series,
    );
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

fn volume_rows(model: &crate::models::Model, effort: Effort) -> Result<Vec<VolumeRow>> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let codes = canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
    let tree = canted_lbvh::radix(canted_lbvh::sort_by_code(&codes, Bits::B63));
    let sorted = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
    let rays = models::camera(model, effort.pick(16, 128, 128));
    let mut volume_rows: Vec<VolumeRow> = vec![];
    let mut aligned_volume = 1.0;
    for strategy in Strategy::ALL {
        let volumes = canted_lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
        let sums = canted_lbvh::tree_cost(&tree, &volumes, &sorted, &Costs::default(), 1.0);
        let blas =
            Bvh2::new(tree.clone(), &volumes, sorted.clone(), &bounds, PairOrder::DepthFirst, TriangleTest::Watertight);
        let mut counts = Counts::default();
        for ray in &rays {
            blas.closest_hit_with(ray, &mut counts);
        }
        if strategy == Strategy::Aabb {
            aligned_volume = sums.volume;
        }
        volume_rows.push(VolumeRow {
            strategy,
            volume: sums.volume / aligned_volume,
            oriented_percent: 100.0 * sums.n_oriented as f64 / sums.n_nodes as f64,
            boxes: counts.boxes as f64 / rays.len() as f64,
        });
    }
    Ok(volume_rows)
}

/// The dissertation's scene with two levels.
const SPONZA: &str = "sponza";

const KITCHEN: &str = "country_kitchen";

/// The dissertation's Sponza: sum of volumes of both levels, percentage of oriented nodes of the top and bottom levels.
const THEIR_LEVELS: [(Strategy, f64, Option<f64>, Option<f64>); 4] = [
    (Strategy::Aabb, 2.507_26, None, None),
    (Strategy::PcaUnbounded, 2.506_91, None, Some(94.2567)),
    (Strategy::PcaBounded, 2.506_93, Some(10.7143), Some(60.4837)),
    (Strategy::Quaternion, 2.506_93, Some(13.7755), Some(60.3462)),
];

/// The dissertation's sum for axis-aligned boxes in one level.
const THEIR_ONE_LEVEL: f64 = 5.330_77;

pub(super) fn two_levels_table(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut found = Found::default();
    for (name, model) in scenes(effort, &[SPONZA], chapter)? {
        let pieces = meshes(name, &model)?;
        let title = format!("Two levels (table 4, 3a and 3b): {name} in {} meshes, theirs in 393", pieces.len());
        let head = [
            "strategy",
            "volume over one level, theirs",
            "ours",
            "over axis-aligned, theirs",
            "ours",
            "top oriented, theirs",
            "ours",
            "bottom oriented, theirs",
            "ours",
        ];
        let mut table = Table::new(title, &head);
        let unit = model.mesh.diagonal();
        let one = bottom(&model.mesh, Strategy::Aabb, unit)?.0.volume;
        let mut aligned = f64::NAN;
        let (mut volumes, mut oriented_bottom) = (vec![], vec![]);
        for (strategy, their_volume, their_top, their_bottom) in THEIR_LEVELS {
            let (top, bottom) = two_levels(&pieces, strategy, unit)?;
            let volume = top.volume + bottom.volume;
            if strategy == Strategy::Aabb {
                aligned = volume;
                found.says = format!(
                    "On {name}, two levels have {} times the volume of axis-aligned boxes in one level here, {} times in the dissertation.",
                    number(volume / one),
                    number(their_volume / THEIR_ONE_LEVEL)
                );
            }
            if name == SPONZA {
                volumes.push([their_volume, volume]);
                oriented_bottom.extend(their_bottom.map(|theirs| [theirs, oriented_percent(&bottom)]));
            }
            let percent = |theirs: Option<f64>| theirs.map_or_else(|| "–".to_owned(), |p| format!("{p:.1}%"));
            let oriented = |sums: &TreeCost| format!("{:.1}%", oriented_percent(sums));
            let cells = [
                format!("{strategy:?}"),
                format!("{:.3}", their_volume / THEIR_ONE_LEVEL),
                format!("{:.3}", volume / one),
                format!("{:.5}", their_volume / THEIR_LEVELS[0].1),
                format!("{:.5}", volume / aligned),
                percent(their_top),
                oriented(&top),
                percent(their_bottom),
                oriented(&bottom),
            ];
            table.rows.push(cells.map(Cell::text).to_vec());
        }
        table.says = format!(
            "{} In both levels and for all strategies, the root box of a mesh is the axis-aligned box of its triangles.",
            found.says
        );
        chapter.tables.push(table);
        found.compared.extend([volumes, oriented_bottom]);
    }
    Ok(found)
}

fn oriented_percent(sums: &TreeCost) -> f64 {
    100.0 * sums.n_oriented as f64 / sums.n_nodes.max(1) as f64
}

/// The meshes of the scene's file in world space, or the struts of a generated lattice.
pub(super) fn meshes(name: &str, model: &Model) -> Result<Vec<Mesh>> {
    let scene = if [SPONZA, KITCHEN, models::BUILT_IN].contains(&name) { models::scene(name)? } else { None };
    Ok(match scene {
        Some(scene) => cut(canted_renderer::flatten(&scene)?),
        None => pieces(&model.mesh),
    })
}

/// Triangles in runs that begin at the given ones.
fn cut((positions, triangles, first): canted_renderer::Flattened) -> Vec<Mesh> {
    let ends = first[1..].iter().map(|&end| end as usize).chain([triangles.len()]);
    let runs = first.iter().zip(ends).map(|(&first, end)| &triangles[first as usize..end]);
    runs.filter(|run| !run.is_empty()).map(|run| of_corners(&positions, run)).collect()
}

/// A mesh with separate vertices for every corner.
fn of_corners(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    let mut mesh = Mesh { positions: vec![], triangles: vec![] };
    triangles.iter().for_each(|triangle| add_triangle(&mut mesh, triangle.map(|i| positions[i as usize])));
    mesh
}

fn add_triangle(mesh: &mut Mesh, corners: [[f32; 3]; 3]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    mesh.triangles.push([first, first + 1, first + 2]);
}

/// Sums of the tree over the pieces, and of the trees of all pieces.
fn two_levels(pieces: &[Mesh], strategy: Strategy, unit: f64) -> Result<(TreeCost, TreeCost)> {
    let mut all = TreeCost::default();
    let mut roots = vec![];
    for piece in pieces {
        let (sums, root) = bottom(piece, strategy, unit)?;
        all.n_nodes += sums.n_nodes;
        all.n_oriented += sums.n_oriented;
        all.volume += sums.volume;
        roots.push(root);
    }
    let boxes: Vec<Aabb> = roots.iter().map(Obb::aabb).collect();
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    let tree = radix(&canted_lbvh::morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes));
    let sorted: Vec<Obb> = tree.leaves.iter().map(|leaf| roots[leaf.index()]).collect();
    let volumes = canted_lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
    Ok((canted_lbvh::tree_cost(&tree, &volumes, &sorted, &Costs::default(), unit), all))
}

/// Sums of a piece's tree, and the box of the piece as the level above sees it.
fn bottom(piece: &Mesh, strategy: Strategy, unit: f64) -> Result<(TreeCost, Obb)> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&piece.positions, &piece.triangles)?;
    let tree = radix(&canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners));
    let sorted = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
    let volumes = canted_lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
    Ok((canted_lbvh::tree_cost(&tree, &volumes, &sorted, &Costs::default(), unit), Obb::from_aabb(&bounds)))
}

fn radix(codes: &[u64]) -> Tree {
    canted_lbvh::radix(canted_lbvh::sort_by_code(codes, Bits::B63))
}

/// The connected components of a mesh, in the order of their first triangles.
fn pieces(mesh: &Mesh) -> Vec<Mesh> {
    let mut first_at = HashMap::new();
    let welded: Vec<usize> = (0..)
        .zip(&mesh.positions)
        .map(|(i, position)| *first_at.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(i))
        .collect();
    let mut parents: Vec<usize> = (0..mesh.positions.len()).collect();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| root(&mut parents, welded[i as usize]));
        parents[b] = a;
        let c = root(&mut parents, c);
        parents[c] = a;
    }
    let mut places = HashMap::new();
    let mut pieces: Vec<Mesh> = vec![];
    for triangle in &mesh.triangles {
        let n = pieces.len();
        let place = *places.entry(root(&mut parents, welded[triangle[0] as usize])).or_insert(n);
        if place == n {
            pieces.push(Mesh { positions: vec![], triangles: vec![] });
        }
        add_triangle(&mut pieces[place], triangle.map(|i| mesh.positions[i as usize]));
    }
    pieces
}

/// The representative vertex of a piece (union-find with path halving).
fn root(parents: &mut [usize], mut vertex: usize) -> usize {
    while parents[vertex] != vertex {
        parents[vertex] = parents[parents[vertex]];
        vertex = parents[vertex];
    }
    vertex
}

const STRATEGIES: [Strategy; 4] = [Strategy::Aabb, Strategy::PcaUnbounded, Strategy::PcaBounded, Strategy::Quaternion];

/// Points of a curve.
const STEPS: usize = 64;

/// Box and triangle tests of each ray, and nanoseconds of a ray, in one level and in two.
struct TestRow {
    name: String,
    counts: [Vec<Counts>; 2],
    ns: [Samples; 2],
}

impl TestRow {
    fn new<B: Intersect + 'static>(name: String, one: B, two: Tlas<B>, rays: &[Ray], n_rounds: usize) -> Result<Self> {
        let counts = counted(&one, &two, rays);
        let engines: [Box<dyn Engine>; 2] = [Box::new(one), Box::new(two)];
        let (seconds, hits) = engine::closest(&engines, rays, n_rounds);
        // Primitives and instances have other numbers.
        let n_other = hits[0].iter().zip(&hits[1]).filter(|(a, b)| a.map(|hit| hit.t) != b.map(|hit| hit.t)).count();
        ensure!(n_other == 0, "{name}: {n_other} hits in two levels differ from those in one");
        let ns = [0, 1].map(|level| Samples::from(engine::cpu(&seconds[level])).scaled(1e9 / rays.len() as f64));
        Ok(Self { name, counts, ns })
    }
}

pub(super) fn tests_per_ray(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Tests and time of a camera ray in one level and in two",
        &[
            "scene",
            "meshes",
            "structure",
            "boxes, one level",
            "boxes, two",
            "two over one",
            "triangles, one level",
            "triangles, two",
            "one level",
            "two",
            "rate of two over one",
        ],
    );
    let (mut found, mut rates) = (vec![], vec![]);
    for (name, model) in scenes(effort, &[SPONZA, KITCHEN, models::BUILT_IN], chapter)? {
        let rays = models::camera(&model, effort.pick(16, 128, 128));
        let (n_meshes, test_rows) = one_thread(|| test_rows(name, &model, &rays, effort.pick(2, 3, 7)))??;
        for row in &test_rows {
            let [boxes, triangles] = [(|c: &Counts| c.boxes) as fn(&Counts) -> u64, |c| c.triangles]
                .map(|of| row.counts.each_ref().map(|counts| mean(counts, of)));
            let texts = [
                name.to_owned(),
                n_meshes.to_string(),
                row.name.clone(),
                number(boxes[0]),
                number(boxes[1]),
                number(boxes[1] / boxes[0]),
                number(triangles[0]),
                number(triangles[1]),
            ];
            let [one, two] = row.ns.each_ref().map(Samples::median);
            let mut cells = texts.map(Cell::text).to_vec();
            cells.extend(row.ns.iter().map(|ns| Cell::measured(ns.clone(), "ns")));
            cells.push(Cell::text(number(one / two)));
            table.rows.push(cells);
            found.push(format!("{} {}", row.name, number(boxes[1] / boxes[0])));
            rates.push(format!("{} {}", row.name, number(one / two)));
        }
        let of = |row: &TestRow, level: usize| {
            curve(format!("{}, {}", row.name, ["one level", "two levels"][level]), &row.counts[level])
        };
        // Figure 12: the box tests of boxes of both kinds; figure 13: of one level and two.
        chapter.plots.push(plot(
            "Figure 12 as a plot: axis-aligned and oriented boxes",
            name,
            test_rows[..STRATEGIES.len()].iter().map(|row| of(row, 0)).collect(),
        ));
        let figure_13 =
            [&test_rows[0], &test_rows[STRATEGIES.len()]].into_iter().flat_map(|row| [of(row, 0), of(row, 1)]);
        chapter.plots.push(plot("Figure 13 as a plot: one level and two", name, figure_13.collect()));
    }
    table.says = format!(
        "The dissertation shows fewer box tests in two levels, where volumes are halved, and says that a second level costs nothing. Here, box tests in two levels \
         relative to one, scene by scene: {}; rays a second: {}.",
        found.join(", "),
        rates.join(", ")
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

fn mean(counts: &[Counts], of: fn(&Counts) -> u64) -> f64 {
    counts.iter().map(of).sum::<u64>() as f64 / counts.len() as f64
}

/// Box tests of the rays in order, few to many.
fn curve(name: String, counts: &[Counts]) -> Series {
    let mut boxes: Vec<u64> = counts.iter().map(|counts| counts.boxes).collect();
    boxes.sort_unstable();
    let last = boxes.len() - 1;
    let point =
        |step: usize| Point::new(String::new(), 100.0 * step as f64 / STEPS as f64, boxes[last * step / STEPS] as f64);
    Series::line(name, (0..=STEPS).map(point).collect())
}

fn plot(title: &str, scene: &str, series: Vec<Series>) -> Plot {
    Plot {
        title: format!("{title} ({scene})"),
        x: Axis::linear("camera rays with at most so many tests, %"),
        y: Axis::linear("box tests of a ray"),
        series,
    }
}

fn test_rows(name: &str, model: &Model, rays: &[Ray], n_rounds: usize) -> Result<(usize, Vec<TestRow>)> {
    let pieces = meshes(name, model)?;
    let instances: Vec<Instance> =
        (0u32..).zip(&pieces).map(|(mesh, _)| Instance::new(mesh, Affine::IDENTITY)).collect();
    let mut test_rows = vec![];
    for strategy in STRATEGIES {
        let volumes = VolumeConfig { strategy, fallback: true };
        let config = Bvh2Config { volumes, ..Bvh2Config::default() };
        let one = Bvh2::build(&model.mesh.positions, &model.mesh.triangles, &config)?;
        let blas = pieces.iter().map(|piece| Bvh2::build(&piece.positions, &piece.triangles, &config));
        let two =
            Tlas::new(blas.collect::<Result<Vec<_>, _>>()?, &instances, TopConfig::other(Bvh2Boxes::builder(volumes)))?;
        test_rows.push(TestRow::new(format!("Bvh2, radix tree, {strategy:?}"), one, two, rays, n_rounds)?);
    }
    let (one, two) = wide_levels(model, &pieces, &instances)?;
    test_rows.push(TestRow::new("WideBvh, balanced".to_owned(), one, two, rays, n_rounds)?);
    Ok((pieces.len(), test_rows))
}

/// Wide BVHs of one level and of two.
fn wide_levels(model: &Model, pieces: &[Mesh], instances: &[Instance]) -> Result<(TriangleBvh, Tlas<TriangleBvh>)> {
    let config = Config::preset(Preset::Balanced);
    let build = |mesh: &Mesh| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config);
    let blas = pieces.iter().map(build).collect::<Result<Vec<_>, _>>()?;
    Ok((build(&model.mesh)?, Tlas::new(blas, instances, TopConfig::Wide(config))?))
}

/// Camera rays through wide BVHs of one level and of two on a device.
pub(super) fn levels_on_device(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let Ok(gpu) = block_on(Gpu::open(&Choice::Best)) else { return Ok(Found::default()) };
    let title =
        format!("A camera ray in one level and in two on a device: {}, WideBvh, with transfers", gpu.info().name);
    let mut table = Table::new(title, &["scene", "meshes", "one level", "two", "rate of two over one"]);
    let mut rates = vec![];
    for (name, model) in scenes(effort, &[SPONZA, KITCHEN, models::BUILT_IN], chapter)? {
        let rays = models::camera(&model, if gpu.info().kind == AdapterKind::Software { 16 } else { 256 });
        let pieces = meshes(name, &model)?;
        let instances: Vec<Instance> = (0u32..).zip(&pieces).map(|(i, _)| Instance::new(i, Affine::IDENTITY)).collect();
        let (one, two) = wide_levels(&model, &pieces, &instances)?;
        let [one, two] = [
            block_on(TracedScene::new(&gpu, Source::wide(&one), Options::default()))?,
            block_on(TracedScene::new(&gpu, Source::tlas(two.blas(), &instances), Options::default()))?,
        ];
        let on = |scene: &TracedScene| block_on(scene.closest_hits(&gpu, &rays)).map(drop);
        let contenders = [&one, &two].map(|scene| timing::Contender::new("", move || on(scene)));
        let timings = timing::try_run(effort.pick(1, 3, 7), Vec::from(contenders))?;
        let rate = number(1.0 / timing::ratio(&timings[1].seconds, &timings[0].seconds));
        rates.push(format!("{name} {rate}"));
        let mut row = [name.to_owned(), pieces.len().to_string()].map(Cell::text).to_vec();
        let ns = |t: &timing::Timing| Samples::from(t.seconds.clone()).scaled(1e9 / rays.len() as f64);
        row.extend(timings.iter().map(|timing| Cell::measured(ns(timing), "ns")));
        row.push(Cell::text(rate));
        table.rows.push(row);
    }
    table.says = format!("Rays a second on a device in two levels relative to one: {}.", rates.join(", "));
    chapter.tables.push(table);
    Ok(Found::default())
}

/// Tests of each ray in one level and in two.
fn counted<B: Intersect>(one: &B, two: &Tlas<B>, rays: &[Ray]) -> [Vec<Counts>; 2] {
    let of = |trace: &dyn Fn(&Ray, &mut Counts)| {
        let count = |ray: &Ray| {
            let mut counts = Counts::default();
            trace(ray, &mut counts);
            counts
        };
        rays.iter().map(count).collect()
    };
    [
        of(&|ray, counts| {
            let _ = one.closest_hit_with(ray, counts);
        }),
        of(&|ray, counts| {
            let _ = two.closest_hit_with(ray, counts);
        }),
    ]
}

const CPU_PASSES: [&str; 6] =
    ["codes", "sort", "nodes", "boxes, PCA bounded", "boxes, quaternion", "boxes, PCA unbounded"];

/// The dissertation's CPU milliseconds.
const THEIRS_ON_CPU: [(&str, [f64; 6]); 3] = [
    ("dragon_871k", [14.40, 100.80, 28.42, 316.26, 520.10, 626.26]),
    ("sponza", [4.27, 23.62, 8.52, 756.01, 490.58, 723.99]),
    ("bunny", [2.37, 12.51, 4.36, 51.90, 84.76, 90.27]),
];

pub(super) fn on_cpu(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Passes of a build on the CPU (table 5, figure 11)",
        &["scene", "pass", "theirs", "ours", "ours over theirs"],
    );
    let (mut series, mut found) = (vec![], Found::default());
    for (name, model) in
        scenes(effort, effort.pick(&[][..], &["sponza"], &["dragon_871k", "sponza", "bunny"]), chapter)?
    {
        let ours = one_thread(|| measure_passes(&model, effort.pick(2, 3, 7)))??;
        let theirs = THEIRS_ON_CPU.iter().find(|(scene, _)| *scene == name).map(|(_, passes)| passes);
        let mut points = vec![];
        for (i, (pass, ms)) in CPU_PASSES.iter().zip(&ours).enumerate() {
            let their = theirs.map(|passes| passes[i]);
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(*pass),
                Cell::text(their.map_or("–".to_owned(), |ms| format!("{ms} ms"))),
                Cell::measured(ms.clone(), "ms"),
                Cell::text(their.map_or("–".to_owned(), |their| number(ms.median() / their))),
            ]);
            // A scene that they lack is compared with itself, so that its passes are plotted.
            points.push(Point::new(*pass, their.unwrap_or_else(|| ms.median()), ms.clone()));
        }
        if let Some(theirs) = theirs {
            let share = |passes: &[f64]| passes[3] / (passes[0] + passes[1] + passes[2] + passes[3]);
            let medians: Vec<f64> = ours.iter().map(Samples::median).collect();
            found.compared.push(theirs.iter().zip(&medians).map(|(&their, &our)| [their, our]).collect());
            found.says = format!(
                "Boxes by bounded principal axes take {:.0}% of the build of {name} here, {:.0}% in the dissertation.",
                100.0 * share(&medians),
                100.0 * share(theirs)
            );
        }
        series.push(Series::dots(name, points));
    }
    chapter.plot(
        "Passes of a build on one thread: ours over the dissertation's",
        Axis::log("theirs, ms"),
        Axis::log("ours, ms"),
        series,
    );
    let order = Pairs::of(&found.compared);
    table.says = format!(
        "In the dissertation, boxes take most of the time of a build on the CPU, in the order bounded, quaternion, unbounded (but for Sponza). Here, {} of {} pairs \
         of passes have its order.",
        order.n_same, order.n_all
    );
    chapter.tables.push(table);
    Ok(found)
}

fn measure_passes(model: &Model, repeats: usize) -> Result<[Samples; 6]> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let mut ms: [Vec<f64>; 6] = Default::default();
    for repeat in 0..=repeats {
        let mut keep = |pass: usize, took: timing::Seconds| {
            if repeat > 0 {
                ms[pass].push(took.cpu * 1e3);
            }
        };
        let (codes, took) = timing::time(|| canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners));
        keep(0, took);
        let (sorted, took) = timing::time(|| canted_lbvh::sort_by_code(&codes, Bits::B63));
        keep(1, took);
        let (tree, took) = timing::time(|| canted_lbvh::radix(sorted));
        keep(2, took);
        let leaves = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
        for (i, strategy) in
            [Strategy::PcaBounded, Strategy::Quaternion, Strategy::PcaUnbounded].into_iter().enumerate()
        {
            let config = VolumeConfig { strategy, fallback: true };
            keep(3 + i, timing::time(|| canted_lbvh::volumes(&tree, &leaves, &config)).1);
        }
    }
    Ok(ms.map(Samples::from))
}

const DEVICE_PASSES: [&str; 4] = ["codes", "nodes", "boxes, PCA bounded", "boxes, quaternion"];

/// The dissertation; its sort runs on the CPU, and its unbounded boxes take more than a minute.
const THEIRS_ON_DEVICE: [(&str, [f64; 4]); 3] = [
    ("dragon_871k", [13.14, 2.08, 50.90, 50.04]),
    ("sponza", [3.81, 0.64, 14.14, 13.40]),
    ("bunny", [1.90, 0.36, 7.67, 7.23]),
];

pub(super) fn on_device(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let gpu = match block_on(Gpu::open(&Choice::Best)) {
        Ok(gpu) => gpu,
        Err(error) => {
            chapter.skipped.push(format!("Passes on a device (table 5): {error}."));
            return Ok(Found::default());
        }
    };
    let runs = effort.pick(1, 2, 5);
    let title = format!(
        "Passes of a build on a device (table 5, figure 11): {} ({}), minimum of {runs} runs",
        gpu.info().name,
        gpu.info().kind
    );
    let mut table = Table::new(title, &["scene", "pass", "TITAN Xp, theirs", "ours", "ours over theirs"]);
    let mut found = Found::default();
    // A software driver takes half a minute per run for the dragon.
    let names =
        if gpu.info().kind == AdapterKind::Software { &["bunny"][..] } else { &["dragon_871k", "sponza", "bunny"] };
    for (name, model) in scenes(effort, names, chapter)? {
        let (corners, _) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
        let items = Primitives::triangles(&gpu, [&corners[..]])?;
        let Passes { codes, tree, boxes, error, .. } = block_on(Passes::measure(&gpu, &items, Bits::B63, runs))?;
        chapter.skipped.extend(error.map(|error| format!("Some passes of {name} on the device: {error}.")));
        let of =
            |wanted: Strategy| build::STRATEGIES.iter().position(|&strategy| strategy == wanted).and_then(|i| boxes[i]);
        let ours = [codes, tree, of(Strategy::PcaBounded), of(Strategy::Quaternion)];
        let theirs = THEIRS_ON_DEVICE.iter().find(|(scene, _)| *scene == name).map(|(_, passes)| passes);
        let both = |(&their, ms): (&f64, &Option<f64>)| Some([their, (*ms)?]);
        found.compared.extend(theirs.map(|theirs| theirs.iter().zip(&ours).filter_map(both).collect()));
        for (i, (pass, ms)) in DEVICE_PASSES.into_iter().zip(ours).enumerate() {
            let their = theirs.map(|passes| passes[i]);
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(pass),
                Cell::text(or_dash(their.map(|ms| format!("{ms} ms")))),
                Cell::text(or_dash(ms.map(|ms| format!("{} ms", number(ms))))),
                Cell::text(or_dash(their.zip(ms).map(|(their, ms)| number(ms / their)))),
            ]);
        }
    }
    let order = Pairs::of(&found.compared);
    table.says = format!(
        "The dissertation builds 4 to 7 times as fast on a TITAN Xp as on its CPU. This device is {}, so only the order of the passes compares: that of {} of {} \
         pairs is the same.",
        gpu.info().kind,
        order.n_same,
        order.n_all
    );
    chapter.tables.push(table);
    Ok(found)
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "–".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_split_at_its_meshes() {
        let positions = (0..4u8).map(|i| [f32::from(i); 3]).collect();
        let meshes = cut((positions, vec![[0, 1, 2], [1, 2, 3], [0, 2, 3]], vec![0, 2, 2]));
        let counts: Vec<usize> = meshes.iter().map(|mesh| mesh.triangles.len()).collect();
        assert_eq!((counts, meshes[1].positions.clone()), (vec![2, 1], vec![[0.0; 3], [2.0; 3], [3.0; 3]]));
    }

    #[test]
    fn pieces_share_no_vertex() {
        // Two triangles that share an edge, and a distant one.
        let positions =
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0; 3], [1.0, 0.0, 0.0], [-0.0, 1.0, 0.0], [1.0; 3]];
        let triangles = vec![[0, 1, 2], [3, 3, 3], [4, 5, 6]];
        let counts: Vec<usize> = pieces(&Mesh { positions, triangles }).iter().map(|p| p.triangles.len()).collect();
        assert_eq!(counts, [2, 1]);
    }
}
