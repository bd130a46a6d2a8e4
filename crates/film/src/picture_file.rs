//! Files of pictures: writes and reads PNG, JPEG, WebP, HDR and EXR.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use exr::io::Tracking;
use exr::prelude::{
    Blocks, Compression, Encoding, Error, Image, Layer, LayerAttributes, LineOrder, MetaData, ReadChannels, ReadLayers,
    RgbChannels, SpecificChannels, Vec2, WritableImage,
};
use image::ExtendedColorType::{Rgb8, Rgb16, Rgba8, Rgba16};
use image::codecs::hdr::HdrEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{DynamicImage, ImageEncoder};

use crate::atomic_file::{read_file, write_file};
use crate::{FileError, Picture, srgb};

/// Writes `picture` as an 8-bit RGB PNG: clamped to 0..=1, encoded by the sRGB curve, rounded to the nearest byte.
///
/// The file is written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), FileError> {
    write_picture(path, picture, None, Format::Png)
}

/// Writes `picture` as an EXR of three `f32` channels, linear RGB, losslessly compressed.
///
/// Negative zero is written as zero and every NaN with the same bits, so that equal pictures are equal files. The file is
/// written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_exr(path: &Path, picture: &Picture) -> Result<(), FileError> {
    write_picture(path, picture, None, Format::Exr)
}

/// Lossless, with lines in order so that the file does not depend on threads.
pub(crate) const ENCODING: Encoding =
    Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };

/// `x` with unique bits for zero and NaN.
pub(crate) fn canonical(x: f32) -> f32 {
    if x.is_nan() {
        f32::NAN
    } else {
        // -0 + 0 is +0; any other number is itself.
        x + 0.0
    }
}

/// A format of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// PNG of 8 bits, clamped to 0..=1 and encoded by the sRGB curve.
    Png,
    /// PNG of 16 bits, likewise.
    Png16,
    /// JPEG of quality 92, likewise.
    Jpeg,
    /// Lossless WebP of 8 bits, likewise; requires the feature `webp`.
    WebP,
    /// Radiance HDR, linear, with a common exponent of the three components; negative values and NaN become 0.
    Hdr,
    /// OpenEXR of 32 bits, linear and lossless.
    Exr,
}

impl Format {
    /// All formats with their names, which are their usual extensions.
    pub const ALL: [(&str, Self); 6] = [
        ("png", Self::Png),
        ("png16", Self::Png16),
        ("jpg", Self::Jpeg),
        ("webp", Self::WebP),
        ("hdr", Self::Hdr),
        ("exr", Self::Exr),
    ];

    /// The format of a file name, by its extension in lower or upper case.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use canted_film::Format;
    ///
    /// assert_eq!(Format::of_path(Path::new("a.JPEG")), Some(Format::Jpeg));
    /// assert_eq!(Format::of_path(Path::new("a.gif")), None);
    /// ```
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_lowercase();
        let name = if extension == "jpeg" { "jpg" } else { &extension };
        Self::ALL.into_iter().find(|&(known, format)| known == name && format != Self::Png16).map(|(_, format)| format)
    }

    /// Whether pixels may have alpha.
    #[must_use]
    pub fn has_alpha(self) -> bool {
        matches!(self, Self::Png | Self::Png16 | Self::WebP | Self::Exr)
    }

    /// Whether values are stored without curve and without limit.
    #[must_use]
    pub fn is_linear(self) -> bool {
        matches!(self, Self::Hdr | Self::Exr)
    }
}

/// The bytes of a file of `picture`. Where `alpha` has a number in 0..=1 for each pixel, the file has alpha; colors are those of what covers the
/// pixel, not multiplied by alpha. EXR files have colors that are multiplied, as is usual there.
///
/// # Errors
/// A size that the format does not support, alpha in a format without it, or a format that this build does not have.
pub fn encode(picture: &Picture, alpha: Option<&[f32]>, format: Format) -> Result<Vec<u8>, String> {
    let Picture { width, height, pixels } = picture;
    if alpha.is_some() && !format.has_alpha() {
        return Err("the format has no alpha".to_owned());
    }
    if alpha.is_some_and(|alpha| alpha.len() != pixels.len()) {
        return Err("alpha and colors differ in size".to_owned());
    }
    let mut file = Vec::new();
    // Each pixel with its alpha, which is linear in all formats.
    let each = || pixels.iter().enumerate().map(|(i, color)| (color, alpha.map(|alpha| alpha[i].clamp(0.0, 1.0))));
    let bytes = || {
        let of_pixel = |(color, alpha): (&[f32; 3], Option<f32>)| {
            let alpha = alpha.map(|alpha| (255.0 * alpha).round() as u8);
            color.map(srgb::encode).into_iter().chain(alpha)
        };
        each().flat_map(of_pixel).collect::<Vec<u8>>()
    };
    let [of_bytes, of_words] = if alpha.is_some() { [Rgba8, Rgba16] } else { [Rgb8, Rgb16] };
    let written = match format {
        Format::Png => PngEncoder::new(&mut file).write_image(&bytes(), *width, *height, of_bytes),
        Format::Png16 => {
            // The encoder takes words in the order of the machine.
            let of_pixel = |(color, alpha): (&[f32; 3], Option<f32>)| {
                let alpha = alpha.map(|alpha| (65535.0 * alpha).round() as u16);
                color.map(srgb::encode_16).into_iter().chain(alpha).flat_map(u16::to_ne_bytes)
            };
            let words: Vec<u8> = each().flat_map(of_pixel).collect();
            PngEncoder::new(&mut file).write_image(&words, *width, *height, of_words)
        }
        Format::Jpeg => JpegEncoder::new_with_quality(&mut file, 92).write_image(&bytes(), *width, *height, Rgb8),
        Format::Hdr => {
            // `max` returns the other operand for NaN. Larger values do not fit the exponent of the format.
            let value = |x: f32| if x > 0.0 { x.min(1e38) } else { 0.0 };
            let pixels: Vec<_> = pixels.iter().map(|color| image::Rgb(color.map(value))).collect();
            HdrEncoder::new(&mut file).encode(&pixels, *width as usize, *height as usize)
        }
        #[cfg(feature = "webp")]
        Format::WebP => {
            image::codecs::webp::WebPEncoder::new_lossless(&mut file).write_image(&bytes(), *width, *height, of_bytes)
        }
        #[cfg(not(feature = "webp"))]
        Format::WebP => return Err("built without the feature 'webp'".to_owned()),
        Format::Exr => return exr(picture, alpha),
    };
    written.map_err(|error| error.to_string())?;
    if matches!(format, Format::Png | Format::Png16) {
        file.splice(PNG_HEADER..PNG_HEADER, PNG_MARK);
    }
    Ok(file)
}

/// Bytes of a PNG up to the end of its chunk `IHDR`, which is the first.
const PNG_HEADER: usize = 8 + 12 + 13;

/// A chunk of text: length, kind, the keyword `Software` of the PNG specification with our name, checksum.
const PNG_MARK: [u8; 27] = *b"\0\0\0\x0ftEXtSoftware\0canted\x21\x7a\x06\x8d";

/// Whether [`write_picture`] wrote this file as PNG, by its chunk `Software`.
#[must_use]
pub fn is_own_png(path: &Path) -> bool {
    let mut start = [0; PNG_HEADER + PNG_MARK.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start[PNG_HEADER..] == PNG_MARK
}

fn exr(picture: &Picture, alpha: Option<&[f32]>) -> Result<Vec<u8>, String> {
    let size = Vec2(picture.width as usize, picture.height as usize);
    let index = |position: Vec2<usize>| position.1 * size.0 + position.0;
    let mut file = Cursor::new(Vec::new());
    let attributes = LayerAttributes::default();
    let written = if let Some(alpha) = alpha {
        let pixel = |position: Vec2<usize>| {
            let alpha = alpha[index(position)];
            let [r, g, b] = picture.pixels[index(position)].map(|x| canonical(x * alpha));
            (r, g, b, canonical(alpha))
        };
        let layer = Layer::new(size, attributes, ENCODING, SpecificChannels::rgba(pixel));
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut file)
    } else {
        let pixel = |position: Vec2<usize>| {
            let [r, g, b] = picture.pixels[index(position)].map(canonical);
            (r, g, b)
        };
        let layer = Layer::new(size, attributes, ENCODING, SpecificChannels::rgb(pixel));
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut file)
    };
    written.map_err(|error| error.to_string())?;
    Ok(file.into_inner())
}

/// Writes `picture` to a file atomically, with alpha as in [`encode`].
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_picture(path: &Path, picture: &Picture, alpha: Option<&[f32]>, format: Format) -> Result<(), FileError> {
    let file = encode(picture, alpha, format).map_err(|reason| FileError::write(path, reason))?;
    write_file(path, &file)
}

/// The first four bytes of an EXR file.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Reads a picture as linear RGB in any format of [`write_picture`], which the content distinguishes. EXR and HDR hold linear values; those of
/// the other formats are decoded from sRGB.
///
/// Alpha is ignored; gray becomes RGB.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn read_picture(path: &Path) -> Result<Picture, FileError> {
    read_file(path, |bytes| match bytes.starts_with(&EXR_MAGIC) {
        true => read_exr(bytes),
        false => read_image(bytes).map_err(|error| error.to_string()),
    })
}

fn read_image(bytes: &[u8]) -> Result<Picture, image::ImageError> {
    let image = image::load_from_memory(bytes)?;
    let (width, height) = (image.width(), image.height());
    let pixels = match image {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let linear = |x: u16| srgb::to_linear(f64::from(x) / 65535.0) as f32;
            image.to_rgb16().pixels().map(|pixel| pixel.0.map(linear)).collect()
        }
        // Radiance HDR.
        DynamicImage::ImageRgb32F(image) => image.pixels().map(|pixel| pixel.0).collect(),
        _ => image.to_rgb8().pixels().map(|pixel| pixel.0.map(srgb::decode)).collect(),
    };
    Ok(Picture { width, height, pixels })
}

fn read_exr(bytes: &[u8]) -> Result<Picture, String> {
    check_exr_size(bytes)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |Vec2(width, height), _: &RgbChannels| (width, vec![[0.0_f32; 3]; width * height]),
            |(width, pixels), Vec2(x, y), (r, g, b): (f32, f32, f32)| pixels[y * *width + x] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    let Vec2(width, height) = image.layer_data.size;
    let side = |n: usize| u32::try_from(n).map_err(|_| format!("{n} pixels along one side are too many"));
    Ok(Picture { width: side(width)?, height: side(height)?, pixels: image.layer_data.channel_data.pixels.1 })
}

/// Upper bound of samples per byte of file: deflate, the strongest compression of EXR, expands at most 1032 times.
const MAX_SAMPLES_PER_BYTE: u64 = 1032;

/// Rejects a header that declares an empty layer or more samples than `bytes` can hold, before anything is allocated.
pub(crate) fn check_exr_size(bytes: &[u8]) -> Result<(), String> {
    // The type of reader that `read` makes, too, so that the parser of headers is compiled once.
    let metadata = MetaData::read_from_buffered(Tracking::new(Cursor::new(bytes)), false).map_err(exr_error)?;
    let n_bytes = bytes.len();
    let max = MAX_SAMPLES_PER_BYTE.saturating_mul(n_bytes as u64);
    let mut n_samples = 0_u64;
    for header in &metadata.headers {
        let Vec2(width, height) = header.layer_size;
        let n_texels = (width as u64).saturating_mul(height as u64);
        n_samples = n_samples.saturating_add(n_texels.saturating_mul(header.channels.list.len() as u64));
        if n_texels == 0 || n_samples > max {
            return Err(format!("invalid image size {width} x {height} for {n_bytes} bytes of data"));
        }
    }
    Ok(())
}

/// A sentence for an error of the decoder.
fn exr_error(error: Error) -> String {
    match error {
        // The decoder's message for data that ends early.
        Error::Invalid(what) if what == "reference to missing bytes" => "unexpected end of OpenEXR data".to_owned(),
        Error::Invalid(what) => format!("invalid OpenEXR data: {what}"),
        Error::NotSupported(what) => format!("unsupported OpenEXR feature: {what}"),
        Error::Io(_) | Error::Aborted => format!("cannot decode OpenEXR data: {error}"),
    }
}
