//! The formats of pictures.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{Image, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage};
use image::ExtendedColorType::{Rgb8, Rgb16};
use image::ImageEncoder;
use image::codecs::{hdr::HdrEncoder, jpeg::JpegEncoder, png::PngEncoder};

use super::{ENCODING, atomic_file::write_file, canonical};
use crate::{FileError, Picture, srgb};

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

    /// Whether values are stored without curve and without limit.
    #[must_use]
    pub fn is_linear(self) -> bool {
        matches!(self, Self::Hdr | Self::Exr)
    }
}

/// The bytes of a file of `picture`.
///
/// # Errors
/// A size that the format does not support, or a format that this build does not have.
pub fn encode(picture: &Picture, format: Format) -> Result<Vec<u8>, String> {
    let Picture { width, height, pixels } = picture;
    let mut file = Vec::new();
    let bytes = || pixels.iter().flatten().map(|&x| srgb::encode(x)).collect::<Vec<u8>>();
    let written = match format {
        Format::Png => PngEncoder::new(&mut file).write_image(&bytes(), *width, *height, Rgb8),
        Format::Png16 => {
            // The encoder takes words in the order of the machine.
            let words: Vec<u8> = pixels.iter().flatten().flat_map(|&x| srgb::encode_16(x).to_ne_bytes()).collect();
            PngEncoder::new(&mut file).write_image(&words, *width, *height, Rgb16)
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
            image::codecs::webp::WebPEncoder::new_lossless(&mut file).write_image(&bytes(), *width, *height, Rgb8)
        }
        #[cfg(not(feature = "webp"))]
        Format::WebP => return Err("built without the feature 'webp'".to_owned()),
        Format::Exr => return exr(picture),
    };
    written.map(|()| file).map_err(|error| error.to_string())
}

fn exr(picture: &Picture) -> Result<Vec<u8>, String> {
    let size = Vec2(picture.width as usize, picture.height as usize);
    let pixel = |position: Vec2<usize>| {
        let [r, g, b] = picture.pixels[position.1 * size.0 + position.0].map(canonical);
        (r, g, b)
    };
    let layer = Layer::new(size, LayerAttributes::default(), ENCODING, SpecificChannels::rgb(pixel));
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut file).map_err(|error| error.to_string())?;
    Ok(file.into_inner())
}

/// Writes `picture` to a file atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_picture(path: &Path, picture: &Picture, format: Format) -> Result<(), FileError> {
    let file = encode(picture, format).map_err(|reason| FileError::write(path, reason))?;
    write_file(path, &file)
}
