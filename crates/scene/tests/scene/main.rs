//! Tests of the public API: scene files, real models, malformed files.

mod animated;
mod expect;
mod files;
mod folder;
mod gltf;
mod models;
mod scene_file;
