//! What a ray's visits cost on this machine: the constants that the collapse of wide trees weighs by.
//!
//! ```text
//! scene -> trees of several configurations -> counts of visits, seconds -> least squares -> nanoseconds a visit
//! ```
//!
//! Trees of one scene that differ in their kinds of nodes and sizes of leaves take times that differ with their counts.
//! Visits of one kind do not all take the same: what is in the cache, and whether a branch was foreseen, differs from
//! scene to scene and is averaged over within one. So the spread between scenes is shown, and what the fit leaves
//! unexplained.

mod fit;

use std::fmt::Write as _;

use anyhow::{Context, Result};
use canted_trace::{Ray, Watertight};
use canted_wide::{Config, Costs, Preset, TraversalCounts, TriangleBvh};
use serde_json::json;

use crate::{
    interleave::median,
    models,
    options::Options,
    wide::{self, Record},
};
use fit::{Fit, N, Sample, TERMS, fit};

/// Lattices, a scan, terrain and architecture.
const SCENES: [&str; 6] = ["truss", "scaffold", "bunny", "dragon_res2", "grid", "sponza"];

/// Trees that differ in what they are made of. Every kind of visit is frequent in one and rare in another, blocks and
/// leaves too.
fn configs() -> Vec<Config> {
    let usual = Config::preset(Preset::Balanced);
    let weighing = |costs: Costs| Config { costs, ..usual };
    let costs = Costs::default();
    vec![
        usual,
        Config { oriented: false, ..usual },
        weighing(Costs { oriented_node: 1.2, ..costs }),
        weighing(Costs { oriented_node: 3.0, ..costs }),
        weighing(Costs { max_leaf: 4, leaf: 0.6, ..costs }),
        weighing(Costs { max_leaf: 32, leaf: 2.5, block: 0.2, ..costs }),
        Config { oriented: false, ..weighing(Costs { max_leaf: 32, leaf: 3.0, block: 0.2, ..costs }) },
    ]
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let mut record = Record::create("costs.jsonl")?;
    let mut scenes = vec![];
    for name in options.scenes(&SCENES) {
        let Some(groups) = groups(&name, options)? else { continue };
        for sample in groups.iter().flatten() {
            record.line(&json!({ "scene": name, "counts": sample.counts, "seconds": sample.seconds }))?;
        }
        scenes.push((name, groups));
    }
    let whole = fit(&scenes.iter().flat_map(|(_, groups)| groups.clone()).collect::<Vec<_>>());
    let whole = whole.context("the trees' visits do not tell the kinds apart")?;
    // What each scene does to the answer.
    let without = |left_out: usize| {
        let others = scenes.iter().enumerate().filter(|&(i, _)| i != left_out);
        fit(&others.flat_map(|(_, (_, groups))| groups.clone()).collect::<Vec<_>>())
    };
    let partial: Vec<Fit> = (0..scenes.len()).filter_map(without).collect();
    let names: Vec<&str> = scenes.iter().map(|(name, _)| name.as_str()).collect();
    write(out, options, &names, &whole, &partial);
    Ok(())
}

/// Counts and times of all configurations on one scene, for camera and diffuse rays; `None` where it is not at hand.
fn groups(name: &str, options: &Options) -> Result<Option<Vec<Vec<Sample>>>> {
    let Some(model) = models::load(name)? else { return Ok(None) };
    let mesh = &model.mesh;
    let build = |config: &Config| TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, config);
    let trees = configs().iter().map(build).collect::<Result<Vec<_>, _>>()?;
    let mut groups = vec![];
    let resolution = canted_fixtures::RESOLUTION / if options.is_quick { 2 } else { 1 };
    for rays in wide::closest_sets(&model, &trees[0], resolution) {
        let seconds = wide::closest_seconds(trees.clone(), &rays, options.rounds);
        let sample = |(tree, seconds): (&TriangleBvh<Watertight>, &Vec<f64>)| Sample {
            counts: counts(&rays, &tree.traversal_counts(&rays)),
            seconds: median(seconds),
        };
        groups.push(trees.iter().zip(&seconds).map(sample).collect());
    }
    Ok(Some(groups))
}

/// In the order of [`TERMS`].
#[expect(clippy::cast_precision_loss, reason = "far below 2^52")]
fn counts(rays: &[Ray], visits: &TraversalCounts) -> [f64; N] {
    let [aligned, oriented] = visits.nodes;
    [aligned, oriented, visits.leaves, visits.blocks, rays.len() as u64].map(|n| n as f64)
}

fn write(out: &mut String, options: &Options, names: &[&str], whole: &Fit, partial: &[Fit]) {
    let Costs { aligned_node, oriented_node, leaf, block, .. } = Costs::default();
    let in_use = [aligned_node, oriented_node, leaf, block].map(|cost| format!("{cost}"));
    let _ = writeln!(
        out,
        "\n## Traversal costs\n\nOne thread, watertight, camera and diffuse rays, {} configurations of {}; {} rounds, medians. \
         Least squares of relative errors: time = slowness of the scene and its rays * sum of visits times costs. Spread: half \
         the range of fits that leave one scene out. The fit explains times up to {:.1} % (root of the mean square), at worst {:.1} %.\n\n\
         | visit | ns | in box nodes | in use |\n| --- | --- | --- | --- |",
        configs().len(),
        names.join(", "),
        options.rounds,
        100.0 * whole.residual,
        100.0 * whole.worst,
    );
    for (i, term) in TERMS.iter().enumerate() {
        let spread = |of: &dyn Fn(&Fit) -> f64| {
            let (least, most) = partial.iter().map(of).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
            (0.5 * (most - least)).max(0.0)
        };
        let ratio = |fit: &Fit| fit.costs[i] / fit.costs[0];
        let _ = writeln!(
            out,
            "| {term} | {:.1} (±{:.1}) | {:.2} (±{:.2}) | {} |",
            1e9 * whole.costs[i],
            1e9 * spread(&|fit| fit.costs[i]),
            ratio(whole),
            spread(&ratio),
            in_use.get(i).map_or("", |cost| cost),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_beside_the_constants_in_use() {
        let fit = Fit { costs: [1e-8, 2e-8, 1e-8, 5e-9, 3e-8], residual: 0.01, worst: 0.02 };
        let options = Options::read(std::iter::empty()).expect("no options are good options");
        let mut out = String::new();
        write(&mut out, &options, &[], &fit, &[fit]);
        assert!(out.contains("| oriented node | 20.0 (±0.0) | 2.00 (±0.00) | 1.7 |"), "{out}");
    }
}
