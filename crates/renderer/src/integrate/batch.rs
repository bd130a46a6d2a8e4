//! Batched path tracing: all paths shade their hits, then all trace their next ray, until every path has ended.
//!
//! A single path stalls on memory for indices, vertices and texels in turn. In a batch these stalls overlap, see
//! [`Surfaces::prefetch`](crate::Surfaces). Paths are otherwise independent, so results do not depend on the batch.

use canted_trace::{Hit, Ray};

use super::{Sample, Start, Transport};
use crate::query::{RayKeyed, Timed};
use crate::{Cone, Tracer};

/// The state of a path between two rays.
pub(super) struct Path<Q, W> {
    pub(super) start: Start,
    /// The query of the path; each ray derives its own key.
    pub(super) query: Timed<Q>,
    /// The last ray traced, or the next one to trace.
    pub(super) ray: Ray,
    /// The ray cone.
    pub(super) cone: Cone,
    /// The closest hit of the ray.
    pub(super) hit: Option<Hit>,
    pub(super) accumulated: PathRadiance,
    /// State of the integrator.
    pub(super) state: W,
}

/// The radiance that a path has accumulated.
pub(super) struct PathRadiance {
    pub(super) radiance: [f32; 3],
    /// Factor of light at the next vertex.
    pub(super) throughput: [f32; 3],
    pub(super) n_rays: u64,
}

impl PathRadiance {
    pub(super) fn add(&mut self, radiance: [f32; 3], weight: f32) {
        self.radiance = std::array::from_fn(|k| self.radiance[k] + self.throughput[k] * radiance[k] * weight);
    }
}

impl<T: Tracer, Q: RayKeyed> Transport<'_, T, Q> {
    /// Traces paths from camera rays whose hits are known.
    ///
    /// `step` shades the `n`-th vertex, or ends the path, and returns whether there is a next ray.
    pub(super) fn batch<W: Default>(
        &self,
        camera_rays: impl Iterator<Item = (Start, Option<Hit>)>,
        step: impl Fn(&mut Path<Q, W>, u32) -> bool,
    ) -> Vec<Sample> {
        let begin = |(start, hit): (Start, Option<Hit>)| Path {
            start,
            query: self.path_query(&start),
            ray: start.ray,
            cone: start.cone,
            hit,
            accumulated: PathRadiance { radiance: [0.0; 3], throughput: [1.0; 3], n_rays: 1 },
            state: W::default(),
        };
        let mut paths: Vec<Path<Q, W>> = camera_rays.map(begin).collect();
        let mut active: Vec<usize> = (0..paths.len()).collect();
        for n in 0.. {
            // The hit of the last ray is not shaded.
            if n <= self.bounces {
                self.surfaces.prefetch(active.iter().filter_map(|&i| paths[i].hit.as_ref()));
            }
            active.retain(|&i| step(&mut paths[i], n));
            if active.is_empty() {
                break;
            }
            for &i in &active {
                let Path { query, ray, hit, accumulated, .. } = &mut paths[i];
                accumulated.n_rays += 1;
                *hit = self.tracer.closest_hit(ray, &mut query.keyed(1 + n));
            }
        }
        let sample = |path: Path<Q, W>| Sample { radiance: path.accumulated.radiance, n_rays: path.accumulated.n_rays };
        paths.into_iter().map(sample).collect()
    }
}
