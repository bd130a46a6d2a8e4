//! KTX2 textures: level 0 of a 2D image, of 8-bit channels or Basis Universal (ETC1S, UASTC), also compressed by Zstandard.
//!
//! Source: KTX File Format Specification, version 2.0.

use std::io::Read;
use std::ops::Range;
use std::panic::catch_unwind;

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use ktx2::{ColorModel, Format, Level, Reader, SupercompressionScheme, TransferFunction};

use super::image::MAX_TEXELS;
use crate::{Encoding, Magnification, Texture, Wrap};

/// Upper bound of texels per byte: a block of Zstandard repeats one byte up to 2^17 times and takes four bytes.
const MAX_TEXELS_PER_BYTE: u64 = 1 << 16;

/// Where a file has offset and length of its pairs of keys and values.
const PAIRS: Range<usize> = 56..64;

/// Decodes an image. Errors do not contain `name`.
///
/// `ktx2` 0.5.0 and `basisu` 0.1.0 panic on some malformed files (`tests::mutated_files_never_panic` finds such files), which
/// is an error here.
pub(super) fn decode(name: &str, bytes: &[u8]) -> Result<Texture, String> {
    catch_unwind(|| decode_trusting(name, bytes)).unwrap_or_else(|_| Err("malformed KTX2".to_owned()))
}

fn decode_trusting(name: &str, bytes: &[u8]) -> Result<Texture, String> {
    let reader = Reader::new(bytes).map_err(|error| format!("malformed KTX2: {error}"))?;
    let header = reader.header();
    let (width, height) = (header.pixel_width, header.pixel_height);
    if height == 0 || header.pixel_depth > 1 || header.layer_count > 1 || header.face_count != 1 {
        return Err("KTX2 images with one, three or more dimensions, layers or faces are not supported".to_owned());
    }
    let max_texels = MAX_TEXELS.min((bytes.len() as u64).saturating_mul(MAX_TEXELS_PER_BYTE));
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
    Ok(Texture {
        name: name.to_owned(),
        width,
        height,
        texels,
        encoding: if is_srgb { Encoding::Srgb } else { Encoding::Linear },
        wrap: [Wrap::Repeat; 2],
        magnification: Magnification::Linear,
    })
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
pub(crate) mod tests;
