//! File names of frames: a printf pattern with one field for the number.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};

/// The names of all frames.
#[derive(Debug)]
pub(super) struct FrameNames {
    pattern: PathBuf,
    folder: PathBuf,
    before: String,
    /// Least number of digits.
    width: usize,
    after: String,
}

/// The most digits of a field: those of the greatest frame number.
const MAX_WIDTH: usize = 10;

impl FrameNames {
    /// Parses the file name of `path`: one field `%d` or `%04d`, and `%%` for a percent sign. The folder is taken as it is.
    pub(super) fn parse(path: &Path) -> Result<Self> {
        let fail = |reason: &str| anyhow!("--output {}: {reason}, e.g. frame_%04d.png", path.display());
        let name = path.file_name().and_then(|name| name.to_str());
        let mut rest =
            name.ok_or_else(|| fail("the file name is not valid UTF-8; use a field for the frame number"))?;
        let (mut text, mut field) = (String::new(), None);
        while let Some(start) = rest.find('%') {
            text.push_str(&rest[..start]);
            rest = &rest[start + 1..];
            if let Some(after) = rest.strip_prefix('%') {
                text.push('%');
                rest = after;
                continue;
            }
            let n_digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let (digits, after) = rest.split_at(n_digits);
            let width: usize = match digits {
                "" => 0,
                _ if !digits.starts_with('0') => MAX_WIDTH + 1,
                _ => digits.parse().unwrap_or(MAX_WIDTH + 1),
            };
            rest = after.strip_prefix('d').filter(|_| width <= MAX_WIDTH).ok_or_else(|| {
                fail("unsupported field for the frame number; use %d, or %0Nd with at most 10 digits, and %% for a percent sign")
            })?;
            if field.replace((std::mem::take(&mut text), width)).is_some() {
                return Err(fail("more than one field for the frame number"));
            }
        }
        text.push_str(rest);
        let (before, width) = field.ok_or_else(|| fail("--frames requires a field for the frame number"))?;
        Ok(Self {
            pattern: path.to_owned(),
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            before,
            width,
            after: text,
        })
    }

    /// The file that lists the frames and what they were rendered with: `frame_%04d.png.frames`.
    pub(super) fn list(&self) -> PathBuf {
        let mut name = self.pattern.clone().into_os_string();
        name.push(".frames");
        name.into()
    }

    /// The file of a frame.
    pub(super) fn path(&self, frame: u32) -> PathBuf {
        self.folder.join(format!("{}{frame:0width$}{}", self.before, self.after, width = self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_printf() {
        for (pattern, frame, want) in [
            ("frame_%04d.png", 7, "frame_0007.png"),
            ("frame_%04d.png", 12345, "frame_12345.png"),
            ("%d.exr", 7, "7.exr"),
            ("%0d.exr", 7, "7.exr"),
            ("100%%_%03d%%.png", 42, "100%_042%.png"),
            ("%%d%d.png", 1, "%d1.png"),
            ("at 100%/%02d.png", 3, "at 100%/03.png"),
            ("é%010d.png", u32::MAX, "é4294967295.png"),
        ] {
            assert_eq!(FrameNames::parse(Path::new(pattern)).unwrap().path(frame), Path::new(want), "{pattern}");
        }
    }

    #[test]
    fn patterns_without_exactly_one_field_are_rejected() {
        for (pattern, reason) in [
            ("frame.png", "requires a field"),
            ("frame%%d.png", "requires a field"),
            ("%02d/frame.png", "requires a field"),
            ("%d_%d.png", "more than one field"),
            ("frame_%s.png", "unsupported field"),
            ("frame_%4d.png", "unsupported field"),
            ("frame_%-4d.png", "unsupported field"),
            ("frame_%011d.png", "unsupported field"),
            ("frame_%099999999999999999999d.png", "unsupported field"),
            ("frame.png%", "unsupported field"),
        ] {
            let error = FrameNames::parse(Path::new(pattern)).unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains(pattern), "{pattern}: {error}");
        }
    }
}
