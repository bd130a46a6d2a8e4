//! Traversal costs on this machine: the constants by which the collapse into a wide BVH chooses nodes.
//!
//! ```text
//! scene -> BVHs of several configurations -> visit counts, seconds -> least squares -> nanoseconds per visit
//! ```
//!
//! BVHs of one scene that differ in node kinds and leaf sizes take times that differ with their visit counts. The cost
//! of a visit also depends on caches and branch prediction, which differ between scenes and are averaged within one.
//! The report therefore shows the spread between scenes and the residual of the fit.

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

/// Configurations in which every kind of visit is frequent in one BVH and rare in another.
fn configs() -> Vec<Config> {
    let usual = Config::preset(Preset::Balanced);
    let with_costs = |costs: Costs| Config { costs, ..usual };
    let costs = Costs::default();
    vec![
        usual,
        Config { oriented: false, ..usual },
        with_costs(Costs { oriented_node: 1.2, ..costs }),
        with_costs(Costs { oriented_node: 3.0, ..costs }),
        with_costs(Costs { max_leaf: 4, leaf: 0.6, ..costs }),
        with_costs(Costs { max_leaf: 32, leaf: 2.5, block: 0.2, ..costs }),
        Config { oriented: false, ..with_costs(Costs { max_leaf: 32, leaf: 3.0, block: 0.2, ..costs }) },
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
    let full_fit = fit(&scenes.iter().flat_map(|(_, groups)| groups.clone()).collect::<Vec<_>>());
    let full_fit = full_fit.context("the visit counts do not determine the costs")?;
    // The fit without each scene.
    let without = |skipped: usize| {
        let others = scenes.iter().enumerate().filter(|&(i, _)| i != skipped);
        fit(&others.flat_map(|(_, (_, groups))| groups.clone()).collect::<Vec<_>>())
    };
    let partial: Vec<Fit> = (0..scenes.len()).filter_map(without).collect();
    let names: Vec<&str> = scenes.iter().map(|(name, _)| name.as_str()).collect();
    write(out, options, &names, &full_fit, &partial);
    Ok(())
}

/// Counts and times of all configurations on one scene, for camera and diffuse rays; `None` if the scene is not
/// available.
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

fn write(out: &mut String, options: &Options, names: &[&str], full_fit: &Fit, partial: &[Fit]) {
    let Costs { aligned_node, oriented_node, leaf, block, .. } = Costs::default();
    let in_use = [aligned_node, oriented_node, leaf, block].map(|cost| format!("{cost}"));
    let _ = writeln!(
        out,
        "\n## Traversal costs\n\nOne thread, watertight, camera and diffuse rays, {} configurations of {}; {} rounds, medians. \
         Least squares of relative errors: time = factor of the scene and its rays * sum of visits times costs. Spread: half the \
         range of the fits without one scene. Residual: {:.1} % (root mean square), at worst {:.1} %.\n\n\
         | visit | ns | relative to aligned nodes | in use |\n| --- | --- | --- | --- |",
        configs().len(),
        names.join(", "),
        options.rounds,
        100.0 * full_fit.residual,
        100.0 * full_fit.worst,
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
            1e9 * full_fit.costs[i],
            1e9 * spread(&|fit| fit.costs[i]),
            ratio(full_fit),
            spread(&ratio),
            in_use.get(i).map_or("", |cost| cost),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_show_the_constants_in_use() {
        let fit = Fit { costs: [1e-8, 2e-8, 1e-8, 5e-9, 3e-8], residual: 0.01, worst: 0.02 };
        let options = Options::read(std::iter::empty()).expect("no options are valid options");
        let mut out = String::new();
        write(&mut out, &options, &[], &fit, &[fit]);
        assert!(out.contains("| oriented node | 20.0 (±0.0) | 2.00 (±0.00) | 2.2 |"), "{out}");
    }
}
