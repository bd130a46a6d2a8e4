//! Renders pictures of scenes: cameras, materials, lights and integrators, on the CPU and on GPUs.
//!
//! ```text
//! Scene -> frame -> Camera -> View -> rays -> SceneBvh -> Hit -> Surface (textures, Bsdf)
//! Surface -> light -> integrate/{hybrid, path} -> Film -> Picture -> PNG, EXR
//! ```
//!
//! Integrators trace rays through a [`SceneBvh`], or anything else that implements `Intersect`. Radiance is linear RGB, `f32` per
//! sample with sums in `f64`. Random numbers are a pure function of pixel, sample, dimension and seed, so a picture has the
//! same bits for any number of threads and any tile size.
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use canted_renderer::{SceneBvh, SceneBvhConfig, Settings, frame, render};
//!
//! let scene = canted_scene::builtin();
//! let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default())?;
//! let settings = Settings { width: 16, height: 9, samples: 1, ..Settings::default() };
//! let camera = frame(&scene, &bvh, 16.0 / 9.0);
//! let film = render(&scene, &bvh, &camera, &settings, &|_, _| (), &AtomicBool::new(false))?;
//! assert_eq!(film.picture().pixels.len(), 144);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Features: `gpu` adds [`DevicePicture`](https://docs.rs/canted-renderer), `baseline` the builder `obvhs`.
#![forbid(unsafe_code)]
#![cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "shared with the GPU renderer, which uses more of it"))]

mod bottom_level;
mod boxes;
mod bsdf;
mod camera;
mod coincident;
mod content;
#[cfg(feature = "gpu")]
mod device;
mod error;
mod framing;
mod heatmap;
mod integrate;
mod levels;
mod light;
mod render;
mod sampler;
pub mod sampling;
mod scene_bvh;
mod settings;
mod surface;
mod texture;
mod times;
mod update;
mod update_policy;

#[cfg(feature = "baseline")]
pub use bottom_level::obvhs_tree;
pub use bottom_level::{BottomLevel, Builder, BvhKind, CurveBvh, Levels, SceneBvhConfig};
pub use boxes::{BoxLevel, draw_boxes};
pub use bsdf::{Bsdf, BsdfSample, Evaluation, Hair, Lobes};
pub use camera::{CameraError, View};
pub use content::{geometry_hash, light_hash, material_hash, scene_hash};
#[cfg(feature = "gpu")]
#[doc(hidden)]
pub use device::twins;
#[cfg(feature = "gpu")]
pub use device::{
    DeviceError, DeviceFrames, DevicePicture, DeviceUpdates, GBuffer, SharedFilm, SurfaceInfo, Traced, built_scene,
    traced_frame, traced_scene,
};
pub use error::PrepareError;
pub use framing::{FlatBase, Shown, Subject, frame, stands_on_z};
pub use heatmap::{Heatmap, Measure, heatmap};

pub use levels::{LevelChoice, LevelReason, PredictedCosts};
pub use light::{LightHit, LightId, LightSample, LightSampler, Lights, environment_of};
pub use render::{Monitor, RenderError, render, resume, resume_with};
pub use sampler::{Pattern, Sampler};
pub use sampling::Hemisphere;
pub use scene_bvh::{FlatBvh, Flattened, SceneBvh, SceneLevels, UnusedFeature, flatten, has_one_level};
pub use settings::{Cull, FirstHit, Integrator, SampleSums, Settings};
pub use surface::{CountedHitFilter, HitFilter, SmoothSurface, Surface, Surfaces};
pub use texture::{Cone, Lod, MipMaps};
pub use times::StageTimes;
pub use update::{UpdateOptions, Updates};
pub use update_policy::UpdatePolicy;

/// A vector in `f64`, exactly.
pub(crate) fn wide(v: [f32; 3]) -> glam::DVec3 {
    glam::Vec3::from(v).as_dvec3()
}

/// A vector rounded to `f32`.
pub(crate) fn narrow(v: glam::DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
