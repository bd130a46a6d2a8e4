//! How build and traversal times grow with the number of triangles.
//!
//! Reads: scaffolds and grids of growing size. Writes: a table per scene, with fitted exponents.
//! Source: exponents are least-squares slopes of the logarithms of size and seconds.

use std::{fmt::Write, io::Write as _};

use anyhow::Result;
use canted_fixtures::{Mesh, grid, grid_cells, object_views, scaffold_nodes, scaffold_of};
use serde_json::json;

use super::{alternate, built, engine::Entry, entries, record::Record, sets};
use crate::{
    interleave::median,
    models::Model,
    options::{LOG2_TRIANGLES, Options},
};

/// Steps between measured sizes, as powers of two.
const STEP: usize = 2;
/// Pixels along a view's side: a quarter of the rays of the other tables, because the BVHs are large.
const RESOLUTION: u32 = canted_fixtures::RESOLUTION / 2;
/// BVHs of more triangles than this are built once.
const MANY: usize = 1 << 20;

pub(crate) type Generate = fn(u32) -> Mesh;

/// The scenes that exist in every size, given the logarithm of the maximum number of triangles.
pub(crate) const SCENES: [(&str, Generate); 2] =
    [("scaffold", |log2| scaffold_of(1, false, scaffold_nodes(log2))), ("grid", |log2| grid(5, grid_cells(log2)))];

/// The times of one size: seconds of each engine.
struct Size {
    n_triangles: usize,
    build: Vec<f64>,
    /// Seconds a camera ray.
    trace: Vec<f64>,
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    out.push_str(
        "\n## Growth\n\nOne thread, sizes from 2^10 triangles in factors of four. Build seconds, and nanoseconds per camera ray \
         (interleaved, medians); the last row has the exponents of the number of triangles, fitted by least squares to logarithms: a \
         build of exponent 1 is linear. A denser scaffold has more struts along each ray.\n",
    );
    let mut record = Record::create("growth.jsonl")?;
    for (name, generate) in SCENES {
        let (mut names, mut sizes) = (vec![], vec![]);
        for log2 in (*LOG2_TRIANGLES.start()..=options.max_log2).step_by(STEP) {
            let mesh = generate(log2);
            let views = object_views(&mesh);
            let model = Model { mesh, views, placed: None };
            let entries = entries::growing(&model, options);
            names = entries.iter().map(super::tables::title).collect();
            let size = measure(&model, &entries, options)?;
            let mut stderr = std::io::stderr();
            writeln!(stderr, "{name}, {} triangles: {:?} s, {:?} s per ray", size.n_triangles, size.build, size.trace)?;
            record.line(&json!({
                "scene": name, "triangles": size.n_triangles, "engines": names,
                "build_s": size.build, "trace_s_per_ray": size.trace,
            }))?;
            sizes.push(size);
        }
        table(out, name, &names, &sizes);
    }
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
fn measure(model: &Model, entries: &[Entry<'_>], options: &Options) -> Result<Size> {
    let n_triangles = model.mesh.triangles.len();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let camera = sets::camera(model, RESOLUTION);
    one.install(|| {
        let (engines, built): (Vec<_>, Vec<_>) = built::build(entries, n_triangles <= MANY)?.into_iter().unzip();
        let (seconds, _) = alternate::closest(&engines, &camera, options.rounds);
        let each = |rounds: &Vec<crate::clock::Seconds>| {
            let cpu: Vec<f64> = rounds.iter().map(|seconds| seconds.cpu).collect();
            median(&cpu) / camera.len() as f64
        };
        let build = built.iter().map(|built: &built::Built| built.one_thread).collect();
        Ok(Size { n_triangles, build, trace: seconds.iter().map(each).collect() })
    })
}

fn table(out: &mut String, scene: &str, names: &[String], sizes: &[Size]) {
    let _ = write!(out, "\n### {scene}\n\n| triangles |");
    for name in names {
        let _ = write!(out, " {name} |");
    }
    let _ = write!(out, "\n| --- |{}\n", " --- |".repeat(names.len()));
    for size in sizes {
        let _ = write!(out, "| {} |", size.n_triangles);
        for (build, trace) in size.build.iter().zip(&size.trace) {
            let _ = write!(out, " {build:.4} s, {:.0} ns |", trace * 1e9);
        }
        out.push('\n');
    }
    out.push_str("| exponent |");
    for i in 0..names.len() {
        let fit = |pick: fn(&Size) -> &Vec<f64>| {
            let points: Vec<_> = sizes.iter().map(|size| (size.n_triangles, pick(size)[i])).collect();
            exponent(&points)
        };
        let _ = write!(out, " {:.2}, {:.2} |", fit(|size| &size.build), fit(|size| &size.trace));
    }
    out.push('\n');
}

/// Slope of the least-squares line through the logarithms; not a number for fewer than two sizes.
#[expect(clippy::cast_precision_loss, reason = "two digits are shown")]
fn exponent(points: &[(usize, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs = || points.iter().map(|&(size, seconds)| ((size as f64).ln(), seconds.ln()));
    let mean = |pick: fn((f64, f64)) -> f64| logs().map(pick).sum::<f64>() / n;
    let (mean_x, mean_y) = (mean(|(x, _)| x), mean(|(_, y)| y));
    let covariance: f64 = logs().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let variance: f64 = logs().map(|(x, _)| (x - mean_x).powi(2)).sum();
    covariance / variance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn exponents_of_powers_are_found() {
        let points = |power: f64| [8, 64, 512].map(|n: usize| (n, 3.0 * (n as f64).powf(power)));
        for power in [0.0, 0.5, 1.0, 2.0] {
            assert!((exponent(&points(power)) - power).abs() < 1e-12);
        }
        assert!(exponent(&points(1.0)[..1]).is_nan());
    }

    #[test]
    fn scenes_come_near_their_sizes() {
        for (name, generate) in SCENES {
            let n_triangles = generate(14).triangles.len();
            assert!(n_triangles > 1 << 13 && n_triangles <= 1 << 14, "{name}: {n_triangles}");
        }
    }
}
