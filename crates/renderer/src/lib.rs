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

#[cfg(feature = "baseline")]
mod baseline;
mod bsdf;
mod camera;
mod content;
mod device;
mod framing;
mod heatmap;
mod integrate;
mod level;
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

#[cfg(feature = "baseline")]
pub use baseline::obvhs_tree;
pub use bsdf::{Bsdf, BsdfSample, Evaluation};
pub use camera::{CameraError, View};
pub use content::{light_hash, scene_hash};
pub use device::{DeviceError, DevicePicture, GBuffer, Seen, SharedFilm, traced_scene};
pub use framing::frame;
pub use heatmap::{Heatmap, Measure, heatmap};
pub use level::{Builder, Level};
pub use light::{LightHit, LightId, LightSample, LightSampler, Lights, environment_of};
pub use mask::Masked;
pub use prepare::{LeftOut, Levels, PrepareError, Prepared, StructureConfig, prepare};
pub use render::{Monitor, RenderError, render, resume};
pub use sampler::{Pattern, Sampler};
pub use settings::{Integrator, Settings};
pub use structure::{Flat, Flattened, Structure, flatten};
pub use surface::{Surface, Surfaces};
pub use texture::{Cone, Lod};
pub use tracer::Tracer;
