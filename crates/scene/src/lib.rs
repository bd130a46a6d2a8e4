//! Reads 3D scenes (OBJ, PLY, STL, OFF, glTF, HDR and EXR environment maps, TOML scene files) into plain arrays.
//!
//! ```
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("model.obj");
//! # std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4")?;
//! let scene = canted_scene::read(&path)?;
//! for instance in &scene.instances {
//!     let mesh = &scene.meshes[instance.mesh.0 as usize];
//!     println!("{}: {} triangles", mesh.name, mesh.triangles.len());
//! }
//! for warning in &scene.warnings {
//!     eprintln!("warning: {warning}");
//! }
//! assert_eq!(scene.n_placed_triangles(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # When to use it
//!
//! Use it to get triangles, instances, materials, textures, lights and cameras out of a file without linking a renderer.
//! It does not write models, keep animations (a scene is posed at one time), or read scene graphs for editing.
//!
//! # Main types
//!
//! | type | purpose |
//! | --- | --- |
//! | [`read`], [`read_with`] | OBJ with MTL, PLY, STL, OFF, glTF and GLB files to a [`Scene`] |
//! | [`read_environment`] | Radiance HDR and OpenEXR environment maps |
//! | [`Scene`] | meshes, instances, materials, textures, lights, cameras, warnings |
//! | [`SceneFile`] | TOML scene files: assets, instances, camera, lights, material changes, render settings |
//! | [`builtin`] | a generated scene: a cable-stayed bridge over a river |
//! | [`ReadError`] | one sentence with file, location and value |
//!
//! # Guarantees
//!
//! * No input makes a reader panic, loop forever, or read outside the folder of the file it was given, unless [`ReadOptions`] permit it.
//!   [`SceneFile`] is the exception: its author chooses the paths.
//! * In a [`Scene`] every index is in range, every referenced position is finite, every transform is invertible, and every
//!   texture has `width * height` texels.
//! * What a reader repairs or skips is reported once in [`Scene::warnings`].
//! * The same file gives the same scene, on any number of threads.
//!
//! # Cost
//!
//! Memory is at most 128 bytes per byte of geometry file, decompressed if it is a gzip file, which holds at most 4 GiB; image
//! sizes are checked against the file size before decoding. Real glTF scenes need at most 3 times the memory of the finished scene while they are read. Images decode in parallel.
//!
//! # Features
//!
//! All are on by default. A mesh that needs an absent one is an error, and a texture a warning, that names
//! the feature.
//!
//! | feature | purpose |
//! | --- | --- |
//! | `stl` | STL meshes, ASCII and binary |
//! | `off` | OFF meshes |
//! | `gzip` | meshes compressed by gzip, such as `model.obj.gz` |
//! | `bmp`, `tga`, `tiff`, `webp` | textures of these formats; PNG and JPEG are always read |
//! | `ktx2` | KTX2 textures and `KHR_texture_basisu`: 8 bits per channel or Basis Universal, also compressed by Zstandard |
//! | `draco` | glTF compressed by `KHR_draco_mesh_compression` |
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate self as canted_scene;

mod builtin;
mod file;
#[cfg(test)]
#[path = "../tests/scene/flaw.rs"]
mod flaw;
mod light;
mod material;
mod read;
mod scene;
mod strand;

pub use builtin::builtin;
pub use file::{
    Asset, AssetInstance, AssetSource, CurveBasis, CurveTable, EnvironmentSource, MaterialEdits, NewMaterial, Override,
    PatchTable, Placement, SceneFile, Setting, closest_match, suggestion,
};
pub use light::{Environment, EnvironmentImage, Light};
pub use material::{
    AlphaMode, Encoding, Hair, Lobes, Magnification, Material, MaterialId, Texture, TextureId, TextureRef, UvSet,
    UvTransform, Wrap,
};
pub use read::{
    AnimatedScene, Lines, ReadError, ReadOptions, is_lines, read, read_environment, read_lines, read_with,
    stream_triangles,
};
pub use scene::{
    Camera, CurveSegments, CurveShape, Curves, Instance, Lens, Mesh, MeshClose, MeshId, Part, Projection, Scene,
};

/// The features of this crate, and whether this build has them.
pub const FEATURES: [(&str, bool); 9] = [
    ("stl", cfg!(feature = "stl")),
    ("off", cfg!(feature = "off")),
    ("gzip", cfg!(feature = "gzip")),
    ("bmp", cfg!(feature = "bmp")),
    ("tga", cfg!(feature = "tga")),
    ("tiff", cfg!(feature = "tiff")),
    ("webp", cfg!(feature = "webp")),
    ("ktx2", cfg!(feature = "ktx2")),
    ("draco", cfg!(feature = "draco")),
];
