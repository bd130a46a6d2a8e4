use super::{Child, average, enclose};
use crate::{Frame, Moments, Obb};

/// Correlation left between axes: a thousandth of the thinner extent is less than the corners know of the content.
const TOLERANCE: f64 = 1e-3;

/// The box of least area among those along the axes of each child, their average by area, the principal axes of
/// `content` and the axes of the space; the first of equals in this order.
///
/// `content` are the moments of everything below, carried up by [`Moments::merged`].
#[must_use]
pub fn best(a: &Obb, b: &Obb, content: Option<&Moments>) -> Obb {
    let candidates: [Option<Frame>; 5] = [
        Some(a.frame),
        Some(b.frame),
        Some(average(a.frame, b.frame, [a.area(), b.area()])),
        content.map(|content| content.axes(TOLERANCE)),
        Some(Obb::IDENTITY_FRAME),
    ];
    let children = [&Child::Box(*a), &Child::Box(*b)];
    let mut least: Option<(f64, Obb)> = None;
    for frame in candidates.into_iter().flatten() {
        let candidate = enclose(frame, children);
        let area = candidate.area();
        if least.is_none_or(|(least, _)| area < least) {
            least = Some((area, candidate));
        }
    }
    least.map_or(*a, |(_, best)| best)
}
