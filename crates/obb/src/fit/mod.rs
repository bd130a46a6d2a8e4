//! Boxes for points and triangles: one method a file, each of which proposes a frame.

mod area_pca;
mod dito;
mod dop;
mod pca;

use crate::{Aabb, Frame, Obb, bound};

/// How [`fit`] chooses the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Fit {
    /// The axes of the space.
    Aabb,
    /// Principal axes of the points, all of one weight (Gottschalk 2000, as in Sabino 2020, 3.1.3).
    ///
    /// Depends on how densely the surface is tessellated; needs no triangles.
    Pca,
    /// Principal axes of the surface (Gottschalk et al. 1996, with the authors' errata): the same box for any
    /// tessellation of it. Where the triangles have no area together, or there are none, the points decide.
    #[default]
    AreaPca,
    /// Edges of a large ditetrahedron on extremal points (Larsson and Källberg 2011); needs no triangles.
    Dito,
    /// The best of sixteen fixed frames, by extents along twenty-five directions; needs no triangles.
    Dop,
}

/// Why there is no box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitError {
    /// There are no points.
    Empty,
    /// A point has a coordinate that is not a finite number.
    NotFinite {
        /// Index of the first such point.
        index: usize,
    },
    /// A triangle names a point that does not exist.
    IndexOutOfRange {
        /// Index of the first such triangle.
        triangle: usize,
        /// The point that it names.
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
                write!(f, "triangle {triangle} names point {index} of {n_points}")
            }
        }
    }
}

impl core::error::Error for FitError {}

/// Fits a box to `points`, its axes chosen by `method`, in the space of the points.
///
/// Contains *every* point exactly, also those that no triangle uses; `triangles` only weigh in where the method says so
/// and may be empty. The axis-parallel box is returned where it has no more area. Points scaled by a power of two give
/// the box scaled by it, bit for bit, short of the ends of the range of `f32`.
///
/// # Errors
/// [`FitError::Empty`], [`FitError::NotFinite`] for the first bad point, [`FitError::IndexOutOfRange`] for the first
/// bad triangle.
pub fn fit(points: &[[f32; 3]], triangles: &[[u32; 3]], method: Fit) -> Result<Obb, FitError> {
    check(points, triangles)?;
    let aabb = Aabb::from_points(points.iter().copied());
    let frame: Frame = match method {
        Fit::Aabb => return Ok(Obb::from_aabb(&aabb)),
        Fit::Pca => pca::frame(points),
        Fit::AreaPca => area_pca::frame(points, triangles),
        Fit::Dito => dito::frame(points),
        Fit::Dop => dop::frame(points),
    };
    Ok(bound(frame, points.iter().copied()).or_aabb(&aabb))
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
