//! Textures: PNG, JPEG and, each behind a feature, BMP, TGA, TIFF, WebP and KTX2. The content determines the format, except of TGA,
//! which has no mark; the size is checked before allocating.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::text;
use crate::{Encoding, Texture};

/// Largest number of texels: 1 GiB as RGBA.
pub(super) const MAX_TEXELS: u64 = 1 << 28;

/// Memory limit of a decoder in bytes: all texels at 16 bits per channel.
const MAX_DECODER_BYTES: u64 = 8 * MAX_TEXELS;

/// Signature of KTX2.
const KTX2: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Upper bound of texels per byte of PNG: deflate expands at most 1032 times, and a byte holds eight 1-bit texels.
const MAX_TEXELS_PER_PNG_BYTE: u64 = 1032 * 8;

/// Upper bound of texels per byte of JPEG: a block of 64 needs at least one bit in the first scan.
const MAX_TEXELS_PER_JPEG_BYTE: u64 = 64 * 8;

/// Upper bound of texels per byte of the other formats, whose run lengths and predictors have none: one color may be a few bytes.
const MAX_TEXELS_PER_OTHER_BYTE: u64 = 1 << 16;

/// The format of an image and its most texels per byte. Only TGA is known by the extension of its name.
fn format_of(name: &str, bytes: &[u8]) -> Result<(ImageFormat, u64), String> {
    let other = |format, feature: &str, is_built: bool| {
        let missing = || format!("{} images require the feature '{feature}'", feature.to_uppercase());
        if is_built { Ok((format, MAX_TEXELS_PER_OTHER_BYTE)) } else { Err(missing()) }
    };
    match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => Ok((ImageFormat::Png, MAX_TEXELS_PER_PNG_BYTE)),
        Ok(ImageFormat::Jpeg) => Ok((ImageFormat::Jpeg, MAX_TEXELS_PER_JPEG_BYTE)),
        Ok(ImageFormat::Bmp) => other(ImageFormat::Bmp, "bmp", cfg!(feature = "bmp")),
        Ok(ImageFormat::Tiff) => other(ImageFormat::Tiff, "tiff", cfg!(feature = "tiff")),
        Ok(ImageFormat::WebP) => other(ImageFormat::WebP, "webp", cfg!(feature = "webp")),
        _ if name.to_lowercase().ends_with(".tga") => other(ImageFormat::Tga, "tga", cfg!(feature = "tga")),
        _ => Err(text::other_content(bytes)
            .unwrap_or("unsupported image format (expected PNG, JPEG, BMP, TGA, TIFF, WebP or KTX2)")
            .to_owned()),
    }
}

/// Decodes an image to 8-bit RGBA with repeat wrapping. Errors do not contain `name`.
pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Texture, String> {
    if bytes.starts_with(KTX2) {
        #[cfg(feature = "ktx2")]
        return super::ktx2::decode(name, bytes, MAX_TEXELS);
        #[cfg(not(feature = "ktx2"))]
        return Err("KTX2 images require the feature 'ktx2'".to_owned());
    }
    let (format, max_texels_per_byte) = format_of(name, bytes)?;
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
    Ok(Texture::new(name, [width, height], texels, Encoding::Srgb))
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

/// Converts an image to linear values of one channel, its luminance; the others are full.
pub(crate) fn into_channel(mut texture: Texture, channel: usize) -> Texture {
    for texel in &mut texture.texels {
        let value = luminance([texel[0], texel[1], texel[2]]);
        *texel = [u8::MAX; 4];
        texel[channel] = value;
    }
    Texture { encoding: Encoding::Linear, ..texture }
}

/// Two images of [`into_channel`] in one, if they have the same size.
pub(crate) fn joined(a: &Texture, b: &Texture) -> Option<Texture> {
    let least = |(a, b): (&[u8; 4], &[u8; 4])| std::array::from_fn(|k| a[k].min(b[k]));
    let texels = || a.texels.iter().zip(&b.texels).map(least).collect();
    ([a.width, a.height] == [b.width, b.height]).then(|| Texture { texels: texels(), ..a.clone() })
}

/// Converts an image of a bump statement to a normal map. Exporters write normal maps there as well, which have colors;
/// gray images are heights.
pub(crate) fn into_normals(texture: Texture) -> Texture {
    /// Slope of a full difference between neighboring texels, which no file states.
    const SLOPE: f32 = 4.0;
    let is_gray = texture.texels.iter().all(|&[r, g, b, _]| r.abs_diff(g) < 8 && g.abs_diff(b) < 8);
    let (width, height) = (texture.width as usize, texture.height as usize);
    if !is_gray || width == 0 || height == 0 {
        return Texture { encoding: Encoding::Linear, ..texture };
    }
    let at = |x: usize, y: usize| f32::from(texture.texels[y * width + x][1]) / 255.0;
    let normal = |index: usize| {
        let (x, y) = (index % width, index / width);
        // Images repeat. Rows go down and v up.
        let across = at((x + 1) % width, y) - at((x + width - 1) % width, y);
        let up = at(x, (y + height - 1) % height) - at(x, (y + 1) % height);
        let normal = [-0.5 * SLOPE * across, -0.5 * SLOPE * up, 1.0_f32];
        let length = normal.iter().map(|c| c * c).sum::<f32>().sqrt();
        let [r, g, b] = normal.map(|c| (127.5 + 127.5 * c / length).round() as u8);
        [r, g, b, u8::MAX]
    };
    let texels = (0..width * height).map(normal).collect();
    Texture { texels, encoding: Encoding::Linear, ..texture }
}

/// Luma of encoded values with Rec. 709 weights; exact for gray.
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
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::read::testing::{damage, damaged, encoded};

    fn texture(texels: &[[u8; 4]]) -> Texture {
        Texture::new("", [u32::try_from(texels.len()).unwrap(), 1], texels.to_vec(), Encoding::Srgb)
    }

    #[test]
    fn decodes_png_and_jpeg_regardless_of_extension() {
        let decoded = decode("wrong name.jpg", &encoded(ImageFormat::Png)).unwrap();
        assert_eq!((decoded.width, decoded.height), (5, 3));
        assert_eq!(decoded.texels[4 + 5 * 2], [160, 160, 200, 255], "row 0 is the top");
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
    #[cfg(all(feature = "bmp", feature = "tga", feature = "tiff", feature = "webp"))]
    fn decodes_other_formats_to_the_texels_of_png() {
        let png = decode("", &encoded(ImageFormat::Png)).unwrap();
        for (name, format) in [
            ("a.png", ImageFormat::Bmp),
            ("A.TGA", ImageFormat::Tga),
            ("a.png", ImageFormat::Tiff),
            ("a.png", ImageFormat::WebP),
        ] {
            let bytes = encoded(format);
            let decoded = decode(name, &bytes).unwrap();
            assert_eq!((decoded.width, decoded.height), (5, 3), "{format:?}");
            assert!(decoded.texels == png.texels, "{format:?}");
            for length in [0, 3, bytes.len() / 4] {
                assert!(decode(name, &bytes[..length]).is_err(), "{format:?} of {length} bytes");
            }
        }
        let error = decode("a.png", &encoded(ImageFormat::Tga)).unwrap_err();
        assert_eq!(error, "unsupported image format (expected PNG, JPEG, BMP, TGA, TIFF, WebP or KTX2)");
    }

    #[test]
    fn heights_become_normals_and_normal_maps_stay() {
        let gray = |x: u8| [x, x, x, 255];
        let row = into_normals(texture(&[gray(0), gray(64), gray(128), gray(64)]));
        assert_eq!(row.encoding, Encoding::Linear);
        // Rising along u: the normal points towards -u. At the top and at the bottom it is upright.
        assert!(row.texels[1][0] < 100 && row.texels[3][0] > 155, "{:?}", row.texels);
        assert_eq!([row.texels[0], row.texels[2]], [[128, 128, 255, 255]; 2]);
        let normals = into_normals(texture(&[[128, 128, 255, 255], [200, 100, 220, 255]]));
        assert_eq!(normals.texels, [[128, 128, 255, 255], [200, 100, 220, 255]]);
    }

    #[test]
    fn channels_are_joined() {
        let one = |x: u8, channel: usize| into_channel(texture(&[[x, x, x, 255]]), channel);
        assert_eq!(joined(&one(10, 1), &one(20, 2)).unwrap().texels, [[255, 10, 20, 255]]);
        let wide = into_channel(texture(&[[0; 4]; 2]), 2);
        assert!(joined(&one(10, 1), &wide).is_none());
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
        fn mutated_images_never_panic(change in damage(), jpeg: bool) {
            let file = encoded(if jpeg { ImageFormat::Jpeg } else { ImageFormat::Png });
            if let Ok(texture) = decode("", &damaged(file, &change)) {
                prop_assert_eq!(texture.texels.len() as u64, u64::from(texture.width) * u64::from(texture.height));
            }
        }
    }
}
