//! Scenes as plain arrays: meshes, instances, materials, textures, lights, cameras.
//!
//! ```text
//! file -> read/{obj, mtl, ply, gltf, image, environment} -> Scene -> stats
//! scene file (TOML) -> file/ -> those that it names -> Scene
//! ```
//!
//! ```
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("model.obj");
//! # std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4")?;
//! use canted_scene::{SceneStats, read};
//!
//! let scene = read(&path)?;
//! let counts = SceneStats::of(&scene);
//! println!("{} meshes, {} instances", counts.n_meshes, counts.n_instances);
//! println!("{} triangles, {} vertices", counts.n_placed_triangles, counts.n_vertices);
//! for warning in &scene.warnings {
//!     eprintln!("{warning}");
//! }
//! assert_eq!((counts.n_placed_triangles, counts.n_vertices), (2, 4));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! No file makes a reader panic, nor takes much more memory than it has bytes (images aside, whose size is checked).
#![forbid(unsafe_code)]

mod builtin;
mod camera;
mod environment;
mod file;
mod light;
mod material;
mod mesh;
mod read;
mod scene;
mod stats;
mod texture;

pub use builtin::builtin;
pub use camera::{Camera, Lens, Projection};
pub use environment::{Environment, EnvironmentImage};
pub use file::{
    Asset, AssetInstance, AssetSource, EnvironmentSource, MaterialEdits, NewMaterial, Override, Placement, SceneFile,
    Setting, closest_match,
};
pub use light::Light;
pub use material::{AlphaMode, Material, MaterialId};
pub use mesh::{Instance, Mesh, MeshId, Part};
pub use read::{ReadError, ReadOptions, declared_exr_samples, read, read_environment, read_with};
pub use scene::Scene;
pub use stats::SceneStats;
pub use texture::{Encoding, Texture, TextureId, TextureRef, UvSet, UvTransform, Wrap};
