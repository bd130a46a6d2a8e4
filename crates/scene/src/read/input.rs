//! A file to read: the options, and its format and content, decompressed and with text in UTF-8.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::error::ReadError;
#[cfg(feature = "off")]
use super::off::is_off;
#[cfg(feature = "stl")]
use super::stl::is_stl;
use super::text;

/// Options of [`read_with`](super::read_with).
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
    /// Folders in which images are searched for that are neither where the file says nor in its own folder.
    pub texture_paths: Vec<PathBuf>,
    /// Whether the file may refer to files outside its folder by `..` and by links.
    pub allow_parent: bool,
    /// Radius of lines for which the file states none, in world units; `None` for a two-thousandth of their extent, in G-code for 0.2
    /// and in molecules for 0.1.
    pub line_radius: Option<f32>,
    /// Radius of the balls that stand for points, in world units; `None` to skip points, in molecules for half the covalent radius.
    pub point_radius: Option<f32>,
}

/// Bytes examined for signatures.
const HEAD_BYTES: usize = 1024;

/// Signature of gzip (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// A format of meshes or scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Obj,
    Ply,
    Stl,
    Off,
    Gltf,
}

impl Format {
    /// Its name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Off => "OFF",
            Self::Gltf => "glTF",
        }
    }
}

/// A file in memory, decompressed, with text in UTF-8.
pub(super) struct Input {
    pub(super) format: Format,
    pub(super) bytes: Vec<u8>,
}

/// Reads a file. One of an unknown format is not read beyond its start.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Input, ReadError> {
    for folder in &options.texture_paths {
        let is_folder = folder.metadata().map_err(ReadError::io(folder))?.is_dir();
        if !is_folder {
            return Err(ReadError::io(folder)(std::io::ErrorKind::NotADirectory.into()));
        }
    }
    let io_error = ReadError::io(path);
    let mut file = File::open(path).map_err(&io_error)?;
    let mut bytes = Vec::new();
    (&mut file).take(HEAD_BYTES as u64).read_to_end(&mut bytes).map_err(&io_error)?;
    if bytes.starts_with(&GZIP) {
        file.read_to_end(&mut bytes).map_err(&io_error)?;
        let bytes = as_utf8(decompress(path, &bytes)?, None);
        let format = format_of(inner_name(path).extension(), &bytes, bytes.len() as u64);
        check_content(path, format, &bytes, bytes.len() as u64)?;
        return format.map(|format| Input { format, bytes }).ok_or(ReadError::UnknownFormat { path: path.to_owned() });
    }
    let n_bytes = file.metadata().map_err(&io_error)?.len();
    let start = as_utf8(bytes.clone(), Some(n_bytes));
    let format = format_of(path.extension(), &start, n_bytes);
    let format = format.ok_or_else(|| match is_gz(path) {
        true => not_gzip(path),
        false => ReadError::UnknownFormat { path: path.to_owned() },
    })?;
    check_content(path, Some(format), &start, n_bytes)?;
    file.read_to_end(&mut bytes).map_err(&io_error)?;
    Ok(Input { format, bytes: as_utf8(bytes, Some(n_bytes)) })
}

/// Rejects a file whose name is that of a format and whose content clearly is something else.
fn check_content(path: &Path, format: Option<Format>, bytes: &[u8], n_bytes: u64) -> Result<(), ReadError> {
    if n_bytes == 0 && format.is_some() {
        return Err(ReadError::malformed(path, "content", "the file is empty"));
    }
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    let found = text::other_content(head).filter(|_| format.is_some() && !is_stl(head, n_bytes));
    found.map_or(Ok(()), |found| Err(ReadError::malformed(path, "content", found)))
}

/// The bytes of a file, or of its start where it has `n_bytes` in all, in UTF-8 if they are a text of UTF-16.
fn as_utf8(bytes: Vec<u8>, n_bytes: Option<u64>) -> Vec<u8> {
    // The first bytes of a binary STL file are anything.
    let is_binary = is_stl(&bytes[..bytes.len().min(HEAD_BYTES)], n_bytes.unwrap_or(bytes.len() as u64));
    if is_binary { bytes } else { text::from_utf16(bytes) }
}

/// All bytes of a file, decompressed.
pub(super) fn read_all(path: &Path) -> Result<Vec<u8>, ReadError> {
    let bytes = std::fs::read(path).map_err(ReadError::io(path))?;
    match bytes.starts_with(&GZIP) {
        true => decompress(path, &bytes),
        false if is_gz(path) => Err(not_gzip(path)),
        false => Ok(bytes),
    }
}

/// Whether a file is compressed by its name.
fn is_gz(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"))
}

/// The name whose extension is that of the content: `model.obj` of `model.obj.gz`.
pub(super) fn inner_name(path: &Path) -> &Path {
    path.file_stem().filter(|_| is_gz(path)).map_or(path, Path::new)
}

fn not_gzip(path: &Path) -> ReadError {
    ReadError::malformed(path, "header", "not a gzip file")
}

/// The format by the first bytes of a file of `n_bytes`, then by extension.
fn format_of(extension: Option<&OsStr>, bytes: &[u8], n_bytes: u64) -> Option<Format> {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    let extension = extension.unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match (head, &extension[..]) {
        ([b'g', b'l', b'T', b'F', ..], _) => Some(Format::Gltf),
        _ if matches!(text::after_mark(head), [b'p', b'l', b'y', b'\n' | b'\r', ..]) => Some(Format::Ply),
        _ if is_stl(head, n_bytes) => Some(Format::Stl),
        _ if is_off(head) => Some(Format::Off),
        (_, "gltf" | "glb") => Some(Format::Gltf),
        (_, "ply") => Some(Format::Ply),
        (_, "obj") => Some(Format::Obj),
        (_, "stl") => Some(Format::Stl),
        (_, "off") => Some(Format::Off),
        _ if is_gltf(head) => Some(Format::Gltf),
        _ => None,
    }
}

/// Whether the first bytes of a file without a known extension are glTF as JSON.
fn is_gltf(head: &[u8]) -> bool {
    text::after_mark(head).trim_ascii_start().starts_with(b"{") && head.windows(7).any(|word| word == b"\"asset\"")
}

/// Without the reader, STL is known by its extension only.
#[cfg(not(feature = "stl"))]
fn is_stl(_: &[u8], _: u64) -> bool {
    false
}

/// Without the reader, OFF is known by its extension only.
#[cfg(not(feature = "off"))]
fn is_off(_: &[u8]) -> bool {
    false
}

/// Largest size of decompressed content: a small file cannot exhaust the memory of usual machines.
#[cfg(feature = "gzip")]
const MAX_DECOMPRESSED_BYTES: u64 = 1 << 32;

/// Decompresses all members of a gzip file.
#[cfg(feature = "gzip")]
fn decompress(path: &Path, bytes: &[u8]) -> Result<Vec<u8>, ReadError> {
    let mut content = Vec::new();
    let decoder = flate2::read::MultiGzDecoder::new(bytes);
    let n_bytes = decoder.take(MAX_DECOMPRESSED_BYTES + 1).read_to_end(&mut content);
    let n_bytes = n_bytes.map_err(|error| ReadError::malformed(path, "gzip", error.to_string()))?;
    if n_bytes as u64 > MAX_DECOMPRESSED_BYTES {
        return Err(ReadError::unsupported(path, "gzip with more than 4 GiB of content"));
    }
    Ok(content)
}

#[cfg(not(feature = "gzip"))]
fn decompress(path: &Path, _: &[u8]) -> Result<Vec<u8>, ReadError> {
    Err(ReadError::missing_feature(path, "gzip", "gzip"))
}
