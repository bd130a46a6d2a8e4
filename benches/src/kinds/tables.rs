//! The measurements as Markdown.
//!
//! Reads: everything measured. Writes: a row a kind and preset, geometric means, kinds below the limit, wrong hits.
//! Holds: every ratio of rays is taken within a round, and its median over rounds is shown.

use std::fmt::Write;

use canted_fixtures::kinds::{Family, RayKind};

use crate::{
    kinds::{Difference, MODELS, Measured, OURS, Set},
    options::Options,
    timing::{median, ratio},
    wide::{
        engine::cpu,
        ours::{ALIGNED, BALANCED},
    },
};

/// A kind on which any kind of rays is slower than this, relative to Embree's default, is listed.
const LIMIT: f64 = 0.9;
/// Rays a second that a plan must reach relative to the other.
const PLAN_LIMIT: f64 = 0.97;
/// Wrong hits that are listed of each kind and preset; the JSON lines have all.
const N_LISTED: usize = 3;

/// What was measured, kind by kind.
#[derive(Default)]
pub(super) struct Tables {
    measured: Vec<Measured>,
}

/// A mode of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Medium,
    High,
    Robust,
}

impl Measured {
    fn preset(&self, i: usize) -> &str {
        self.engines[i].0.strip_prefix(OURS).unwrap_or(&self.engines[i].0).trim_start()
    }

    /// Our engines that are presets.
    fn presets(&self) -> impl Iterator<Item = usize> {
        self.ours().filter(|&i| self.engines[i].0 != ALIGNED)
    }

    /// Rays a second of `balanced` relative to the same without oriented nodes: geometric mean over the kinds of rays.
    fn plan(&self) -> Option<f64> {
        let engine = |name| self.engines.iter().position(|(found, _)| found == name);
        let (chosen, aligned) = (engine(BALANCED)?, engine(ALIGNED)?);
        let of = |set: &Set| ratio(&cpu(&set.seconds[aligned]), &cpu(&set.seconds[chosen]));
        mean(self.sets.iter().map(|set| Some(of(set))))
    }

    /// Our engines.
    fn ours(&self) -> impl Iterator<Item = usize> {
        (0..self.engines.len()).filter(|&i| self.engines[i].0.starts_with(OURS))
    }

    fn embree(&self, mode: Mode) -> Option<usize> {
        let word = match mode {
            Mode::Medium => "medium",
            Mode::High => "high",
            Mode::Robust => "robust",
        };
        self.engines.iter().position(|(name, _)| name.starts_with("Embree") && name.ends_with(word))
    }

    /// Rays a second relative to a mode of Embree.
    fn speed(&self, i: usize, rays: RayKind, mode: Mode) -> Option<f64> {
        let set = self.sets.iter().find(|set| set.kind == rays)?;
        Some(ratio(&cpu(&set.seconds[self.embree(mode)?]), &cpu(&set.seconds[i])))
    }

    /// Million rays a second.
    fn rate(&self, i: usize, rays: RayKind) -> Option<f64> {
        let set = self.sets.iter().find(|set| set.kind == rays)?;
        Some(set.n_rays as f64 / median(&cpu(&set.seconds[i])) * 1e-6)
    }

    /// Build time on one or two threads relative to a mode of Embree.
    fn build(&self, i: usize, mode: Mode, n_threads: usize) -> Option<f64> {
        let seconds = |engine: usize| {
            let built = &self.engines[engine].1;
            if n_threads == 2 { built.two_threads } else { Some(built.one_thread) }
        };
        Some(seconds(i)? / seconds(self.embree(mode)?)?)
    }

    fn bytes(&self, i: usize) -> Option<f64> {
        Some(self.engines[i].1.n_bytes? as f64 / self.n_triangles as f64)
    }

    /// The kinds of rays that are below the limit, with their ratios.
    fn slow(&self, i: usize) -> Vec<String> {
        let below = |rays: RayKind| {
            let speed = self.speed(i, rays, Mode::Medium).filter(|&speed| speed < LIMIT)?;
            Some(format!("{} {speed:.2}", rays.name()))
        };
        RayKind::ALL.into_iter().filter_map(below).collect()
    }

    /// The table's row of one of our engines.
    fn row(&self, i: usize) -> String {
        let mut row = format!("| {} | {} | {} |", self.name, self.n_triangles, self.preset(i));
        for rays in RayKind::ALL {
            let cell = match self.speed(i, rays, Mode::Medium) {
                Some(speed) => format!("{speed:.2}"),
                None => self.rate(i, rays).map_or_else(dash, |rate| format!("{rate:.2} M/s")),
            };
            let _ = write!(row, " {cell} |");
        }
        for mode in [Mode::Medium, Mode::High] {
            let _ = write!(row, " {} |", number(self.build(i, mode, 1), 1));
        }
        let _ = write!(row, " {} | {} |", number(self.bytes(i), 0), self.verdict(i));
        row
    }

    fn verdict(&self, i: usize) -> String {
        let Some(check) = self.checks.get(i) else { return dash() };
        match check.differences.len() {
            0 => "yes".to_owned(),
            n => format!("**no**, {n} of {}", check.n_looped),
        }
    }
}

fn dash() -> String {
    "–".to_owned()
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(dash, |value| format!("{value:.digits$}"))
}

/// Progress lines of a kind.
pub(super) fn summary(measured: &Measured) -> String {
    let mut text = String::new();
    for i in measured.ours() {
        let _ = writeln!(text, "{}", measured.row(i));
        wrong(&mut text, measured, i);
    }
    text
}

/// The first wrong hits of an engine.
fn wrong(out: &mut String, measured: &Measured, i: usize) {
    let differences = measured.checks.get(i).map_or(&[][..], |check| &check.differences);
    for Difference { rays, index, ray, truth, found } in differences.iter().take(N_LISTED) {
        let _ = writeln!(
            out,
            "* {}, {}, {} ray {index}: {ray:?}; loop {truth:?}; found {found}",
            measured.name,
            measured.preset(i),
            rays.name(),
        );
    }
}

/// Geometric mean of what is there; `None` if nothing is.
fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let logarithms: Vec<f64> = values.flatten().map(f64::ln).collect();
    (!logarithms.is_empty()).then(|| (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp())
}

impl Tables {
    /// Adds a kind.
    pub(super) fn add(&mut self, measured: Measured) {
        self.measured.push(measured);
    }

    /// Writes the section.
    pub(super) fn write(&self, out: &mut String, options: &Options) {
        let n_looped: usize =
            self.measured.iter().map(|measured| measured.checks.first().map_or(0, |check| check.n_looped)).sum();
        let n_rays: usize = self.measured.iter().flat_map(|measured| &measured.sets).map(|set| set.n_rays).sum();
        let _ = write!(
            out,
            "\n## Generated kinds of scenes\n\nSeed {}; one thread; engines take turns every 8,192 rays, {} rounds after a warm-up. \
             Columns camera to random: rays a second relative to Embree's default mode (medium build, not robust), thread time, \
             median over rounds; above 1 is faster{}. Builds: wall time relative to Embree medium and high, above 1 is slower. \
             Hits: all bits equal those of a loop over all triangles, and over all instances, on {n_looped} of {n_rays} rays: \
             evenly chosen ones, and those on which our presets or Embree disagree.\n\n| kind | triangles | preset |",
            options.seed,
            options.rounds,
            if cfg!(feature = "peers") { "" } else { "; without Embree: million rays a second" },
        );
        for rays in RayKind::ALL {
            let _ = write!(out, " {} |", rays.name());
        }
        let _ = writeln!(out, " build / medium | build / high | B a triangle | hits equal |\n|{}", " --- |".repeat(11));
        for measured in &self.measured {
            for i in measured.presets() {
                let _ = writeln!(out, "{}", measured.row(i));
            }
        }
        for family in [Family::Ordinary.name(), Family::Fresh.name(), MODELS] {
            self.means(out, family);
        }
        self.below(out);
        self.plans(out);
        self.wrongs(out);
    }

    /// Geometric means over a family.
    fn means(&self, out: &mut String, family: &str) {
        let all: Vec<&Measured> = self.measured.iter().filter(|measured| measured.family == family).collect();
        let Some(first) = all.first().filter(|first| first.embree(Mode::Medium).is_some()) else { return };
        let _ = writeln!(
            out,
            "\n### Geometric means over {} {family}{}\n\nCells of rays: relative to Embree default, in brackets to Embree \
             robust. Builds on one thread, in brackets on two; the part of one on two threads in which one works alone.\n\n| engine | camera | bounce | occlusion | random | least of all \
             | build / medium | build / high | alone | B a triangle |\n|{}",
            all.len(),
            if family == MODELS { "" } else { " kinds" },
            " --- |".repeat(10),
        );
        for i in 0..first.engines.len() {
            let _ = write!(out, "| {} |", first.engines[i].0);
            for rays in RayKind::ALL {
                let speed = |mode| number(mean(all.iter().map(|m| m.speed(i, rays, mode))), 2);
                let _ = write!(out, " {} ({}) |", speed(Mode::Medium), speed(Mode::Robust));
            }
            let speeds = all.iter().flat_map(|m| RayKind::ALL.map(|rays| (m.speed(i, rays, Mode::Medium), &m.name)));
            let least = speeds.filter_map(|(speed, name)| Some((speed?, name))).min_by(|a, b| a.0.total_cmp(&b.0));
            let _ = write!(out, " {} |", least.map_or_else(dash, |(speed, name)| format!("{speed:.2} {name}")));
            for mode in [Mode::Medium, Mode::High] {
                let build = |n_threads| number(mean(all.iter().map(|m| m.build(i, mode, n_threads))), 2);
                let _ = write!(out, " {} ({}) |", build(1), build(2));
            }
            let parts: Vec<f64> = all.iter().filter_map(|m| m.engines[i].1.serial_part()).collect();
            let alone = if parts.is_empty() { dash() } else { format!("{:.0} %", 100.0 * median(&parts)) };
            let _ = writeln!(out, " {alone} | {} |", number(mean(all.iter().map(|m| m.bytes(i))), 0));
        }
    }

    /// The kinds that are slower than the limit.
    fn below(&self, out: &mut String) {
        if self.measured.iter().all(|measured| measured.embree(Mode::Medium).is_none()) {
            return;
        }
        let _ = writeln!(out, "\n### Below {LIMIT} of Embree's default\n");
        let presets: Vec<&str> = self.measured.first().map_or(vec![], |m| m.presets().map(|i| m.preset(i)).collect());
        for (i, preset) in presets.into_iter().enumerate() {
            let slow = self.measured.iter().filter_map(|measured| {
                let rays = measured.slow(i);
                (!rays.is_empty()).then(|| format!("{} ({})", measured.name, rays.join(", ")))
            });
            let slow: Vec<String> = slow.collect();
            let kinds = if slow.is_empty() { "none".to_owned() } else { slow.join("; ") };
            let _ = writeln!(out, "* {preset}: {kinds}.");
        }
    }

    /// Whether oriented nodes are used where they pay: the better of two plans is the one with them or the one without.
    fn plans(&self, out: &mut String) {
        let plans = self.measured.iter().filter_map(|m| Some((&*m.name, m.plan()?)));
        let plans: Vec<(&str, f64)> = plans.collect();
        let Some(all) = mean(plans.iter().map(|&(_, speed)| Some(speed))) else { return };
        let text = |chosen: Vec<&(&str, f64)>| {
            let list: Vec<String> = chosen.iter().map(|(name, speed)| format!("{name} {speed:.2}")).collect();
            if list.is_empty() { "none".to_owned() } else { list.join(", ") }
        };
        let _ = writeln!(
            out,
            "\n### The chosen nodes\n\nRays a second of `balanced` relative to `balanced` without oriented nodes, geometric mean over \
             the kinds of rays. Over {} kinds: {all:.2}.\n\n* Below {PLAN_LIMIT}, where aligned nodes alone are better: {}.\n* \
             Above {}: {}.",
            plans.len(),
            text(plans.iter().filter(|(_, speed)| *speed < PLAN_LIMIT).collect()),
            number(Some(1.0 / PLAN_LIMIT), 2),
            text(plans.iter().filter(|(_, speed)| *speed > 1.0 / PLAN_LIMIT).collect()),
        );
    }

    fn wrongs(&self, out: &mut String) {
        let mut list = String::new();
        for measured in &self.measured {
            for i in measured.ours() {
                wrong(&mut list, measured, i);
            }
        }
        if !list.is_empty() {
            let _ = write!(out, "\n### Wrong hits\n\n{list}");
        }
    }
}
