use crate::eigen::FULL_PRECISION;
use crate::{Frame, Moments};

/// Principal axes of the surface, longest first (Gottschalk et al. 1996); of the points where it has no area.
pub(super) fn frame(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Frame {
    let surface = triangles.iter().fold(Moments::EMPTY, |moments, corners| {
        moments.merged(&Moments::from_triangle(corners.map(|index| points[index as usize])))
    });
    if surface.weight > 0.0 { surface.axes(FULL_PRECISION) } else { super::pca::frame(points) }
}
