//! The size of a PNG file, read without the encoder that wrote it.

use std::{fs, path::Path};

use anyhow::{Context, Result, ensure};

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// Length, type and checksum of the empty chunk that ends every file.
const END: &[u8] = b"\0\0\0\0IEND\xae\x42\x60\x82";

/// Width and height of a complete PNG file.
///
/// # Errors
/// The file cannot be read, is not PNG, or ends early.
pub(crate) fn size(path: &Path) -> Result<[u32; 2]> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    size_of(&bytes).with_context(|| format!("{} is not a complete PNG file", path.display()))
}

fn size_of(bytes: &[u8]) -> Result<[u32; 2]> {
    ensure!(bytes.starts_with(SIGNATURE), "wrong signature");
    ensure!(bytes.get(12..16) == Some(b"IHDR"), "no header");
    ensure!(bytes.ends_with(END), "no end");
    let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_be_bytes);
    Ok([word(16).context("no width")?, word(20).context("no height")?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(width: u32, height: u32) -> Vec<u8> {
        let sides = [width.to_be_bytes(), height.to_be_bytes()].concat();
        [SIGNATURE, b"\0\0\0\x0dIHDR", &sides, b"\x08\x02\0\0\0crc.", END].concat()
    }

    #[test]
    fn a_header_gives_its_size() {
        assert_eq!(size_of(&header(160, 90)).unwrap(), [160, 90]);
    }

    #[test]
    fn truncated_and_foreign_files_are_rejected() {
        let whole = header(160, 90);
        assert!(size_of(&whole[..whole.len() - 1]).is_err());
        assert!(size_of(b"").is_err());
        assert!(size_of(b"P6 160 90 255").is_err());
        assert!(size_of(&[SIGNATURE, END].concat()).is_err());
    }
}
