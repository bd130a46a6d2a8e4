//! Paths side by side: all take a step at their surfaces, then all trace the ray that leaves, until none is left.
//!
//! A path by itself waits for memory again and again: for a triangle's indices, then its vertices, then texels. Of many paths
//! the waits overlap, see [`Surfaces::warm`](crate::Surfaces). Paths share nothing else, so the light of each is the same bits whatever
//! it is traced beside.

use canted_trace::{Hit, Ray};

use super::{Sample, Start, Transport};
use crate::query::{RayKeyed, Timed};
use crate::{Cone, Tracer};

/// A path between two of its rays.
pub(super) struct Path<Q, W> {
    pub(super) start: Start,
    /// That of all its rays; each asks by a number of its own.
    pub(super) query: Timed<Q>,
    /// The ray that it has traced last, or is about to trace.
    pub(super) ray: Ray,
    /// What the ray stands for.
    pub(super) cone: Cone,
    /// What the ray met.
    pub(super) hit: Option<Hit>,
    pub(super) gathered: PathRadiance,
    /// What its integrator keeps beside this.
    pub(super) own: W,
}

/// What a path has gathered on its way.
pub(super) struct PathRadiance {
    pub(super) radiance: [f32; 3],
    /// What light from the next vertex is multiplied with.
    pub(super) throughput: [f32; 3],
    pub(super) n_rays: u64,
}

impl PathRadiance {
    pub(super) fn add(&mut self, radiance: [f32; 3], weight: f32) {
        self.radiance = std::array::from_fn(|k| self.radiance[k] + self.throughput[k] * radiance[k] * weight);
    }
}

impl<T: Tracer, Q: RayKeyed> Transport<'_, T, Q> {
    /// The light of paths with these camera rays, whose hits are known.
    ///
    /// `step` takes a path on at its `n`-th vertex, or at what it met instead, and says whether it left along a new ray.
    pub(super) fn batch<W: Default>(
        &self,
        begun: impl Iterator<Item = (Start, Option<Hit>)>,
        step: impl Fn(&mut Path<Q, W>, u32) -> bool,
    ) -> Vec<Sample> {
        let begin = |(start, hit): (Start, Option<Hit>)| Path {
            start,
            query: self.path_query(&start),
            ray: start.ray,
            cone: start.cone,
            hit,
            gathered: PathRadiance { radiance: [0.0; 3], throughput: [1.0; 3], n_rays: 1 },
            own: W::default(),
        };
        let mut paths: Vec<Path<Q, W>> = begun.map(begin).collect();
        let mut going: Vec<usize> = (0..paths.len()).collect();
        for n in 0.. {
            // Of what the last ray meets no surface is made.
            if n <= self.bounces {
                self.surfaces.prefetch(going.iter().filter_map(|&i| paths[i].hit.as_ref()));
            }
            going.retain(|&i| step(&mut paths[i], n));
            if going.is_empty() {
                break;
            }
            for &i in &going {
                let Path { query, ray, hit, gathered, .. } = &mut paths[i];
                gathered.n_rays += 1;
                *hit = self.tracer.closest_hit(ray, &mut query.keyed(1 + n));
            }
        }
        let sample = |path: Path<Q, W>| Sample { radiance: path.gathered.radiance, n_rays: path.gathered.n_rays };
        paths.into_iter().map(sample).collect()
    }
}
