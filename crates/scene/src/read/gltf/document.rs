//! A parsed file with its buffers in memory.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

#[cfg(feature = "draco")]
use gltf::json::Index;
use gltf::json::animation::Animation;
use gltf::json::buffer::View;
use gltf::json::deserialize::from_slice;
use gltf::json::mesh::Primitive;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Error, Root, Value};
use rayon::prelude::*;
use serde_json::Map;

use super::container;
use super::meshopt::{self, Decompressed};
use crate::read::error::{ReadError, WarningGroups};
use crate::read::folder::Folder;
use crate::read::input::ReadOptions;

/// Instances of a mesh by accessors: name of the extension, and its key in a node.
pub(super) const MESH_GPU_INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// Animation of properties by JSON pointers; those of nodes are supported.
const ANIMATION_POINTER: &str = "KHR_animation_pointer";
/// Geometry compressed by Draco.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";
/// Diffuse and specular color instead of base color and metallic.
pub(super) const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";
/// Whether a node and those below it are seen.
pub(super) const VISIBILITY: &str = "KHR_node_visibility";
/// Other materials for the primitives of a file, by name.
pub(super) const VARIANTS: &str = "KHR_materials_variants";

/// Extensions that a file may require.
///
/// Unsupported material extensions and image formats are included: ignoring them gives an approximate image but correct
/// geometry, and a warning is reported. Metadata change nothing.
const SUPPORTED: [&str; 27] = [
    DRACO,
    meshopt::NAMES[0],
    meshopt::NAMES[1],
    MESH_GPU_INSTANCING,
    ANIMATION_POINTER,
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    SPECULAR_GLOSSINESS,
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    VARIANTS,
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    VISIBILITY,
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

/// Attributes whose morph targets are not supported.
pub(super) const UNSUPPORTED_TARGETS: [&str; 3] = ["TEXCOORD_0", "TEXCOORD_1", "COLOR_0"];

/// Parts of the JSON that the `gltf` crate does not represent.
#[derive(Default)]
pub(super) struct UnparsedData {
    /// For each animation, the channels that are not read.
    pub(super) dropped_channels: Vec<DroppedChannels>,
    /// By mesh, the morph targets that affect one of [`UNSUPPORTED_TARGETS`], with the attribute.
    pub(super) unsupported_targets: HashMap<usize, BTreeSet<(usize, &'static str)>>,
}

/// Channels of an animation that are not read.
#[derive(Clone, Default)]
pub(super) struct DroppedChannels {
    /// Number of channels without a target node.
    pub(super) n_without_node: usize,
    /// Pointers of `KHR_animation_pointer` to something else than the transform or the weights of a node.
    pub(super) pointers: Vec<String>,
    /// Those to nodes that are not in the file.
    pub(super) absent_nodes: Vec<String>,
}

/// A file in memory.
pub(super) struct Document<'a> {
    /// The JSON. Indices are unchecked and taken modulo 2^32.
    pub(super) root: Root,
    /// The folder of the file.
    pub(super) folder: Folder,
    /// Data missing in [`Document::root`].
    pub(super) unparsed: UnparsedData,
    /// Whether a pose that makes a vertex infinite or NaN is an error; else its triangles are skipped.
    pub(super) requires_finite: bool,
    path: Cow<'a, Path>,
    buffers: Vec<Cow<'a, [u8]>>,
    /// By buffer view, its content if it is compressed.
    decompressed: Vec<Option<Decompressed>>,
}

impl<'a> Document<'a> {
    /// Parses the file and loads its buffers.
    pub(super) fn open(path: &'a Path, bytes: &'a [u8], options: &ReadOptions) -> Result<Self, ReadError> {
        let container = container::split(path, bytes)?;
        let (root, unparsed) = parse(container.json).map_err(|source| match is_version_1(container.json) {
            true => ReadError::unsupported(path, "glTF 1.0"),
            false => ReadError::malformed(path, "json", source.to_string()),
        })?;
        check_version(path, &root)?;
        if let Some(extension) = root.extensions_required.iter().find(|name| !SUPPORTED.contains(&name.as_str())) {
            return Err(ReadError::unsupported(path, format!("required extension {extension}")));
        }
        let folder = Folder::of(path, options).map_err(ReadError::io(path))?;
        let path = Cow::Borrowed(path);
        let (buffers, decompressed) = (Vec::new(), Vec::new());
        let mut document = Self { root, folder, unparsed, requires_finite: false, path, buffers, decompressed };
        document.buffers = (0..document.root.buffers.len())
            .map(|k| document.load_buffer(k, container.bin))
            .collect::<Result<_, _>>()?;
        document.decompress()?;
        Ok(document)
    }

    /// Reports unsupported extensions, except those already reported for materials.
    pub(super) fn note_extensions(&self, grouped: &mut WarningGroups) {
        let of_nodes = self.root.nodes.iter().enumerate().flat_map(|(k, node)| {
            let names = node.extensions.iter().flat_map(|all| all.others.keys());
            names.map(move |name| (name, format!("node {k}")))
        });
        let used = self.root.extensions_used.iter().map(|name| (name, "extensionsUsed".to_owned()));
        for (name, location) in of_nodes.chain(used).filter(|(name, _)| !SUPPORTED.contains(&name.as_str())) {
            grouped.add_once(&format!("ignoring {name} (not supported)"), &location);
        }
    }

    /// The same document with copies of everything it borrows.
    pub(super) fn into_owned(self) -> Document<'static> {
        let Self { root, folder, unparsed, requires_finite, path, buffers, decompressed } = self;
        let buffers = buffers.into_iter().map(|bytes| Cow::Owned(bytes.into_owned())).collect();
        Document { root, folder, unparsed, requires_finite, path: Cow::Owned(path.into_owned()), buffers, decompressed }
    }

    /// The index of an animation: of the first one with this name, else of this number; the first one for `None`. `None`
    /// for a file without animations.
    ///
    /// # Errors
    /// [`ReadError::UnknownAnimation`] if the file has no such animation.
    pub(super) fn animation(&self, wanted: Option<&str>) -> Result<Option<usize>, ReadError> {
        let animations = &self.root.animations;
        let Some(wanted) = wanted else { return Ok((!animations.is_empty()).then_some(0)) };
        let named = animations.iter().position(|animation| animation.name.as_deref() == Some(wanted));
        let numbered = || wanted.parse().ok().filter(|&number: &usize| number < animations.len());
        let unknown = || {
            let known = animations.iter().enumerate().map(|(number, animation): (_, &Animation)| {
                animation.name.as_ref().map_or_else(|| number.to_string(), |name| format!("{number} {name:?}"))
            });
            ReadError::UnknownAnimation { path: self.path.to_path_buf(), wanted: wanted.into(), known: known.collect() }
        };
        named.or_else(numbered).map(Some).ok_or_else(unknown)
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// A violation of the format at `location`.
    pub(super) fn malformed(&self, location: impl Into<String>, message: impl Into<String>) -> ReadError {
        ReadError::malformed(&self.path, location, message)
    }

    /// A vertex of a pose that is infinite or NaN.
    pub(super) fn not_finite(&self, mesh: usize, vertex: String, position: [f32; 3]) -> ReadError {
        let name = self.root.meshes[mesh].name.as_deref().unwrap_or_default();
        let mesh = if name.is_empty() { format!("mesh {mesh}") } else { format!("mesh {mesh} {name:?}") };
        ReadError::VertexNotFinite { path: self.path.to_path_buf(), mesh, vertex, position }
    }

    /// Looks up an index that `location` references.
    pub(super) fn get<'b, T>(
        &self,
        list: &'b [T],
        index: usize,
        kind: &str,
        location: &str,
    ) -> Result<&'b T, ReadError> {
        list.get(index).ok_or_else(|| {
            self.malformed(location, format!("{kind} index {index} out of range ({} defined)", list.len()))
        })
    }

    /// The bytes and the stride of a buffer view.
    pub(super) fn view(&self, index: usize, location: &str) -> Result<(&[u8], Option<usize>), ReadError> {
        let view = self.get(&self.root.buffer_views, index, "buffer view", location)?;
        if let Some(Some(decompressed)) = self.decompressed.get(index) {
            return Ok((&decompressed.bytes, Some(decompressed.stride)));
        }
        let location = format!("buffer view {index}");
        let buffer = self.get(&self.buffers, view.buffer.value(), "buffer", &location)?;
        let offset = view.byte_offset.unwrap_or_default();
        let bytes = range(buffer, offset, view.byte_length).ok_or_else(|| {
            let (offset, length) = (offset.0, view.byte_length.0);
            self.malformed(
                &location,
                format!("{length} bytes at offset {offset} exceed the buffer of {} bytes", buffer.len()),
            )
        })?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }

    /// Adds a buffer view with a content of its own; the index of the view.
    #[cfg(feature = "draco")]
    pub(super) fn add_view(&mut self, bytes: Vec<u8>, stride: usize) -> usize {
        let view = self.root.buffer_views.len();
        self.root.buffer_views.push(View {
            buffer: Index::new(0),
            byte_length: USize64(bytes.len() as u64),
            byte_offset: None,
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: None,
        });
        self.decompressed.resize_with(view, || None);
        self.decompressed.push(Some(Decompressed { bytes, stride }));
        view
    }

    /// Whether a primitive has data that is compressed by Draco, and no other: it may have both, for programs that do not
    /// decompress it.
    pub(super) fn needs_draco(&self, primitive: &Primitive) -> bool {
        let extension = primitive.extensions.as_ref().and_then(|all| all.others.get(DRACO));
        let Some(extension) = extension else { return false };
        let compressed = extension.get("attributes");
        let attributes = primitive.attributes.iter().filter(|(semantic, _)| match semantic {
            Checked::Valid(semantic) => compressed.is_some_and(|all| all.get(semantic.to_string()).is_some()),
            Checked::Invalid => false,
        });
        // Accessors without data would be zeros.
        attributes.map(|(_, &index)| index).chain(primitive.indices).any(|index| {
            let accessor = self.root.accessors.get(index.value());
            accessor.is_some_and(|accessor| accessor.buffer_view.is_none() && accessor.sparse.is_none())
        })
    }

    /// Bytes of all buffers.
    pub(super) fn n_stored_bytes(&self) -> u64 {
        self.buffers.iter().map(|buffer| buffer.len() as u64).sum()
    }

    /// Limit of elements that are not backed by bytes of their own (no buffer view, or shared): the total buffer size in bytes,
    /// but at least 2^20.
    pub(super) fn max_virtual_elements(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.len()).sum::<usize>().max(1 << 20)
    }

    /// Decompresses the buffer views that are compressed, in parallel.
    fn decompress(&mut self) -> Result<(), ReadError> {
        let malformed = |index: usize, error: String| self.malformed(format!("buffer view {index}"), error);
        let mut declared = Vec::with_capacity(self.root.buffer_views.len());
        let mut n_bytes = 0_u64;
        for (index, view) in self.root.buffer_views.iter().enumerate() {
            let others = view.extensions.as_ref().map(|all| &all.others);
            let extension = meshopt::extension(|name| others?.get(name));
            let compressed = extension.map(meshopt::Compressed::read).transpose().map_err(|e| malformed(index, e))?;
            n_bytes = n_bytes.saturating_add(compressed.as_ref().map_or(0, meshopt::Compressed::n_bytes));
            declared.push(compressed);
        }
        // Views may share compressed bytes.
        let n_stored = self.n_stored_bytes();
        if n_bytes > meshopt::MAX_BYTES.min(1024 * n_stored.saturating_add(1024)) {
            return Err(self.malformed("bufferViews", format!("{n_bytes} decompressed bytes in a file of {n_stored}")));
        }
        let decompressed: Result<Vec<_>, ReadError> = declared
            .par_iter()
            .enumerate()
            .map(|(index, compressed)| {
                let Some(compressed) = compressed else { return Ok(None) };
                let location = format!("buffer view {index}");
                let buffer = self.get(&self.buffers, compressed.buffer, "buffer", &location)?;
                let bytes = range(buffer, USize64(compressed.offset), USize64(compressed.length));
                let bytes = bytes.ok_or_else(|| malformed(index, "compressed bytes exceed their buffer".to_owned()))?;
                compressed.decompress(bytes).map(Some).map_err(|error| malformed(index, error))
            })
            .collect();
        self.decompressed = decompressed?;
        Ok(())
    }

    /// Whether a buffer has views that are compressed, and no others: some programs do not mark those that stand in for them.
    fn has_only_compressed_views(&self, buffer: usize) -> bool {
        let mut views = self.root.buffer_views.iter().filter(|view| view.buffer.value() == buffer).peekable();
        let is_compressed = |view: &View| {
            view.extensions.as_ref().is_some_and(|all| meshopt::extension(|name| all.others.get(name)).is_some())
        };
        views.peek().is_some() && views.all(is_compressed)
    }

    fn load_buffer(&self, index: usize, bin: Option<&'a [u8]>) -> Result<Cow<'a, [u8]>, ReadError> {
        let buffer = &self.root.buffers[index];
        let location = format!("buffer {index}");
        let others = buffer.extensions.as_ref().map(|all| &all.others);
        let is_fallback = meshopt::is_fallback(meshopt::extension(|name| others?.get(name)));
        if is_fallback || buffer.uri.is_none() && (index > 0 || bin.is_none()) && self.has_only_compressed_views(index)
        {
            return Ok(Cow::Borrowed(&[]));
        }
        let mut bytes = match (&buffer.uri, bin) {
            (Some(uri), _) => {
                Cow::Owned(container::load_uri(uri, &self.folder).map_err(|error| self.malformed(&location, error))?)
            }
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(self.malformed(location, "neither a uri nor a BIN chunk")),
        };
        let n_bytes = bytes.len();
        let length =
            usize::try_from(buffer.byte_length.0).ok().filter(|&length| length <= n_bytes).ok_or_else(|| {
                self.malformed(
                    location,
                    format!("byteLength is {}, but the data has {n_bytes} bytes", buffer.byte_length.0),
                )
            })?;
        match &mut bytes {
            Cow::Borrowed(bytes) => *bytes = &bytes[..length],
            Cow::Owned(bytes) => bytes.truncate(length),
        }
        Ok(bytes)
    }
}

/// Parses the JSON; the parser rejects more than 128 nesting levels.
///
/// Only [`Root::from_slice`] deserializes the structs: a generic function of serde would compile all of them here once more.
fn parse(json: &[u8]) -> Result<(Root, UnparsedData), Error> {
    let (value, unparsed, is_changed) = completed(json)?;
    let text = is_changed.then(|| value.to_string());
    drop(value);
    let root = Root::from_slice(text.as_ref().map_or(json, |text| text.as_bytes()))
        // The structs have no repeated keys; of those of a value the last counts.
        .or_else(|_| Root::from_slice(completed(json)?.0.to_string().as_bytes()))
        // For an error with the line in the file.
        .or_else(|_| Root::from_slice(json))?;
    Ok((root, unparsed))
}

/// The JSON as a value, what it has beyond the structs of the `gltf` crate, and whether it differs from the text.
///
/// The crate requires `nodes` in scenes and target nodes in animation channels, which are optional in glTF. This adds
/// the list, replaces pointers to properties of nodes by the node and the property, and removes and counts channels without a node.
fn completed(json: &[u8]) -> Result<(Value, UnparsedData, bool), Error> {
    let mut unparsed = UnparsedData::default();
    let mut value: Value = from_slice(json)?;
    let mut is_changed = false;
    for scene in value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut().filter(|scene| !scene.contains_key("nodes")) {
            scene.insert("nodes".to_owned(), Value::Array(Vec::new()));
            is_changed = true;
        }
    }
    let n_nodes = items(&value, "nodes").count();
    for animation in value.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        let mut dropped = DroppedChannels::default();
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            channels.retain_mut(|channel| {
                let Some(target) = channel.get_mut("target").and_then(Value::as_object_mut) else { return true };
                if target.get("path").and_then(Value::as_str) == Some("pointer") {
                    is_changed = true;
                    return match follow(target) {
                        Ok((node, _)) if (node as usize) < n_nodes => true,
                        Ok((_, pointer)) => {
                            dropped.absent_nodes.push(pointer);
                            false
                        }
                        Err(pointer) => {
                            dropped.pointers.push(pointer);
                            false
                        }
                    };
                }
                let has_node = target.contains_key("node");
                dropped.n_without_node += usize::from(!has_node);
                is_changed |= !has_node;
                has_node
            });
        }
        unparsed.dropped_channels.push(dropped);
    }
    for (mesh, item) in items(&value, "meshes").enumerate() {
        for (target, moved) in items(item, "primitives").flat_map(|primitive| items(primitive, "targets").enumerate()) {
            for name in UNSUPPORTED_TARGETS.into_iter().filter(|name| moved.get(name).is_some()) {
                unparsed.unsupported_targets.entry(mesh).or_default().insert((target, name));
            }
        }
    }
    Ok((value, unparsed, is_changed))
}

/// Replaces a pointer to the transform or the weights of a node in the target of an animation channel: `/nodes/4/rotation`. Gives the
/// number of the node, and the pointer.
///
/// # Errors
/// A pointer to something else.
fn follow(target: &mut Map<String, Value>) -> Result<(u32, String), String> {
    let pointer = target.get("extensions").and_then(|all| all.get(ANIMATION_POINTER)?.get("pointer")?.as_str());
    let pointer = pointer.unwrap_or_default().to_owned();
    let property = pointer.strip_prefix("/nodes/").and_then(|rest| rest.split_once('/'));
    let node = property.and_then(|(node, _)| node.parse::<u32>().ok());
    match (node, property) {
        (Some(node), Some((_, path @ ("translation" | "rotation" | "scale" | "weights")))) => {
            target.insert("node".to_owned(), node.into());
            target.insert("path".to_owned(), path.into());
            Ok((node, pointer))
        }
        _ => Err(pointer),
    }
}

/// The items of a list; none if it is absent.
fn items<'a>(value: &'a Value, list: &str) -> impl Iterator<Item = &'a Value> {
    value.get(list).and_then(Value::as_array).into_iter().flatten()
}

/// `length` bytes at `offset`, if in bounds.
pub(super) fn range(bytes: &[u8], offset: USize64, length: USize64) -> Option<&[u8]> {
    let end = offset.0.checked_add(length.0)?;
    bytes.get(usize::try_from(offset.0).ok()?..usize::try_from(end).ok()?)
}

/// Whether JSON that is not glTF 2.0 is glTF 1.0, whose lists are tables. The version is optional there.
fn is_version_1(json: &[u8]) -> bool {
    let Ok(value) = from_slice::<Value>(json) else { return false };
    let version = value.get("asset").and_then(|asset| asset.get("version"));
    match version.and_then(Value::as_str) {
        Some(version) => version.split('.').next() == Some("1"),
        None => ["accessors", "buffers", "meshes"].iter().any(|list| value.get(list).is_some_and(Value::is_object)),
    }
}

/// Accepts versions 2.x with a minimum version of at most 2.0.
fn check_version(path: &Path, root: &Root) -> Result<(), ReadError> {
    let version = &root.asset.version;
    if version.split('.').next() != Some("2") {
        return Err(ReadError::unsupported(path, format!("glTF {version}")));
    }
    match root.asset.min_version.as_deref() {
        None | Some("2.0") => Ok(()),
        Some(least) => Err(ReadError::unsupported(path, format!("glTF {least}"))),
    }
}
