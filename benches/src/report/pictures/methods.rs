//! Integrators and samplers.

use anyhow::Result;
use canted_renderer::{Integrator, Pattern};

use super::race::{self, Clock, Racer};
use super::reference::{self, Reference};
use super::stage::Stage;
use crate::report::{effort::Effort, model::Chapter, samples::number};

const INTEGRATORS: [(&str, Integrator); 2] = [("hybrid", Integrator::Hybrid), ("path", Integrator::Path)];
const PATTERNS: [(&str, Pattern); 3] =
    [("random", Pattern::Random), ("stratified", Pattern::Stratified), ("sobol", Pattern::Sobol)];

/// Number of seeds per point.
pub(super) fn n_seeds(effort: Effort) -> u32 {
    effort.pick(3, 16, 16)
}

/// Sample counts of each method.
pub(super) fn samples(effort: Effort) -> Vec<u32> {
    (0..=effort.pick(1, 4, 6)).map(|log2| 1 << log2).collect()
}

/// A reference for an integrator, with a sampler other than `pattern`.
pub(super) fn reference(stage: &Stage, integrator: Integrator, pattern: Pattern, effort: Effort) -> Result<Reference> {
    let other = if pattern == Pattern::Sobol { Pattern::Stratified } else { Pattern::Sobol };
    Reference::new(stage, &stage.settings(integrator, other, effort.pick(8, 128, 512), 0), 8)
}

/// Adds the comparison of all integrators and samplers on a stage; returns its finding.
pub(super) fn add(chapter: &mut Chapter, stage: &Stage, effort: Effort) -> Result<String> {
    let mut references = vec![];
    for (_, integrator) in INTEGRATORS {
        for (_, pattern) in PATTERNS {
            references.push(reference(stage, integrator, pattern, effort)?);
        }
    }
    let pairs = INTEGRATORS.iter().flat_map(|integrator| PATTERNS.iter().map(move |pattern| (integrator, pattern)));
    let racers: Vec<Racer<'_>> = pairs
        .zip(&references)
        .map(|((&(integrator_name, integrator), &(pattern_name, pattern)), reference)| Racer {
            name: format!("{integrator_name}, {pattern_name}"),
            reference,
            build: &stage.build,
            settings: stage.settings(integrator, pattern, 1, 0),
            render: Box::new(|settings| reference::film(stage, settings)),
        })
        .collect();
    let samples = samples(effort);
    let courses = race::race(&racers, &samples, n_seeds(effort))?;
    race::show(chapter, &stage.sized(), &courses, &samples, Clock::Processor);
    let mut says = vec![];
    for (k, (integrator, _)) in INTEGRATORS.iter().enumerate() {
        let of_one: Vec<_> = courses[k * PATTERNS.len()..][..PATTERNS.len()].iter().collect();
        says.extend(race::best(&of_one, Clock::Processor));
        for (course, (pattern, _)) in of_one.iter().zip(PATTERNS) {
            let (efficiency, _) = course.efficiency(Clock::Processor);
            let relative = efficiency / of_one[0].efficiency(Clock::Processor).0;
            let key = format!("{}.{integrator}.{pattern}.efficiency-over-random", stage.name);
            chapter.claims.insert(key, number(relative));
        }
    }
    let [width, height] = stage.size;
    let most = samples[samples.len() - 1];
    Ok(format!("On {} ({width} x {height}, up to {most} samples) {}.", stage.name, says.join("; ")))
}
