//! Buffer views compressed by `EXT_meshopt_compression` or `KHR_meshopt_compression`.
//!
//! They are decompressed when the file is opened. What they declare is compared with the size of the compressed data before
//! anything is allocated. The decoders are ours: meshoptimizer's is C++, which not every machine compiles.
//!
//! Sources: the appendices of the two extensions, which specify the bit streams; the codecs and filters of meshoptimizer
//! (Arseny Kapoulkine), whose streams are the tests.

mod filter;
mod index;
mod vertex;

use gltf::json::Value;

/// Names of the extensions, in the order in which they are looked for.
pub(super) const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// A decompressed buffer view.
pub(super) struct Decompressed {
    pub(super) bytes: Vec<u8>,
    /// Bytes from one element to the next.
    pub(super) stride: usize,
}

/// The extension of an object.
pub(super) fn extension<'a>(get: impl Fn(&str) -> Option<&'a Value>) -> Option<&'a Value> {
    NAMES.iter().find_map(|name| get(name))
}

/// Whether a buffer only stands in for programs that cannot decompress, and may have no content.
pub(super) fn is_fallback(extension: Option<&Value>) -> bool {
    extension.and_then(|extension| extension.get("fallback")).and_then(Value::as_bool).unwrap_or(false)
}

/// Most decompressed bytes of all buffer views of a file.
pub(super) const MAX_BYTES: u64 = 1 << 32;

/// What a compressed view declares.
pub(super) struct Compressed<'a> {
    mode: &'a str,
    filter: &'a str,
    count: usize,
    stride: usize,
    /// Index of the buffer with the compressed bytes, offset and length there.
    pub(super) buffer: usize,
    pub(super) offset: u64,
    pub(super) length: u64,
}

impl<'a> Compressed<'a> {
    /// Reads and checks the extension.
    pub(super) fn read(extension: &'a Value) -> Result<Self, String> {
        let optional = |key: &str| match extension.get(key) {
            None => Ok(0),
            Some(value) => value.as_u64().ok_or_else(|| format!("{key} is {value}")),
        };
        let number = |key: &str| extension.get(key).map_or_else(|| Err(format!("missing {key}")), |_| optional(key));
        let size = |key: &str| usize::try_from(number(key)?).map_err(|error| format!("{key}: {error}"));
        let word = |key: &str| extension.get(key).and_then(Value::as_str);
        let compressed = Self {
            mode: word("mode").ok_or("missing mode")?,
            filter: word("filter").unwrap_or("NONE"),
            count: size("count")?,
            stride: size("byteStride")?,
            buffer: size("buffer")?,
            offset: optional("byteOffset")?,
            length: number("byteLength")?,
        };
        compressed.check()?;
        Ok(compressed)
    }

    /// Bytes when decompressed.
    pub(super) fn n_bytes(&self) -> u64 {
        (self.count as u64).saturating_mul(self.stride as u64)
    }

    fn check(&self) -> Result<(), String> {
        let Self { mode, filter, count, stride, .. } = *self;
        let (is_stride, max_per_byte) = match mode {
            // A control byte describes four bytes each of up to 256 elements.
            "ATTRIBUTES" => (stride % 4 == 0 && (4..=256).contains(&stride), 1024 / stride.max(1) as u64),
            // At least a byte for each triangle, or index.
            "TRIANGLES" => ([2, 4].contains(&stride), 3),
            "INDICES" => ([2, 4].contains(&stride), 1),
            _ => return Err(format!("unknown mode '{mode}'")),
        };
        let is_filter = match filter {
            "NONE" => true,
            "OCTAHEDRAL" | "COLOR" => mode == "ATTRIBUTES" && [4, 8].contains(&stride),
            "QUATERNION" => mode == "ATTRIBUTES" && stride == 8,
            "EXPONENTIAL" => mode == "ATTRIBUTES",
            _ => return Err(format!("unknown filter '{filter}'")),
        };
        if !is_stride || !is_filter {
            return Err(format!("a stride of {stride} bytes is invalid for mode {mode} and filter {filter}"));
        }
        if mode == "TRIANGLES" && count % 3 != 0 {
            return Err(format!("{count} indices are no triangles"));
        }
        // Rounded up to whole blocks of 256 elements.
        if (count as u64).div_ceil(256).saturating_mul(256)
            > self.length.saturating_mul(max_per_byte.max(4)).saturating_add(256)
        {
            return Err(format!("{count} elements from {} bytes", self.length));
        }
        Ok(())
    }

    /// Decompresses the bytes of the view.
    pub(super) fn decompress(&self, bytes: &[u8]) -> Result<Decompressed, String> {
        let Self { mode, filter, count, stride, .. } = *self;
        let indices = |list: Vec<u32>| -> Vec<u8> {
            list.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
        };
        let elements = match mode {
            "TRIANGLES" => index::triangles(bytes, count).map(indices),
            "INDICES" => index::sequence(bytes, count).map(indices),
            _ => vertex::decode(bytes, count, stride),
        };
        let mut bytes = elements.map_err(|flaw| format!("malformed compressed data: {flaw}"))?;
        match (filter, stride) {
            ("OCTAHEDRAL", 4) => filter::octahedral_8(&mut bytes),
            ("OCTAHEDRAL", _) => filter::octahedral_16(&mut bytes),
            ("COLOR", 4) => filter::color_8(&mut bytes),
            ("COLOR", _) => filter::color_16(&mut bytes),
            ("QUATERNION", _) => filter::quaternion(&mut bytes),
            ("EXPONENTIAL", _) => filter::exponential(&mut bytes),
            _ => {}
        }
        Ok(Decompressed { bytes, stride })
    }
}

/// What is wrong with compressed bytes.
type Flaw = &'static str;

/// The bytes of a stream that are not yet read.
struct Stream<'a>(&'a [u8]);

impl<'a> Stream<'a> {
    /// The bytes after the header, which is `kind` in the high half and a version up to 1 in the low half, without the `n_tail`
    /// last bytes; the version; the last bytes.
    fn open(bytes: &'a [u8], kind: u8, n_tail: impl Fn(u8) -> usize) -> Result<(Self, u8, &'a [u8]), Flaw> {
        let (&header, rest) = bytes.split_first().ok_or(END)?;
        let version = header & 15;
        if header & 0xf0 != kind {
            return Err("the first byte is that of another codec");
        }
        if version > 1 {
            return Err("unknown version");
        }
        let (rest, tail) = rest.split_at(rest.len().checked_sub(n_tail(version)).ok_or(END)?);
        Ok((Self(rest), version, tail))
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], Flaw> {
        let (taken, rest) = self.0.split_at_checked(n).ok_or(END)?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, Flaw> {
        let (&byte, rest) = self.0.split_first().ok_or(END)?;
        self.0 = rest;
        Ok(byte)
    }

    /// Checks that everything was read.
    fn close(&self) -> Result<(), Flaw> {
        if self.0.is_empty() { Ok(()) } else { Err("bytes are left over") }
    }
}

const END: Flaw = "unexpected end";

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use gltf::json::deserialize::from_slice;

    use super::*;
    use crate::read::folder::Folder;
    use crate::read::gltf::container::load_uri;
    use crate::read::input::ReadOptions;

    /// The views of `tests/files/meshopt/streams.gltf`: stream by stream, what it declares and what the reference decoder makes
    /// of it.
    fn streams() -> Vec<(Value, Vec<u8>, Vec<u8>)> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/meshopt/streams.gltf");
        let json: Value = from_slice(&fs::read(&path).unwrap()).unwrap();
        let folder = Folder::of(&path, &ReadOptions::default()).unwrap();
        let buffer = |k: usize| load_uri(json["buffers"][k]["uri"].as_str().unwrap(), &folder).unwrap();
        let [streams, plain] = [buffer(0), buffer(1)];
        let part = |bytes: &[u8], view: &Value| {
            let [offset, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
            bytes[offset..][..length].to_vec()
        };
        let views = json["bufferViews"].as_array().unwrap().iter().map(|view| {
            let extension = &view["extensions"][NAMES[0]];
            (extension.clone(), part(&streams, extension), part(&plain, view))
        });
        views.collect()
    }

    #[test]
    fn elements_are_those_of_the_reference_decoder() {
        for (k, (extension, stream, plain)) in streams().into_iter().enumerate() {
            let compressed = Compressed::read(&extension).unwrap();
            let bytes = compressed.decompress(&stream).unwrap().bytes;
            // Its filters round by instructions that differ between processors.
            let is_close = match (compressed.filter, compressed.stride) {
                ("NONE" | "EXPONENTIAL", _) => bytes == plain,
                (_, 4) => bytes.iter().zip(&plain).all(|(a, b)| a.wrapping_sub(*b).wrapping_add(1) <= 2),
                _ => {
                    let [a, b] =
                        [&bytes, &plain].map(|bytes| bytes.as_chunks().0.iter().map(|&x| u16::from_le_bytes(x)));
                    a.zip(b).all(|(a, b)| a.wrapping_sub(b).wrapping_add(1) <= 2)
                }
            };
            assert!(is_close && bytes.len() == plain.len(), "stream {k}: {extension}");
        }
    }

    #[test]
    fn flaws_are_named() {
        let decompress = |which: usize, change: fn(&mut Vec<u8>)| {
            let (extension, mut stream, _) = streams().swap_remove(which);
            change(&mut stream);
            Compressed::read(&extension).unwrap().decompress(&stream).err().unwrap_or_default()
        };
        // The first streams are elements of both versions, the seventh is triangles.
        for which in [0, 1, 6, 7] {
            assert_eq!(decompress(which, |_| {}), "");
            assert!(
                decompress(which, |bytes| bytes[0] ^= 0x40).ends_with("data: the first byte is that of another codec")
            );
            assert!(decompress(which, |bytes| bytes[0] |= 2).ends_with("data: unknown version"));
            assert!(decompress(which, |bytes| bytes.truncate(bytes.len() / 3)).ends_with("data: unexpected end"));
        }
        assert!(decompress(0, |bytes| bytes.push(0)).ends_with("data: bytes are left over"));
    }
}
