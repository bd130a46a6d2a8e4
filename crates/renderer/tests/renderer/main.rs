//! Tests of the renderer against closed forms, quadrature and brute force. One binary, one file per stage.

mod bsdf;
mod camera;
mod coincident;
mod common;
mod components;
mod cull;
mod curves;
mod environment;
mod film;
mod first_light;
mod hair;
mod hybrid;
mod light;
mod microfacet;
mod motion;
mod patches;
mod path;
mod render;
mod ribbons;
mod sampler;
mod surface;
mod terminator;
mod texture;
mod update;
