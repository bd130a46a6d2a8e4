//! Our trees beside the strongest peers: rays a second, hits that differ, build time and memory.
//!
//! ```text
//! scene -> model -> sets of rays -> entries (ours, peers) -> built -> duel -> judge -> tables, JSON lines
//! ```

mod built;
pub(crate) mod duel;
#[cfg(feature = "peers")]
pub(crate) mod embree;
pub(crate) mod engine;
pub(crate) mod entries;
pub(crate) mod growth;
mod judge;
pub(crate) mod obvhs;
pub(crate) mod ours;
mod peers;
mod record;
pub(crate) mod sets;
mod subject;
mod tables;
#[cfg(all(feature = "peers", target_feature = "avx2"))]
pub(crate) mod tinybvh;

use std::io::Write;

use anyhow::Result;
use canted_trace::{Ray, Watertight};
use canted_wide::TriangleBvh;

use crate::{
    models::{self, Model},
    options::Options,
};
use {subject::Subject, tables::Tables};

pub(crate) use growth::section as growing;
pub(crate) use peers::{left_out as peers_left_out, methods as peers};
pub(crate) use record::Record;

/// The section that is run by this program itself, in a process of its own, to see whether tinybvh lives through it.
pub(crate) const TRIAL: &str = "tinybvh-trial";

/// Lets tinybvh trace the named scenes, in a build that has it.
pub(crate) fn trial(options: &Options) -> Result<()> {
    #[cfg(all(feature = "peers", target_feature = "avx2"))]
    tinybvh::trial(options)?;
    let _ = options;
    Ok(())
}

/// What is measured unless `--scenes` says otherwise: leaning and thin first, ordinary last.
const SCENES: [&str; 21] = [
    "truss",
    "scaffold",
    "scaffold_thin",
    "poles",
    "hair_thin_tubes",
    "hair_ribbons",
    "hair_thin_ribbons",
    "eiffel",
    "truss_bridge",
    "radio_tower",
    "tower_crane",
    "truss_stage",
    "tower_field",
    "sponza_rotated",
    "country_kitchen_rotated",
    "sponza",
    "country_kitchen",
    "bunny",
    "dragon_res2",
    "dragon_871k",
    "grid",
];

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let mut record = Record::create("wide.jsonl")?;
    let mut tables = Tables::default();
    for name in options.scenes(&SCENES) {
        let Some(model) = models::load(&name)? else {
            tables.absent(&name);
            continue;
        };
        // Everything is built and traced on one thread, which a pool of one thread sees to.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let subject = Subject::new(name, model, options)?;
        let measured = one.install(|| subject.measure(options))?;
        record.add(&measured)?;
        let mut stderr = std::io::stderr();
        stderr.write_all(measured.summary().as_bytes())?;
        tables.add(measured);
    }
    tables.write(out, options);
    Ok(())
}

/// Camera and diffuse rays of a model, whose hits `tree` tells.
pub(crate) fn closest_sets(model: &Model, tree: &TriangleBvh<Watertight>, resolution: u32) -> [Vec<Ray>; 2] {
    let camera = sets::camera(model, resolution);
    let mut hits = vec![None; camera.len()];
    tree.par_closest_hits(&camera, &mut hits);
    let [diffuse, _] = sets::secondary(model, &camera, &hits);
    [camera, diffuse]
}

/// Thread seconds of each tree and round for the nearest hits of `rays`, in turn.
pub(crate) fn closest_seconds(trees: Vec<TriangleBvh<Watertight>>, rays: &[Ray], rounds: usize) -> Vec<Vec<f64>> {
    let engines: Vec<Box<dyn engine::Engine>> = trees.into_iter().map(|tree| Box::new(tree) as _).collect();
    let (seconds, _) = duel::closest(&engines, rays, rounds);
    seconds.iter().map(|rounds| rounds.iter().map(|seconds| seconds.cpu).collect()).collect()
}
