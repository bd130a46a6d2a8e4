//! Lights: what they send to a point, how to choose among them, and how likely each choice was.
//!
//! ```text
//! Light         -> incoming: sun point spot, sphere disc by a point of their own  -> direct light of the hybrid integrator
//! Environment   -> environment: radiance, SkySampler
//! emission      -> emitters: triangle, by its spherical triangle                    -> LightSampler -> path tracing
//! lights, emitters -> cluster (cone) -> build -> tree (bounds)
//! LightSampler  -> packed, for devices
//! ```
//!
//! Spheres and discs are bodies: rays see them, and they stand in the light of others. They reflect nothing, and are
//! black where they do not shine: a disc from behind, a ball from inside.

mod bounds;
mod build;
mod cluster;
mod cone;
mod disk;
mod emitters;
mod environment;
mod incoming;
mod lights;
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
