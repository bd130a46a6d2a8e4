//! Novak's thesis: a fast builder compared with an SAH builder (his tables), and bytes.

use anyhow::Result;
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{scaffold_nodes, scaffold_of};
use canted_lbvh::Leaf;
use canted_obb::Aabb;
use canted_sah::{Builder, TopDownConfig};
use canted_trace::Intersect;

use super::{orders::Found, passes::one_thread};
use crate::{
    models::{self, Model},
    rays,
    report::{
        model::{Axis, Cell, Chapter, Effort, Plot, Point, Series, Table},
        samples::{Samples, faster, number},
    },
    timing,
};

/// The cheapest.
pub(super) const RADIX: (&str, Builder) = ("radix tree", Builder::Lbvh);

/// Evaluates every split of every node with the surface area heuristic.
pub(super) const SWEPT: (&str, Builder) = ("full SAH sweep", Builder::TopDown(TopDownConfig::SWEEP, None));

/// The times of one BVH.
pub(super) struct Took {
    /// Milliseconds.
    pub(super) build: Samples,
    /// Milliseconds of all camera rays.
    pub(super) picture: Samples,
    pub(super) n_bytes: usize,
}

/// A scaffold of about `2^log2` triangles.
pub(super) fn scaffold(log2: u32) -> Model {
    models::of_mesh(scaffold_of(1, false, scaffold_nodes(log2)))
}

/// Every BVH of a model, built and traced in turn on one thread.
pub(super) fn measure(model: &Model, builders: &[(&'static str, Builder)], effort: Effort) -> Result<Vec<Took>> {
    one_thread(|| measure_here(model, builders, effort))?
}

fn measure_here(model: &Model, builders: &[(&'static str, Builder)], effort: Effort) -> Result<Vec<Took>> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    // Four views together have the pixels of one picture of twice the width and height.
    let rays = rays::camera(model, effort.pick(16, 128, 128));
    let mut took: Vec<(Vec<f64>, Vec<f64>, usize)> = vec![Default::default(); builders.len()];
    for repeat in 0..=effort.pick(2, 3, 5) {
        for ((_, builder), (builds, pictures, n_bytes)) in builders.iter().zip(&mut took) {
            let (blas, build) = timing::time(|| {
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                let tree = canted_sah::build(&boxes, &bounds, builder);
                Bvh2::over(tree, &corners, &bounds, &Bvh2Config::default())
            });
            let (_, picture) = timing::time(|| {
                for ray in &rays {
                    std::hint::black_box(blas.closest_hit(ray));
                }
            });
            *n_bytes = blas.n_bytes();
            if repeat > 0 {
                builds.push(build.cpu * 1e3);
                pictures.push(picture.cpu * 1e3);
            }
        }
    }
    let took = took.into_iter().map(|(build, picture, n_bytes)| Took {
        build: build.into(),
        picture: picture.into(),
        n_bytes,
    });
    Ok(took.collect())
}

/// Novak's scenes: triangles if known, megabytes of the tree built on the CPU and of the one built on the GPU.
const SCENES: [(&str, Option<usize>, [f64; 2]); 6] = [
    ("scene 1", None, [59.0, 66.0]),
    ("scene 2", None, [94.0, 125.0]),
    ("scene 3", None, [106.0, 162.0]),
    ("scene 4", Some(1_099_995), [213.0, 302.0]),
    ("scene 5", Some(1_468_284), [251.0, 347.0]),
    ("scene 6", Some(2_880_000), [372.0, 446.0]),
];

/// By scene and machine: build and frame milliseconds of the GPU's radix tree, then of the CPU's SAH tree.
const THEIRS: [[[f64; 4]; 3]; 6] = [
    [[153.02, 34.82, 218.87, 62.52], [18.04, 4.89, 167.81, 7.49], [19.21, 5.73, 167.85, 9.11]],
    [[186.15, 117.22, 582.61, 231.91], [35.13, 17.35, 477.59, 21.91], [37.77, 21.26, 476.81, 25.18]],
    [[197.33, 117.28, 1271.21, 155.82], [77.11, 7.74, 1033.91, 14.38], [81.56, 10.94, 1033.98, 17.63]],
    [[466.33, 62.13, 2745.89, 95.72], [222.04, 5.82, 2241.39, 8.63], [231.86, 8.21, 2241.89, 11.58]],
    [[539.11, 134.82, 3774.12, 272.22], [181.62, 32.31, 3063.49, 44.55], [192.71, 36.19, 3063.46, 49.74]],
    [[792.15, 891.92, 9359.67, 896.72], [371.08, 368.45, 7263.72, 319.68], [384.16, 386.65, 7264.15, 347.55]],
];

const MACHINES: [&str; 3] = ["GTX 950", "RTX 2080 Ti", "RX Vega 64"];

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
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
        .map(|name| Series { name, points: vec![], is_joined: false })
        .collect();
    let point = |scene: &str, (build, picture): (f64, f64)| Point {
        label: scene.to_owned(),
        x: build.into(),
        y: picture.into(),
    };
    for ((scene, n_triangles, megabytes), machines) in SCENES.into_iter().zip(THEIRS) {
        let n = n_triangles.map_or_else(|| "lost".to_owned(), |n| n.to_string());
        for ((machine, ms), series) in MACHINES.iter().zip(machines).zip(&mut series) {
            let gains = row(&mut times, [&format!("Novak, {machine}"), scene, &n], ms.map(Samples::from));
            series.points.push(point(scene, gains));
        }
        // The first column belongs to the CPU.
        memory.rows.push(bytes(["Novak", scene, &n], n_triangles, [megabytes[1] * 1e6, megabytes[0] * 1e6]));
    }
    let (mut says, mut gains_of) = (String::new(), vec![]);
    for &log2 in effort.pick(&[8][..], &[15, 17], &[15, 17, 20, 21]) {
        let model = scaffold(log2);
        let n_triangles = model.mesh.triangles.len();
        let n = n_triangles.to_string();
        let took = measure(&model, &[RADIX, SWEPT], effort)?;
        let [fast, sah] = [&took[0], &took[1]];
        says = format!(
            "On a scaffold of {n} triangles {}; {}.",
            faster(("the radix tree's build", &fast.build), ("the SAH build", &sah.build)),
            faster(("the SAH tree's picture", &sah.picture), ("the radix tree's", &fast.picture)),
        );
        let ms = [&fast.build, &fast.picture, &sah.build, &sah.picture].map(Samples::clone);
        let gains = row(&mut times, ["ours", "scaffold", &n], ms);
        series[MACHINES.len()].points.push(point("scaffold", gains));
        gains_of.push(format!("{} with {n} triangles", number(gains.1)));
        #[expect(clippy::cast_precision_loss, reason = "bytes are fewer than 2^53")]
        let sizes = [0, 1].map(|i| took[i].n_bytes as f64);
        memory.rows.push(bytes(["ours", "scaffold", &n], Some(n_triangles), sizes));
    }
    chapter.plots.push(Plot {
        title: "SAH compared with a fast builder: picture gain over build cost".to_owned(),
        x: Axis::log("SAH build over fast build"),
        y: Axis::log("fast picture over SAH picture"),
        series,
    });
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
fn row(table: &mut Table, [source, scene, n]: [&str; 3], ms: [Samples; 4]) -> (f64, f64) {
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

fn bytes([source, scene, n]: [&str; 3], n_triangles: Option<usize>, sizes: [f64; 2]) -> Vec<Cell> {
    let mut cells = [source, scene, n].map(Cell::text).to_vec();
    cells.extend(sizes.map(|size| Cell::text(format!("{} MB", number(size * 1e-6)))));
    #[expect(clippy::cast_precision_loss, reason = "triangles are fewer than 2^53")]
    let each = |size: f64| n_triangles.map_or_else(|| "–".to_owned(), |n| format!("{} B", number(size / n as f64)));
    cells.extend(sizes.map(|size| Cell::text(each(size))));
    cells
}
