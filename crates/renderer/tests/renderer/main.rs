//! Tests of the renderer against closed forms, quadrature and brute force. One binary, one file per stage.

mod alpha;
mod bsdf;
mod camera;
mod chi_square;
mod common;
mod film;
mod filter;
mod framing;
mod furnace;
mod heatmap;
mod light;
mod lighting;
mod mirrors;
mod motion;
mod normal_map;
mod occlusion;
mod offset;
mod path;
mod render;
mod sampler;
mod sampling;
mod sequences;
mod shutter;
mod surface;
mod texture;
mod update;
