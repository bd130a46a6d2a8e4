//! A parsed file with its buffers in memory: what the other stations look things up in.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use gltf::json::deserialize::{from_slice, from_value};
use gltf::json::validation::USize64;
use gltf::json::{Error, Root, Value};

use super::container;
use super::instancing;
use super::uri;
use crate::read::ReadError;
use crate::read::folder::Folder;
use crate::read::remarks::Remarks;

/// Extensions that a file may require.
///
/// Those of materials change what this crate's surfaces cannot say anyway, and those of textures bring images that are not
/// read; without them the picture is an approximation, not wrong geometry, and what is left out is said.
const SUPPORTED: [&str; 19] = [
    instancing::NAME,
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "MSFT_texture_dds",
];

/// Attributes of meshes that morph targets may move and that are not moved here.
pub(super) const UNMORPHED: [&str; 3] = ["TEXCOORD_0", "TEXCOORD_1", "COLOR_0"];

/// What a file says and the structures of `gltf` do not keep.
#[derive(Default)]
pub(super) struct LeftOut {
    /// Channels of the first animation that name no node.
    pub(super) n_channels_without_node: usize,
    /// By mesh, the morph targets that move one of [`UNMORPHED`], with which.
    pub(super) unmorphed: HashMap<usize, BTreeSet<(usize, &'static str)>>,
}

/// A file in memory.
pub(super) struct Document<'a> {
    /// The JSON. Indices in it are not checked, and arrive modulo 2^32.
    pub(super) root: Root,
    /// The folder that images are read from.
    pub(super) folder: Folder,
    /// What [`Document::root`] lacks of the file.
    pub(super) left_out: LeftOut,
    path: &'a Path,
    buffers: Vec<Cow<'a, [u8]>>,
}

impl<'a> Document<'a> {
    /// Parses the file and loads its buffers.
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ReadError> {
        let container = container::split(path, bytes)?;
        let (root, left_out) =
            parse(container.json).map_err(|source| ReadError::malformed(path, "json", source.to_string()))?;
        check_version(path, &root)?;
        if let Some(extension) = root.extensions_required.iter().find(|name| !SUPPORTED.contains(&name.as_str())) {
            return Err(ReadError::unsupported(path, format!("the required extension {extension}")));
        }
        let folder = Folder::of(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
        let mut document = Self { root, folder, left_out, path, buffers: Vec::new() };
        document.buffers = (0..document.root.buffers.len())
            .map(|k| document.load_buffer(k, container.bin))
            .collect::<Result<_, _>>()?;
        Ok(document)
    }

    /// Notes what the file's extensions say and nobody reads, but for those that `remarks` know from the materials.
    pub(super) fn note_extensions(&self, remarks: &mut Remarks) {
        let of_nodes = self.root.nodes.iter().enumerate().flat_map(|(k, node)| {
            let names = node.extensions.iter().flat_map(|all| all.others.keys());
            names.map(move |name| (name, format!("node {k}")))
        });
        let used = self.root.extensions_used.iter().map(|name| (name, "extensionsUsed".to_owned()));
        for (name, place) in of_nodes.chain(used).filter(|(name, _)| !SUPPORTED.contains(&name.as_str())) {
            remarks.note_once(&format!("{name} is ignored"), &place);
        }
    }

    /// A breach of the rules at a place in this file.
    pub(super) fn malformed(&self, place: impl Into<String>, message: impl Into<String>) -> ReadError {
        ReadError::malformed(self.path, place, message)
    }

    /// The item of one of the lists of [`Document::root`], or the error that `place` names an item beyond its end.
    pub(super) fn get<'b, T>(&self, list: &'b [T], index: usize, kind: &str, place: &str) -> Result<&'b T, ReadError> {
        list.get(index).ok_or_else(|| self.malformed(place, format!("names {kind} {index} of {}", list.len())))
    }

    /// The bytes of a buffer view and the stride that it asks for.
    pub(super) fn view(&self, index: usize, place: &str) -> Result<(&[u8], Option<usize>), ReadError> {
        let view = self.get(&self.root.buffer_views, index, "buffer view", place)?;
        let place = format!("buffer view {index}");
        let buffer = self.get(&self.buffers, view.buffer.value(), "buffer", &place)?;
        let offset = view.byte_offset.unwrap_or_default();
        let bytes = range(buffer, offset, view.byte_length).ok_or_else(|| {
            let (offset, length) = (offset.0, view.byte_length.0);
            self.malformed(&place, format!("has {length} bytes from {offset} on, its buffer has {}", buffer.len()))
        })?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }

    /// Elements that a file may make of none of its bytes, or again and again of the same: as many as its buffers have bytes, and
    /// 64 MiB of the largest whatever they have.
    pub(super) fn most_from_nothing(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.len()).sum::<usize>().max(1 << 20)
    }

    fn load_buffer(&self, index: usize, bin: Option<&'a [u8]>) -> Result<Cow<'a, [u8]>, ReadError> {
        let buffer = &self.root.buffers[index];
        let place = format!("buffer {index}");
        let mut bytes = match (&buffer.uri, bin) {
            (Some(uri), _) => {
                Cow::Owned(uri::load(uri, &self.folder).map_err(|error| self.malformed(&place, error.to_string()))?)
            }
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(self.malformed(place, "has neither a uri nor a BIN chunk")),
        };
        let n_bytes = bytes.len();
        let length =
            usize::try_from(buffer.byte_length.0).ok().filter(|&length| length <= n_bytes).ok_or_else(|| {
                self.malformed(place, format!("promises {} bytes and has {n_bytes}", buffer.byte_length.0))
            })?;
        match &mut bytes {
            Cow::Borrowed(bytes) => *bytes = &bytes[..length],
            Cow::Owned(bytes) => bytes.truncate(length),
        }
        Ok(bytes)
    }
}

/// Parses the JSON; nesting beyond 128 levels is refused by the parser.
///
/// A scene may lack `nodes` and a channel of an animation a node, but not for the structures of `gltf`: the list is added
/// and the channel left out before they are made. Such channels of the first animation are counted.
fn parse(json: &[u8]) -> Result<(Root, LeftOut), Error> {
    let mut left_out = LeftOut::default();
    let mut value: Value = from_slice(json)?;
    for scene in value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut() {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    for (k, animation) in value.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten().enumerate() {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            let n_channels = channels.len();
            channels.retain(|channel| channel.get("target").is_none_or(|target| target.get("node").is_some()));
            left_out.n_channels_without_node += if k == 0 { n_channels - channels.len() } else { 0 };
        }
    }
    for (mesh, item) in items(&value, "meshes").enumerate() {
        for (target, moved) in items(item, "primitives").flat_map(|primitive| items(primitive, "targets").enumerate()) {
            for name in UNMORPHED.into_iter().filter(|name| moved.get(name).is_some()) {
                left_out.unmorphed.entry(mesh).or_default().insert((target, name));
            }
        }
    }
    // Where that fails, only the text knows the line.
    let root = from_value(value).or_else(|_| from_slice(json))?;
    Ok((root, left_out))
}

/// The items of a list, none where there is no list.
fn items<'a>(value: &'a Value, list: &str) -> impl Iterator<Item = &'a Value> {
    value.get(list).and_then(Value::as_array).into_iter().flatten()
}

/// `length` bytes from `offset` on, if there are as many.
pub(super) fn range(bytes: &[u8], offset: USize64, length: USize64) -> Option<&[u8]> {
    let end = offset.0.checked_add(length.0)?;
    bytes.get(usize::try_from(offset.0).ok()?..usize::try_from(end).ok()?)
}

/// Versions 2.x are read, where the file does not ask for a later minor version than 2.0.
fn check_version(path: &Path, root: &Root) -> Result<(), ReadError> {
    let version = &root.asset.version;
    if version.split('.').next() != Some("2") {
        return Err(ReadError::unsupported(path, format!("version {version} of glTF")));
    }
    match root.asset.min_version.as_deref() {
        None | Some("2.0") => Ok(()),
        Some(least) => Err(ReadError::unsupported(path, format!("version {least} of glTF"))),
    }
}
