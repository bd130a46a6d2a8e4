//! Renders pictures on a GPU: packs what the CPU's integrators read into buffers, and collects samples from kernels.

mod collector;
mod columns;
mod device_picture;
mod dispatcher;
mod error;
mod first_hit;
mod frames;
mod gbuffer;
mod geometry;
mod kernels;
mod lights;
mod materials;
mod picture;
mod records;
mod scene;
mod slack;
mod textures;
mod traced;
#[cfg(test)]
mod twins;

pub use device_picture::{DevicePicture, SharedFilm};
pub use error::DeviceError;
pub use frames::{DeviceFrames, DeviceUpdates};
pub use gbuffer::{GBuffer, SurfaceInfo};
pub use traced::{Traced, built_scene, traced_frame, traced_scene};
