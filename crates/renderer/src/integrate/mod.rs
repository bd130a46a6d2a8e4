//! Light that arrives along camera rays.

mod direct;
mod hybrid;

use canted_trace::{Hit, Query, Ray};

use crate::light::Lights;
use crate::motion::Timed;
use crate::{Sampler, Surfaces, Tracer};

/// What all paths of a picture share. `query` is cloned for each ray.
pub(crate) struct Transport<'a, T, Q> {
    pub(crate) tracer: &'a T,
    pub(crate) surfaces: &'a Surfaces<'a>,
    pub(crate) query: Q,
    pub(crate) sampler: Sampler,
    pub(crate) lights: Lights<'a>,
    pub(crate) bounces: u32,
    pub(crate) method: Method,
}

/// Which light a path gathers.
pub(crate) enum Method {
    /// See `hybrid`.
    Hybrid {
        /// World units; above zero, may be infinite.
        ao_radius: f64,
    },
}

/// The light of one path.
pub(crate) struct Sample {
    /// Linear RGB; not finite where a light or material is not.
    pub(crate) radiance: [f32; 3],
    /// Rays traced for it, the camera ray among them.
    pub(crate) n_rays: u64,
}

impl<T: Tracer, Q: Query + Clone> Transport<'_, T, Q> {
    /// Radiance that arrives against a camera ray whose closest hit is `first`, one sample of it.
    ///
    /// All rays of the path fly at `time`: 0 as the shutter opens, 1 as it closes.
    pub(crate) fn sample(&self, camera_ray: Ray, first: Option<Hit>, time: f32, pixel: u32, sample: u32) -> Sample {
        match self.method {
            Method::Hybrid { ao_radius } => self.hybrid_sample(camera_ray, first, time, pixel, sample, ao_radius),
        }
    }

    /// The query of rays that fly at `time`.
    pub(crate) fn query_at(&self, time: f32) -> Timed<Q> {
        Timed { inner: self.query.clone(), time }
    }
}
