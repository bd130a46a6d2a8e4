//! The sources: results of four theses, and the same measurements here, as far as the structures exist.
//!
//! Their machines differ from ours: only shares, ratios and orders are comparable.

mod camera;
mod dissertation;
mod elastic;
mod frame;
mod meshes;
mod silva;
mod splits;
mod structures;

use anyhow::Result;
use canted_fixtures::{scaffold_nodes, scaffold_of};

use super::model::{Chapter, Effort};
use crate::models::{self, Model};

/// A part of the chapter, which adds its tables.
type Part = fn(&mut Chapter, Effort) -> Result<Found>;

/// Source by source.
const SOURCES: [(&str, &[Part]); 4] = [
    (
        "the dissertation",
        &[
            dissertation::scenes_table,
            dissertation::volumes,
            dissertation::two_levels_table,
            dissertation::tests_per_ray,
            dissertation::levels_on_device,
            dissertation::on_cpu,
            dissertation::on_device,
            meshes::passes_by_size,
            meshes::one_dispatch,
            meshes::per_triangle,
            frame::six_pictures,
        ],
    ),
    ("the BIH thesis", &[structures::rebuilt, structures::from_boxes, elastic::by_stage]),
    ("Novak's thesis", &[structures::builders, splits::add, splits::one_table, frame::by_stage]),
    (
        "Silva's study",
        &[silva::paths, silva::hierarchy, silva::empty_space, silva::threads, camera::packets, camera::moving],
    ),
];

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "sources", title: "The sources: their results and ours", ..Chapter::default() };
    let (mut says, mut pairs) = (vec![], vec![]);
    for (source, parts) in SOURCES {
        let mut of_source = Pairs::default();
        for part in parts {
            let found = part(&mut chapter, effort)?;
            says.push(found.says);
            of_source = of_source.and(Pairs::of(&found.compared));
        }
        pairs.push((source, of_source));
    }
    says.insert(0, over_all(chapter.tables.len(), chapter.plots.len(), &pairs));
    chapter.set_sentences(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.skipped.extend(ABSENT.map(str::to_owned));
    Ok(chapter)
}

/// How much is compared, and how much of it has the same order.
fn over_all(n_tables: usize, n_plots: usize, pairs: &[(&str, Pairs)]) -> String {
    let all = pairs.iter().fold(Pairs::default(), |all, (_, pairs)| all.and(*pairs));
    let each: Vec<String> = pairs
        .iter()
        .filter(|(_, pairs)| pairs.n_all > 0)
        .map(|(source, Pairs { n_same, n_all })| format!("{source}: {n_same} of {n_all}"))
        .collect();
    let order = if each.is_empty() {
        "none of their ordered scenes is available".to_owned()
    } else {
        format!(
            "of {} pairs of passes, strategies or structures that they order by number, {} have the same order here ({})",
            all.n_all,
            all.n_same,
            each.join(", ")
        )
    };
    format!("{n_tables} tables and {n_plots} plots compare the results of {} sources with ours: {order}.", pairs.len())
}

const METHOD: [&str; 7] = [
    "The dissertation: Sabino 2020, tables 3 to 5 and figures 11 to 13, on an i7-8700K and a TITAN Xp. Its sums of volumes are over \
     all inner nodes of a radix tree in an unnamed unit, so ratios are compared; every entry of its table 4 is a ratio of two sums. \
     Its two levels are over 393 meshes with an instance each; ours over the meshes of our file. The ratios of its part 3a \
     contradict its own sums (0.803 instead of 0.99986): we use the sums. Its Bunny has twice the triangles of ours, its Dragon 108 \
     fewer. Ours run on one thread.",
    "Its table 4 counts nodes whose oriented box has less volume than the axis-aligned one; ours counts nodes whose oriented box was \
     chosen for its smaller area. In every table and for every structure, the root box of a mesh in the top level is the axis-aligned box of its triangles.",
    "The BIH thesis builds on an i7 at 3.2 GHz and traces on a GTX 480; it states no resolution. Ours build and trace on one CPU \
     thread, 65,536 camera rays of four views, which is a picture of 256 x 256; every structure has the same hits. Its models are not available, so scaffolds \
     have as many triangles; the Bunny and the Dragon are those of its chart 2. Bytes of a WideBvh: the numbers of triangles, which its blocks hold, count as references.",
    "Novak's fast builder is a radix tree on a GPU, his SAH builder runs on a CPU with a few candidates along one axis; the GPU \
     traces both. Ours are both built and traced on one CPU thread.",
    "Silva's study compares vector instructions, a GPU, threads, and rays with and without a hierarchy; its charts are lost, and the \
     quoted values come from its text. Its hierarchy is a kd-tree, ours a WideBvh. Threads are measured in wall time, which other processes affect.",
    "Stages of a build are those of `canted_lbvh::stages`; a frame by stage is made of the renderer's parts, each stage for all pixels at once. Holes and speckle \
     are counted on the picture that is timed; a lost hit is found by a loop over all triangles with the ray of the pixel's center.",
    "Orders are compared pair by pair within a scene: passes by time, strategies by volume and by oriented nodes, the BIH and the \
     kd-tree by build time, picture time and their sum. Pairs with equal values in the source and statements without \
     numbers are skipped.",
];

const ABSENT: [&str; 8] = [
    "Tables 3 to 5, Breakfast room, Buddha, Pirate ship and Sibenik: these models are not available.",
    "Figure 11 is table 5 in bars; figures 12 and 13 are pictures of box tests without numbers: ours are plots of box tests over camera rays.",
    "Table 5, unbounded principal axes on a device: they took more than a minute in the dissertation; `cargo xtask bench --device gpu` \
     and `canted stats --device gpu` measure ours.",
    "Chart 2 of the BIH thesis for Dino, Bunny and Alien: its bars are lost.",
    "Novak's chart of a profile of nanoRT has no numbers; ours of a frame by stage stands alone.",
    "Box tests of a traversal by links without a stack (Novak's 4.4): it no longer exists here. By links or by bits, rays had 0.64 to 0.81 times the rate of a \
     stack on every scene (`benches/TRIED.md`, On devices), so both were removed; their box tests were not recorded.",
    "Novak's uniform grid and octree (4.1), which he describes and does not measure: neither is built here. A grid has cells of one size for dense and \
     empty parts of a scene, and an octree is a kd-tree whose planes are midpoints of all three axes; `canted stats --json` has the SAH cost of a \
     kd-tree with midpoints beside that with planes by cost.",
    "Silva's intersections per second in OpenCL: the chapter on kernels has single tests and complete rays on a device.",
];

/// Scenes of the dissertation, or a small lattice for tests.
fn scenes(effort: Effort, names: &[&'static str], chapter: &mut Chapter) -> Result<Vec<(&'static str, Model)>> {
    let names = if effort == Effort::Tiny { &[models::SMALL] } else { names };
    let mut scenes = vec![];
    for &name in names {
        match models::load(name)? {
            Some(model) => scenes.push((name, model)),
            None => {
                let lacking = format!("{name}: the model is not available.");
                if !chapter.skipped.contains(&lacking) {
                    chapter.skipped.push(lacking);
                }
            }
        }
    }
    if scenes.is_empty() {
        // Generated, so always available.
        scenes.extend(models::load("truss")?.map(|model| ("truss", model)));
    }
    Ok(scenes)
}

/// The findings of a part of the chapter.
#[derive(Default)]
struct Found {
    /// A sentence; may be empty.
    says: String,
    /// Lists of compared items: the source's value and ours.
    compared: Vec<Vec<[f64; 2]>>,
}

impl From<String> for Found {
    fn from(says: String) -> Self {
        Self { says, ..Self::default() }
    }
}

/// Numbers of ordered pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Pairs {
    /// In the same order in theirs and ours.
    n_same: usize,
    /// Ordered in theirs.
    n_all: usize,
}

impl Pairs {
    /// All pairs of every list whose values differ in the source.
    fn of(compared: &[Vec<[f64; 2]>]) -> Self {
        let mut pairs = Self::default();
        for list in compared {
            for (i, a) in list.iter().enumerate() {
                for b in list[..i].iter().filter(|b| b[0] != a[0]) {
                    pairs.n_all += 1;
                    pairs.n_same += usize::from((a[0] < b[0]) == (a[1] < b[1]) && a[1] != b[1]);
                }
            }
        }
        pairs
    }

    fn and(self, other: Self) -> Self {
        Self { n_same: self.n_same + other.n_same, n_all: self.n_all + other.n_all }
    }
}

/// A scaffold of about `2^log2` triangles.
fn scaffold(log2: u32) -> Model {
    models::of_mesh(scaffold_of(1, false, scaffold_nodes(log2)))
}

/// The exponent of the power law through points, by least squares of logarithms, with its standard error.
fn exponent(points: &[[f64; 2]]) -> String {
    let logs: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let n = logs.len() as f64;
    let [mean_x, mean_y] = [0, 1].map(|k| logs.iter().map(|log| log[k]).sum::<f64>() / n);
    let squares: f64 = logs.iter().map(|[x, _]| (x - mean_x).powi(2)).sum();
    let slope = logs.iter().map(|[x, y]| (x - mean_x) * (y - mean_y)).sum::<f64>() / squares;
    let residual: f64 = logs.iter().map(|[x, y]| (y - mean_y - slope * (x - mean_x)).powi(2)).sum();
    format!("{slope:.2} ±{:.2}", (residual / (n - 2.0) / squares).sqrt())
}

/// Runs on a pool of one thread.
fn one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(1).build()?.install(work))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_main_finding_counts_pairs_in_the_same_order() {
        let pairs =
            [("a", Pairs { n_same: 3, n_all: 4 }), ("b", Pairs::default()), ("c", Pairs { n_same: 1, n_all: 1 })];
        let text = over_all(7, 2, &pairs);
        assert!(
            text.starts_with("7 tables and 2 plots compare the results of 3 sources with ours: of 5 pairs"),
            "{text}"
        );
        assert!(text.ends_with("4 have the same order here (a: 3 of 4, c: 1 of 1)."), "{text}");
    }

    #[test]
    fn the_exponent_of_a_power_law_is_found() {
        assert_eq!(exponent(&[[1.0, 3.0], [2.0, 12.0], [4.0, 48.0]]), "2.00 ±0.00");
    }

    #[test]
    fn reversed_pairs_are_not_the_same() {
        // The last two are swapped, and the first two are equal in the source: five pairs remain, one of them reversed.
        let list = vec![[1.0, 9.0], [1.0, 8.0], [2.0, 30.0], [3.0, 20.0]];
        assert_eq!(Pairs::of(std::slice::from_ref(&list)), Pairs { n_same: 4, n_all: 5 });
        // Equal values here have no order.
        assert_eq!(Pairs::of(&[vec![[1.0, 5.0], [2.0, 5.0]], list]), Pairs { n_same: 4, n_all: 6 });
    }
}
