//! Tracks of nerve fibers: MRtrix `.tck` and TrackVis `.trk`.
//!
//! Sources: MRtrix documentation, "Tracks file format (.tck)"; trackvis.org, "Track File Structure".

use std::path::Path;

use super::{Numbers, Strands, point_index};
use crate::read::error::ReadError;
use crate::read::text::{self, quoted};

/// Parses MRtrix tracks: a header of text up to `END`, then points at its offset. Three NaN end a track, three infinities the file.
pub(super) fn parse_tck(path: &Path, bytes: &[u8]) -> Result<Strands, ReadError> {
    if !bytes.starts_with(b"mrtrix tracks") {
        return Err(ReadError::malformed(path, "header", "the file does not begin with 'mrtrix tracks'"));
    }
    let (mut offset, mut data_type) = (None, None);
    let mut ended = false;
    for line in bytes.split(|&byte| byte == b'\n').skip(1) {
        let line = line.trim_ascii();
        if line == b"END" {
            ended = true;
            break;
        }
        let Some(colon) = line.iter().position(|&byte| byte == b':') else { continue };
        let (key, value) = (line[..colon].trim_ascii(), line[colon + 1..].trim_ascii());
        match key {
            b"file" => offset = value.strip_prefix(b".").and_then(|at| text::integer(at.trim_ascii())),
            b"datatype" => data_type = Some(value),
            _ => {}
        }
    }
    if !ended {
        return Err(ReadError::malformed(path, "header", "there is no line END"));
    }
    let missing = |key: &str| ReadError::malformed(path, "header", format!("there is no usable line '{key}'"));
    let offset = offset.and_then(|at| usize::try_from(at).ok()).ok_or_else(|| missing("file: . OFFSET"))?;
    let data = bytes.get(offset..).ok_or_else(|| {
        ReadError::malformed(path, "header", format!("the offset {offset} is after the end, {}", bytes.len()))
    })?;
    let mut points: Box<dyn Iterator<Item = [f32; 3]> + '_> = match data_type {
        Some(b"Float32LE") => Box::new(triples(data, |bytes: [u8; 4]| f32::from_le_bytes(bytes))),
        Some(b"Float32BE") => Box::new(triples(data, |bytes: [u8; 4]| f32::from_be_bytes(bytes))),
        Some(b"Float64LE") => Box::new(triples(data, |bytes: [u8; 8]| f64::from_le_bytes(bytes) as f32)),
        Some(b"Float64BE") => Box::new(triples(data, |bytes: [u8; 8]| f64::from_be_bytes(bytes) as f32)),
        Some(other) => return Err(ReadError::unsupported(path, format!("datatype {}", quoted(other)))),
        None => return Err(missing("datatype")),
    };
    let mut strands = Strands::default();
    let mut first = 0;
    let mut is_complete = false;
    for point in points.by_ref() {
        let is_end = point.iter().all(|x| x.is_infinite());
        if is_end || point.iter().all(|x| x.is_nan()) {
            let end = point_index(path, strands.points.len())?;
            strands.add_polyline(first..end);
            first = end;
        } else {
            strands.points.push(point);
        }
        if is_end {
            is_complete = true;
            break;
        }
    }
    if !is_complete {
        let end = point_index(path, strands.points.len())?;
        strands.add_polyline(first..end);
        strands.warnings.push("the file has no end mark: it may be cut off".to_owned());
    }
    Ok(strands)
}

/// Points of three numbers of `N` bytes.
fn triples<'a, const N: usize>(
    bytes: &'a [u8],
    number: impl Fn([u8; N]) -> f32 + 'a,
) -> impl Iterator<Item = [f32; 3]> + 'a {
    let (numbers, _) = bytes.as_chunks::<N>();
    numbers.as_chunks::<3>().0.iter().map(move |triple| triple.map(&number))
}

/// Bytes of the header of a `.trk` file.
const HEADER_BYTES: usize = 1000;

/// Parses TrackVis tracks. Points are in millimeters from the corner of the first voxel; the matrix of the header, if it has one, takes
/// voxels to the space of the scanner.
pub(super) fn parse_trk(path: &Path, bytes: &[u8]) -> Result<Strands, ReadError> {
    if !bytes.starts_with(b"TRACK") {
        return Err(ReadError::malformed(path, "header", "the file does not begin with TRACK"));
    }
    let header = Numbers::new(path, bytes, 0).take(HEADER_BYTES, "the header")?;
    let short = |at: usize| i16::from_le_bytes([header[at], header[at + 1]]);
    let int = |at: usize| i32::from_le_bytes(std::array::from_fn(|k| header[at + k]));
    let float = |at: usize| f32::from_bits(int(at) as u32);
    if int(996) != HEADER_BYTES as i32 {
        let message = format!("the size of the header is {}, not {HEADER_BYTES}", int(996));
        return Err(ReadError::malformed(path, "header", message));
    }
    let count = |at: usize, what: &str| {
        let n = short(at);
        usize::try_from(n).map_err(|_| ReadError::malformed(path, "header", format!("the number of {what} is {n}")))
    };
    let (n_scalars, n_properties) = (count(36, "scalars")?, count(238, "properties")?);
    let voxel: [f32; 3] = std::array::from_fn(|k| float(12 + 4 * k));
    let matrix: [[f32; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| float(440 + 16 * i + 4 * j)));
    let has_matrix = matrix[3][3] != 0.0 && voxel.iter().all(|&size| size > 0.0);
    let placed = |point: [f32; 3]| -> [f32; 3] {
        if !has_matrix {
            return point;
        }
        let of_voxel: [f64; 3] = std::array::from_fn(|k| f64::from(point[k]) / f64::from(voxel[k]) - 0.5);
        std::array::from_fn(|i| {
            let row = matrix[i].map(f64::from);
            (row[0] * of_voxel[0] + row[1] * of_voxel[1] + row[2] * of_voxel[2] + row[3]) as f32
        })
    };
    let mut strands = Strands::default();
    if !has_matrix {
        strands
            .warnings
            .push("the header has no matrix: points are in millimeters from the corner of the first voxel".to_owned());
    }
    let mut numbers = Numbers::new(path, bytes, HEADER_BYTES);
    let mut track = 0_usize;
    while numbers.at < bytes.len() {
        let n = i32::from_le_bytes(numbers.array("the number of points")?);
        let n_points = usize::try_from(n).map_err(|_| {
            ReadError::malformed(path, format!("track {track}"), format!("the number of points is {n}"))
        })?;
        let stride = 3 + n_scalars;
        let values = numbers.floats(n_points.saturating_mul(stride), "a track")?;
        let first = point_index(path, strands.points.len())?;
        strands.points.extend(values.chunks_exact(stride).map(|point| placed([point[0], point[1], point[2]])));
        let end = point_index(path, strands.points.len())?;
        strands.add_polyline(first..end);
        numbers.take(4 * n_properties, "the properties of a track")?;
        track += 1;
    }
    Ok(strands)
}
