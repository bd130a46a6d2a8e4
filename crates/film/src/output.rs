//! Writes pictures to files atomically.

mod atomic_file;
mod film;
mod record;

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2, WritableImage,
};
use image::ImageEncoder;
use image::codecs::png::PngEncoder;

use crate::{FileError, Picture, srgb};
pub(crate) use atomic_file::write_file;
pub use atomic_file::{AtomicFile, Discarded, discard_unfinished};
pub use film::{read_part, write_film};
pub use record::Record;
pub(crate) use record::{record_from_lines, record_lines};

/// Writes `picture` as an 8-bit RGB PNG: clamped to 0..=1, encoded by the sRGB curve, rounded to the nearest byte.
///
/// The file is written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), FileError> {
    let bytes: Vec<u8> = picture.pixels.iter().flatten().map(|&x| srgb::encode(x)).collect();
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(&bytes, picture.width, picture.height, image::ExtendedColorType::Rgb8)
        .map_err(|error| FileError::write(path, error))?;
    write_file(path, &file)
}

/// Writes `picture` as an EXR of three `f32` channels, linear RGB, losslessly compressed.
///
/// Negative zero is written as zero and every NaN with the same bits, so that equal pictures are equal files. The file is
/// written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_exr(path: &Path, picture: &Picture) -> Result<(), FileError> {
    let size = Vec2(picture.width as usize, picture.height as usize);
    let pixel = |position: Vec2<usize>| {
        let [r, g, b] = picture.pixels[position.1 * size.0 + position.0].map(canonical);
        (r, g, b)
    };
    let layer = Layer::new(size, LayerAttributes::default(), ENCODING, SpecificChannels::rgb(pixel));
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut file)
        .map_err(|error| FileError::write(path, error))?;
    write_file(path, file.get_ref())
}

/// Lossless, with lines in order so that the file does not depend on threads.
const ENCODING: Encoding =
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_and_nan_have_unique_bits() {
        assert_eq!(canonical(-0.0).to_bits(), 0);
        assert_eq!(canonical(f32::from_bits(0xffc0_1234)).to_bits(), f32::NAN.to_bits());
        for x in [1.0, -1.0, f32::MIN_POSITIVE / 2.0, f32::INFINITY] {
            assert_eq!(canonical(x).to_bits(), x.to_bits());
        }
    }
}
