//! Scenes as plain arrays: meshes, instances, materials, textures, lights, cameras.
//!
//! ```text
//! file -> read/{obj, mtl, ply, gltf, image} -> Scene -> describe
//! ```
#![forbid(unsafe_code)]

mod camera;
mod light;
mod material;
mod mesh;
mod read;
mod scene;
mod texture;

pub use camera::Camera;
pub use light::Light;
pub use material::{Material, MaterialId};
pub use mesh::{Instance, Mesh, MeshId, Part};
pub use read::{ReadError, read};
pub use scene::Scene;
pub use texture::{Texture, TextureId, Wrap};
