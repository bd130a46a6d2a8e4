//! Boxes of points and triangles. Each method proposes a frame; the box along it is then exact.

mod dito;

use crate::eigen::FULL_PRECISION;
use crate::{Aabb, Dop, Frame, Moments, Obb, bound};

/// How [`fit`] chooses the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Fit {
    /// Axis-aligned.
    Aabb,
    /// Principal axes of the points, equally weighted (Gottschalk 2000, as in Sabino 2020, 3.1.3).
    ///
    /// Depends on the tessellation; needs no triangles.
    Pca,
    /// Principal axes of the surface (Gottschalk et al. 1996, with the authors' errata): the same box for
    /// any tessellation. Without triangles, or where their total area is zero, as [`Fit::Pca`].
    #[default]
    AreaPca,
    /// DiTO-14: edges of a large ditetrahedron of extremal points (Larsson and Källberg 2011); needs no triangles.
    Dito,
    /// The best of sixteen fixed frames, by extents along twenty-five directions; needs no triangles.
    Dop,
}

/// Why [`fit`] failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitError {
    /// There are no points.
    Empty,
    /// A point has a coordinate that is not a finite number.
    NotFinite {
        /// Index of the first such point.
        index: usize,
    },
    /// A triangle index is out of range.
    IndexOutOfRange {
        /// Index of the first such triangle.
        triangle: usize,
        /// The index.
        index: u32,
        /// Number of points.
        n_points: usize,
    },
}

impl core::fmt::Display for FitError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => write!(f, "no points to fit a box to"),
            Self::NotFinite { index } => write!(f, "point {index} is not finite"),
            Self::IndexOutOfRange { triangle, index, n_points } => {
                write!(f, "triangle {triangle} has index {index}, but there are {n_points} points")
            }
        }
    }
}

impl core::error::Error for FitError {}

/// Fits a box to `points`, with axes chosen by `method`.
///
/// The box contains *every* point exactly, also points that no triangle uses. `triangles` may be empty; only
/// [`Fit::AreaPca`] uses them. The axis-aligned box is returned where it has no more area. Scaling the points by a power
/// of two scales the box bit for bit, unless it leaves the range of `f32`.
///
/// # Errors
/// [`FitError::Empty`], [`FitError::NotFinite`] for the first bad point, [`FitError::IndexOutOfRange`] for the first
/// bad triangle.
pub fn fit(points: &[[f32; 3]], triangles: &[[u32; 3]], method: Fit) -> Result<Obb, FitError> {
    check(points, triangles)?;
    let aabb = Aabb::from_points(points.iter().copied());
    let frame: Frame = match method {
        Fit::Aabb => return Ok(Obb::from_aabb(&aabb)),
        Fit::Pca => principal_axes(points),
        Fit::AreaPca => surface_axes(points, triangles),
        Fit::Dito => dito::frame(points),
        Fit::Dop => fixed_frame(points),
    };
    Ok(bound(frame, points.iter().copied()).or_aabb(&aabb))
}

/// Principal axes of the points, longest first.
fn principal_axes(points: &[[f32; 3]]) -> Frame {
    Moments::from_points(points.iter().copied()).axes(FULL_PRECISION)
}

/// Principal axes of the surface, longest first; of the points where it has no area.
fn surface_axes(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Frame {
    let surface = triangles.iter().fold(Moments::EMPTY, |moments, corners| {
        moments.merged(&Moments::from_triangle(corners.map(|index| points[index as usize])))
    });
    if surface.weight > 0.0 { surface.axes(FULL_PRECISION) } else { principal_axes(points) }
}

/// The best of the fixed frames, by extents relative to the first point, for precision far from the origin.
fn fixed_frame(points: &[[f32; 3]]) -> Frame {
    let [x, y, z] = points[0];
    Dop::from_points(points.iter().map(|p| [p[0] - x, p[1] - y, p[2] - z])).best().0
}

fn check(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<(), FitError> {
    if points.is_empty() {
        return Err(FitError::Empty);
    }
    if let Some(index) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(FitError::NotFinite { index });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&index| index as usize >= points.len()) {
            return Err(FitError::IndexOutOfRange { triangle, index, n_points: points.len() });
        }
    }
    Ok(())
}
