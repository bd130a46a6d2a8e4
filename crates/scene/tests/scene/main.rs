//! Tests of the public API: scene files, real models, malformed files.

mod files;
mod flaw;
mod gltf;
mod lines;
mod scene_file;
