//! Writes pictures to files atomically.

mod atomic_file;
mod film;
mod format;
mod record;

use std::path::Path;

use exr::prelude::{Blocks, Compression, Encoding, LineOrder};

use crate::{FileError, Picture};
pub(crate) use atomic_file::write_file;
pub use atomic_file::{AtomicFile, Discarded, discard_unfinished};
pub use film::{read_part, write_film, write_film_as};
pub use format::{Format, encode, write_picture};
pub use record::Record;
pub(crate) use record::{record_from_lines, record_lines};

/// Writes `picture` as an 8-bit RGB PNG: clamped to 0..=1, encoded by the sRGB curve, rounded to the nearest byte.
///
/// The file is written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), FileError> {
    write_picture(path, picture, Format::Png)
}

/// Writes `picture` as an EXR of three `f32` channels, linear RGB, losslessly compressed.
///
/// Negative zero is written as zero and every NaN with the same bits, so that equal pictures are equal files. The file is
/// written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_exr(path: &Path, picture: &Picture) -> Result<(), FileError> {
    write_picture(path, picture, Format::Exr)
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
