//! The sources: what four theses print, and the same measured here, side by side as far as the structures exist.
//!
//! Their machines are not ours: what can be compared are shares and ratios, and the order of things.

mod boxes;
mod builders;
mod passes;
mod simd;

use anyhow::Result;

use super::effort::Effort;
use super::model::{Chapter, sentences};
use super::subjects;
use crate::models::Model;

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "sources", title: "The sources: theirs and ours", ..Chapter::default() };
    let mut says = vec![];
    for part in [boxes::add, passes::add, builders::add, simd::add] {
        says.push(part(&mut chapter, effort)?);
    }
    chapter.says = sentences(&says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.skipped.extend(ABSENT.map(str::to_owned));
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "The dissertation: Sabino 2020, tables 3 to 5 and figures 11 to 13, on an i7-8700K; its numbers of volumes are ratios of sums over \
     all inner nodes of a radix tree, its passes those on the CPU. Its Bunny has 144,046 triangles, its Sponza and Dragon are ours but for \
     108 triangles of the latter. Ours run on one thread.",
    "The BIH thesis, table 1, and Novak's tables set a careful builder beside a cheap one: milliseconds to build and to trace a picture. \
     Ours are the radix tree and the swept surface area heuristic, meshes of about their sizes, 1024 x 1024 camera rays on one thread.",
    "Silva's study compares vector instructions with one lane, and threads; its charts are lost, these ratios survive.",
];

const ABSENT: [&str; 4] = [
    "Bounding interval hierarchies and kd-trees of the BIH thesis and of Silva's study: there are none here; builders of unlike care take \
     their place.",
    "Figure 11's bars on the dissertation's GPU: `canted stats --device gpu` has the passes of a device.",
    "Figures 12 and 13 carry no numbers; ours stand in the table of box tests.",
    "Novak's frames on three GPUs: no such device is here.",
];

/// Scenes of the dissertation, or a lattice of few triangles where a test asks for little.
fn scenes(effort: Effort, names: &[&'static str], chapter: &mut Chapter) -> Result<Vec<(&'static str, Model)>> {
    let names = if effort == Effort::Tiny { &[subjects::SMALL] } else { names };
    let mut scenes = vec![];
    for &name in names {
        match subjects::load(name)? {
            Some(model) => scenes.push((name, model)),
            None => chapter.skipped.push(format!("{name}: the model is not at hand.")),
        }
    }
    if scenes.is_empty() {
        // Generated, so always at hand.
        scenes.extend(subjects::load("truss")?.map(|model| ("truss", model)));
    }
    Ok(scenes)
}
