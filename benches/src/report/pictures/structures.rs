//! Structures: the same picture from each, bit for bit, at another price.

use anyhow::{Result, ensure};
use canted_lbvh::Strategy;
use canted_renderer::{Builder, Film, Integrator, Pattern, StructureConfig, prepare, render};
use canted_trace::Watertight;
use canted_wide::Preset;
use std::sync::atomic::AtomicBool;

use super::stage::Stage;
use crate::clock;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, first, number},
};

/// The structures, the program's own choice first.
fn structures() -> [(&'static str, StructureConfig); 7] {
    let usual = StructureConfig::default();
    let of = |builder, volumes| StructureConfig { builder, volumes, ..usual };
    [
        ("wide, balanced", StructureConfig { preset: Preset::Balanced, ..usual }),
        ("wide, fast", StructureConfig { preset: Preset::Fast, ..usual }),
        ("wide, quality", StructureConfig { preset: Preset::Quality, ..usual }),
        ("wide over obvhs", of(Builder::Obvhs, None)),
        ("binary, radix, axis-aligned", of(Builder::Lbvh, Some(Strategy::Aabb))),
        ("binary, radix, combined", of(Builder::Lbvh, Some(Strategy::Combined))),
        ("binary, PLOC, combined", of(Builder::Ploc, Some(Strategy::Combined))),
    ]
}

/// What one structure costs.
struct Cost {
    name: &'static str,
    build: Samples,
    /// Seconds of one sample of every pixel.
    sample: Samples,
}

impl Cost {
    /// Seconds until `n` samples a pixel are there.
    fn after(&self, n: f64) -> Samples {
        self.sample.with(&self.build, |sample, build| build + n * sample)
    }

    /// Samples a pixel from which `self`, dearer to build, is ahead of `cheap`; `None` where it never is, or where their
    /// samples differ by noise.
    fn crossing(&self, cheap: &Self) -> Option<f64> {
        let gain = cheap.sample.median() - self.sample.median();
        let is_real = !self.sample.is_noise_beside(&cheap.sample) && gain > 0.0;
        is_real.then(|| ((self.build.median() - cheap.build.median()) / gain).max(0.0))
    }
}

/// Adds what structures cost on a stage; what it shows.
pub(super) fn add(chapter: &mut Chapter, stage: &Stage, effort: Effort) -> Result<String> {
    let n_samples = effort.pick(1, 4, 16);
    let settings = stage.settings(Integrator::Path, Pattern::Sobol, n_samples, 7);
    let rounds = effort.pick(2, 5, 9);
    let mut costs: Vec<(Vec<f64>, Vec<f64>)> = vec![Default::default(); structures().len()];
    let mut first: Option<Film> = None;
    for round in 0..=rounds {
        for ((name, config), (builds, samples)) in structures().iter().zip(&mut costs) {
            let (prepared, build) = clock::time_all(|| prepare::<Watertight>(&stage.scene, config));
            let prepared = prepared?;
            let cancel = AtomicBool::new(false);
            let (film, took) = clock::time_all(|| {
                render(&stage.scene, &prepared.structure, &stage.camera, &settings, &|_, _| {}, &cancel)
            });
            let film = film?;
            let first = first.get_or_insert_with(|| film.clone());
            ensure!(first.pixels() == film.pixels(), "{}: the picture of '{name}' is not the first's", stage.name);
            if round > 0 {
                builds.push(build.cpu);
                samples.push(took.cpu / f64::from(n_samples));
            }
        }
    }
    let costs: Vec<Cost> = structures()
        .iter()
        .zip(costs)
        .map(|((name, _), (build, sample))| Cost { name, build: build.into(), sample: sample.into() })
        .collect();
    Ok(show(chapter, stage, &costs))
}

fn show(chapter: &mut Chapter, stage: &Stage, costs: &[Cost]) -> String {
    let numbers: Vec<f64> = (0..=12).map(|log2| f64::from(1 << log2)).collect();
    let series = costs.iter().map(|cost| Series {
        name: cost.name.to_owned(),
        points: numbers
            .iter()
            .map(|&n| Point { label: format!("{n} samples"), x: n.into(), y: cost.after(n) })
            .collect(),
        is_joined: true,
    });
    let [width, height] = stage.size;
    chapter.plots.push(Plot {
        title: format!("{}: seconds to build and to render {width} x {height}, by structure", stage.name),
        x: Axis::log("samples a pixel"),
        y: Axis::log("processor seconds"),
        series: series.collect(),
    });
    let Some(cheapest) = costs.iter().min_by(|a, b| a.build.median().total_cmp(&b.build.median())) else {
        return String::new();
    };
    let mut table = Table::new(
        format!("{}: structures that make the same picture", stage.name),
        &[
            "structure",
            "build",
            "a sample of every pixel",
            &format!("ahead of '{}' from, samples a pixel", cheapest.name),
        ],
    );
    for cost in costs {
        let crossing = cost.crossing(cheapest).map_or_else(|| "never, or noise".to_owned(), |n| number(n.ceil()));
        table.rows.push(vec![
            Cell::text(cost.name),
            Cell::measured(cost.build.scaled(1e3), "ms"),
            Cell::measured(cost.sample.scaled(1e3), "ms"),
            Cell::text(if std::ptr::eq(cost, cheapest) { "–".to_owned() } else { crossing }),
        ]);
    }
    chapter.tables.push(table);
    let best = |n: f64| first(&costs.iter().map(|cost| (cost.name, cost.after(n))).collect::<Vec<_>>());
    let builds: Vec<(&str, Samples)> = costs.iter().map(|cost| (cost.name, cost.build.clone())).collect();
    format!(
        "All {} structures make the same picture bit for bit; {} is built first, {} has it first at 16 samples of {width} x \
         {height} pixels and {} at 4096.",
        costs.len(),
        first(&builds),
        best(16.0),
        best(4096.0)
    )
}
