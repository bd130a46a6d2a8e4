//! Structures: the same picture from each, bit for bit, in different time.

use anyhow::{Result, ensure};
use canted_film::Film;
use canted_lbvh::Strategy;
use canted_renderer::{Accel, Builder, Integrator, Pattern, StructureConfig, prepare, render};
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

/// The structures, the program's default first.
fn structures() -> [(&'static str, StructureConfig); 7] {
    let of = |accel| StructureConfig { accel, ..StructureConfig::default() };
    let wide = |preset, builder| of(Accel::Wide { preset, builder });
    let binary = |builder, strategy| of(Accel::Binary { strategy, builder: Some(builder) });
    [
        ("WideBvh, balanced", wide(Preset::Balanced, None)),
        ("WideBvh, fast", wide(Preset::Fast, None)),
        ("WideBvh, quality", wide(Preset::Quality, None)),
        ("WideBvh over obvhs", wide(Preset::Balanced, Some(Builder::Obvhs))),
        ("binary, radix, axis-aligned", binary(Builder::Lbvh, Strategy::Aabb)),
        ("binary, radix, combined", binary(Builder::Lbvh, Strategy::Combined)),
        ("binary, PLOC, combined", binary(Builder::Ploc, Strategy::Combined)),
    ]
}

/// Costs of one structure, a sample per round.
struct Cost {
    name: &'static str,
    build: Samples,
    /// Seconds of a picture that do not depend on the number of samples.
    setup: Samples,
    /// Seconds of one sample of every pixel.
    sample: Samples,
}

impl Cost {
    /// From the seconds of a build, of a picture with one sample and of one with `n`.
    fn of(name: &'static str, rounds: &[[f64; 3]], n: u32) -> Self {
        let samples = |of: &dyn Fn(&[f64; 3]) -> f64| Samples::from(rounds.iter().map(of).collect::<Vec<_>>());
        let each = |&[_, one, many]: &[f64; 3]| (many - one) / f64::from(n - 1);
        // A picture with one sample varies by more than its set-up; negative values become zero.
        let setup = |round: &[f64; 3]| (round[1] - each(round)).max(0.0);
        Self { name, build: samples(&|round| round[0]), setup: samples(&setup), sample: samples(&each) }
    }

    /// Seconds of a build and `n` samples per pixel.
    fn after(&self, n: f64) -> Samples {
        let fixed = self.build.with(&self.setup, |build, setup| build + setup);
        self.sample.with(&fixed, |sample, fixed| fixed + n * sample)
    }

    /// Samples per pixel from which `self`, with the more expensive build, is ahead of `cheap`, per round; `None` if it
    /// never is, or if their samples differ only by noise.
    fn crossing(&self, cheap: &Self) -> Option<Samples> {
        let gain = cheap.sample.with(&self.sample, |cheap, own| cheap - own);
        let more = self.after(0.0).with(&cheap.after(0.0), |own, cheap| own - cheap);
        let is_real = !self.sample.differs_by_noise(&cheap.sample) && gain.median() > 0.0;
        // Without a gain the lines never cross.
        let crossing = |more: f64, gain: f64| if gain > 0.0 { (more / gain).max(0.0).ceil() } else { f64::INFINITY };
        is_real.then(|| more.with(&gain, crossing))
    }
}

/// A crossing as its median and the interval of that median.
fn formatted(crossing: &Samples) -> String {
    let [low, high] = crossing.interval_of_median().unwrap_or_else(|| crossing.range());
    let end = |n: f64| if n.is_finite() { number(n) } else { "never".to_owned() };
    format!("{} ({} to {})", end(crossing.median()), end(low), end(high))
}

/// Adds the costs of structures on a stage; returns the finding.
pub(super) fn add(chapter: &mut Chapter, stage: &Stage, effort: Effort) -> Result<String> {
    let n_samples = effort.pick(2, 16, 32);
    let rounds = effort.pick(2, 5, 9);
    let mut seconds: Vec<Vec<[f64; 3]>> = vec![vec![]; structures().len()];
    let mut firsts: [Option<Film>; 2] = [None, None];
    for round in 0..=rounds {
        for ((name, config), seconds) in structures().iter().zip(&mut seconds) {
            let (prepared, build) = clock::time_all(|| prepare::<Watertight>(&stage.scene, config));
            let prepared = prepared?;
            let mut took = [build.cpu, 0.0, 0.0];
            for ((n, first), took) in [1, n_samples].into_iter().zip(&mut firsts).zip(&mut took[1..]) {
                let settings = stage.settings(Integrator::Path, Pattern::Sobol, n, 7);
                let cancel = AtomicBool::new(false);
                let (film, seconds) = clock::time_all(|| {
                    render(&stage.scene, &prepared.structure, &stage.camera, &settings, &|_, _| {}, &cancel)
                });
                let film = film?;
                let first = first.get_or_insert_with(|| film.clone());
                ensure!(
                    first.pixels() == film.pixels(),
                    "{}: the picture of '{name}' differs from the first",
                    stage.name
                );
                *took = seconds.cpu;
            }
            if round > 0 {
                seconds.push(took);
            }
        }
    }
    let costs: Vec<Cost> =
        structures().iter().zip(&seconds).map(|((name, _), rounds)| Cost::of(name, rounds, n_samples)).collect();
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
        x: Axis::log("samples per pixel"),
        y: Axis::log("processor seconds"),
        series: series.collect(),
    });
    let Some(cheapest) = costs.iter().min_by(|a, b| a.build.median().total_cmp(&b.build.median())) else {
        return String::new();
    };
    let mut table = Table::new(
        format!("{}: structures that give the same picture", stage.name),
        &[
            "structure",
            "build",
            "set-up",
            "one sample per pixel",
            &format!("faster than '{}' from, samples per pixel at {width} x {height} (interval)", cheapest.name),
        ],
    );
    for cost in costs {
        let crossing = cost.crossing(cheapest).map_or_else(|| "never, or noise".to_owned(), |n| formatted(&n));
        table.rows.push(vec![
            Cell::text(cost.name),
            Cell::measured(cost.build.scaled(1e3), "ms"),
            Cell::measured(cost.setup.scaled(1e3), "ms"),
            Cell::measured(cost.sample.scaled(1e3), "ms"),
            Cell::text(if std::ptr::eq(cost, cheapest) { "–".to_owned() } else { crossing }),
        ]);
    }
    chapter.tables.push(table);
    let best = |n: f64| first(&costs.iter().map(|cost| (cost.name, cost.after(n))).collect::<Vec<_>>());
    let builds: Vec<(&str, Samples)> = costs.iter().map(|cost| (cost.name, cost.build.clone())).collect();
    format!(
        "All {} structures give the same picture bit for bit; {} is the fastest to build, {} is the fastest to render 16 samples of \
         {width} x {height} pixels and {} to render 4096.",
        costs.len(),
        first(&builds),
        best(16.0),
        best(4096.0)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cost_of_a_sample_is_the_difference_between_pictures() {
        // A build of 8, a set-up of 3 and 2 per sample, twice as much in the last rounds.
        let rounds = |build: f64, sample: f64| -> Vec<[f64; 3]> {
            let round = |i| [build, 3.0 + sample, 3.0 + 16.0 * sample].map(|s| if i < 3 { s } else { 2.0 * s });
            (0..5).map(round).collect()
        };
        let cheap = Cost::of("cheap", &rounds(8.0, 2.0), 16);
        assert_eq!([&cheap.build, &cheap.setup, &cheap.sample].map(Samples::median), [8.0, 3.0, 2.0]);
        assert_eq!(cheap.after(100.0).median(), 211.0);
        // 30 more for half a second less per sample, in every round.
        let expensive = Cost::of("expensive", &rounds(38.0, 1.5), 16);
        assert_eq!(formatted(&expensive.crossing(&cheap).unwrap()), "60.0 (60.0 to 60.0)");
        assert!(cheap.crossing(&expensive).is_none() && cheap.crossing(&cheap).is_none());
    }
}
