use std::fmt;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use canted_scene::declared_exr_samples;
use exr::prelude::{ReadChannels, ReadLayers, RgbChannels, Vec2};
use image::{DynamicImage, ImageReader};

use crate::{FileError, Picture, srgb};

/// The first four bytes of an EXR file.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Reads a picture as linear RGB from EXR or PNG, which the content distinguishes; PNG values are decoded from sRGB.
///
/// Alpha is ignored; gray becomes RGB.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn read_picture(path: &Path) -> Result<Picture, FileError> {
    let fail = |reason: &dyn fmt::Display| FileError::read(path, reason);
    let bytes = fs::read(path).map_err(|error| fail(&error))?;
    if bytes.starts_with(&EXR_MAGIC) {
        read_exr(&bytes).map_err(|reason| fail(&reason))
    } else {
        read_image(&bytes).map_err(|error| fail(&error))
    }
}

fn read_image(bytes: &[u8]) -> Result<Picture, image::ImageError> {
    let image = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?.decode()?;
    let (width, height) = (image.width(), image.height());
    let pixels = match image {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
            let linear = |x: u16| srgb::to_linear(f64::from(x) / 65535.0) as f32;
            image.to_rgb16().pixels().map(|pixel| pixel.0.map(linear)).collect()
        }
        _ => image.to_rgb8().pixels().map(|pixel| pixel.0.map(srgb::decode)).collect(),
    };
    Ok(Picture { width, height, pixels })
}

fn read_exr(bytes: &[u8]) -> Result<Picture, String> {
    // Reject sizes that the file cannot hold before anything is allocated.
    declared_exr_samples(bytes)?;
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
