//! glTF 2.0 as JSON or GLB.
//!
//! ```text
//! bytes -> container, meshopt -> document -> draco -> accessor -> animation -> nodes
//!          texture -> material
//!          primitive -> instances
//! ```
//!
//! The `gltf` crate only deserializes the JSON. It does not validate indices, ranges and the node hierarchy; they are checked
//! where they are used. Numbers are already rounded to `f32`.

mod accessor;
mod animation;
mod container;
mod document;
#[cfg(feature = "draco")]
mod draco;
mod instances;
mod lines;
mod material;
mod meshopt;
mod nodes;
mod primitive;
mod texture;

use std::path::Path;

use document::{Document, VARIANTS};
use gltf::json::scene::Node;
use gltf::json::{Index, Value};
use nodes::Nodes;

use super::error::{ReadError, WarningGroups};
use super::input::ReadOptions;
use super::mesh::MeshChecks;
use super::strands::Strands;
use crate::{Material, Scene};

/// Reads the content of a `.gltf` or `.glb` file with its buffers and images.
///
/// A glTF mesh becomes a [`crate::Mesh`] with one part per primitive; a node with a mesh becomes an instance, or several with
/// `EXT_mesh_gpu_instancing`. Nodes with a skin or their own morph weights get a deformed copy of the mesh. Only the default
/// scene is used, in file order.
///
/// # Errors
/// [`ReadError`] if the geometry is invalid or there is nothing to draw.
pub(crate) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Scene, ReadError> {
    read_document(&mut open(path, bytes, options)?, options)
}

/// Reads the lines and points of a file, in world space.
pub(super) fn read_lines(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Strands, ReadError> {
    let mut document = open(path, bytes, options)?;
    let mut grouped = WarningGroups::default();
    let animation = options.animation.as_deref();
    match options.time {
        Some(time) => animation::pose(&mut document, animation, time, &mut grouped)?,
        None => drop(document.animation(animation)?),
    }
    let nodes = nodes::read(&document, &mut grouped)?;
    let mut strands = lines::read(&document, &nodes, options, &mut grouped)?;
    grouped.finish(&mut strands.warnings);
    Ok(strands)
}

/// Parses a file and loads its buffers; decompresses its geometry.
fn open<'a>(path: &'a Path, bytes: &'a [u8], options: &ReadOptions) -> Result<Document<'a>, ReadError> {
    #[cfg_attr(not(feature = "draco"), expect(unused_mut, reason = "only Draco changes the document"))]
    let mut document = Document::open(path, bytes, options)?;
    #[cfg(feature = "draco")]
    draco::make_plain(&mut document)?;
    Ok(document)
}

/// Reads everything, and poses the nodes of the document.
fn read_document(document: &mut Document<'_>, options: &ReadOptions) -> Result<Scene, ReadError> {
    let (mut scene, mut grouped) = (Scene::default(), WarningGroups::default());
    let animation = options.animation.as_deref();
    if let Some(variant) = &options.variant {
        choose_variant(document, variant)?;
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
    nodes::read_cameras(document, nodes, scene)?;
    nodes::read_lights(document, nodes, &mut grouped, scene)?;
    document.note_extensions(&mut grouped);
    grouped.finish(&mut scene.warnings);
    checks.finish(document.path(), scene)?;
    if scene.instances.is_empty() {
        return Err(ReadError::empty(document.path(), "no node has a mesh and an invertible transform"));
    }
    Ok(())
}

/// A parsed file with its buffers in memory: poses at many times, without reading its materials and images again.
pub(crate) struct Poses {
    document: Document<'static>,
    /// The nodes without an animation.
    rest: Vec<Node>,
    /// The materials, by which vertex attributes are kept or dropped.
    materials: Vec<Material>,
    /// Name or number of the animation.
    animation: Option<String>,
}

impl Poses {
    /// Reads a file as [`read`] does, except that a pose that makes a vertex infinite or NaN is an error. Keeps what
    /// further poses need, if the file has an animation.
    pub(crate) fn open(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Option<Self>, Scene), ReadError> {
        let mut document = open(path, bytes, options)?;
        if document.animation(options.animation.as_deref())?.is_none() {
            return Ok((None, read_document(&mut document, options)?));
        }
        let rest = document.root.nodes.clone();
        document.requires_finite = true;
        let scene = read_document(&mut document, options)?;
        let (document, animation) = (document.into_owned(), options.animation.clone());
        Ok((Some(Self { document, rest, materials: scene.materials.clone(), animation }), scene))
    }

    /// The file.
    pub(crate) fn path(&self) -> &Path {
        self.document.path()
    }

    /// First and last key time of the animation in seconds.
    pub(crate) fn time_range(&self) -> Option<[f32; 2]> {
        animation::time_range(&self.document, self.animation.as_deref())
    }

    /// The meshes, instances, cameras, lights and warnings at a time in seconds.
    pub(crate) fn at(&mut self, time: f32) -> Result<Scene, ReadError> {
        let mut grouped = WarningGroups::default();
        self.document.root.nodes.clone_from(&self.rest);
        animation::pose(&mut self.document, self.animation.as_deref(), time, &mut grouped)?;
        let nodes = nodes::read(&self.document, &mut grouped)?;
        let mut scene = Scene { materials: self.materials.clone(), ..Scene::default() };
        read_geometry(&self.document, &nodes, grouped, &mut scene)?;
        Ok(scene)
    }
}

/// Gives primitives the materials of the variant of this name, else of this number.
///
/// # Errors
/// [`ReadError::UnknownVariant`] if the file has no such variant.
fn choose_variant(document: &mut Document<'_>, wanted: &str) -> Result<(), ReadError> {
    let extensions = document.root.extensions.as_ref().map(|extensions| &extensions.others);
    let list = extensions.and_then(|others| others.get(VARIANTS)?.get("variants")?.as_array());
    let names: Vec<String> = list
        .into_iter()
        .flatten()
        .map(|variant| variant.get("name").and_then(Value::as_str).unwrap_or_default().to_owned())
        .collect();
    let numbered = || wanted.parse().ok().filter(|&number: &usize| number < names.len());
    let Some(variant) = names.iter().position(|name| name == wanted).or_else(numbered) else {
        let known = names.iter().enumerate().map(|(number, name)| format!("{number} {name:?}")).collect();
        return Err(ReadError::UnknownVariant { path: document.path().to_owned(), wanted: wanted.to_owned(), known });
    };
    for primitive in document.root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        let mappings =
            primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(VARIANTS)?.get("mappings"));
        let named = |mapping: &&Value| {
            let variants = mapping.get("variants").and_then(Value::as_array);
            variants.into_iter().flatten().any(|number| number.as_u64() == Some(variant as u64))
        };
        let mapping = mappings.and_then(Value::as_array).into_iter().flatten().find(named);
        if let Some(material) = mapping.and_then(|mapping| mapping.get("material")?.as_u64()) {
            // An index out of range is reported with the primitive.
            primitive.material = Some(Index::new(u32::try_from(material).unwrap_or(u32::MAX)));
        }
    }
    Ok(())
}
