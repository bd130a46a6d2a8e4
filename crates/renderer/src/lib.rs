//! Pictures from scenes: camera rays, light, film, files.
//!
//! ```text
//! Scene -> frame -> Camera -> View -> rays -> Tracer -> Hit -> Surface (textures, Bsdf)
//! Surface -> light -> integrate/{hybrid, path} -> Film -> Picture -> PNG, EXR
//! ```
//!
//! Nothing here knows how rays are traced: a [`Tracer`] answers them. Radiance is linear RGB, `f32` per sample with
//! sums in `f64`; randomness is a pure function of pixel, sample, dimension and seed, so a picture is the same bits
//! for any number of threads and any tile size.
#![forbid(unsafe_code)]
#![cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "shared with the GPU renderer, which uses more of it"))]

mod accel;
#[cfg(feature = "baseline")]
mod baseline;
mod bsdf;
mod camera;
mod content;
#[cfg(feature = "gpu")]
mod device;
mod error;
mod framing;
mod heatmap;
mod integrate;
mod light;
mod mask;
mod placement;
mod prepare;
mod query;
mod render;
mod sampler;
pub mod sampling;
mod settings;
mod structure;
mod surface;
mod texture;
mod tracer;
mod vector;

pub use accel::{Accel, Builder, Bvh};
#[cfg(feature = "baseline")]
pub use baseline::obvhs_tree;
pub use bsdf::{Bsdf, BsdfSample, Evaluation};
pub use camera::{CameraError, View};
pub use content::{light_hash, scene_hash};
#[cfg(feature = "gpu")]
pub use device::{DeviceError, DevicePicture, GBuffer, SharedFilm, SurfaceInfo, traced_scene};
pub use error::PrepareError;
pub use framing::frame;
pub use heatmap::{Heatmap, Measure, heatmap};
pub use light::{LightHit, LightId, LightSample, LightSampler, Lights, environment_of};
pub use mask::Masked;
pub use prepare::{Levels, Prepared, StructureConfig, UnusedFeature, prepare};
pub use render::{Monitor, RenderError, render, resume};
pub use sampler::{Pattern, Sampler};
pub use settings::{Integrator, Settings};
pub use structure::{Flat, Flattened, Structure, flatten};
pub use surface::{Surface, Surfaces};
pub use texture::{Cone, Lod};
pub use tracer::Tracer;
