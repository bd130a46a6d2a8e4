use crate::{Dop, Frame};

/// The best of the fixed frames, by extents measured from the first point so that `f32` keeps the detail.
pub(super) fn frame(points: &[[f32; 3]]) -> Frame {
    let [x, y, z] = points[0];
    Dop::from_points(points.iter().map(|p| [p[0] - x, p[1] - y, p[2] - z])).best().0
}
