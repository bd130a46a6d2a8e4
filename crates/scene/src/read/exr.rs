//! What the header of an OpenEXR promises, looked at before a decoder allocates anything of that size.

use std::io::Cursor;

use exr::prelude::{Error, MetaData, Vec2};

/// Most samples that a byte of file can stand for: deflate, the tightest compression of EXR, expands at most 1032 times.
const MAX_SAMPLES_PER_BYTE: u64 = 1032;

/// The samples that the header of an OpenEXR promises, in all channels of all layers together.
///
/// # Errors
/// A header that is damaged, has a layer without texels, or promises more than `bytes` can hold.
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
            return Err(format!("its header promises {width} x {height} texels in {n_bytes} bytes"));
        }
    }
    Ok(n_samples)
}

/// What is wrong with a file, for those who did not write its decoder.
pub(super) fn reason(error: Error) -> String {
    match error {
        // What the decoder says where it wants bytes behind the last.
        Error::Invalid(what) if what == "reference to missing bytes" => "the OpenEXR ends early".to_owned(),
        Error::Invalid(what) => format!("the OpenEXR is damaged: {what}"),
        Error::NotSupported(what) => format!("the OpenEXR is of a kind that is not read: {what}"),
        Error::Io(_) | Error::Aborted => format!("the OpenEXR cannot be decoded: {error}"),
    }
}
