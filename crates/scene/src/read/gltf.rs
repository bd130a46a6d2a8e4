//! glTF 2.0 as JSON or GLB.
//!
//! ```text
//! bytes -> container -> document -> animation -> nodes -> camera, light
//!          material -> texture_info -> texture
//!          instances -> pose -> mesh -> primitive -> topology, attributes (normals) -> accessor
//! ```
//!
//! The `gltf` crate only deserializes the JSON. It does not validate indices, ranges and the node hierarchy; they are checked
//! where they are used. Numbers are already rounded to `f32`.

mod accessor;
mod animation;
mod attributes;
mod camera;
mod container;
mod document;
mod instances;
mod instancing;
mod keyframes;
mod light;
mod lobes;
mod material;
mod matrix;
mod mesh;
mod meshopt;
mod nodes;
mod normals;
mod pose;
mod poses;
mod primitive;
#[cfg(test)]
mod tests;
mod texture;
mod texture_info;
mod topology;
mod uri;
mod variants;

use std::path::Path;

use super::mesh_checks::MeshChecks;
use super::warning_groups::WarningGroups;
use super::{ReadError, ReadOptions};
use crate::Scene;
use document::Document;
use nodes::Nodes;
pub(super) use poses::Poses;

/// Reads the content of a `.gltf` or `.glb` file with its buffers and images.
///
/// A glTF mesh becomes a [`crate::Mesh`] with one part per primitive; a node with a mesh becomes an instance, or several with
/// `EXT_mesh_gpu_instancing`. Nodes with a skin or their own morph weights get a deformed copy of the mesh. Only the default
/// scene is used, in file order.
///
/// # Errors
/// [`ReadError`] if the geometry is invalid or there is nothing to draw.
pub(crate) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Scene, ReadError> {
    read_document(&mut Document::open(path, bytes)?, options)
}

/// Reads everything, and poses the nodes of the document.
fn read_document(document: &mut Document<'_>, options: &ReadOptions) -> Result<Scene, ReadError> {
    let (mut scene, mut grouped) = (Scene::default(), WarningGroups::default());
    let animation = options.animation.as_deref();
    if let Some(variant) = &options.variant {
        variants::choose(document, variant)?;
    }
    match options.time {
        Some(time) => animation::pose(document, animation, time, &mut grouped)?,
        None => drop(document.animation(animation)?),
    }
    let nodes = nodes::read(document, &mut grouped)?;
    material::read(document, &mut grouped, &mut scene)?;
    read_geometry(document, &nodes, grouped, &mut scene)?;
    scene.files = document.folder.found();
    Ok(scene)
}

/// Adds the meshes, instances, cameras and lights to the materials of `scene`.
fn read_geometry(
    document: &Document<'_>,
    nodes: &Nodes,
    mut grouped: WarningGroups,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let mut checks = MeshChecks::default();
    instances::read(document, nodes, &mut checks, &mut grouped, scene)?;
    camera::read(document, nodes, scene)?;
    light::read(document, nodes, &mut grouped, scene)?;
    document.note_extensions(&mut grouped);
    grouped.finish(&mut scene.warnings);
    checks.finish(document.path(), scene)?;
    if scene.instances.is_empty() {
        return Err(ReadError::empty(document.path(), "no node has a mesh and an invertible transform"));
    }
    Ok(())
}
