//! Checks the sizes in an OpenEXR header before a decoder allocates memory for them.

use std::io::Cursor;

use exr::prelude::{Error, MetaData, Vec2};

/// Upper bound of samples per byte of file: deflate, the strongest compression of EXR, expands at most 1032 times.
const MAX_SAMPLES_PER_BYTE: u64 = 1032;

/// Number of samples that the header of an OpenEXR file declares, in all channels of all layers.
///
/// # Errors
/// The header is invalid, declares an empty layer, or declares more samples than `bytes` can hold.
pub fn declared_exr_samples(bytes: &[u8]) -> Result<u64, String> {
    let metadata = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(reason)?;
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
    Ok(n_samples)
}

/// A readable message for a decoder error.
pub(super) fn reason(error: Error) -> String {
    match error {
        // The decoder's message for data that ends early.
        Error::Invalid(what) if what == "reference to missing bytes" => "unexpected end of OpenEXR data".to_owned(),
        Error::Invalid(what) => format!("invalid OpenEXR data: {what}"),
        Error::NotSupported(what) => format!("unsupported OpenEXR feature: {what}"),
        Error::Io(_) | Error::Aborted => format!("cannot decode OpenEXR data: {error}"),
    }
}
