//! Vertices and indices in the types of the caller.

use std::any::Any;
use std::borrow::Cow;

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
