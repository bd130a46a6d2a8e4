use crate::eigen::FULL_PRECISION;
use crate::{Frame, Moments};

/// Principal axes of the points, longest first (Gottschalk 2000).
pub(super) fn frame(points: &[[f32; 3]]) -> Frame {
    Moments::from_points(points.iter().copied()).axes(FULL_PRECISION)
}
