//! The sources: what four theses print, and the same measured here, side by side as far as the structures exist.
//!
//! Their machines are not ours: what can be compared are shares and ratios, and the order of things.

mod bih;
mod boxes;
mod builders;
mod device;
mod levels;
mod linear;
mod novak;
mod orders;
mod passes;
mod scenes;
mod simd;

use anyhow::Result;

use super::effort::Effort;
use super::model::Chapter;
use super::subjects;
use crate::models::Model;
use orders::{Found, Pairs};

/// A part of the chapter: adds its tables.
type Part = fn(&mut Chapter, Effort) -> Result<Found>;

/// Source by source.
const SOURCES: [(&str, &[Part]); 4] = [
    ("the dissertation", &[scenes::add, boxes::add, levels::add, passes::add, device::add]),
    ("the BIH thesis", &[bih::add]),
    ("Novak's thesis", &[novak::add]),
    ("Silva's study", &[simd::add, linear::add]),
];

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "sources", title: "The sources: theirs and ours", ..Chapter::default() };
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
    chapter.tell(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.skipped.extend(ABSENT.map(str::to_owned));
    Ok(chapter)
}

/// How much stands beside ours, and how much of it in the same order.
fn over_all(n_tables: usize, n_plots: usize, pairs: &[(&str, Pairs)]) -> String {
    let all = pairs.iter().fold(Pairs::default(), |all, (_, pairs)| all.and(*pairs));
    let each: Vec<String> = pairs
        .iter()
        .filter(|(_, pairs)| pairs.n_all > 0)
        .map(|(source, Pairs { n_same, n_all })| format!("{source}: {n_same} of {n_all}"))
        .collect();
    let order = if each.is_empty() {
        "no scene of theirs is at hand whose numbers could be put in an order".to_owned()
    } else {
        format!(
            "of {} pairs of passes, strategies or structures that they put in an order by number {} stand in the same order here ({})",
            all.n_all,
            all.n_same,
            each.join(", ")
        )
    };
    format!("{n_tables} tables and {n_plots} plots set what {} sources print beside ours: {order}.", pairs.len())
}

const METHOD: [&str; 6] = [
    "The dissertation: Sabino 2020, tables 3 to 5 and figures 11 to 13, on an i7-8700K and a TITAN Xp. Its sums of volumes are over all \
     inner nodes of a radix tree, in a unit that it does not name, so ratios are compared; the ratio of two of its sums is every entry of \
     its table 4. Its two levels are over 393 meshes, an instance each; ours over the meshes of the \
     file at hand. Of part 3a it prints ratios that its own sums contradict (0.803 where they give 0.99986): the sums are taken. Its Bunny \
     has twice the triangles of ours, its Dragon 108 fewer. Ours run on one thread.",
    "Table 4 counts nodes whose leaning box has less volume than the straight one, ours those whose leaning box was taken for its \
     lesser area. Ours puts the mesh's straight box under the top level, as the renderer does.",
    "The BIH thesis, on an i7 at 3.2 GHz that builds and a GTX 480 that traces. There is no bounding interval hierarchy and no kd-tree \
     here. In place of the first stands a tree whose nodes are halved in space on their longest axis, as its are, with boxes where it has \
     two planes; in place of the second one for which every split was tried, as its kd-tree's are chosen by the same heuristic, \
     but which cuts no triangle. So cost and care can be compared, structures cannot. Ours trace 256 x 256 rays; theirs \
     do not say how many.",
    "Novak's cheap tree is a radix tree that a GPU builds, his careful one that of a CPU by the surface area heuristic along one \
     axis from a few candidates; both are traced by the GPU. Ours are both built and traced on one thread of a CPU.",
    "Silva's study compares vector instructions, a GPU, threads, and no hierarchy with one; its charts are lost, what is quoted survives \
     in its text. Its hierarchy is a kd-tree, ours a wide tree.",
    "Orders are compared pair by pair: of a scene, passes by time, strategies by volume and by nodes that lean, a BIH and a kd-tree by \
     build and picture with the trees that stand in their place. Pairs to which the source gives one number are left out, and all \
     that it says without numbers.",
];

const ABSENT: [&str; 7] = [
    "Tables 3 to 5, Breakfast room, Buddha, Pirate ship and Sibenik: these models are not at hand.",
    "Figure 11 is table 5 in bars; figures 12 and 13 are pictures of box tests without numbers: ours stand as box tests a camera ray.",
    "Table 5, unbounded principal axes on a device: the dissertation's took more than a minute, here they stay on the CPU.",
    "Chart 2 of the BIH thesis for Dino, Bunny and Alien: its bars are lost.",
    "Novak's chart of a profile of nanoRT: it has no numbers.",
    "Silva's intersections a second in OpenCL: isolated tests on a GPU have no twin here; the chapter of kernels times a device on whole \
     rays.",
    "Silva's seconds over threads: the chart is lost, and its text names no scene and prints no seconds; the chapter of growth times builds \
     and rays on one to all threads.",
];

/// Scenes of the dissertation, or a lattice of few triangles where a test asks for little.
fn scenes(effort: Effort, names: &[&'static str], chapter: &mut Chapter) -> Result<Vec<(&'static str, Model)>> {
    let names = if effort == Effort::Tiny { &[subjects::SMALL] } else { names };
    let mut scenes = vec![];
    for &name in names {
        match subjects::load(name)? {
            Some(model) => scenes.push((name, model)),
            None => {
                let lacking = format!("{name}: the model is not at hand.");
                if !chapter.skipped.contains(&lacking) {
                    chapter.skipped.push(lacking);
                }
            }
        }
    }
    if scenes.is_empty() {
        // Generated, so always at hand.
        scenes.extend(subjects::load("truss")?.map(|model| ("truss", model)));
    }
    Ok(scenes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_opening_counts_what_stands_in_the_same_order() {
        let pairs =
            [("a", Pairs { n_same: 3, n_all: 4 }), ("b", Pairs::default()), ("c", Pairs { n_same: 1, n_all: 1 })];
        let said = over_all(7, 2, &pairs);
        assert!(said.starts_with("7 tables and 2 plots set what 3 sources print beside ours: of 5 pairs"), "{said}");
        assert!(said.ends_with("4 stand in the same order here (a: 3 of 4, c: 1 of 1)."), "{said}");
    }
}
