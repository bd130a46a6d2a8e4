//! Integrators: radiance along camera rays.

mod batch;
mod direct;
mod hybrid;
mod path;
mod roulette;

use canted_trace::{Hit, Ray};

use crate::light::{LightSampler, Lights};
use crate::query::{RayKeyed, Timed};
use crate::{Cone, Sampler, Surfaces, Tracer};

/// The data shared by all paths of an image. `query` is cloned for each ray.
pub(crate) struct Transport<'a, T, Q> {
    pub(crate) tracer: &'a T,
    pub(crate) surfaces: &'a Surfaces<'a>,
    pub(crate) query: Q,
    pub(crate) sampler: Sampler,
    pub(crate) lights: Lights<'a>,
    pub(crate) bounces: u32,
    /// Whether rough surfaces are compensated for multiple scattering; `hybrid` has none.
    pub(crate) is_compensated: bool,
    pub(crate) method: Method<'a>,
}

/// The integrator.
pub(crate) enum Method<'a> {
    /// See `hybrid`.
    Hybrid {
        /// World units; positive, may be infinite.
        ao_radius: f64,
    },
    /// See `path`.
    Path(&'a LightSampler<'a>),
}

/// Sampler dimension of the ray keys for stochastic alpha, far from the other dimensions.
const ALPHA_DIMENSION: u32 = u32::MAX - 2;

/// The start of a path at the camera.
#[derive(Clone, Copy)]
pub(crate) struct Start {
    pub(crate) ray: Ray,
    /// The ray cone.
    pub(crate) cone: Cone,
    /// Shutter time of the entire path, in 0..=1.
    pub(crate) time: f32,
    /// Index of the pixel.
    pub(crate) pixel: u32,
    /// Index of the sample in the pixel.
    pub(crate) sample: u32,
}

/// The result of one path.
pub(crate) struct Sample {
    /// Linear RGB; not finite if the value of a light or material is not finite.
    pub(crate) radiance: [f32; 3],
    /// Number of rays traced, including the camera ray.
    pub(crate) n_rays: u64,
}

impl<T: Tracer, Q: RayKeyed> Transport<'_, T, Q> {
    /// Radiance along camera rays whose closest hits are known, one sample each.
    pub(crate) fn samples(&self, camera_rays: impl Iterator<Item = (Start, Option<Hit>)>) -> Vec<Sample> {
        match self.method {
            Method::Hybrid { ao_radius } => self.hybrid_samples(camera_rays, ao_radius),
            Method::Path(lights) => self.path_samples(camera_rays, lights),
        }
    }

    /// The query of a camera ray: number 0 of its path.
    pub(crate) fn camera_query(&self, start: &Start) -> Timed<Q> {
        self.path_query(start).keyed(0)
    }

    /// The query of a path; each ray derives its own key.
    fn path_query(&self, start: &Start) -> Timed<Q> {
        let Start { time, pixel, sample, .. } = *start;
        Timed { inner: self.query.keyed(self.sampler.bits(pixel, sample, ALPHA_DIMENSION)), time }
    }
}
