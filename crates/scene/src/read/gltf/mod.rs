//! glTF 2.0, as JSON or GLB: geometry, posed and placed by nodes, with the materials that a scene can say.
//!
//! ```text
//! bytes -> container -> document -> animation -> nodes -> camera, light
//!          material -> lookup -> texture
//!          place -> pose -> mesh -> primitive -> topology, attributes -> accessor
//! ```
//!
//! The `gltf` crate only turns JSON into structures. It accepts indices, ranges and trees that break the rules, so
//! every index and range is checked here, where it is used. Numbers in JSON are `f32` by the time they arrive.

mod accessor;
mod animation;
mod attributes;
mod camera;
mod container;
mod document;
mod instancing;
mod keyframes;
mod light;
mod lookup;
mod material;
mod matrix;
mod mesh;
mod nodes;
mod place;
mod pose;
mod primitive;
#[cfg(test)]
mod tests;
mod texture;
mod topology;
mod uri;

use std::fs;
use std::path::Path;

use super::remarks::Remarks;
use super::repair::Repair;
use super::{ReadError, ReadOptions};
use crate::Scene;
use document::Document;

/// Reads a `.gltf` or `.glb` file with the buffers and images that it names.
///
/// A glTF mesh becomes one [`crate::Mesh`] with a part per primitive, a node with a mesh becomes an instance of it, or
/// as many as `EXT_mesh_gpu_instancing` says. A node with a skin or morph weights of its own gets a posed copy of its
/// mesh. Everything drawn comes from the default scene, in the order of the file's lists.
///
/// # Errors
/// [`ReadError`] where the file breaks the rules so that its geometry cannot be trusted, or has nothing to draw.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    let bytes = fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    let (mut scene, mut repair, mut remarks) = (Scene::default(), Repair::default(), Remarks::default());
    let mut document = Document::open(path, &bytes)?;
    if let Some(time) = options.time {
        animation::pose(&mut document, time, &mut remarks)?;
    }
    let nodes = nodes::read(&document)?;
    material::read(&document, &mut remarks, &mut scene)?;
    place::read(&document, &nodes, &mut repair, &mut remarks, &mut scene)?;
    camera::read(&document, &nodes, &mut scene)?;
    light::read(&document, &nodes, &mut remarks, &mut scene)?;
    document.note_extensions(&mut remarks);
    scene.files = document.folder.into_found();
    remarks.finish(&mut scene.warnings);
    repair.finish(path, &mut scene)?;
    if scene.instances.is_empty() {
        return Err(ReadError::empty(path, "no node places a mesh by a transform that has an inverse"));
    }
    Ok(scene)
}
