//! Buffer views compressed by `EXT_meshopt_compression` or `KHR_meshopt_compression`.
//!
//! They are decompressed when the file is opened. What they declare is compared with the size of the compressed data before
//! anything is allocated. The decoder is meshoptimizer's own, in C++; it checks what it reads, and its assertions are checked
//! here beforehand.

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
#[cfg(feature = "meshopt")]
pub(super) const MAX_BYTES: u64 = 1 << 32;

#[cfg(feature = "meshopt")]
pub(super) use decoder::Compressed;

#[cfg(feature = "meshopt")]
mod decoder {
    use gltf::json::Value;

    use super::Decompressed;

    /// What a compressed view declares.
    pub(crate) struct Compressed<'a> {
        mode: &'a str,
        filter: &'a str,
        count: usize,
        stride: usize,
        /// Index of the buffer with the compressed bytes, offset and length there.
        pub(crate) buffer: usize,
        pub(crate) offset: u64,
        pub(crate) length: u64,
    }

    impl<'a> Compressed<'a> {
        /// Reads and checks the extension.
        pub(crate) fn read(extension: &'a Value) -> Result<Self, String> {
            let optional = |key: &str| match extension.get(key) {
                None => Ok(0),
                Some(value) => value.as_u64().ok_or_else(|| format!("{key} is {value}")),
            };
            let number =
                |key: &str| extension.get(key).map_or_else(|| Err(format!("missing {key}")), |_| optional(key));
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
        pub(crate) fn n_bytes(&self) -> u64 {
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
        pub(crate) fn decompress(&self, bytes: &[u8]) -> Result<Decompressed, String> {
            let (short, long) =
                (|list: Vec<u16>| of(&list, u16::to_ne_bytes), |list: Vec<u32>| of(&list, u32::to_ne_bytes));
            let elements = match (self.mode, self.stride) {
                ("TRIANGLES", 2) => meshopt::decode_index_buffer(bytes, self.count).ok().map(short),
                ("TRIANGLES", _) => meshopt::decode_index_buffer(bytes, self.count).ok().map(long),
                ("INDICES", 2) => meshopt::decode_index_sequence(bytes, self.count).ok().map(short),
                ("INDICES", _) => meshopt::decode_index_sequence(bytes, self.count).ok().map(long),
                _ => attributes(self.stride, bytes, self.count),
            };
            let mut bytes = elements.ok_or("malformed compressed data")?;
            self.unfilter(&mut bytes);
            Ok(Decompressed { bytes, stride: self.stride })
        }

        /// Applies the filter to decompressed elements.
        fn unfilter(&self, bytes: &mut [u8]) {
            let narrow = self.stride == 4;
            match self.filter {
                "OCTAHEDRAL" if narrow => {
                    filtered(bytes, i8::from_ne_bytes, i8::to_ne_bytes, meshopt::decode_filter_oct)
                }
                "OCTAHEDRAL" => filtered(bytes, i16::from_ne_bytes, i16::to_ne_bytes, meshopt::decode_filter_oct),
                "COLOR" if narrow => filtered(bytes, u8::from_ne_bytes, u8::to_ne_bytes, meshopt::decode_filter_color),
                "COLOR" => filtered(bytes, u16::from_ne_bytes, u16::to_ne_bytes, meshopt::decode_filter_color),
                "QUATERNION" => filtered(bytes, i16::from_ne_bytes, i16::to_ne_bytes, meshopt::decode_filter_quat),
                // Each component by itself.
                "EXPONENTIAL" => {
                    filtered::<_, 4, 1>(bytes, u32::from_ne_bytes, u32::to_ne_bytes, meshopt::decode_filter_exp)
                }
                _ => {}
            }
        }
    }

    /// The bytes of a list.
    fn of<T: Copy, const N: usize>(list: &[T], bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
        list.iter().flat_map(|&x| bytes(x)).collect()
    }

    /// Applies a filter to elements of `N` components of `B` bytes.
    fn filtered<T: Copy, const B: usize, const N: usize>(
        bytes: &mut [u8],
        from: impl Fn([u8; B]) -> T,
        to: impl Fn(T) -> [u8; B],
        filter: impl Fn(&mut [[T; N]]),
    ) {
        let components: Vec<T> = bytes.as_chunks().0.iter().map(|&part| from(part)).collect();
        let mut elements = components.as_chunks().0.to_vec();
        filter(&mut elements);
        bytes.copy_from_slice(&of(elements.as_flattened(), to));
    }

    /// An element of attributes: the decoder takes the size from the type.
    #[derive(Clone, Copy)]
    struct Element<const WORDS: usize>([u32; WORDS]);

    impl<const WORDS: usize> Default for Element<WORDS> {
        fn default() -> Self {
            Self([0; WORDS])
        }
    }

    fn attributes_of<const WORDS: usize>(bytes: &[u8], count: usize) -> Option<Vec<u8>> {
        let elements: Vec<Element<WORDS>> = meshopt::decode_vertex_buffer(bytes, count).ok()?;
        Some(elements.iter().flat_map(|element| element.0).flat_map(u32::to_ne_bytes).collect())
    }

    /// Elements of `stride` bytes, a multiple of 4 up to 256.
    fn attributes(stride: usize, bytes: &[u8], count: usize) -> Option<Vec<u8>> {
        macro_rules! of_words {
            ($($words:literal)*) => {
                match stride / 4 {
                    $($words => attributes_of::<$words>(bytes, count),)*
                    _ => None,
                }
            };
        }
        of_words!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38 39
            40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
    }
}
