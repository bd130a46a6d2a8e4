//! WideBvh compared with the strongest peers: rays per second, differing hits, build time and memory.
//!
//! ```text
//! scene -> model -> sets of rays -> entries (ours, peers) -> built, traced in turn, compared -> tables, JSON lines
//! ```

#[cfg(feature = "peers")]
pub(crate) mod embree;
pub(crate) mod engine;
pub(crate) mod ours;
pub(crate) mod peers;
mod subject;
mod tables;
#[cfg(all(feature = "peers", target_feature = "avx2"))]
pub(crate) mod tinybvh;

use std::io::Write;

use anyhow::Result;
use canted_trace::Ray;
use canted_wide::TriangleBvh;
use tables::Tables;

use crate::{models, options::Options};

pub(crate) use engine::Promise;
pub(crate) use peers::{methods as peers, skipped as skipped_peers};
pub(crate) use subject::{Measured, Subject};
pub(crate) use tables::Record;

/// Traces the named scenes with tinybvh, if this build includes it.
pub(crate) fn trial(options: &Options) -> Result<()> {
    #[cfg(all(feature = "peers", target_feature = "avx2"))]
    tinybvh::trial(options)?;
    let _ = options;
    Ok(())
}

/// The default scenes: thin and diagonal ones first, ordinary ones last.
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
        // A pool of one thread builds and traces everything on one thread.
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

/// Thread seconds of each BVH and round for the nearest hits of `rays`, in turn.
pub(crate) fn closest_seconds(trees: Vec<TriangleBvh>, rays: &[Ray], rounds: usize) -> Vec<Vec<f64>> {
    let engines: Vec<Box<dyn engine::Engine>> = trees.into_iter().map(|tree| Box::new(tree) as _).collect();
    let (seconds, _) = engine::closest(&engines, rays, rounds);
    seconds.iter().map(|seconds| engine::cpu(seconds)).collect()
}
