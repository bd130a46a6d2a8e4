use canted_obb::{Aabb, PrimId};

use crate::par;

/// The three vertices of a triangle, in the mesh's space.
pub type Corners = [[f32; 3]; 3];

/// Why geometry is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeometryError {
    /// A vertex index is out of range.
    IndexOutOfRange {
        /// The triangle.
        triangle: PrimId,
        /// The index.
        index: u32,
        /// Number of vertices.
        n_vertices: usize,
    },
    /// A triangle has a vertex that is infinite or NaN.
    NotFinite {
        /// The triangle.
        triangle: PrimId,
    },
    /// More triangles than a tree supports.
    TooMany {
        /// Number of triangles.
        n_triangles: usize,
    },
}

impl std::fmt::Display for GeometryError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::IndexOutOfRange { triangle, index, n_vertices } => {
                write!(f, "triangle {triangle} has vertex index {index}, but there are {n_vertices} vertices")
            }
            Self::NotFinite { triangle } => write!(f, "triangle {triangle} has a vertex that is not finite"),
            Self::TooMany { n_triangles } => {
                write!(f, "{n_triangles} triangles exceed the maximum of {MAX_PRIMITIVES}")
            }
        }
    }
}

impl std::error::Error for GeometryError {}

/// Maximum number of primitives of a tree: a child reference reserves two bits.
pub const MAX_PRIMITIVES: usize = 1 << 30;

const CHUNK: usize = 1 << 14;

/// The vertices of indexed triangles, in input order, and their bounding box.
///
/// Unused vertices are ignored.
///
/// # Errors
/// More than [`MAX_PRIMITIVES`] triangles, checked first; the first triangle, in input order, with an index out of range or
/// a vertex that is not finite.
pub fn triangle_corners(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<(Vec<Corners>, Aabb), GeometryError> {
    triangle_corners_at_most(MAX_PRIMITIVES, positions, triangles)
}

/// As [`triangle_corners`], with a limit.
fn triangle_corners_at_most(
    max: usize,
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
) -> Result<(Vec<Corners>, Aabb), GeometryError> {
    if triangles.len() > max {
        return Err(GeometryError::TooMany { n_triangles: triangles.len() });
    }
    let corners = par::map(triangles, CHUNK, |triangle| corners_of(positions, triangle));
    let bounds = par::map_chunks(&corners, CHUNK, |_, chunk| finite_bounds(chunk.iter().copied()));
    Ok((corners, joined(&bounds).ok_or_else(|| first_flaw(positions, triangles))?))
}

/// The bounding box of indexed triangles, with the errors of [`triangle_corners`], without their vertices.
///
/// # Errors
/// As [`triangle_corners`].
pub fn triangle_bounds(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Aabb, GeometryError> {
    if triangles.len() > MAX_PRIMITIVES {
        return Err(GeometryError::TooMany { n_triangles: triangles.len() });
    }
    let bounds = par::map_chunks(triangles, CHUNK, |_, chunk| {
        finite_bounds(chunk.iter().map(|triangle| corners_of(positions, triangle)))
    });
    joined(&bounds).ok_or_else(|| first_flaw(positions, triangles))
}

/// The vertices of a triangle; NaN for those that are missing, so that errors are found off the fast path.
#[inline]
#[must_use]
pub fn corners_of(positions: &[[f32; 3]], triangle: &[u32; 3]) -> Corners {
    triangle.map(|i| positions.get(i as usize).copied().unwrap_or([f32::NAN; 3]))
}

/// The box around triangles; `None` where a coordinate is not finite.
fn finite_bounds(triangles: impl Iterator<Item = Corners>) -> Option<Aabb> {
    let mut bounds = Aabb::EMPTY;
    // A sum of products with zero is NaN if and only if a coordinate is not finite.
    let mut zero_or_nan = 0.0f32;
    for corner in triangles.flatten() {
        bounds.grow(corner);
        zero_or_nan += corner[0] * 0.0 + corner[1] * 0.0 + corner[2] * 0.0;
    }
    (zero_or_nan == 0.0).then_some(bounds)
}

/// The box around boxes; `None` where one is missing.
fn joined(boxes: &[Option<Aabb>]) -> Option<Aabb> {
    boxes.iter().try_fold(Aabb::EMPTY, |all, aabb| Some(all.union((*aabb)?)))
}

#[expect(clippy::cast_possible_truncation, reason = "at most MAX_PRIMITIVES triangles")]
fn first_flaw(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> GeometryError {
    for (t, indices) in triangles.iter().enumerate() {
        let triangle = PrimId(t as u32);
        for &index in indices {
            match positions.get(index as usize) {
                None => return GeometryError::IndexOutOfRange { triangle, index, n_vertices: positions.len() },
                Some(p) if !p.iter().all(|x| x.is_finite()) => return GeometryError::NotFinite { triangle },
                Some(_) => {}
            }
        }
    }
    unreachable!("a chunk was not finite, so some vertex is missing or not finite")
}

/// The corners in leaf order.
#[must_use]
pub fn in_leaf_order(corners: &[Corners], leaves: &[PrimId]) -> Vec<Corners> {
    par::map(leaves, CHUNK, |leaf| corners[leaf.index()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_invalid_triangle_is_reported() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]];
        assert_eq!(
            triangle_corners(&positions, &[[0, 1, 0], [0, 1, 2], [0, 1, 9]]).unwrap_err(),
            GeometryError::NotFinite { triangle: PrimId(1) }
        );
        assert_eq!(
            triangle_corners(&positions, &[[0, 1, 0], [0, 3, 1]]).unwrap_err(),
            GeometryError::IndexOutOfRange { triangle: PrimId(1), index: 3, n_vertices: 3 }
        );
    }

    #[test]
    fn rejects_too_many_triangles_before_reading_them() {
        let [positions, invalid] = [[[0.0; 3]; 3], [[f32::NAN; 3]; 3]];
        let triangles = [[0, 1, 2]; 8];
        assert_eq!(triangle_corners_at_most(8, &positions, &triangles).unwrap().0.len(), 8);
        for positions in [&positions[..], &invalid, &[]] {
            let error = triangle_corners_at_most(7, positions, &triangles).unwrap_err();
            assert_eq!(error, GeometryError::TooMany { n_triangles: 8 });
        }
    }

    #[test]
    fn bounds_ignore_unused_vertices() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, -2.0], [f32::NAN; 3]];
        let (corners, bounds) = triangle_corners(&positions, &[[0, 1, 2]]).unwrap();
        assert_eq!(corners, [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, -2.0]]]);
        assert_eq!(bounds, Aabb { min: [0.0, 0.0, -2.0], max: [1.0, 1.0, 0.0] });
    }
}
