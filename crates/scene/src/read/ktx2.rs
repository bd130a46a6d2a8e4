//! KTX2 textures: level 0 of a 2D image, of 8-bit channels or Basis Universal (ETC1S, UASTC), also compressed by Zstandard.
//!
//! Source: KTX File Format Specification, version 2.0.

use std::io::Read;
use std::ops::Range;
use std::panic::catch_unwind;

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use ktx2::{ColorModel, Format, Level, Reader, SupercompressionScheme, TransferFunction};

use crate::{Encoding, Texture};

/// Upper bound of texels per byte: a block of Zstandard repeats one byte up to 2^17 times and takes four bytes.
const MAX_TEXELS_PER_BYTE: u64 = 1 << 16;

/// Where a file has offset and length of its pairs of keys and values.
const PAIRS: Range<usize> = 56..64;

/// Decodes an image. Errors do not contain `name`.
///
/// `ktx2` 0.5.0 and `basisu` 0.1.0 panic on some malformed files (`tests::mutated_files_never_panic` finds such files), which
/// is an error here.
pub(super) fn decode(name: &str, bytes: &[u8], max_texels: u64) -> Result<Texture, String> {
    catch_unwind(|| decode_trusting(name, bytes, max_texels)).unwrap_or_else(|_| Err("malformed KTX2".to_owned()))
}

fn decode_trusting(name: &str, bytes: &[u8], max_texels: u64) -> Result<Texture, String> {
    let reader = Reader::new(bytes).map_err(|error| format!("malformed KTX2: {error}"))?;
    let header = reader.header();
    let (width, height) = (header.pixel_width, header.pixel_height);
    if height == 0 || header.pixel_depth > 1 || header.layer_count > 1 || header.face_count != 1 {
        return Err("KTX2 images with one, three or more dimensions, layers or faces are not supported".to_owned());
    }
    let max_texels = max_texels.min((bytes.len() as u64).saturating_mul(MAX_TEXELS_PER_BYTE));
    if u64::from(width) * u64::from(height) > max_texels {
        return Err(format!("invalid image size {width} x {height}"));
    }
    let n_texels = width as usize * height as usize;
    let (mut texels, is_srgb) = match header.format {
        Some(format) => plain(&reader, format, n_texels)?,
        None => (basis(&reader, bytes, n_texels)?, reader.transfer_function() == Some(TransferFunction::SRGB)),
    };
    let value = |key: &str| reader.key_value_data().find(|(its, _)| *its == key).map(|(_, value)| value);
    if let Some(&[a, b, c, d, ..]) = value("KTXswizzle") {
        swizzle(&mut texels, [a, b, c, d])?;
    }
    // Rows go from left to right and down, unless the file says otherwise.
    if let Some(&[x, y, ..]) = value("KTXorientation") {
        let row = width as usize;
        if x == b'l' {
            texels.chunks_mut(row).for_each(<[_]>::reverse);
        }
        if y == b'u' {
            texels = texels.chunks(row).rev().flatten().copied().collect();
        }
    }
    Ok(Texture::new(name, [width, height], texels, if is_srgb { Encoding::Srgb } else { Encoding::Linear }))
}

/// Texels of a format of 8-bit channels, and whether they are sRGB. Absent channels are 0, and 1 for alpha.
fn plain(reader: &Reader<&[u8]>, format: Format, n_texels: usize) -> Result<(Vec<[u8; 4]>, bool), String> {
    let (n_bytes, is_bgr, is_srgb) = match format {
        Format::R8_UNORM => (1, false, false),
        Format::R8_SRGB => (1, false, true),
        Format::R8G8_UNORM => (2, false, false),
        Format::R8G8_SRGB => (2, false, true),
        Format::R8G8B8_UNORM => (3, false, false),
        Format::R8G8B8_SRGB => (3, false, true),
        Format::B8G8R8_UNORM => (3, true, false),
        Format::B8G8R8_SRGB => (3, true, true),
        Format::R8G8B8A8_UNORM => (4, false, false),
        Format::R8G8B8A8_SRGB => (4, false, true),
        Format::B8G8R8A8_UNORM => (4, true, false),
        Format::B8G8R8A8_SRGB => (4, true, true),
        other => {
            return Err(format!("KTX2 format {other:?} is not supported; use 8 bits per channel, or Basis Universal"));
        }
    };
    let data = level(reader)?.data;
    let unpacked;
    let data = match reader.header().supercompression_scheme {
        None => data,
        Some(SupercompressionScheme::Zstandard) => {
            unpacked = decompressed(data, n_texels * n_bytes)?;
            &unpacked
        }
        Some(other) => return Err(format!("KTX2 compressed by {other:?} is not supported; use Zstandard")),
    };
    let texels = data.get(..n_texels * n_bytes).ok_or("unexpected end of image data")?.chunks_exact(n_bytes);
    let texel = |bytes: &[u8]| {
        let mut texel = [0, 0, 0, u8::MAX];
        texel[..n_bytes].copy_from_slice(bytes);
        if is_bgr {
            texel.swap(0, 2);
        }
        texel
    };
    Ok((texels.map(texel).collect(), is_srgb))
}

/// The largest level.
fn level<'a>(reader: &'a Reader<&[u8]>) -> Result<Level<'a>, String> {
    reader.levels().next().ok_or_else(|| "no image data".to_owned())
}

/// The first `n_bytes` of a frame of Zstandard.
fn decompressed(data: &[u8], n_bytes: usize) -> Result<Vec<u8>, String> {
    let malformed = |error: &dyn std::fmt::Display| format!("malformed Zstandard data: {error}");
    let mut bytes = Vec::new();
    let decoder = ruzstd::StreamingDecoder::new(data).map_err(|error| malformed(&error))?;
    decoder.take(n_bytes as u64).read_to_end(&mut bytes).map_err(|error| malformed(&error))?;
    Ok(bytes)
}

/// Texels of Basis Universal.
fn basis(reader: &Reader<&[u8]>, bytes: &[u8], n_texels: usize) -> Result<Vec<[u8; 4]>, String> {
    let malformed = |error: basisu::Error| format!("malformed Basis Universal data: {error:?}");
    if !matches!(reader.color_model(), Some(ColorModel::ETC1S | ColorModel::UASTC)) {
        return Err(format!("KTX2 of {:?} is not supported; use ETC1S or UASTC", reader.color_model()));
    }
    // The transcoder allocates what the file declares: at most a byte per texel, rounded up to whole blocks.
    let header = reader.header();
    let max_bytes =
        u64::from(header.pixel_width.next_multiple_of(16)) * u64::from(header.pixel_height.next_multiple_of(16));
    if reader.levels().any(|level| level.uncompressed_byte_length > max_bytes) {
        return Err("malformed Basis Universal data: the declared size differs from that of the image".to_owned());
    }
    // Its pairs of keys and values are read above; the transcoder panics on malformed ones.
    let mut bytes = bytes.to_vec();
    bytes[PAIRS].fill(0);
    let transcoder = Transcoder::new(&bytes).map_err(malformed)?;
    let raw = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(malformed)?;
    let (texels, _) = raw.as_chunks();
    if texels.len() == n_texels { Ok(texels.to_vec()) } else { Err("unexpected end of image data".to_owned()) }
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
            (File { format: BC7, ..column() }, "KTX2 format BC7_UNORM_BLOCK is not supported"),
            (File { scheme: 3, ..column() }, "KTX2 compressed by ZLIB is not supported; use Zstandard"),
            (File { counts: [1, 2, 0, 0, 6], ..column() }, "layers or faces are not supported"),
            (File { counts: [1, 2, 2, 0, 1], ..column() }, "layers or faces are not supported"),
            (File { counts: [1, 0, 0, 0, 1], ..column() }, "layers or faces are not supported"),
            (File { counts: [1 << 14, 1 << 14, 0, 0, 1], ..column() }, "invalid image size 16384 x 16384"),
            (File { counts: [1, 3, 0, 0, 1], ..column() }, "unexpected end of image data"),
            (File { format: 0, ..column() }, "is not supported; use ETC1S or UASTC"),
        ] {
            let error = decode("a", &file.bytes(), MAX_TEXELS).unwrap_err();
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    /// The files of the reference encoder.
    fn samples() -> Vec<(&'static str, Vec<u8>)> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/files/ktx2");
        ["etc1s", "etc1s_alpha", "uastc"]
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
            assert_eq!((decoded.width, decoded.height, decoded.encoding), (12, 8, Encoding::Srgb), "{name}");
            assert!(decoded.texels == want.texels, "{name}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]

        #[test]
        fn mutated_files_never_panic(which in 0..4_usize, change in damage()) {
            let file = samples().get(which).map_or_else(|| column().bytes(), |(_, bytes)| bytes.clone());
            if let Ok(texture) = decode("a", &damaged(file, &change), MAX_TEXELS) {
                prop_assert_eq!(texture.texels.len() as u64, u64::from(texture.width) * u64::from(texture.height));
            }
        }
    }
}
