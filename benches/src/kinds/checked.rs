//! Our hits compared with a loop over all triangles.
//!
//! Reads: the answers of all engines. Writes: differences of ours, by ray.
//! Holds: all bits of a hit are compared. Three sets of rays enter the loop: evenly chosen ones, those on which our
//! presets disagree, and those on which Embree disagrees with ours, where a lost hit is most likely.

use canted_fixtures::Mesh;
use canted_obb::Affine;
use canted_tests::brute;
use canted_trace::{Hit, Kernel, Ray, Watertight};
use rayon::prelude::*;

use crate::{
    kinds::{Check, Difference, Measured, OURS, Set, Subject},
    models::Model,
    wide::engine::Answers,
};

/// Triangles that the loop tests for each set of rays, about: a second of processor time.
const BUDGET: usize = 40_000_000;
/// Rays that are looped over at least and at most, in each of the three sets.
const N_LOOPED: [usize; 2] = [16, 512];
/// Distances of Embree and ours that differ by more than this, relatively, are looked at.
const T_DIFFERENCE: f32 = 1e-4;

impl Measured {
    /// Compares our answers with the loop, on all threads, and drops them.
    pub(super) fn check(mut self, subject: &Subject) -> Self {
        let truth = Truth::new(&subject.model);
        let ours: Vec<usize> = (0..self.engines.len()).filter(|&i| self.engines[i].0.starts_with(OURS)).collect();
        self.checks = vec![Check::default(); ours.len()];
        for (set, (_, rays)) in self.sets.iter_mut().zip(&subject.sets) {
            let looped = chosen(set, &ours, truth.n_triangles());
            let hits: Vec<Option<Hit>> = looped.par_iter().map(|&ray| truth.closest(&rays[ray])).collect();
            for (check, &engine) in self.checks.iter_mut().zip(&ours) {
                check.n_looped += looped.len();
                check.n_compared += rays.len();
                let answers = &set.answers[engine];
                let wrong = looped.iter().zip(&hits).filter(|&(&ray, truth)| !answers.is(ray, truth.as_ref()));
                check.differences.extend(wrong.map(|(&index, &truth)| Difference {
                    rays: set.kind,
                    index,
                    ray: rays[index],
                    truth,
                    found: answers.text(index),
                }));
            }
            set.answers.clear();
        }
        self
    }
}

/// The rays that enter the loop, in order.
fn chosen(set: &Set, ours: &[usize], n_triangles: usize) -> Vec<usize> {
    let [least, most] = N_LOOPED;
    let n = (BUDGET / 3 / n_triangles.max(1)).clamp(least, most).min(set.n_rays);
    let even = (0..n).map(|i| i * set.n_rays / n);
    let Some((first, others)) = ours.split_first() else { return vec![] };
    let first = &set.answers[*first];
    let differ = |ray: &usize| others.iter().any(|&other| !first.equals(&set.answers[other], *ray));
    let doubt = |ray: &usize| {
        let peers = (0..set.answers.len()).filter(|engine| !ours.contains(engine));
        peers.into_iter().any(|peer| first.is_doubtful(&set.answers[peer], *ray))
    };
    let differing = (0..set.n_rays).filter(differ).take(n);
    let doubtful = (0..set.n_rays).filter(doubt).take(n);
    let mut rays: Vec<usize> = even.chain(differing).chain(doubtful).collect();
    rays.sort_unstable();
    rays.dedup();
    rays
}

impl Answers {
    /// Whether the answer for a ray is the true one.
    fn is(&self, ray: usize, truth: Option<&Hit>) -> bool {
        match self {
            Self::Closest(hits) => hits[ray].as_ref() == truth,
            Self::Occluded(occluded) => occluded[ray] == truth.is_some(),
        }
    }

    fn equals(&self, other: &Self, ray: usize) -> bool {
        match (self, other) {
            (Self::Closest(a), Self::Closest(b)) => a[ray] == b[ray],
            (Self::Occluded(a), Self::Occluded(b)) => a[ray] == b[ray],
            _ => false,
        }
    }

    /// Whether a peer's answer, whose triangle test rounds otherwise, makes ours worth a look.
    fn is_doubtful(&self, peer: &Self, ray: usize) -> bool {
        match (self, peer) {
            (Self::Closest(ours), Self::Closest(peers)) => match (ours[ray], peers[ray]) {
                (None, None) => false,
                (Some(ours), Some(peer)) => {
                    let is_near = (ours.t - peer.t).abs() <= T_DIFFERENCE * ours.t;
                    !is_near
                }
                _ => true,
            },
            _ => !self.equals(peer, ray),
        }
    }

    fn text(&self, ray: usize) -> String {
        match self {
            Self::Closest(hits) => format!("{:?}", hits[ray]),
            Self::Occluded(occluded) => format!("{:?}", occluded[ray]),
        }
    }
}

type Records = Vec<<Watertight as Kernel>::Record>;

/// The triangles of a model, for a loop. No box is tested; rays enter object space as `canted-tlas` documents it.
struct Truth {
    meshes: Vec<Records>,
    /// The mesh and the transform of each instance; empty for one mesh in world space.
    instances: Vec<(usize, Affine)>,
    n_triangles: usize,
}

impl Truth {
    fn new(model: &Model) -> Self {
        let records = |mesh: &Mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
        let Some(placed) = &model.placed else {
            let meshes = vec![records(&model.mesh)];
            return Self { n_triangles: meshes[0].len(), meshes, instances: vec![] };
        };
        let meshes: Vec<Records> = placed.meshes.iter().map(records).collect();
        let instances: Vec<_> =
            placed.instances.iter().map(|instance| (instance.blas as usize, instance.world_from_object)).collect();
        Self { n_triangles: instances.iter().map(|&(mesh, _)| meshes[mesh].len()).sum(), meshes, instances }
    }

    /// Triangles that a loop tests.
    fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// The closest hit, ties to the lowest (instance, primitive).
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        if self.instances.is_empty() {
            return brute::closest_hit::<Watertight>(&self.meshes[0], ray);
        }
        let transforms: Vec<Affine> = self.instances.iter().map(|&(_, transform)| transform).collect();
        let trace = |i: usize, ray: &Ray| brute::closest_hit::<Watertight>(&self.meshes[self.instances[i].0], ray);
        brute::closest_hit_of_instances(&transforms, ray, trace)
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::kinds::RayKind;
    use canted_obb::PrimId;
    use canted_trace::{InstanceId, Side};

    use super::*;

    fn at(t: f32, primitive: u32) -> Option<Hit> {
        let primitive = PrimId(primitive);
        Some(Hit { t, u: 0.0, v: 0.0, primitive, instance: InstanceId(0), side: Side::Front })
    }

    fn set(answers: Vec<Vec<Option<Hit>>>) -> Set {
        let n_rays = answers[0].len();
        let answers = answers.into_iter().map(Answers::Closest).collect();
        Set { kind: RayKind::Random, n_rays, seconds: vec![], answers }
    }

    #[test]
    fn rays_on_which_engines_disagree_are_looped_over() {
        // With as many triangles as this only 16 of 1,000 rays are chosen evenly: every 62.5th.
        let ours = vec![at(1.0, 0); 1000];
        let [mut other, mut peer] = [ours.clone(), ours.clone()];
        other[333] = at(1.0, 1);
        peer[444] = None;
        peer[555] = at(1.000_01, 7);
        let rays = chosen(&set(vec![ours, other, peer]), &[0, 1], usize::MAX);
        assert_eq!(rays.len(), 18);
        assert!(rays.contains(&333) && rays.contains(&444) && !rays.contains(&555));
    }

    #[test]
    fn every_bit_of_a_hit_counts() {
        let hits = Answers::Closest(vec![at(1.0, 0), None]);
        assert!(hits.is(0, at(1.0, 0).as_ref()) && hits.is(1, None));
        assert!(!hits.is(0, at(1.0, 1).as_ref()) && !hits.is(0, at(1.000_000_1, 0).as_ref()) && !hits.is(0, None));
        assert!(!hits.is(1, at(1.0, 0).as_ref()));
        let occluded = Answers::Occluded(vec![true, false]);
        assert!(occluded.is(0, at(1.0, 0).as_ref()) && !occluded.is(1, at(1.0, 0).as_ref()) && !occluded.is(0, None));
    }
}
