//! Lights: the radiance they send to a point, light sampling, and the PDF of each sample.
//!
//! ```text
//! Light            -> incoming: sun, point, spot; sphere and disk by sampling      -> direct lighting (hybrid)
//! Environment      -> environment: radiance, SkySampler
//! emission         -> emitters: triangles, sampled by solid angle                   -> LightSampler (path)
//! lights, emitters -> cluster (cone) -> build -> tree (bounds)
//! LightSampler     -> packed, for the GPU
//! ```
//!
//! Sphere and disk lights are *shape lights*: camera rays and bounced rays hit them, and they occlude other lights.
//! They reflect nothing. The back of a disk and the inside of a sphere are black.

mod bounds;
mod build;
mod cluster;
mod cone;
mod disk;
mod emitters;
mod environment;
mod incoming;
mod lights;
#[cfg(feature = "gpu")]
pub(crate) mod packed;
mod sampler;
mod sphere;
mod spherical;
mod tree;
mod triangle;

pub(crate) use incoming::IncomingLight;
pub(crate) use lights::has_multiple_lights;
pub use lights::{LightHit, LightId, Lights, environment_of};
pub use sampler::{LightSample, LightSampler};
