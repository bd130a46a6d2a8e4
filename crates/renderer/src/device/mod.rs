//! Pictures on a device: what its kernels read, packed from what the CPU's integrators read.

mod both;
mod division;
mod environment;
mod error;
mod film;
mod gbuffer;
mod geometry;
mod lights;
mod materials;
mod picture;
mod render;
mod scene;
mod slack;
mod slices;
mod stages;
mod textures;
#[cfg(test)]
mod twins;

pub use both::SharedFilm;
pub use error::DeviceError;
pub use gbuffer::{GBuffer, Seen};
pub use render::{DevicePicture, traced_scene};
