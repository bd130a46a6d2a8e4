//! Hair models: the HAIR format of Cem Yuksel (cemyuksel.com/research/hairmodels, "HAIR File Format").
//!
//! A header of 128 bytes, then, as its flags say: numbers of segments of the strands, points, thickness, transparency and
//! colors of the points. Thickness is a diameter. Transparency is not read; colors are linear.

use std::path::Path;

use super::{Numbers, Strands};
use crate::read::error::ReadError;

const HEADER_BYTES: usize = 128;

/// Bits of the flags.
const HAS_SEGMENTS: u32 = 1;
const HAS_POINTS: u32 = 1 << 1;
const HAS_THICKNESS: u32 = 1 << 2;
const HAS_TRANSPARENCY: u32 = 1 << 3;
const HAS_COLORS: u32 = 1 << 4;

pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Strands, ReadError> {
    if !bytes.starts_with(b"HAIR") {
        return Err(ReadError::malformed(path, "header", "the file does not begin with HAIR"));
    }
    let mut numbers = Numbers::new(path, bytes, 4);
    let mut next = || Ok::<u32, ReadError>(u32::from_le_bytes(numbers.array("the header")?));
    let [n_strands, n_points, flags, usual_segments] = [next()?, next()?, next()?, next()?];
    let usual_thickness = f32::from_bits(next()?);
    if flags & HAS_POINTS == 0 {
        return Err(ReadError::malformed(path, "header", "the flags say that there are no points"));
    }
    let mut numbers = Numbers::new(path, bytes, HEADER_BYTES);
    let of_strands: Option<Vec<u32>> = if flags & HAS_SEGMENTS == 0 {
        None
    } else {
        let counts = numbers.take((n_strands as usize).saturating_mul(2), "the array of segments")?;
        Some(counts.as_chunks().0.iter().map(|&count| u32::from(u16::from_le_bytes(count))).collect())
    };
    let mut strands =
        Strands { points: numbers.points(n_points as usize, "the array of points")?, ..Strands::default() };
    let thickness = if flags & HAS_THICKNESS == 0 {
        vec![usual_thickness; strands.points.len()]
    } else {
        numbers.floats(n_points as usize, "the array of thickness")?
    };
    strands.radii = Some(thickness.into_iter().map(|diameter| 0.5 * diameter).collect());
    if flags & HAS_TRANSPARENCY != 0 {
        numbers.take((n_points as usize).saturating_mul(4), "the array of transparency")?;
    }
    if flags & HAS_COLORS != 0 {
        let colors = numbers.points(n_points as usize, "the array of colors")?;
        let usable = |x: f32| if x > 0.0 { x.min(1.0) } else { 0.0 };
        strands.colors = Some(colors.into_iter().map(|color| color.map(usable)).collect());
    }
    let mut first = 0_u32;
    for strand in 0..n_strands {
        let n_segments = of_strands.as_ref().map_or(usual_segments, |counts| counts[strand as usize]);
        let end = u64::from(first) + u64::from(n_segments) + 1;
        let end = u32::try_from(end).ok().filter(|&end| end <= n_points).ok_or_else(|| {
            let message = format!("{n_segments} segments from point {first}, but the file has {n_points} points");
            ReadError::malformed(path, format!("strand {strand}"), message)
        })?;
        strands.add_polyline(first..end);
        first = end;
    }
    if first < n_points {
        strands.warnings.push(format!("ignoring points after the last strand: {}", n_points - first));
    }
    Ok(strands)
}
