//! Readers for OBJ, PLY, STL, OFF, glTF and environment maps.

mod animated;
mod environment;
mod error;
mod exr;
mod folder;
mod gltf;
mod image;
mod input;
#[cfg(feature = "ktx2")]
mod ktx2;
mod mesh_checks;
mod mtl;
mod obj;
#[cfg(feature = "off")]
mod off;
mod ply;
mod polygon;
mod shutter;
mod single;
#[cfg(feature = "stl")]
mod stl;
mod text;
mod vertex_colors;
mod warning_groups;
#[cfg(feature = "stl")]
mod weld;

use std::path::Path;

use crate::Scene;

pub use self::exr::declared_exr_samples;
pub use animated::AnimatedScene;
pub use environment::read_environment;
pub use error::ReadError;
pub(crate) use image::decode;
use input::{Format, Input};
pub(crate) use text::quoted;

/// Options of [`read_with`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Time in seconds at which an animation of the file poses the scene; `None` for the default pose. Times outside the
    /// animation are clamped to it.
    pub time: Option<f32>,
    /// Name of the animation, or its number from 0 where no animation has that name. `None` for the first animation; others
    /// are then ignored with a warning, as they are usually alternatives.
    pub animation: Option<String>,
    /// Name of a material variant of a glTF file, or its number from 0 where no variant has that name. `None` for the materials of the
    /// primitives.
    pub variant: Option<String>,
}

/// Reads an OBJ (with MTL), PLY, STL, OFF, glTF or GLB file with the buffers and images it references.
///
/// The format is determined by the content (PLY, GLB, STL, OFF), else by the extension. Files compressed by gzip are
/// decompressed first. Referenced files are only read from the
/// folder of `path` and below. Repairs and skipped elements are reported in [`Scene::warnings`]. Coordinates keep the file's
/// unit.
///
/// # Errors
/// [`ReadError`] with file, location and value.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    read_with(path, &ReadOptions::default())
}

/// As [`read`], with options.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    let Input { format, bytes } = input::open(path)?;
    if format == Format::Gltf {
        return gltf::read(path, &bytes, options);
    }
    let mut scene = read_static(path, format, &bytes, options)?;
    if let Some(time) = options.time {
        scene.warnings.push(format!("ignoring time {time}: {format:?} files have no animation"));
    }
    Ok(scene)
}

/// Parses a file of a format without animations.
fn read_static(path: &Path, format: Format, bytes: &[u8], options: &ReadOptions) -> Result<Scene, ReadError> {
    if let Some(wanted) = &options.animation {
        return Err(ReadError::UnknownAnimation { path: path.to_owned(), wanted: wanted.clone(), known: Vec::new() });
    }
    if let Some(wanted) = &options.variant {
        return Err(ReadError::UnknownVariant { path: path.to_owned(), wanted: wanted.clone(), known: Vec::new() });
    }
    match format {
        Format::Obj => obj::parse(path, bytes),
        Format::Ply => ply::parse(path, bytes),
        #[cfg(feature = "stl")]
        Format::Stl => stl::parse(path, bytes),
        #[cfg(not(feature = "stl"))]
        Format::Stl => Err(ReadError::missing_feature(path, "STL", "stl")),
        #[cfg(feature = "off")]
        Format::Off => off::parse(path, bytes),
        #[cfg(not(feature = "off"))]
        Format::Off => Err(ReadError::missing_feature(path, "OFF", "off")),
        Format::Gltf => gltf::read(path, bytes, options),
    }
}

#[cfg(test)]
mod tests;
