//! Lines with a thickness: hair, tracks of fibers, lines of OBJ.
//!
//! ```text
//! bytes -> strands of points -> segments, numbered strand by strand
//! ```
//!
//! Segments with a point that is not finite are dropped and have no number.

mod hair;
mod obj;
mod tracks;

use std::path::Path;

use super::error::ReadError;
use super::input::read_all;

/// Lines and balls with a thickness, in the file's unit and space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Positions, finite where a segment uses them.
    pub points: Vec<[f32; 3]>,
    /// The radius at each point, at least 0.
    pub radii: Vec<f32>,
    /// The ends of each segment as indices of points.
    pub segments: Vec<[u32; 2]>,
    /// What was repaired or skipped.
    pub warnings: Vec<String>,
}

/// Options of [`read_lines`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineOptions {
    /// Radius of lines for which the file states none, in the file's unit; `None` for a two-thousandth of their extent.
    pub line_radius: Option<f32>,
}

/// Radius relative to the diagonal of the bounds, where neither file nor options state one.
const DEFAULT_RADIUS: f32 = 1.0 / 2000.0;

/// A format of lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Hair,
    Tck,
    Trk,
    Obj,
}

fn format_of(path: &Path) -> Option<Format> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "hair" => Some(Format::Hair),
        "tck" => Some(Format::Tck),
        "trk" => Some(Format::Trk),
        "obj" => Some(Format::Obj),
        _ => None,
    }
}

/// Whether a file holds lines and no triangles, by its extension: `.hair`, `.tck`, `.trk`.
#[must_use]
pub fn is_lines(path: &Path) -> bool {
    matches!(format_of(path), Some(Format::Hair | Format::Tck | Format::Trk))
}

/// Reads the lines of a file, by its extension: `.hair` (Yuksel), `.tck` (MRtrix), `.trk` (TrackVis), `.obj` (`l` statements).
///
/// Thickness in `.hair` is a diameter. Points of `.trk` are in millimeters of the space of its matrix.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("path.obj");
/// # std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3")?;
/// use canted_scene::{LineOptions, read_lines};
///
/// let lines = read_lines(&path, &LineOptions { line_radius: Some(0.1) })?;
/// assert_eq!(lines.segments, [[0, 1], [1, 2]]);
/// assert_eq!(lines.radii, [0.1; 3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ReadError`] with file, location and value.
pub fn read_lines(path: &Path, options: &LineOptions) -> Result<Lines, ReadError> {
    let format = format_of(path).ok_or_else(|| ReadError::UnknownFormat { path: path.to_owned() })?;
    let strands = match (format, read_all(path)?) {
        (Format::Hair, bytes) => hair::parse(path, &bytes)?,
        (Format::Tck, bytes) => tracks::parse_tck(path, &bytes)?,
        (Format::Trk, bytes) => tracks::parse_trk(path, &bytes)?,
        (Format::Obj, bytes) => obj::parse(path, &bytes)?,
    };
    strands.into_lines(path, options)
}

/// Polylines, as a file holds them.
#[derive(Debug, Default)]
struct Strands {
    points: Vec<[f32; 3]>,
    /// Radii of the points, if the file states any.
    radii: Option<Vec<f32>>,
    segments: Vec<[u32; 2]>,
    warnings: Vec<String>,
}

impl Strands {
    /// Adds segments between consecutive points of a range.
    fn add_polyline(&mut self, points: std::ops::Range<u32>) {
        let others = points.start.saturating_add(1)..points.end;
        self.segments.extend(points.zip(others).map(|(from, to)| [from, to]));
    }

    /// Drops what is not finite, and gives every point a radius.
    fn into_lines(mut self, path: &Path, options: &LineOptions) -> Result<Lines, ReadError> {
        let n = self.segments.len();
        let is_finite = |&i: &u32| self.points[i as usize].iter().all(|x| x.is_finite());
        self.segments.retain(|segment| segment.iter().all(is_finite));
        let n_dropped = n - self.segments.len();
        if n_dropped > 0 {
            self.warnings.push(format!("skipping segments with points that are not finite: {n_dropped}"));
        }
        if self.segments.is_empty() {
            let reason = if n == 0 {
                "no lines".to_owned()
            } else {
                format!("all {n} segments have points that are not finite")
            };
            return Err(ReadError::empty(path, reason));
        }
        let radii = match self.radii {
            Some(radii) => radii,
            None => {
                let radius = options.line_radius.unwrap_or_else(|| {
                    let radius = DEFAULT_RADIUS * diagonal(&self.points, &self.segments);
                    self.warnings.push(format!("the file states no thickness of lines: using a radius of {radius}"));
                    radius
                });
                vec![radius; self.points.len()]
            }
        };
        if let Some(i) = self.segments.iter().flatten().find(|&&i| !(0.0..f32::INFINITY).contains(&radii[i as usize])) {
            let radius = radii[*i as usize];
            return Err(ReadError::malformed(
                path,
                format!("point {i}"),
                format!("the radius {radius} is not a length"),
            ));
        }
        Ok(Lines { points: self.points, radii, segments: self.segments, warnings: self.warnings })
    }
}

/// Diagonal of the box around the segments.
fn diagonal(points: &[[f32; 3]], segments: &[[u32; 2]]) -> f32 {
    let used = segments.iter().flatten().map(|&i| points[i as usize]);
    let extent = canted_obb::Aabb::from_points(used).extent();
    extent.iter().map(|x| x * x).sum::<f64>().sqrt() as f32
}

/// Numbers of a binary file, read in order.
struct Numbers<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Numbers<'a> {
    fn new(path: &'a Path, bytes: &'a [u8], at: usize) -> Self {
        Self { path, bytes, at }
    }

    /// The next `n` bytes; `what` is named where they are missing.
    fn take(&mut self, n: usize, what: &str) -> Result<&'a [u8], ReadError> {
        let found = self.at.checked_add(n).and_then(|end| self.bytes.get(self.at..end));
        let found = found.ok_or_else(|| {
            let n_left = self.bytes.len().saturating_sub(self.at);
            ReadError::malformed(
                self.path,
                format!("byte {}", self.at),
                format!("{what} has {n} bytes, {n_left} are left"),
            )
        })?;
        self.at += n;
        Ok(found)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], ReadError> {
        Ok(self.take(N, what)?.try_into().expect("of this length"))
    }

    /// `n` values of `f32`, little-endian.
    fn floats(&mut self, n: usize, what: &str) -> Result<Vec<f32>, ReadError> {
        let bytes = self.take(n.saturating_mul(4), what)?;
        Ok(bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
    }

    /// `n` points.
    fn points(&mut self, n: usize, what: &str) -> Result<Vec<[f32; 3]>, ReadError> {
        Ok(self.floats(n.saturating_mul(3), what)?.as_chunks().0.to_vec())
    }
}
