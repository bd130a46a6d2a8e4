//! Lines and points with a thickness, as every reader of them gives them.

use std::path::Path;

use super::error::ReadError;
use super::input::ReadOptions;

/// Lines and balls with a thickness, in the file's unit and space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Positions, finite where a segment uses them.
    pub points: Vec<[f32; 3]>,
    /// The radius at each point, at least 0.
    pub radii: Vec<f32>,
    /// Linear RGB at each point, if the file has colors.
    pub colors: Option<Vec<[f32; 3]>>,
    /// The ends of each segment as indices of points; equal ones for a ball.
    pub segments: Vec<[u32; 2]>,
    /// What was repaired or skipped.
    pub warnings: Vec<String>,
}

/// Radius relative to the diagonal of the bounds, where neither file nor options state one.
const DEFAULT_RADIUS: f32 = 1.0 / 2000.0;

impl ReadOptions {
    /// Whether lines and points of a file are wanted that holds faces as well.
    #[must_use]
    pub fn reads_lines(&self) -> bool {
        self.line_radius.is_some() || self.point_radius.is_some()
    }

    /// The radius of lines, which is that of points where it is not given.
    pub(super) fn radius_of_lines(&self) -> Option<f32> {
        self.line_radius.or(self.point_radius)
    }
}

/// Polylines and points, as a file holds them.
#[derive(Debug, Default)]
pub(super) struct Strands {
    pub(super) points: Vec<[f32; 3]>,
    /// Radii of the points, if the file states any.
    pub(super) radii: Option<Vec<f32>>,
    /// Linear RGB of the points, if the file states any.
    pub(super) colors: Option<Vec<[f32; 3]>>,
    pub(super) segments: Vec<[u32; 2]>,
    pub(super) warnings: Vec<String>,
}

/// An index of points; they are 32 bits.
pub(super) fn point_index(path: &Path, n: usize) -> Result<u32, ReadError> {
    u32::try_from(n).map_err(|_| ReadError::unsupported(path, "more than 2^32 points"))
}

impl Strands {
    /// Adds segments between consecutive points of a range.
    pub(super) fn add_polyline(&mut self, points: std::ops::Range<u32>) {
        let others = points.start.saturating_add(1)..points.end;
        self.segments.extend(points.zip(others).map(|(from, to)| [from, to]));
    }

    /// Gives segments of one point, which are balls, one radius and all others another.
    pub(super) fn thicken_points(&mut self, of_points: f32, of_lines: f32) {
        let mut radii = vec![of_lines; self.points.len()];
        for segment in self.segments.iter_mut().filter(|[from, to]| from == to && of_points != of_lines) {
            let Ok(index) = u32::try_from(self.points.len()) else { break };
            self.points.push(self.points[segment[0] as usize]);
            if let Some(colors) = &mut self.colors {
                colors.push(colors[segment[0] as usize]);
            }
            radii.push(of_points);
            *segment = [index; 2];
        }
        self.radii = Some(radii);
    }

    /// Drops what is not finite, and gives every point a radius.
    pub(super) fn into_lines(mut self, path: &Path, options: &ReadOptions) -> Result<Lines, ReadError> {
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
                let radius = options.radius_of_lines().unwrap_or_else(|| {
                    let radius = DEFAULT_RADIUS * diagonal(&self.points, &self.segments);
                    self.warnings.push(format!("the file states no thickness of lines: using a radius of {radius}"));
                    radius
                });
                vec![radius; self.points.len()]
            }
        };
        if let Some(i) = self.segments.iter().flatten().find(|&&i| !(0.0..f32::INFINITY).contains(&radii[i as usize])) {
            let message = format!("the radius {} is not a length", radii[*i as usize]);
            return Err(ReadError::malformed(path, format!("point {i}"), message));
        }
        let Self { points, colors, segments, warnings, .. } = self;
        Ok(Lines { points, radii, colors, segments, warnings })
    }
}

/// Diagonal of the box around the segments.
fn diagonal(points: &[[f32; 3]], segments: &[[u32; 2]]) -> f32 {
    let used = segments.iter().flatten().map(|&i| points[i as usize]);
    let extent = canted_obb::Aabb::from_points(used).extent();
    extent.iter().map(|x| x * x).sum::<f64>().sqrt() as f32
}
