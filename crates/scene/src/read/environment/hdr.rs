//! Radiance pictures: RGBE and XYZE, plain or with either kind of run lengths, in any orientation.
//!
//! ```text
//! bytes -> header (exposure, color correction, primaries), size -> scan lines -> texels
//! ```
//!
//! Source: Ward, "The RADIANCE Picture File Format", and `color.c` of Radiance.

use super::primaries::{self, Primaries};
use super::{MAX_PER_BYTE, MAX_TEXELS, Texels};
use crate::read::text::{self, quoted};

/// What the header says about colors.
struct Header {
    /// Radiance of a pixel is its color divided by these: the product of all `EXPOSURE` and `COLORCORR`.
    divisor: [f64; 3],
    is_xyz: bool,
    primaries: Option<Primaries>,
}

/// The order of pixels.
struct Layout {
    /// Number of scan lines, and of pixels in each.
    counts: [u32; 2],
    /// Whether scan lines are columns.
    is_transposed: bool,
    /// Whether scan lines, and pixels in them, are in the opposite order of that from the left and from the top.
    is_reversed: [bool; 2],
}

/// Decodes a file; what is ignored becomes a warning.
pub(super) fn decode(bytes: &[u8], warnings: &mut Vec<String>) -> Result<Texels, String> {
    let (header, layout, mut rest) = read_header(bytes, warnings)?;
    let [n_lines, length] = layout.counts;
    let [width, height] = if layout.is_transposed { [n_lines, length] } else { [length, n_lines] };
    let max = MAX_TEXELS.min(MAX_PER_BYTE.saturating_mul(bytes.len() as u64));
    if !(1..=max).contains(&(u64::from(width) * u64::from(height))) {
        return Err(format!("invalid image size {width} x {height} for {} bytes of data", bytes.len()));
    }
    let mut list = vec![[0.0; 3]; width as usize * height as usize];
    let mut line = vec![[0; 4]; length as usize];
    let place = |k: u32, n: u32, is_reversed: bool| (if is_reversed { n - 1 - k } else { k }) as usize;
    for i in 0..n_lines {
        read_line(&mut rest, &mut line)?;
        let i = place(i, n_lines, layout.is_reversed[0]);
        for (j, &pixel) in (0..length).zip(&line) {
            let j = place(j, length, layout.is_reversed[1]);
            let (row, column) = if layout.is_transposed { (j, i) } else { (i, j) };
            list[row * width as usize + column] = color(pixel, header.divisor);
        }
    }
    if let Some(matrix) = matrix(&header)? {
        primaries::apply(&matrix, &mut list);
    }
    Ok(Texels { width, height, list })
}

/// The matrix to Rec. 709. Files without `PRIMARIES` are of Rec. 709, as all programs but Radiance take them; XYZ is that of Radiance.
fn matrix(header: &Header) -> Result<Option<[[f64; 3]; 3]>, String> {
    match header.primaries {
        _ if header.is_xyz => Primaries::RADIANCE.rgb_from_xyz().map(Some),
        Some(primaries) => primaries.to_rec_709(),
        None => Ok(None),
    }
}

/// The color of a pixel: three mantissas and an exponent.
fn color([r, g, b, e]: [u8; 4], divisor: [f64; 3]) -> [f32; 3] {
    if e == 0 {
        return [0.0; 3];
    }
    // 128 of the exponent, and 8 as mantissas have 8 bits.
    let scale = 2_f64.powi(i32::from(e) - 136);
    let mantissas = [r, g, b];
    std::array::from_fn(|k| (f64::from(mantissas[k]) * scale / divisor[k]) as f32)
}

/// Reads the header and the size; also gives the bytes after them.
fn read_header<'a>(bytes: &'a [u8], warnings: &mut Vec<String>) -> Result<(Header, Layout, &'a [u8]), String> {
    // Where lines end with CR, an LF after the last one is the first byte of the pixels.
    let end = if bytes[..text::line_length(bytes)].ends_with(b"\r") { b'\r' } else { b'\n' };
    let mut rest = bytes;
    let mut header = Header { divisor: [1.0; 3], is_xyz: false, primaries: None };
    while let Some(length) = rest.iter().position(|&byte| byte == end) {
        let line = rest[..length].trim_ascii();
        rest = &rest[length + 1..];
        if let Some(layout) = layout(line) {
            return Ok((header, layout?, rest));
        }
        header.read(line, warnings)?;
    }
    Err("unexpected end of the header".to_owned())
}

impl Header {
    /// Reads a variable.
    fn read(&mut self, line: &[u8], warnings: &mut Vec<String>) -> Result<(), String> {
        let Some(at) = line.iter().position(|&byte| byte == b'=') else { return Ok(()) };
        let (name, value) = (line[..at].trim_ascii(), line[at + 1..].trim_ascii());
        let numbers: Option<Vec<f64>> =
            text::words(value).map(|word| std::str::from_utf8(word).ok()?.parse().ok()).collect();
        let is_factor = |factor: &f64| factor.is_finite() && *factor > 0.0;
        match (&name.to_ascii_uppercase()[..], numbers.as_deref()) {
            (b"FORMAT", _) => match value {
                b"32-bit_rle_rgbe" => self.is_xyz = false,
                b"32-bit_rle_xyze" => self.is_xyz = true,
                _ => return Err(format!("unsupported format {} of a Radiance file", quoted(value))),
            },
            (b"EXPOSURE", Some([exposure, ..])) if is_factor(exposure) => {
                self.divisor = self.divisor.map(|divisor| divisor * exposure);
            }
            (b"COLORCORR", Some(&[r, g, b, ..])) if [r, g, b].iter().all(is_factor) => {
                self.divisor = [self.divisor[0] * r, self.divisor[1] * g, self.divisor[2] * b];
            }
            (b"PRIMARIES", Some(&[rx, ry, gx, gy, bx, by, wx, wy])) => {
                self.primaries = Some(Primaries([[rx, ry], [gx, gy], [bx, by], [wx, wy]]));
            }
            (b"EXPOSURE" | b"COLORCORR" | b"PRIMARIES", _) => {
                warnings.push(format!("ignoring {}: its value is not valid", quoted(line)));
            }
            _ => {}
        }
        Ok(())
    }
}

/// The size and the order of pixels: `-Y 512 +X 1024`; `None` for a line of the header.
fn layout(line: &[u8]) -> Option<Result<Layout, String>> {
    let words: Vec<&[u8]> = text::words(line).collect();
    let &[first, n_lines, second, length] = &words[..] else { return None };
    let axis = |word: &[u8]| match word {
        [sign @ (b'+' | b'-'), axis @ (b'X' | b'Y')] => Some((*axis, *sign == b'+')),
        _ => None,
    };
    let ((first, is_first_up), (second, is_second_up)) = (axis(first)?, axis(second)?);
    let count = |word: &[u8]| std::str::from_utf8(word).ok()?.parse().ok();
    let (Some(n_lines), Some(length)) = (count(n_lines), count(length)) else {
        return Some(Err(format!("invalid image size {}", quoted(line))));
    };
    // X rises to the right, Y to the top.
    let is_reversed = |axis: u8, is_up: bool| (axis == b'Y') == is_up;
    (first != second).then_some(Ok(Layout {
        counts: [n_lines, length],
        is_transposed: first == b'X',
        is_reversed: [is_reversed(first, is_first_up), is_reversed(second, is_second_up)],
    }))
}

const ENDS_EARLY: &str = "unexpected end of Radiance data";

fn take<'a>(rest: &mut &'a [u8], n: usize) -> Result<&'a [u8], String> {
    let (taken, after) = rest.split_at_checked(n).ok_or(ENDS_EARLY)?;
    *rest = after;
    Ok(taken)
}

/// Reads a scan line: one channel after another with run lengths, or pixels.
fn read_line(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Result<(), String> {
    // A line of this length whose first pixel is no color says that channels follow.
    let has_runs = (8..0x8000).contains(&line.len());
    match **rest {
        [2, 2, high, low, ..] if has_runs && high < 128 => {
            *rest = &rest[4..];
            if usize::from(high) << 8 | usize::from(low) != line.len() {
                return Err("the length of a scan line differs from the width".to_owned());
            }
            (0..4).try_for_each(|channel| read_channel(rest, line, channel))
        }
        _ => read_pixels(rest, line),
    }
}

/// Reads one channel of a scan line: a byte above 128 repeats the next one, others say how many follow.
fn read_channel(rest: &mut &[u8], line: &mut [[u8; 4]], channel: usize) -> Result<(), String> {
    let mut at = 0;
    while at < line.len() {
        let code = take(rest, 1)?[0];
        let (n, is_run) = if code > 128 { (usize::from(code) - 128, true) } else { (usize::from(code), false) };
        if n == 0 || at + n > line.len() {
            return Err("a run exceeds its scan line".to_owned());
        }
        let values = take(rest, if is_run { 1 } else { n })?;
        for (k, pixel) in line[at..at + n].iter_mut().enumerate() {
            pixel[channel] = values[if is_run { 0 } else { k }];
        }
        at += n;
    }
    Ok(())
}

/// Reads the pixels of a scan line; `1 1 1 n` repeats the one before, and several in a row are the digits of a number.
fn read_pixels(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Result<(), String> {
    let (mut at, mut shift) = (0_usize, 0_u32);
    while at < line.len() {
        let pixel: [u8; 4] = take(rest, 4)?.try_into().map_err(|_| ENDS_EARLY)?;
        let [1, 1, 1, digit] = pixel else {
            line[at] = pixel;
            (at, shift) = (at + 1, 0);
            continue;
        };
        let n = usize::from(digit) << shift.min(24);
        let before = at.checked_sub(1).map(|before| line[before]).ok_or("a scan line begins with a run")?;
        let end = at.checked_add(n).filter(|&end| end <= line.len()).ok_or("a run exceeds its scan line")?;
        line[at..end].fill(before);
        (at, shift) = (end, shift + 8);
    }
    Ok(())
}
