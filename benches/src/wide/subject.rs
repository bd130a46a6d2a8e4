//! One scene with its rays and their true answers, the measuring of all engines on it, and how often their answers differ.

use anyhow::Result;
use canted_bvh2::Bvh2;
use canted_tlas::Tlas;
use canted_trace::{Intersect, Ray};
use rayon::prelude::*;

use super::{
    engine::{self, Answers, Built, Engine, Owner, Promise},
    ours,
};
use crate::{
    models::{self, Kind, Model},
    options::Options,
    timing::Seconds,
};

/// BVHs that return the same hits as testing every triangle.
struct Truth {
    flat: Bvh2,
    /// For engines with instances: transforms round differently, so other rays graze past.
    placed: Option<Tlas<Bvh2>>,
}

impl Truth {
    /// The true answers, flat and placed.
    fn answers(&self, kind: Kind, rays: &[Ray]) -> [Answers; 2] {
        let all: [&(dyn Intersect + Sync); 2] =
            [&self.flat, self.placed.as_ref().map_or(&self.flat as _, |placed| placed as _)];
        all.map(|bvh| match kind {
            Kind::Occlusion => Answers::Occluded(rays.par_iter().map(|ray| bvh.occluded(ray)).collect()),
            Kind::Camera | Kind::Diffuse => Answers::Closest(rays.par_iter().map(|ray| bvh.closest_hit(ray)).collect()),
        })
    }
}

/// A scene, ready for measuring.
pub(crate) struct Subject {
    name: String,
    model: Model,
    sets: Vec<Set>,
}

/// Rays of one kind with their answers, flat and placed.
struct Set {
    kind: Kind,
    rays: Vec<Ray>,
    truth: [Answers; 2],
}

impl Subject {
    /// Makes rays and true answers, on all threads.
    pub(crate) fn new(name: String, model: Model, options: &Options) -> Result<Self> {
        let resolution = canted_fixtures::RESOLUTION / if options.is_quick { 2 } else { 1 };
        let flat = ours::one_level(&model.mesh)?;
        let placed = model.placed.as_ref().map(ours::two_levels).transpose()?;
        let truth = Truth { flat, placed };
        let camera = models::camera(&model, resolution);
        let mut hits = vec![None; camera.len()];
        truth.flat.par_closest_hits(&camera, &mut hits);
        let [diffuse, occlusion] = models::secondary(&model, &camera, &hits);
        let set = |(kind, rays): (Kind, Vec<Ray>)| Set { kind, truth: truth.answers(kind, &rays), rays };
        let sets = Kind::ALL.into_iter().zip([camera, diffuse, occlusion]).map(set).collect();
        Ok(Self { name, model, sets })
    }

    /// Builds every engine and traces every set, on this thread.
    pub(crate) fn measure(self, options: &Options) -> Result<Measured> {
        let entries = ours::with_peers(&self.name, &self.model, options);
        let (engines, built): (Vec<_>, Vec<_>) = engine::build_all(&entries, !options.is_quick)?.into_iter().unzip();
        let sets = self.sets.iter().map(|set| set.measure(&engines, options, |i| entries[i].is_placed)).collect();
        let contestants = entries
            .iter()
            .zip(built)
            .map(|(entry, built)| Contestant {
                name: entry.name.clone(),
                owner: entry.owner,
                promise: entry.promise,
                built,
            })
            .collect();
        let n_triangles = self.model.mesh.triangles.len();
        drop(entries);
        Ok(Measured { scene: self.name, n_triangles, contestants, sets })
    }
}

impl Set {
    fn measure(
        &self,
        engines: &[Box<dyn Engine>],
        options: &Options,
        is_placed: impl Fn(usize) -> bool,
    ) -> MeasuredSet {
        let (seconds, answers) = engine::answers(engines, &self.rays, options.rounds, self.kind == Kind::Occlusion);
        let verdict = |(i, answers)| differing(&self.truth[usize::from(is_placed(i))], answers);
        let verdicts = answers.iter().enumerate().map(verdict).collect();
        MeasuredSet { kind: self.kind, n_rays: self.rays.len(), seconds, verdicts }
    }
}

/// An engine that was measured.
pub(crate) struct Contestant {
    pub(crate) name: String,
    pub(crate) owner: Owner,
    pub(crate) promise: Promise,
    pub(crate) built: Built,
}

/// All measurements of one scene.
pub(crate) struct Measured {
    pub(crate) scene: String,
    pub(crate) n_triangles: usize,
    pub(crate) contestants: Vec<Contestant>,
    pub(crate) sets: Vec<MeasuredSet>,
}

/// All measurements of one set of rays; vectors are in contestant order.
pub(crate) struct MeasuredSet {
    pub(crate) kind: Kind,
    pub(crate) n_rays: usize,
    pub(crate) seconds: Vec<Vec<Seconds>>,
    pub(crate) verdicts: Vec<Verdict>,
}

/// Greatest difference of `t`, relative to the true one, that rounding explains at these distances.
///
/// A Möller-Trumbore test in `f32` accumulates about ten roundings of 6e-8 relative to coordinates; grazing and distant
/// rays multiply them. A difference beyond a hundred times that counts as another hit.
const T_TOLERANCE: f32 = 1e-4;

/// Answers that differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// The engine misses an existing hit.
    pub(crate) lost: usize,
    /// The engine reports a hit where there is none.
    pub(crate) invented: usize,
    /// Both hit, at distances that rounding does not explain.
    pub(crate) elsewhere: usize,
}

/// Compares answers.
fn differing(truth: &Answers, answers: &Answers) -> Verdict {
    let mut verdict = Verdict::default();
    match (truth, answers) {
        (Answers::Closest(truth), Answers::Closest(answers)) => {
            for (truth, answer) in truth.iter().zip(answers) {
                match (truth, answer) {
                    (Some(_), None) => verdict.lost += 1,
                    (None, Some(_)) => verdict.invented += 1,
                    (Some(truth), Some(answer)) if !is_near(truth.t, answer.t) => verdict.elsewhere += 1,
                    _ => {}
                }
            }
        }
        (Answers::Occluded(truth), Answers::Occluded(answers)) => {
            let count =
                |is: bool| truth.iter().zip(answers).filter(|&(&truth, &answer)| truth == is && answer != is).count();
            (verdict.lost, verdict.invented) = (count(true), count(false));
        }
        _ => unreachable!("both are of the same kind of rays"),
    }
    verdict
}

/// Whether rounding explains the difference; it never explains a NaN.
fn is_near(truth: f32, t: f32) -> bool {
    (truth - t).abs() <= T_TOLERANCE * truth
}

#[cfg(test)]
mod tests {
    use canted_obb::PrimId;
    use canted_trace::{Hit, InstanceId, Side};

    use super::*;

    fn at(t: f32) -> Option<Hit> {
        Some(Hit { t, u: 0.0, v: 0.0, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front })
    }

    #[test]
    fn each_difference_is_counted_once() {
        let truth = Answers::Closest(vec![None, None, at(1.0), at(1.0), at(1.0), at(1.0)]);
        let answers = Answers::Closest(vec![None, at(1.0), None, at(1.000_05), at(1.001), at(f32::NAN)]);
        assert_eq!(differing(&truth, &answers), Verdict { lost: 1, invented: 1, elsewhere: 2 });
        assert_eq!(differing(&truth, &truth), Verdict::default());
        let [truth, answers] = [[true, true, false, false], [true, false, false, true]].map(|all| all.to_vec());
        let verdict = differing(&Answers::Occluded(truth), &Answers::Occluded(answers));
        assert_eq!(verdict, Verdict { lost: 1, invented: 1, elsewhere: 0 });
    }
}
