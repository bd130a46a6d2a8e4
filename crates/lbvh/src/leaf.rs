//! Leaves: triangles by their corners, checked once, from vertices and indices in the types of the caller; what a tree needs to know of
//! them.

use std::{any::Any, borrow::Cow};

use canted_obb::{
    Aabb, Dop, Enclosure, Frame, Moments, Obb, PrimId, merge,
    vector::{cross, dot, sub},
};

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
        /// The index of the vertex.
        vertex: u32,
        /// Its position.
        position: BadPosition,
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
            Self::NotFinite { triangle, vertex, position } => {
                write!(f, "triangle {triangle} has a vertex that is not finite: vertex {vertex} is {position}")
            }
            Self::TooMany { n_triangles } => {
                write!(f, "{n_triangles} triangles exceed the maximum of {MAX_PRIMITIVES}")
            }
        }
    }
}

impl std::error::Error for GeometryError {}

/// A position that is not finite. Equal ones have the same bits, NaN included.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct BadPosition([u32; 3]);

impl From<[f32; 3]> for BadPosition {
    fn from(position: [f32; 3]) -> Self {
        Self(position.map(f32::to_bits))
    }
}

impl From<BadPosition> for [f32; 3] {
    fn from(position: BadPosition) -> Self {
        position.0.map(f32::from_bits)
    }
}

impl std::fmt::Display for BadPosition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = <[f32; 3]>::from(*self);
        write!(f, "({x}, {y}, {z})")
    }
}

impl std::fmt::Debug for BadPosition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Display::fmt(self, f)
    }
}

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

/// The indices of triangles that have their vertices themselves: over `triangles.as_flattened()`, triangle `i` has the vertices `3i`, `3i + 1`
/// and `3i + 2`.
///
/// # Errors
/// More than [`MAX_PRIMITIVES`] triangles.
pub fn flat_indices(n_triangles: usize) -> Result<Vec<[u32; 3]>, GeometryError> {
    if n_triangles > MAX_PRIMITIVES {
        return Err(GeometryError::TooMany { n_triangles });
    }
    Ok(par::from_fn(n_triangles, CHUNK, |i| [0, 1, 2].map(|k| 3 * i as u32 + k)))
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

fn first_flaw(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> GeometryError {
    for (t, indices) in triangles.iter().enumerate() {
        let triangle = PrimId(t as u32);
        for &index in indices {
            match positions.get(index as usize) {
                None => return GeometryError::IndexOutOfRange { triangle, index, n_vertices: positions.len() },
                Some(&p) if !p.iter().all(|x| x.is_finite()) => {
                    return GeometryError::NotFinite { triangle, vertex: index, position: p.into() };
                }
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

/// A primitive of a tree: a triangle, by its corners, or a box.
pub trait Leaf: Copy + Send + Sync {
    /// Its axis-aligned bounding box.
    fn aabb(&self) -> Aabb;

    /// The leaf as input of [`merge`].
    fn child(&self) -> merge::Child;

    /// Moments of its surface, for principal axes.
    fn moments(&self) -> Moments;

    /// Adds it to a DOP.
    fn grow_dop(&self, dop: &mut Dop);

    /// Adds it to an enclosure.
    fn grow(&self, enclosure: &mut Enclosure);

    /// Axes of its best oriented box, of unit length up to rounding.
    fn frame(&self) -> Frame;

    /// Surface area of that box.
    fn oriented_area(&self) -> f64;

    /// Points that every volume above contains exactly.
    fn points(&self) -> impl Iterator<Item = [f32; 3]>;
}

impl Leaf for Corners {
    #[inline]
    fn aabb(&self) -> Aabb {
        let [a, b, c] = *self;
        let mut aabb = Aabb { min: a, max: a };
        aabb.grow(b);
        aabb.grow(c);
        aabb
    }

    fn child(&self) -> merge::Child {
        merge::Child::Triangle(*self)
    }

    fn moments(&self) -> Moments {
        Moments::from_triangle(*self)
    }

    fn grow_dop(&self, dop: &mut Dop) {
        self.iter().for_each(|&corner| dop.grow(corner));
    }

    fn grow(&self, enclosure: &mut Enclosure) {
        self.iter().for_each(|&corner| enclosure.add_point(corner));
    }

    /// Along the longest edge, which gives the smallest rectangle of a triangle; the identity for a degenerate one.
    fn frame(&self) -> Frame {
        let [a, b, c] = self.map(|p| p.map(f64::from));
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let longest =
            (1..3).fold(0, |best, i| if dot(edges[i], edges[i]) > dot(edges[best], edges[best]) { i } else { best });
        let normal = cross(edges[longest], edges[(longest + 1) % 3]);
        let (edge, up) = (dot(edges[longest], edges[longest]).sqrt(), dot(normal, normal).sqrt());
        // Negated to reject NaN from an overflow too.
        if !(up > 0.0 && up.is_finite()) {
            return Obb::IDENTITY_FRAME;
        }
        let (along, normal) = (edges[longest].map(|x| x / edge), normal.map(|x| x / up));
        let rounded = |axis: [f64; 3]| axis.map(|x| x as f32);
        [rounded(along), rounded(cross(normal, along)), rounded(normal)]
    }

    /// Both sides of the rectangle along the longest edge, which has twice the area of the triangle.
    fn oriented_area(&self) -> f64 {
        let [a, b, c] = self.map(|p| p.map(f64::from));
        let normal = cross(sub(b, a), sub(c, a));
        2.0 * dot(normal, normal).sqrt()
    }

    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        self.iter().copied()
    }
}

/// The box of an instance.
impl Leaf for Obb {
    fn aabb(&self) -> Aabb {
        Self::aabb(self)
    }

    fn child(&self) -> merge::Child {
        merge::Child::Box(*self)
    }

    fn moments(&self) -> Moments {
        Moments::from_box_corners(self, self.area())
    }

    fn grow_dop(&self, dop: &mut Dop) {
        self.corners().iter().for_each(|corner| dop.grow(corner.map(|x| x as f32)));
    }

    fn grow(&self, enclosure: &mut Enclosure) {
        enclosure.add_box(self);
    }

    /// Its own axes.
    fn frame(&self) -> Frame {
        self.frame
    }

    fn oriented_area(&self) -> f64 {
        self.area()
    }

    /// The center only: corners are not representable in `f32`.
    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        std::iter::once(self.center)
    }
}

/// The coordinates of vertices of any type that converts into them; not copied where they are `[f32; 3]` already.
#[must_use]
pub fn as_positions<V: Into<[f32; 3]> + Copy + 'static>(vertices: &[V]) -> Cow<'_, [[f32; 3]]> {
    match same_type(vertices) {
        Some(positions) => Cow::Borrowed(positions),
        None => Cow::Owned(vertices.iter().map(|&vertex| vertex.into()).collect()),
    }
}

/// Triangles whose indices have any integer type; not copied where it is `u32`. Indices beyond the range of `u32` become the greatest one,
/// which no mesh has.
///
/// A flat list of indices is a list of triangles by `as_chunks::<3>().0`.
#[must_use]
pub fn as_triangles<I: TryInto<u32> + Copy + 'static>(triangles: &[[I; 3]]) -> Cow<'_, [[u32; 3]]> {
    match same_type(triangles) {
        Some(triangles) => Cow::Borrowed(triangles),
        None => Cow::Owned(triangles.iter().map(|t| t.map(|i| i.try_into().unwrap_or(u32::MAX))).collect()),
    }
}

/// The slice, if both types are one.
fn same_type<A: 'static, B: 'static>(slice: &[A]) -> Option<&[B]> {
    let identity: fn(&[A]) -> &[A] = |slice| slice;
    let identity = (&identity as &dyn Any).downcast_ref::<fn(&[A]) -> &[B]>()?;
    Some(identity(slice))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_invalid_triangle_is_reported() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]];
        assert_eq!(
            triangle_corners(&positions, &[[0, 1, 0], [0, 1, 2], [0, 1, 9]]).unwrap_err(),
            GeometryError::NotFinite { triangle: PrimId(1), vertex: 2, position: positions[2].into() }
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

    #[test]
    fn only_other_types_are_copied() {
        #[derive(Clone, Copy)]
        struct Vertex([f32; 3], u8);
        impl From<Vertex> for [f32; 3] {
            fn from(vertex: Vertex) -> Self {
                vertex.0
            }
        }
        let vertices = [Vertex([1.0, 2.0, 3.0], 7), Vertex([4.0; 3], 8)];
        assert_eq!(vertices[1].1, 8);
        assert!(matches!(as_positions(&vertices), Cow::Owned(owned) if owned == [[1.0, 2.0, 3.0], [4.0; 3]]));
        let positions = [[1.0f32, 2.0, 3.0]];
        assert!(matches!(as_positions(&positions), Cow::Borrowed(borrowed) if std::ptr::eq(borrowed, &positions)));
        assert!(matches!(as_triangles(&[[0u32, 1, 2]]), Cow::Borrowed([[0, 1, 2]])));
        assert_eq!(*as_triangles(&[[0u16, 1, u16::MAX]]), [[0, 1, 65_535]]);
        assert_eq!(*as_triangles(&[[0, -1, 2]]), [[0, u32::MAX, 2]]);
        assert_eq!(*as_triangles([3u8, 4, 5, 6, 7, 8].as_chunks::<3>().0), [[3, 4, 5], [6, 7, 8]]);
    }
}
