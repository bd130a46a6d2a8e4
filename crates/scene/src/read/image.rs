//! PNG and JPEG images as textures; the format is told by the content, the size is checked before any allocation.

use std::fmt;
use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::{Encoding, Texture, Wrap};

/// Most texels of an image: 1 GiB as RGBA.
const MAX_TEXELS: u64 = 1 << 28;

/// Most bytes that a decoder may hold at a time: the texels at 16 bits a channel.
const MAX_DECODER_BYTES: u64 = 8 * MAX_TEXELS;

/// Most texels that a byte of PNG can stand for: deflate expands at most 1032 times, and a byte holds eight texels of one bit.
const MAX_TEXELS_PER_PNG_BYTE: u64 = 1032 * 8;

/// Most texels that a byte of JPEG can stand for: a block of 64 takes a bit at least in the first scan.
const MAX_TEXELS_PER_JPEG_BYTE: u64 = 64 * 8;

/// Why an image became no texture. The message does not name the image.
#[derive(Debug)]
pub(crate) enum ImageError {
    /// The first bytes are neither those of a PNG nor of a JPEG.
    UnknownFormat,
    /// The header promises more than is read, or more than the file can hold.
    Size { width: u32, height: u32 },
    /// The last scan has no end marker.
    EndsEarly,
    /// What the decoder said.
    Decoder(image::ImageError),
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownFormat => f.write_str("the content is neither PNG nor JPEG"),
            Self::Size { width, height } => write!(f, "its header promises {width} x {height} texels"),
            Self::EndsEarly => f.write_str("it ends early"),
            // Decoders end sentences with blank lines.
            Self::Decoder(source) => f.write_str(&source.to_string().split_whitespace().collect::<Vec<_>>().join(" ")),
        }
    }
}

/// Decodes a PNG or JPEG, whatever its name says, to RGBA of 8 bits. It repeats in both directions.
pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Texture, ImageError> {
    let (format, max_texels_per_byte) = match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => (ImageFormat::Png, MAX_TEXELS_PER_PNG_BYTE),
        Ok(ImageFormat::Jpeg) => (ImageFormat::Jpeg, MAX_TEXELS_PER_JPEG_BYTE),
        _ => return Err(ImageError::UnknownFormat),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_DECODER_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(ImageError::Decoder)?;
    let (width, height) = decoder.dimensions();
    let max_texels = MAX_TEXELS.min((bytes.len() as u64).saturating_mul(max_texels_per_byte));
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > max_texels {
        return Err(ImageError::Size { width, height });
    }
    // The JPEG decoder fills what is missing with grey and says nothing.
    if format == ImageFormat::Jpeg && !last_scan_ends(bytes) {
        return Err(ImageError::EndsEarly);
    }
    let image = DynamicImage::from_decoder(decoder).map_err(ImageError::Decoder)?;
    let texels = image.into_rgba8().into_raw().as_chunks().0.to_vec();
    Ok(Texture { name: name.to_owned(), width, height, texels, encoding: Encoding::Srgb, wrap: [Wrap::Repeat; 2] })
}

/// Turns an image into a mask: white, with the image's alpha where that varies, else with its luminance, as alpha.
pub(crate) fn into_mask(mut texture: Texture) -> Texture {
    let first = texture.texels.first().map_or(u8::MAX, |texel| texel[3]);
    let varies = texture.texels.iter().any(|texel| texel[3] != first);
    for texel in &mut texture.texels {
        let alpha = if varies { texel[3] } else { luminance([texel[0], texel[1], texel[2]]) };
        *texel = [u8::MAX, u8::MAX, u8::MAX, alpha];
    }
    texture
}

/// Luminance of encoded values with the weights of Rec. 709; grey stays what it is.
#[expect(clippy::cast_possible_truncation, reason = "the weights sum to 10000, so the mean fits a byte")]
fn luminance(rgb: [u8; 3]) -> u8 {
    let [r, g, b] = rgb.map(u32::from);
    ((2126 * r + 7152 * g + 722 * b + 5000) / 10000) as u8
}

/// Whether an end marker follows the last start of a scan.
fn last_scan_ends(jpeg: &[u8]) -> bool {
    let last = |marker: [u8; 2]| jpeg.windows(2).rposition(|pair| pair == marker);
    // Inside a scan 0xff is followed by zero or a restart, so neither marker can be data.
    last([0xff, 0xd9]) > last([0xff, 0xda])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A 5 x 3 image with a different colour in each texel, in a format.
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
    fn png_keeps_every_texel() {
        let decoded = decode("wrong name.jpg", &encoded(ImageFormat::Png)).unwrap();
        assert_eq!((decoded.width, decoded.height), (5, 3));
        assert_eq!(decoded.texels[4 + 5 * 2], [160, 160, 200, 255], "row 0 is the top");
    }

    #[test]
    fn jpeg_is_told_by_content() {
        let decoded = decode("wrong name.png", &encoded(ImageFormat::Jpeg)).unwrap();
        assert_eq!((decoded.width, decoded.height, decoded.texels.len()), (5, 3, 15));
    }

    #[test]
    fn every_truncation_is_seen() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let whole = encoded(format);
            // What a PNG has after its last data byte is the end chunk alone, which decoders need not see.
            let needed = if format == ImageFormat::Png { whole.len() - 16 } else { whole.len() };
            for length in 0..needed {
                let error = decode("", &whole[..length]).expect_err(&format!("{format:?} of {length} bytes"));
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused() {
        let mut png = encoded(ImageFormat::Png);
        // Width and height lie at 16, the checksum of the header chunk (12..29) behind it.
        png[16..24].copy_from_slice(&[0, 0, 0x20, 0, 0, 0, 0x20, 0]);
        let crc = png_crc(&png[12..29]);
        png[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(matches!(decode("", &png), Err(ImageError::Size { width: 8192, height: 8192 })));
    }

    /// The checksum of PNG chunks, bit by bit (PNG specification, annex D).
    fn png_crc(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
        !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
    }

    #[test]
    fn masks_take_alpha_where_it_varies_else_luminance() {
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
