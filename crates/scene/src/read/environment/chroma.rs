//! OpenEXR of luminance and chroma, whose two channels of chroma have a quarter of the samples: scan lines, plain or compressed by run
//! lengths or ZIP. The decoder of the other files has no channels of fewer samples.
//!
//! Sources: Technical Introduction to OpenEXR, "Luminance/Chroma Images"; OpenEXR File Layout; `ImfRgbaYca.cpp`.

use std::collections::HashMap;
use std::io::Read as _;

use exr::prelude::f16;

use super::primaries::Primaries;
use super::{Decoded, MAX_PER_BYTE, MAX_TEXELS, Texels};

/// Tiles, deep data and several parts, in the word after the signature.
const OTHER_LAYOUTS: u32 = 0x200 | 0x800 | 0x1000;

const ENDS_EARLY: &str = "unexpected end of OpenEXR data";

/// A channel of the file.
struct Channel {
    name: Vec<u8>,
    /// 1 for half, 2 for float.
    kind: u32,
    /// Columns and rows per sample.
    sampling: [i32; 2],
}

/// What the header says.
struct Header {
    channels: Vec<Channel>,
    compression: u8,
    /// First column and row, last column and row.
    window: [i32; 4],
    primaries: Option<Primaries>,
    is_cube: bool,
}

/// Samples of a channel, by row.
struct Plane {
    /// Column of the first sample, and row.
    first: [i32; 2],
    sampling: [i32; 2],
    width: usize,
    list: Vec<f32>,
}

/// Decodes a file of luminance and chroma, with its primaries and whether it is a cube map; `None` for other files.
pub(super) fn decode(bytes: &[u8]) -> Option<Result<Decoded, String>> {
    let (header, rest) = read_header(bytes)?;
    let is_chroma = |channel: &Channel| [&b"RY"[..], b"BY"].contains(&&channel.name[..]);
    if !header.channels.iter().any(is_chroma) {
        return None;
    }
    Some(read_image(bytes, &header, rest).map(|texels| (texels, header.primaries, header.is_cube)))
}

/// Reads the header; also gives the bytes after it. `None` if it is not that of one part of scan lines.
fn read_header(bytes: &[u8]) -> Option<(Header, &[u8])> {
    let version = u32::from_le_bytes(*bytes.get(4..)?.first_chunk()?);
    let mut rest = bytes.get(8..).filter(|_| version & OTHER_LAYOUTS == 0)?;
    let mut attributes = HashMap::new();
    while let Some((name, after)) = text(rest).filter(|(name, _)| !name.is_empty()) {
        let (_, after) = text(after)?;
        let (length, after) = after.split_first_chunk()?;
        let (value, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        attributes.insert(name, value);
        rest = after;
    }
    let value = |name: &[u8]| attributes.get(name).copied();
    let channels = read_channels(value(b"channels")?)?;
    let words = value(b"dataWindow")?.as_chunks::<4>().0;
    let window = <[[u8; 4]; 4]>::try_from(words).ok()?.map(i32::from_le_bytes);
    let numbers = value(b"chromaticities").map(|value| value.as_chunks::<4>().0);
    let primaries = numbers.and_then(|words| <[[u8; 4]; 8]>::try_from(words).ok()).map(|words| {
        let number = |k: usize| f64::from(f32::from_le_bytes(words[k]));
        Primaries(std::array::from_fn(|k| [number(2 * k), number(2 * k + 1)]))
    });
    let compression = *value(b"compression")?.first()?;
    let is_cube = value(b"envmap") == Some(&[1]);
    Some((Header { channels, compression, window, primaries, is_cube }, rest.get(1..)?))
}

/// The text up to a zero byte, and the bytes after it.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = bytes.iter().take(256).position(|&byte| byte == 0)?;
    Some((&bytes[..end], &bytes[end + 1..]))
}

fn read_channels(mut rest: &[u8]) -> Option<Vec<Channel>> {
    let mut channels = Vec::new();
    while let Some((name, after)) = text(rest).filter(|(name, _)| !name.is_empty()) {
        let (words, after) = after.split_first_chunk::<16>()?;
        let word = |k: usize| -> [u8; 4] { words.as_chunks::<4>().0[k] };
        let sampling = [2, 3].map(|k| i32::from_le_bytes(word(k)));
        channels.push(Channel { name: name.to_owned(), kind: u32::from_le_bytes(word(0)), sampling });
        rest = after;
    }
    Some(channels)
}

fn read_image(bytes: &[u8], header: &Header, rest: &[u8]) -> Result<Texels, String> {
    let [x_min, y_min, x_max, y_max] = header.window.map(i64::from);
    let (width, height) = (x_max - x_min + 1, y_max - y_min + 1);
    if header.channels.iter().any(|c| c.sampling.iter().any(|&n| n < 1) || !(0..=2).contains(&c.kind)) {
        return Err("invalid channels of luminance and chroma".to_owned());
    }
    // As many as if each channel had all samples.
    let n_texels = u64::try_from(width).unwrap_or(0).saturating_mul(u64::try_from(height).unwrap_or(0));
    let n_samples = n_texels.saturating_mul(header.channels.len() as u64);
    if n_texels == 0 || n_samples > (4 * MAX_TEXELS).min(MAX_PER_BYTE.saturating_mul(bytes.len() as u64)) {
        return Err(format!("invalid image size {width} x {height} for {} bytes of data", bytes.len()));
    }
    let mut planes: Vec<Plane> = header.channels.iter().map(|channel| Plane::of(channel, header.window)).collect();
    read_blocks(bytes, header, rest, &mut planes)?;
    let plane = |name: &[u8]| {
        let at = header.channels.iter().position(|channel| channel.name == name);
        at.map(|at| &planes[at]).ok_or_else(|| format!("missing channel {}", String::from_utf8_lossy(name)))
    };
    let (y, ry, by) = (plane(b"Y")?, plane(b"RY")?, plane(b"BY")?);
    let of_file = header.primaries.and_then(Primaries::luminance);
    let [of_red, of_green, of_blue] = of_file.or(Primaries::REC_709.luminance()).unwrap_or([1.0 / 3.0; 3]);
    let color = |column: i32, row: i32| {
        let luminance = y.at(column, row);
        let [red, blue] = [ry, by].map(|chroma| (chroma.at(column, row) + 1.0) * luminance);
        let green = (luminance - red * of_red - blue * of_blue) / of_green;
        [red, green, blue].map(|x| x as f32)
    };
    let [first, top, last, bottom] = header.window;
    let list = (top..=bottom).flat_map(|row| (first..=last).map(move |column| (column, row)));
    let list = list.map(|(column, row)| color(column, row)).collect();
    Ok(Texels { width: width as u32, height: height as u32, list })
}

/// Numbers of multiples of `step` from `first` to `last`, and the first of them.
fn multiples(first: i32, last: i32, step: i32) -> (usize, i32) {
    let (first, last, step) = (i64::from(first), i64::from(last), i64::from(step));
    let (from, to) = ((first + step - 1).div_euclid(step), last.div_euclid(step));
    ((to - from + 1).max(0) as usize, (from * step).clamp(first, last) as i32)
}

impl Plane {
    /// Zeros of the size of a channel.
    fn of(channel: &Channel, [x_min, y_min, x_max, y_max]: [i32; 4]) -> Self {
        let (width, first_column) = multiples(x_min, x_max, channel.sampling[0]);
        let (height, first_row) = multiples(y_min, y_max, channel.sampling[1]);
        let (first, sampling) = ([first_column, first_row], channel.sampling);
        Self { first, sampling, width, list: vec![0.0; width * height] }
    }

    /// The value at a pixel, interpolated between samples.
    fn at(&self, column: i32, row: i32) -> f64 {
        let height = self.list.len().checked_div(self.width).unwrap_or(0);
        let neighbors = |at: i32, axis: usize, n: usize| {
            let steps = f64::from(at - self.first[axis]) / f64::from(self.sampling[axis]);
            let steps = steps.clamp(0.0, n.saturating_sub(1) as f64);
            let before = steps.floor() as usize;
            (before, (before + 1).min(n.saturating_sub(1)), steps - steps.floor())
        };
        let ((left, right, along), (top, bottom, down)) = (neighbors(column, 0, self.width), neighbors(row, 1, height));
        let value =
            |row: usize, column: usize| self.list.get(row * self.width + column).map_or(0.0, |&value| f64::from(value));
        let mix = |a: f64, b: f64, part: f64| if part == 0.0 { a } else { a + part * (b - a) };
        mix(
            mix(value(top, left), value(top, right), along),
            mix(value(bottom, left), value(bottom, right), along),
            down,
        )
    }
}

/// Reads the scan lines of all blocks into the planes.
fn read_blocks(bytes: &[u8], header: &Header, rest: &[u8], planes: &mut [Plane]) -> Result<(), String> {
    let (n_lines, is_runs) = match header.compression {
        0 => (1, false),
        1 => (1, true),
        2 => (1, false),
        3 => (16, false),
        other => {
            let name = ["PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"].get(usize::from(other.saturating_sub(4)));
            let name = name.map_or_else(|| other.to_string(), |name| (*name).to_owned());
            return Err(format!(
                "unsupported OpenEXR feature: luminance and chroma compressed by {name}; use ZIP or RGB"
            ));
        }
    };
    let [_, top, _, bottom] = header.window;
    let n_blocks = (i64::from(bottom) - i64::from(top) + 1 + n_lines - 1) / n_lines;
    for k in 0..n_blocks as usize {
        let offset = rest.get(8 * k..).and_then(|rest| rest.first_chunk()).ok_or(ENDS_EARLY)?;
        let at = usize::try_from(u64::from_le_bytes(*offset)).map_err(|_| ENDS_EARLY)?;
        let (start, data) = bytes.get(at..).and_then(|block| block.split_first_chunk::<8>()).ok_or(ENDS_EARLY)?;
        let first = i32::from_le_bytes([start[0], start[1], start[2], start[3]]);
        let length = u32::from_le_bytes([start[4], start[5], start[6], start[7]]) as usize;
        let data = data.get(..length).ok_or(ENDS_EARLY)?;
        if !(top..=bottom).contains(&first) {
            return Err(format!("invalid OpenEXR data: scan line {first}"));
        }
        let last = (i64::from(first) + n_lines - 1).min(i64::from(bottom)) as i32;
        let rows = |plane: &Plane| multiples(first, last, plane.sampling[1]).0;
        let n_bytes: usize = (planes.iter().zip(&header.channels))
            .map(|(plane, channel)| rows(plane) * plane.width * size(channel))
            .sum();
        // A block that compression would not make smaller is stored as it is.
        let plain = match (header.compression, data.len() >= n_bytes) {
            (0, _) | (_, true) => data.to_vec(),
            (_, false) if is_runs => merged(&expanded(data, n_bytes)?),
            (_, false) => merged(&inflated(data, n_bytes)?),
        };
        if plain.len() != n_bytes {
            return Err(ENDS_EARLY.to_owned());
        }
        let mut rest = &plain[..];
        for row in first..=last {
            for (plane, channel) in planes.iter_mut().zip(&header.channels) {
                rest = plane.read_row(row, channel, rest).ok_or(ENDS_EARLY)?;
            }
        }
    }
    Ok(())
}

/// Bytes of a sample.
fn size(channel: &Channel) -> usize {
    if channel.kind == 1 { 2 } else { 4 }
}

impl Plane {
    /// Reads the samples of a row, if it has any; gives the bytes after them.
    fn read_row<'a>(&mut self, row: i32, channel: &Channel, bytes: &'a [u8]) -> Option<&'a [u8]> {
        if row.rem_euclid(self.sampling[1]) != 0 {
            return Some(bytes);
        }
        let at = usize::try_from((i64::from(row) - i64::from(self.first[1])) / i64::from(self.sampling[1])).ok()?;
        let samples = self.list.get_mut(at * self.width..)?.get_mut(..self.width)?;
        let (own, rest) = bytes.split_at_checked(self.width * size(channel))?;
        for (k, sample) in samples.iter_mut().enumerate() {
            *sample = match channel.kind {
                1 => f16::from_le_bytes(own.as_chunks().0[k]).to_f32(),
                2 => f32::from_le_bytes(own.as_chunks().0[k]),
                _ => u32::from_le_bytes(own.as_chunks().0[k]) as f32,
            };
        }
        Some(rest)
    }
}

/// Expands run lengths: a negative count precedes as many bytes, another one a byte that is repeated once more than it says.
fn expanded(mut data: &[u8], n_bytes: usize) -> Result<Vec<u8>, String> {
    let mut out = Vec::with_capacity(n_bytes);
    while let Some((&code, rest)) = data.split_first() {
        let count = usize::from((code as i8).unsigned_abs());
        if (code as i8) < 0 {
            let (bytes, rest) = rest.split_at_checked(count).ok_or(ENDS_EARLY)?;
            out.extend_from_slice(bytes);
            data = rest;
        } else {
            let (&byte, rest) = rest.split_first().ok_or(ENDS_EARLY)?;
            out.resize(out.len() + count + 1, byte);
            data = rest;
        }
        if out.len() > n_bytes {
            return Err("invalid OpenEXR data: a run exceeds its block".to_owned());
        }
    }
    Ok(out)
}

fn inflated(data: &[u8], n_bytes: usize) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let mut decoder = flate2::read::ZlibDecoder::new(data).take(n_bytes as u64 + 1);
    decoder.read_to_end(&mut out).map_err(|error| format!("invalid OpenEXR data: {error}"))?;
    Ok(out)
}

/// Undoes the differences of bytes, and then their division into halves: the even ones first.
fn merged(data: &[u8]) -> Vec<u8> {
    let mut sum = 128_u8;
    let bytes: Vec<u8> = data
        .iter()
        .enumerate()
        .map(|(k, &difference)| {
            sum = if k == 0 { difference } else { sum.wrapping_add(difference).wrapping_sub(128) };
            sum
        })
        .collect();
    let (even, odd) = bytes.split_at(bytes.len().div_ceil(2));
    (0..bytes.len()).map(|k| if k % 2 == 0 { even[k / 2] } else { odd[k / 2] }).collect()
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    /// Luminance of 4 x 4 pixels and chroma of 2 x 2 samples, as a file whose window begins at an even pixel.
    fn file(compression: u8, luminance: impl Fn(i32, i32) -> f32, chroma: [impl Fn(i32, i32) -> f32; 2]) -> Vec<u8> {
        const FIRST: i32 = -2;
        let attribute = |name: &str, kind: &str, value: &[u8]| {
            let length = u32::try_from(value.len()).unwrap().to_le_bytes();
            [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &length, value].concat()
        };
        let channel = |name: &str, sampling: i32| {
            let words = [1, 0, sampling, sampling].map(i32::to_le_bytes);
            [name.as_bytes(), b"\0", words.as_flattened()].concat()
        };
        let channels = [channel("BY", 2), channel("RY", 2), channel("Y", 1), vec![0]].concat();
        let window = [FIRST, FIRST, FIRST + 3, FIRST + 3].map(i32::to_le_bytes);
        let mut bytes = [[0x76, 0x2f, 0x31, 0x01], 2_u32.to_le_bytes()].concat();
        bytes.extend(attribute("channels", "chlist", &channels));
        bytes.extend(attribute("compression", "compression", &[compression]));
        bytes.extend(attribute("dataWindow", "box2i", window.as_flattened()));
        bytes.push(0);
        let half = |x: f32| f16::from_f32(x).to_le_bytes();
        let line = |y: i32| {
            let [red, blue] = &chroma;
            let of = |value: &dyn Fn(i32, i32) -> f32, step: usize| -> Vec<u8> {
                (FIRST..FIRST + 4).step_by(step).flat_map(|x| half(value(x, y))).collect()
            };
            let chroma = if y % 2 == 0 { [of(blue, 2), of(red, 2)].concat() } else { Vec::new() };
            [chroma, of(&luminance, 1)].concat()
        };
        let n_lines = if compression == 3 { 16 } else { 1 };
        let blocks: Vec<(i32, Vec<u8>)> = (FIRST..FIRST + 4)
            .step_by(n_lines)
            .map(|y| (y, (y..(y + n_lines as i32).min(FIRST + 4)).flat_map(line).collect()))
            .map(|(y, plain): (i32, Vec<u8>)| (y, compressed(compression, &plain)))
            .collect();
        let mut at = bytes.len() + 8 * blocks.len();
        for (_, data) in &blocks {
            bytes.extend((at as u64).to_le_bytes());
            at += 8 + data.len();
        }
        for (y, data) in blocks {
            bytes.extend([y.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat());
            bytes.extend(data);
        }
        bytes
    }

    /// A block as a writer stores it.
    fn compressed(compression: u8, plain: &[u8]) -> Vec<u8> {
        let halves = |first: usize| plain.iter().copied().skip(first).step_by(2);
        let split: Vec<u8> = halves(0).chain(halves(1)).collect();
        let before = std::iter::once(128).chain(split.iter().copied());
        let mut differences: Vec<u8> =
            split.iter().zip(before).map(|(x, before)| x.wrapping_sub(before).wrapping_add(128)).collect();
        differences[0] = split[0];
        let packed = match compression {
            0 => return plain.to_vec(),
            1 => differences.chunk_by(|a, b| a == b).flat_map(|run| [run.len() as u8 - 1, run[0]]).collect(),
            _ => {
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
                encoder.write_all(&differences).unwrap();
                encoder.finish().unwrap()
            }
        };
        if packed.len() < plain.len() { packed } else { plain.to_vec() }
    }

    #[test]
    fn colors_are_those_that_were_written() {
        // Chroma of a color of Rec. 709: (red - Y) / Y and (blue - Y) / Y.
        let rgb = [0.6, 0.3, 0.1];
        let y = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        let chroma = [(rgb[0] - y) / y, (rgb[2] - y) / y];
        for compression in 0..4 {
            let bytes = file(compression, |_, _| y, chroma.map(|value| move |_, _| value));
            let (texels, primaries, is_cube) = decode(&bytes).unwrap().unwrap();
            assert_eq!((texels.width, texels.height, primaries, is_cube), (4, 4, None, false));
            for texel in texels.list {
                // Half precision has eleven bits.
                assert!(texel.iter().zip(rgb).all(|(got, want)| (got - want).abs() < 2e-3), "{compression}: {texel:?}");
            }
        }
    }

    #[test]
    fn chroma_is_interpolated_and_luminance_is_not() {
        let chroma: [fn(i32, i32) -> f32; 2] = [|x, _| (x + 2) as f32, |_, y| (y + 2) as f32];
        let bytes = file(0, |x, y| ((x + 2) * 4 + y + 2) as f32, chroma);
        let (texels, ..) = decode(&bytes).unwrap().unwrap();
        for (k, texel) in texels.list.iter().enumerate() {
            let (x, y) = ((k % 4) as f32, (k / 4) as f32);
            let luminance = 4.0 * x + y;
            // The last column and row have no sample after them.
            let want = [(x.min(2.0) + 1.0) * luminance, (y.min(2.0) + 1.0) * luminance];
            assert_eq!([texel[0], texel[2]], want, "{k}");
        }
    }

    #[test]
    fn damaged_files_are_errors_and_others_are_left_to_the_other_decoder() {
        for compression in 0..4 {
            let full = file(compression, |_, _| 1.0, [|_: i32, _: i32| 0.0; 2]);
            for length in 0..full.len() {
                assert!(!matches!(decode(&full[..length]), Some(Ok(_))), "{length}");
            }
            for at in 0..full.len() {
                for byte in [0, 1, 0x7f, 0x80, 0xff] {
                    let mut bytes = full.clone();
                    bytes[at] = byte;
                    if let Some(Ok((texels, ..))) = decode(&bytes) {
                        assert_eq!(texels.list.len() as u64, u64::from(texels.width) * u64::from(texels.height));
                    }
                }
            }
        }
        let mut piz = file(0, |_, _| 1.0, [|_: i32, _: i32| 0.0; 2]);
        let at = piz.windows(12).position(|window| window == b"compression\0").unwrap() + 12 + 12 + 4;
        piz[at] = 4;
        assert!(decode(&piz).unwrap().err().unwrap().contains("PIZ"));
    }
}
