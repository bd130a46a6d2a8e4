//! When oriented nodes pay: `WideBvh` with aligned nodes only, as built, and with oriented nodes wherever they are possible.
//!
//! ```text
//! scene -> rays, three BVHs of preset balanced -> traced in turn -> rates, ratios, the ratio that the build predicted
//! ```

use std::fmt::Write;

use anyhow::{Result, ensure};
use canted_trace::Intersect;
use canted_wide::{Config, Costs, Preset, TriangleBvh};

use crate::{
    models::{self, Kind, Model},
    options::Options,
    timing::{median, ratio, spread},
    wide::engine::{self, Engine},
};

/// Thin and diagonal scenes first, ordinary ones last.
const SCENES: [&str; 12] = [
    "truss",
    "scaffold",
    "poles",
    "hair_thin_tubes",
    "eiffel",
    "radio_tower",
    "sponza_rotated",
    "sponza",
    "country_kitchen",
    "bunny",
    "dragon_res2",
    "grid",
];

/// Factor on the cost of oriented nodes that makes the build choose them wherever they are possible.
const FORCED_COST: f32 = 0.1;

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let _ = writeln!(
        out,
        "\n## Oriented nodes\n\nWideBvh of preset balanced, watertight, one thread; the three BVHs take turns every 8,192 rays, {} rounds after a \
         warm-up. Aligned: million rays a second without oriented nodes, camera / diffuse / occlusion. As built and everywhere: rays a \
         second relative to aligned, medians over rounds with half the range. Predicted: the ratio of the traversal costs that the build \
         predicted. Everywhere: oriented nodes at a tenth of their cost. The hits of all three are equal.\n\n\
         | scene | triangles | oriented nodes | aligned | as built | predicted | everywhere |\n\
         | --- | --- | --- | --- | --- | --- | --- |",
        options.rounds
    );
    for name in options.scenes(&SCENES) {
        let Some(model) = models::load(&name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        // A pool of one thread builds and traces everything on one thread.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        out.push_str(&one.install(|| row(&name, &model, options))?);
    }
    Ok(())
}

fn row(name: &str, model: &Model, options: &Options) -> Result<String> {
    let mesh = &model.mesh;
    let usual = Config::preset(Preset::Balanced);
    let build = |config| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config);
    let aligned = build(Config { oriented: false, ..usual })?;
    let chosen = build(usual)?;
    let oriented_node = FORCED_COST * usual.costs.oriented_node;
    let everywhere = build(Config { costs: Costs { oriented_node, ..usual.costs }, ..usual })?;
    let resolution = canted_fixtures::RESOLUTION / if options.is_quick { 2 } else { 1 };
    let camera = models::camera(model, resolution);
    let mut hits = vec![None; camera.len()];
    chosen.closest_hits(&camera, &mut hits);
    let [diffuse, occlusion] = models::secondary(model, &camera, &hits);
    let predicted = chosen.predicted();
    let [n_aligned, n_oriented] = chosen.sizes().nodes;
    let engines: Vec<Box<dyn Engine>> = vec![Box::new(aligned), Box::new(chosen), Box::new(everywhere)];
    let mut cells: [Vec<String>; 3] = Default::default();
    for (kind, rays) in Kind::ALL.into_iter().zip([camera, diffuse, occlusion]) {
        let (seconds, answers) = engine::answers(&engines, &rays, options.rounds, kind == Kind::Occlusion);
        let is_equal = answers.iter().all(|answer| *answer == answers[0]);
        ensure!(is_equal, "{name}, {} rays: the kind of the nodes changes a hit", kind.name());
        let cpu: Vec<Vec<f64>> = seconds.iter().map(|seconds| engine::cpu(seconds)).collect();
        let rate = rays.len() as f64 * 1e-6 / median(&cpu[0]);
        cells[0].push(format!("{rate:.2}"));
        for (cells, other) in cells[1..].iter_mut().zip(&cpu[1..]) {
            let ratios: Vec<f64> = cpu[0].iter().zip(other).map(|(aligned, other)| aligned / other).collect();
            cells.push(format!("{:.2} (±{:.0} %)", ratio(&cpu[0], other), 100.0 * spread(&ratios)));
        }
    }
    let [rates, as_built, everywhere] = cells.map(|cells| cells.join(" / "));
    let share = 100.0 * n_oriented as f64 / (n_aligned + n_oriented).max(1) as f64;
    let predicted = predicted.aligned / predicted.chosen;
    let n_triangles = mesh.triangles.len();
    Ok(format!("| {name} | {n_triangles} | {share:.0} % | {rates} | {as_built} | {predicted:.2} | {everywhere} |\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::SMALL;

    #[test]
    fn a_row_has_rates_ratios_and_the_prediction() {
        let options = Options::read(["nodes", "--rounds", "1", "--quick"].map(str::to_owned).into_iter()).unwrap();
        let row = row("scaffold", &models::load(SMALL).unwrap().unwrap(), &options).unwrap();
        let cells: Vec<&str> = row.split(" | ").collect();
        assert_eq!((cells.len(), cells[4].matches('±').count()), (7, 3), "{row}");
        assert!(cells[5].parse::<f64>().unwrap() > 1.0, "{row}");
    }
}
