//! The renderer against closed forms, quadrature and brute force. One binary, a file a station.

mod bsdf;
mod camera;
mod common;
mod files;
mod film;
mod filter;
mod framing;
mod furnace;
mod heatmap;
mod light;
mod lighting;
mod motion;
mod occlusion;
mod offset;
mod render;
mod sampler;
mod sampling;
mod surface;
