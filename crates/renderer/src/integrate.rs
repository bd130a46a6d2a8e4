//! Light that arrives along camera rays.

mod batch;
mod direct;
mod hybrid;
mod path;
mod roulette;

use canted_trace::{Hit, Ray};

use crate::light::{LightSampler, Lights};
use crate::query::{RayKeyed, Timed};
use crate::{Cone, Sampler, Surfaces, Tracer};

/// What all paths of a picture share. `query` is cloned for each ray.
pub(crate) struct Transport<'a, T, Q> {
    pub(crate) tracer: &'a T,
    pub(crate) surfaces: &'a Surfaces<'a>,
    pub(crate) query: Q,
    pub(crate) sampler: Sampler,
    pub(crate) lights: Lights<'a>,
    pub(crate) bounces: u32,
    pub(crate) method: Method<'a>,
}

/// Which light a path gathers.
pub(crate) enum Method<'a> {
    /// See `hybrid`.
    Hybrid {
        /// World units; above zero, may be infinite.
        ao_radius: f64,
    },
    /// See `path`.
    Path(&'a LightSampler<'a>),
}

/// Dimension that numbers rays, for surfaces that stop some and let others pass; apart from those that are counted up.
const PASSAGE: u32 = u32::MAX - 2;

/// Where a path starts at the camera.
#[derive(Clone, Copy)]
pub(crate) struct Start {
    pub(crate) ray: Ray,
    /// What the ray stands for.
    pub(crate) cone: Cone,
    /// When all rays of the path fly: 0 as the shutter opens, 1 as it closes.
    pub(crate) time: f32,
    /// Number of the pixel.
    pub(crate) pixel: u32,
    /// Number of the sample in it.
    pub(crate) sample: u32,
}

/// The light of one path.
pub(crate) struct Sample {
    /// Linear RGB; not finite where a light or material is not.
    pub(crate) radiance: [f32; 3],
    /// Rays traced for it, the camera ray among them.
    pub(crate) n_rays: u64,
}

impl<T: Tracer, Q: RayKeyed> Transport<'_, T, Q> {
    /// Radiance that arrives against camera rays whose closest hits are given, one sample of each.
    pub(crate) fn samples(&self, begun: impl Iterator<Item = (Start, Option<Hit>)>) -> Vec<Sample> {
        match self.method {
            Method::Hybrid { ao_radius } => self.hybrid_samples(begun, ao_radius),
            Method::Path(lights) => self.path_samples(begun, lights),
        }
    }

    /// The query of a camera ray: number 0 of its path.
    pub(crate) fn camera_query(&self, start: &Start) -> Timed<Q> {
        self.path_query(start).keyed(0)
    }

    /// The query of all rays of a path; each asks by a number of its own.
    fn path_query(&self, start: &Start) -> Timed<Q> {
        let Start { time, pixel, sample, .. } = *start;
        Timed { inner: self.query.keyed(self.sampler.bits(pixel, sample, PASSAGE)), time }
    }
}
