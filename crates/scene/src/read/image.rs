//! PNG and JPEG textures. The content determines the format; the size is checked before allocating.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::{Encoding, Texture, Wrap};

/// Largest number of texels: 1 GiB as RGBA.
const MAX_TEXELS: u64 = 1 << 28;

/// Memory limit of a decoder in bytes: all texels at 16 bits per channel.
const MAX_DECODER_BYTES: u64 = 8 * MAX_TEXELS;

/// Upper bound of texels per byte of PNG: deflate expands at most 1032 times, and a byte holds eight 1-bit texels.
const MAX_TEXELS_PER_PNG_BYTE: u64 = 1032 * 8;

/// Upper bound of texels per byte of JPEG: a block of 64 needs at least one bit in the first scan.
const MAX_TEXELS_PER_JPEG_BYTE: u64 = 64 * 8;

/// Decodes a PNG or JPEG to 8-bit RGBA with repeat wrapping. Ignores the extension of `name`; errors do not contain it.
pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Texture, String> {
    let (format, max_texels_per_byte) = match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => (ImageFormat::Png, MAX_TEXELS_PER_PNG_BYTE),
        Ok(ImageFormat::Jpeg) => (ImageFormat::Jpeg, MAX_TEXELS_PER_JPEG_BYTE),
        _ => return Err("unsupported image format (expected PNG or JPEG)".to_owned()),
    };
    // Decoder messages may span lines.
    let one_line = |error: image::ImageError| error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_DECODER_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(one_line)?;
    let (width, height) = decoder.dimensions();
    let max_texels = MAX_TEXELS.min((bytes.len() as u64).saturating_mul(max_texels_per_byte));
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > max_texels {
        return Err(format!("invalid image size {width} x {height}"));
    }
    // The JPEG decoder silently fills missing data with gray.
    if format == ImageFormat::Jpeg && !last_scan_ends(bytes) {
        return Err("unexpected end of image data".to_owned());
    }
    let image = DynamicImage::from_decoder(decoder).map_err(one_line)?;
    let texels = image.into_rgba8().into_raw().as_chunks().0.to_vec();
    Ok(Texture { name: name.to_owned(), width, height, texels, encoding: Encoding::Srgb, wrap: [Wrap::Repeat; 2] })
}

/// Converts an image to a white alpha mask: its alpha channel if that varies, else its luminance.
pub(crate) fn into_mask(mut texture: Texture) -> Texture {
    let first = texture.texels.first().map_or(u8::MAX, |texel| texel[3]);
    let varies = texture.texels.iter().any(|texel| texel[3] != first);
    for texel in &mut texture.texels {
        let alpha = if varies { texel[3] } else { luminance([texel[0], texel[1], texel[2]]) };
        *texel = [u8::MAX, u8::MAX, u8::MAX, alpha];
    }
    texture
}

/// Luma of encoded values with Rec. 709 weights; exact for gray.
#[expect(clippy::cast_possible_truncation, reason = "the weights sum to 10000, so the mean fits a byte")]
fn luminance(rgb: [u8; 3]) -> u8 {
    let [r, g, b] = rgb.map(u32::from);
    ((2126 * r + 7152 * g + 722 * b + 5000) / 10000) as u8
}

/// Whether an end marker follows the last start-of-scan marker.
fn last_scan_ends(jpeg: &[u8]) -> bool {
    let last = |marker: [u8; 2]| jpeg.windows(2).rposition(|pair| pair == marker);
    // Within scan data 0xff is followed by zero or a restart marker, so neither marker can be data.
    last([0xff, 0xd9]) > last([0xff, 0xda])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A 5 x 3 image with a different color in each texel.
    pub(crate) fn encoded(format: ImageFormat) -> Vec<u8> {
        let channel = |x: u32| u8::try_from(x).unwrap();
        let image = image::RgbImage::from_fn(5, 3, |x, y| image::Rgb([channel(40 * x), channel(80 * y), 200]));
        let mut bytes = Vec::new();
        image.write_to(&mut Cursor::new(&mut bytes), format).unwrap();
        bytes
    }

    fn texture(texels: &[[u8; 4]]) -> Texture {
        Texture {
            name: String::new(),
            width: u32::try_from(texels.len()).unwrap(),
            height: 1,
            texels: texels.to_vec(),
            encoding: Encoding::Srgb,
            wrap: [Wrap::Repeat; 2],
        }
    }

    #[test]
    fn decodes_png_regardless_of_extension() {
        let decoded = decode("wrong name.jpg", &encoded(ImageFormat::Png)).unwrap();
        assert_eq!((decoded.width, decoded.height), (5, 3));
        assert_eq!(decoded.texels[4 + 5 * 2], [160, 160, 200, 255], "row 0 is the top");
    }

    #[test]
    fn decodes_jpeg_regardless_of_extension() {
        let decoded = decode("wrong name.png", &encoded(ImageFormat::Jpeg)).unwrap();
        assert_eq!((decoded.width, decoded.height, decoded.texels.len()), (5, 3, 15));
    }

    #[test]
    fn rejects_every_truncation() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let full = encoded(format);
            // After the last data byte a PNG only has the end chunk, which decoders need not read.
            let needed = if format == ImageFormat::Png { full.len() - 16 } else { full.len() };
            for length in 0..needed {
                let error = decode("", &full[..length]).expect_err(&format!("{format:?} of {length} bytes"));
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }

    #[test]
    fn rejects_sizes_beyond_the_data() {
        let mut png = encoded(ImageFormat::Png);
        // Width and height are at offset 16; the checksum follows the header chunk (12..29).
        png[16..24].copy_from_slice(&[0, 0, 0x20, 0, 0, 0, 0x20, 0]);
        let crc = png_crc(&png[12..29]);
        png[29..33].copy_from_slice(&crc.to_be_bytes());
        assert_eq!(decode("", &png).unwrap_err(), "invalid image size 8192 x 8192");
    }

    /// The checksum of PNG chunks, bit by bit (PNG specification, annex D).
    fn png_crc(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
        !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
    }

    #[test]
    fn masks_use_varying_alpha_or_luminance() {
        let varying = into_mask(texture(&[[10, 20, 30, 0], [10, 20, 30, 255]]));
        assert_eq!(varying.texels, [[255, 255, 255, 0], [255, 255, 255, 255]]);
        let opaque = into_mask(texture(&[[0, 0, 0, 255], [77, 77, 77, 255], [255, 255, 255, 255]]));
        assert_eq!(opaque.texels.iter().map(|texel| texel[3]).collect::<Vec<_>>(), [0, 77, 255]);
    }

    proptest! {
        #[test]
        fn mutated_images_never_panic(at in 0_usize..2000, byte: u8, jpeg: bool) {
            let mut bytes = encoded(if jpeg { ImageFormat::Jpeg } else { ImageFormat::Png });
            let at = at % bytes.len();
            bytes[at] = byte;
            if let Ok(texture) = decode("", &bytes) {
                prop_assert_eq!(texture.texels.len() as u64, u64::from(texture.width) * u64::from(texture.height));
            }
        }
    }
}
