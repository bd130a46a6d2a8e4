//! Radiance RGBE (`.hdr`).

use std::io::Cursor;

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};

use super::{MAX_TEXELS, Texels};

/// Upper bound of texels per byte of file; run-length encoding reaches about 16.
const MAX_TEXELS_PER_BYTE: u64 = 1032;

/// Decodes the image.
pub(super) fn decode(bytes: &[u8]) -> Result<Texels, String> {
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    let max = MAX_TEXELS.min(MAX_TEXELS_PER_BYTE.saturating_mul(bytes.len() as u64));
    if !(1..=max).contains(&(u64::from(width) * u64::from(height))) {
        return Err(format!("invalid image size {width} x {height} for {} bytes of data", bytes.len()));
    }
    let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
    let list = image.into_rgb32f().into_raw().as_chunks().0.to_vec();
    Ok(Texels { width, height, list })
}
