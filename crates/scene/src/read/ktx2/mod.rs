//! KTX2 textures: level 0 of a 2D image, of 8-bit channels or Basis Universal (ETC1S, UASTC), also compressed by Zstandard.
//!
//! The decoders are ours: `basisu` 0.1, which decodes to every format of a device, has 600,000 lines of tables and panics on some
//! malformed files, as does `ktx2` 0.5.
//!
//! Source: KTX File Format Specification, version 2.0.

mod bits;
mod etc1s;
mod uastc;

use std::borrow::Cow;
use std::io::Read;

use crate::{Encoding, Texture};

/// Upper bound of texels per byte: a block of Zstandard repeats one byte up to 2^17 times and takes four bytes.
const MAX_TEXELS_PER_BYTE: u64 = 1 << 16;

/// Places in the header of words, then of long words.
const FORMAT: usize = 12;
const WIDTH: usize = 20;
const SCHEME: usize = 44;
const DESCRIPTOR: usize = 48;
const PAIRS: usize = 56;
const GLOBAL: usize = 64;
const LEVEL: usize = 80;

/// Schemes of compression.
const BASIS_LZ: u32 = 1;
const ZSTANDARD: u32 = 2;

/// Color models and the transfer function of sRGB (Khronos Data Format Specification).
const ETC1S: u8 = 163;
const UASTC: u8 = 166;
const SRGB: u8 = 2;

/// What is wrong with compressed data.
type Flaw = &'static str;

const END: Flaw = "unexpected end of image data";

/// Decodes an image. Errors do not contain `name`.
pub(super) fn decode(name: &str, bytes: &[u8], max_texels: u64) -> Result<Texture, String> {
    let file = File { bytes };
    let [format, scheme] = [file.word(FORMAT)?, file.word(SCHEME)?];
    let mut sizes = [0; 6];
    for (k, size) in sizes.iter_mut().enumerate() {
        *size = file.word(WIDTH + 4 * k)?;
    }
    let [width, height, depth, n_layers, n_faces, n_levels] = sizes;
    if height == 0 || depth > 1 || n_layers > 1 || n_faces != 1 {
        return Err("KTX2 images with one, three or more dimensions, layers or faces are not supported".to_owned());
    }
    let max_texels = max_texels.min((bytes.len() as u64).saturating_mul(MAX_TEXELS_PER_BYTE));
    if width == 0 || u64::from(width) * u64::from(height) > max_texels {
        return Err(format!("invalid image size {width} x {height}"));
    }
    let size = [width as usize, height as usize];
    let (mut texels, is_srgb) = match format {
        0 => {
            let [model, _, transfer, _] = file.word(file.word(DESCRIPTOR)? as usize + 12)?.to_le_bytes();
            let texels = match model {
                ETC1S => etc1s(&file, scheme, size, n_levels)?,
                UASTC => uastc(&file, scheme, size)?,
                other => return Err(format!("KTX2 of color model {other} is not supported; use ETC1S or UASTC")),
            };
            (texels, transfer == SRGB)
        }
        format => plain(&file, format, scheme, size[0] * size[1])?,
    };
    if let Some(&[a, b, c, d, ..]) = file.value("KTXswizzle") {
        swizzle(&mut texels, [a, b, c, d])?;
    }
    // Rows go from left to right and down, unless the file says otherwise.
    if let Some(&[x, y, ..]) = file.value("KTXorientation") {
        if x == b'l' {
            texels.chunks_mut(size[0]).for_each(<[_]>::reverse);
        }
        if y == b'u' {
            texels = texels.chunks(size[0]).rev().flatten().copied().collect();
        }
    }
    Ok(Texture::new(name, [width, height], texels, if is_srgb { Encoding::Srgb } else { Encoding::Linear }))
}

/// The bytes of a file.
struct File<'a> {
    bytes: &'a [u8],
}

impl<'a> File<'a> {
    fn word(&self, at: usize) -> Result<u32, Flaw> {
        let bytes = self.bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or("unexpected end of header")?;
        Ok(u32::from_le_bytes(*bytes))
    }

    /// The bytes whose offset and length are long words of the header.
    fn part(&self, at: usize) -> Result<&'a [u8], Flaw> {
        let long = |at: usize| {
            let [low, high] = [self.word(at)?, self.word(at + 4)?].map(u64::from);
            usize::try_from(low | high << 32).map_err(|_| END)
        };
        let (offset, length) = (long(at)?, long(at + 8)?);
        self.bytes.get(offset..).and_then(|rest| rest.get(..length)).ok_or(END)
    }

    /// The value of a key.
    fn value(&self, key: &str) -> Option<&'a [u8]> {
        let (offset, length) = (self.word(PAIRS).ok()? as usize, self.word(PAIRS + 4).ok()? as usize);
        let mut rest = self.bytes.get(offset..)?.get(..length)?;
        while let Some((length, tail)) = rest.split_first_chunk() {
            let length = u32::from_le_bytes(*length) as usize;
            let pair = tail.get(..length)?;
            if let Some(value) = pair.strip_prefix(key.as_bytes()).and_then(|value| value.strip_prefix(b"\0")) {
                return Some(value);
            }
            rest = tail.get(length.checked_next_multiple_of(4)?..)?;
        }
        None
    }
}

/// Texels of a format of 8-bit channels, and whether they are sRGB. Absent channels are 0, and 1 for alpha.
fn plain(file: &File<'_>, format: u32, scheme: u32, n_texels: usize) -> Result<(Vec<[u8; 4]>, bool), String> {
    // Numbers of Vulkan: normalized and sRGB, of one to four channels, two of them also from blue to red.
    let (n_bytes, is_bgr, is_srgb) = match format {
        9 | 15 => (1, false, format == 15),
        16 | 22 => (2, false, format == 22),
        23 | 29 => (3, false, format == 29),
        30 | 36 => (3, true, format == 36),
        37 | 43 => (4, false, format == 43),
        44 | 50 => (4, true, format == 50),
        other => {
            return Err(format!("KTX2 format {other} is not supported; use 8 bits per channel, or Basis Universal"));
        }
    };
    let data = level(file, scheme, n_texels * n_bytes)?;
    let texel = |bytes: &[u8]| {
        let mut texel = [0, 0, 0, u8::MAX];
        texel[..n_bytes].copy_from_slice(bytes);
        if is_bgr {
            texel.swap(0, 2);
        }
        texel
    };
    Ok((data.chunks_exact(n_bytes).map(texel).collect(), is_srgb))
}

/// The first `n_bytes` of the largest level.
fn level<'a>(file: &File<'a>, scheme: u32, n_bytes: usize) -> Result<Cow<'a, [u8]>, String> {
    let data = file.part(LEVEL)?;
    match scheme {
        0 => Ok(Cow::Borrowed(data.get(..n_bytes).ok_or(END)?)),
        ZSTANDARD => {
            let malformed = |error: &dyn std::fmt::Display| format!("malformed Zstandard data: {error}");
            let mut bytes = Vec::new();
            let decoder = ruzstd::StreamingDecoder::new(data).map_err(|error| malformed(&error))?;
            decoder.take(n_bytes as u64).read_to_end(&mut bytes).map_err(|error| malformed(&error))?;
            if bytes.len() < n_bytes { Err(END.to_owned()) } else { Ok(Cow::Owned(bytes)) }
        }
        other => Err(format!("KTX2 compressed by scheme {other} is not supported; use Zstandard")),
    }
}

/// Texels of UASTC.
fn uastc(file: &File<'_>, scheme: u32, [width, height]: [usize; 2]) -> Result<Vec<[u8; 4]>, String> {
    let blocks = [width.div_ceil(4), height.div_ceil(4)];
    let data = level(file, scheme, 16 * blocks[0] * blocks[1])?;
    let mut texels = vec![[0; 4]; width * height];
    for (k, &block) in data.as_chunks().0.iter().enumerate() {
        let colors = uastc::decode(block).map_err(malformed)?;
        for (at, color) in places(k, [width, height]).zip(colors).filter_map(|(at, color)| Some((at?, color))) {
            texels[at] = color;
        }
    }
    Ok(texels)
}

/// Texels of ETC1S.
fn etc1s(file: &File<'_>, scheme: u32, [width, height]: [usize; 2], n_levels: u32) -> Result<Vec<[u8; 4]>, String> {
    if scheme != BASIS_LZ {
        return Err(malformed("ETC1S without BasisLZ"));
    }
    let data = file.part(LEVEL)?;
    let (palettes, slices) = etc1s::Palettes::read(file.part(GLOBAL)?, n_levels.max(1) as usize).map_err(malformed)?;
    let blocks = [width.div_ceil(4), height.div_ceil(4)];
    let mut texels = vec![[0, 0, 0, u8::MAX]; width * height];
    let mut decode = |[offset, length]: [u32; 2], put: fn(&mut [u8; 4], [u8; 3])| {
        let slice = data.get(offset as usize..).and_then(|rest| rest.get(..length as usize)).ok_or(END)?;
        palettes.decode(slice, blocks, |k, colors| {
            for (at, color) in places(k, [width, height]).zip(colors).filter_map(|(at, color)| Some((at?, color))) {
                put(&mut texels[at], color);
            }
        })
    };
    decode(slices.color, |texel, color| texel[..3].copy_from_slice(&color)).map_err(malformed)?;
    if slices.alpha[1] > 0 {
        decode(slices.alpha, |texel, [_, green, _]| texel[3] = green).map_err(malformed)?;
    }
    Ok(texels)
}

fn malformed(flaw: Flaw) -> String {
    format!("malformed Basis Universal data: {flaw}")
}

/// The places in an image of the texels of a block; `None` for those beyond its edges.
fn places(block: usize, [width, height]: [usize; 2]) -> impl Iterator<Item = Option<usize>> {
    let row = width.div_ceil(4);
    let (left, top) = (block % row * 4, block / row * 4);
    (0..16).map(move |texel| {
        let (x, y) = (left + texel % 4, top + texel / 4);
        (x < width && y < height).then_some(y * width + x)
    })
}

/// Replaces channels by others, or by 0 or 1.
fn swizzle(texels: &mut [[u8; 4]], source: [u8; 4]) -> Result<(), String> {
    if source == *b"rgba" {
        return Ok(());
    }
    if !source.iter().all(|channel| b"rgba01".contains(channel)) {
        return Err(format!("unknown KTXswizzle {:?}", String::from_utf8_lossy(&source)));
    }
    for texel in texels {
        let [r, g, b, a] = *texel;
        *texel = source.map(|channel| match channel {
            b'r' => r,
            b'g' => g,
            b'b' => b,
            b'a' => a,
            b'0' => 0,
            _ => u8::MAX,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use crate::read::image::MAX_TEXELS;
    use crate::read::testing::{damage, damaged};

    /// Words of the header of Vulkan formats.
    const R8_UNORM: u32 = 9;
    const RG8_UNORM: u32 = 16;
    const RGBA8_SRGB: u32 = 43;
    const BGR8_UNORM: u32 = 30;
    const BC7: u32 = 145;

    /// A file under construction.
    #[derive(Clone)]
    struct File {
        format: u32,
        /// Width, height, depth, layers, faces.
        counts: [u32; 5],
        scheme: u32,
        pairs: &'static [(&'static str, &'static str)],
        data: Vec<u8>,
    }

    impl File {
        fn bytes(&self) -> Vec<u8> {
            let mut pairs = Vec::new();
            for (key, value) in self.pairs {
                let pair = [key.as_bytes(), b"\0", value.as_bytes(), b"\0"].concat();
                pairs.extend(u32::try_from(pair.len()).unwrap().to_le_bytes());
                pairs.extend(&pair);
                pairs.resize(pairs.len().next_multiple_of(4), 0);
            }
            // A basic descriptor without samples: 4 bytes of length, then 24.
            let descriptor: Vec<u8> = [28_u32, 0, 2 | 24 << 16, 1 | 1 << 8 | 2 << 16, 0, 4, 0]
                .iter()
                .flat_map(|word| word.to_le_bytes())
                .collect();
            let [descriptor_at, pairs_at] = [104, 104 + descriptor.len()];
            let data_at = (pairs_at + pairs.len()).next_multiple_of(8);
            let [width, height, depth, layers, faces] = self.counts;
            let words = [self.format, 1, width, height, depth, layers, faces, 1, self.scheme];
            let index = [descriptor_at, descriptor.len(), pairs_at, pairs.len()].map(|x| u32::try_from(x).unwrap());
            let longs = [0, 0, data_at, self.data.len(), self.data.len()].map(|x| x as u64);
            let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
            bytes.extend(words.iter().chain(&index).flat_map(|word| word.to_le_bytes()));
            bytes.extend(longs.iter().flat_map(|long| long.to_le_bytes()));
            bytes.extend(descriptor);
            bytes.extend(pairs);
            bytes.resize(data_at, 0);
            bytes.extend(&self.data);
            bytes
        }
    }

    /// Two texels in a column.
    fn column() -> File {
        let data = vec![10, 20, 30, 40, 50, 60, 70, 80];
        File { format: RGBA8_SRGB, counts: [1, 2, 0, 0, 1], scheme: 0, pairs: &[], data }
    }

    /// A frame of Zstandard: one block, stored or a repeated byte.
    fn frame(content: &[u8], repeats: Option<u32>) -> Vec<u8> {
        let n = repeats.unwrap_or_else(|| u32::try_from(content.len()).unwrap());
        let header = 1 | u32::from(repeats.is_some()) << 1 | n << 3;
        [&[0x28, 0xb5, 0x2f, 0xfd, 0xa0][..], &n.to_le_bytes(), &header.to_le_bytes()[..3], content].concat()
    }

    fn texels(file: &File) -> Vec<[u8; 4]> {
        decode("a", &file.bytes(), MAX_TEXELS).unwrap().texels
    }

    #[test]
    fn reads_plain_formats() {
        let decoded = decode("a", &column().bytes(), MAX_TEXELS).unwrap();
        assert_eq!((decoded.width, decoded.height, decoded.encoding), (1, 2, Encoding::Srgb));
        assert_eq!(decoded.texels, [[10, 20, 30, 40], [50, 60, 70, 80]]);
        let gray = File { format: R8_UNORM, data: vec![1, 2], ..column() };
        assert_eq!(decode("a", &gray.bytes(), MAX_TEXELS).unwrap().encoding, Encoding::Linear);
        assert_eq!(texels(&gray), [[1, 0, 0, 255], [2, 0, 0, 255]]);
        assert_eq!(
            texels(&File { format: RG8_UNORM, data: vec![1, 2, 3, 4], ..column() }),
            [[1, 2, 0, 255], [3, 4, 0, 255]]
        );
        let bgr = File { format: BGR8_UNORM, data: vec![1, 2, 3, 4, 5, 6], ..column() };
        assert_eq!(texels(&bgr), [[3, 2, 1, 255], [6, 5, 4, 255]]);
    }

    #[test]
    fn channels_and_orientation_of_the_file_are_applied() {
        let gray = File { format: R8_UNORM, data: vec![1, 2], pairs: &[("KTXswizzle", "rrr1")], ..column() };
        assert_eq!(texels(&gray), [[1, 1, 1, 255], [2, 2, 2, 255]]);
        let upward = File { pairs: &[("KTXorientation", "ru")], ..column() };
        assert_eq!(texels(&upward), [[50, 60, 70, 80], [10, 20, 30, 40]]);
        let mirrored = File { counts: [2, 1, 0, 0, 1], pairs: &[("KTXorientation", "ld")], ..column() };
        assert_eq!(texels(&mirrored), [[50, 60, 70, 80], [10, 20, 30, 40]]);
        let unknown = File { pairs: &[("KTXswizzle", "rgbx")], ..column() };
        assert_eq!(decode("a", &unknown.bytes(), MAX_TEXELS).unwrap_err(), "unknown KTXswizzle \"rgbx\"");
    }

    #[test]
    fn decompresses_zstandard() {
        let packed = File { scheme: 2, data: frame(&column().data, None), ..column() };
        assert_eq!(texels(&packed), texels(&column()));
        let repeated = File { scheme: 2, data: frame(&[7], Some(8)), ..column() };
        assert_eq!(texels(&repeated), [[7; 4]; 2]);
        let short = File { scheme: 2, data: frame(&[7], Some(7)), ..column() };
        assert_eq!(decode("a", &short.bytes(), MAX_TEXELS).unwrap_err(), "unexpected end of image data");
        let broken = File { scheme: 2, ..column() };
        assert!(decode("a", &broken.bytes(), MAX_TEXELS).unwrap_err().starts_with("malformed Zstandard data: "));
    }

    #[test]
    fn other_files_are_refused_by_name() {
        for (file, words) in [
            (File { format: BC7, ..column() }, "KTX2 format 145 is not supported"),
            (File { scheme: 3, ..column() }, "KTX2 compressed by scheme 3 is not supported; use Zstandard"),
            (File { counts: [1, 2, 0, 0, 6], ..column() }, "layers or faces are not supported"),
            (File { counts: [1, 2, 2, 0, 1], ..column() }, "layers or faces are not supported"),
            (File { counts: [1, 0, 0, 0, 1], ..column() }, "layers or faces are not supported"),
            (File { counts: [1 << 14, 1 << 14, 0, 0, 1], ..column() }, "invalid image size 16384 x 16384"),
            (File { counts: [1, 3, 0, 0, 1], ..column() }, "unexpected end of image data"),
            (File { format: 0, ..column() }, "KTX2 of color model 1 is not supported; use ETC1S or UASTC"),
        ] {
            let error = decode("a", &file.bytes(), MAX_TEXELS).unwrap_err();
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    /// The files of the reference encoder, and random blocks of all modes of UASTC.
    fn samples() -> Vec<(&'static str, Vec<u8>)> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/ktx2");
        ["etc1s", "etc1s_alpha", "uastc", "modes"]
            .map(|name| (name, fs::read(folder.join(name).with_extension("ktx2")).unwrap()))
            .to_vec()
    }

    #[test]
    fn texels_of_basis_universal_are_those_of_the_reference_decoder() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/ktx2");
        for (name, bytes) in samples() {
            let decoded = decode(name, &bytes, MAX_TEXELS).unwrap();
            let png = fs::read(folder.join(name).with_extension("png")).unwrap();
            let want = crate::read::image::decode(name, &png).unwrap();
            // The random blocks are linear; they do not fill the last column and row.
            let shape = if name == "modes" { (55, 15, Encoding::Linear) } else { (12, 8, Encoding::Srgb) };
            assert_eq!((decoded.width, decoded.height, decoded.encoding), shape, "{name}");
            assert!(decoded.texels == want.texels, "{name}");
        }
    }

    #[test]
    fn flaws_of_basis_universal_are_named() {
        let etc1s = &samples()[0].1;
        let changed = |at: usize, word: u32| {
            let mut bytes = etc1s.clone();
            bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
            decode("a", &bytes, MAX_TEXELS).unwrap_err()
        };
        assert_eq!(changed(SCHEME, 0), "malformed Basis Universal data: ETC1S without BasisLZ");
        assert_eq!(changed(LEVEL + 8, 1 << 30), "unexpected end of image data");
        assert_eq!(changed(GLOBAL + 8, 30), "malformed Basis Universal data: unexpected end of global data");
        let mut modes = samples()[3].1.clone();
        let data = modes.len() - 16;
        // The one code that stands for no mode.
        modes[data] = 0x45;
        assert_eq!(
            decode("a", &modes, MAX_TEXELS).unwrap_err(),
            "malformed Basis Universal data: unknown mode of a block"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]

        #[test]
        fn mutated_files_never_panic(which in 0..5_usize, change in damage()) {
            let file = samples().get(which).map_or_else(|| column().bytes(), |(_, bytes)| bytes.clone());
            if let Ok(texture) = decode("a", &damaged(file, &change), MAX_TEXELS) {
                prop_assert_eq!(texture.texels.len() as u64, u64::from(texture.width) * u64::from(texture.height));
            }
        }
    }
}
