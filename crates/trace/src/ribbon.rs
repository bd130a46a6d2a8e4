//! Flat ribbons that face the ray.
//!
//! # Which points a ray hits
//! A ribbon has a center line and a width, but no orientation of its own. Seen along the ray, in the plane across it, the center line is a
//! plane curve and the ray is a point. The ray hits the ribbon at the parameter `u` if the distance between that point and the curve has a local minimum
//! at `u` that is at most half the width there. The hit is the point of the ray that is as far along the ray as the center at `u`. So the
//! surface consists of lines that are perpendicular to the ray and to the center line, one through each center.
//!
//! A minimum at an end does not count: a ribbon ends in a straight edge. Where another ribbon follows, the wedge between both edges, on the outside
//! of a bend, belongs to the first: points beyond its last edge, before the first edge of the next one, and no farther
//! than half the width from the joint. Both edges are decided with the same arithmetic, so no ray passes between them. On the
//! inside of a bend both ribbons are hit.
//!
//! Every hit is on the front: a ribbon has no inside.

use canted_obb::vector::{sqrt, sub, to_f64};

use crate::ScaledRay;
use crate::cubic_part::RayFrame;
use crate::round_segment::passes;
use crate::rounding::nearest;

/// Where a ray hits a ribbon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RibbonPoint {
    /// Distance in units of the direction.
    pub t: f32,
    /// Parameter of the center line, 0..=1.
    pub u: f32,
    /// Position across, 0..=1: from the left edge to the right one, as the ray sees a ribbon that leads upward.
    pub v: f32,
}

/// A flat ribbon along a line segment that faces every ray.
///
/// The distance between a ray and a center decides about a hit, as with a [`RoundSegment`](crate::RoundSegment), which has the same
/// silhouette but for its ends. A ribbon is hit once, in the middle of the segment instead of in front of it. A segment that the ray looks along, or that has no
/// length, is a disk at its first end.
///
/// ```
/// use canted_trace::{Ray, RibbonSegment, ScaledRay};
///
/// let [a, b] = [[0.0, 0.0, 0.0], [0.0, 4.0, 2.0]];
/// let ribbon = RibbonSegment { ends: [a, b], radii: [1.0, 0.5], next: b };
/// let ray = ScaledRay::new(&Ray::new([0.375, 2.0, 5.0], [0.0, 0.0, -1.0])).expect("a valid ray");
/// let hit = ribbon.point_scaled(&ray).expect("the ray is half the radius beside the middle");
/// assert_eq!((hit.t, hit.u, hit.v), (4.0, 0.5, 0.75));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RibbonSegment {
    /// Ends of the center line, in the space of the rays.
    pub ends: [[f32; 3]; 2],
    /// Half the width at each end, at least 0.
    pub radii: [f32; 2],
    /// A point towards which the next ribbon leads from the second end; that end itself where none follows.
    pub next: [f32; 3],
}

/// A center in the frame of a ray: across the line, along it, and half the width.
pub(crate) type Center = [f64; 4];

/// A vector across the line.
pub(crate) type Across = [f64; 2];

/// The product across the line.
#[inline(always)]
pub(crate) fn dot(a: Across, b: Across) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// From one center to another, across the line.
#[inline(always)]
pub(crate) fn between(from: &Center, to: &Center) -> Across {
    [to[0] - from[0], to[1] - from[1]]
}

#[inline(always)]
pub(crate) fn across(center: &Center) -> Across {
    [center[0], center[1]]
}

/// Whether the line, which is beyond the end of a ribbon, is before the start of the next one, which leads along `next`.
#[inline(always)]
pub(crate) fn is_before_next(end: &Center, next: Across) -> bool {
    // Of a next ribbon that the ray looks along, no side is known.
    dot(across(end), next) > 0.0 || next == [0.0; 2]
}

/// The hit at a center where the center line leads along `tangent`; `None` where the line passes it.
#[inline(always)]
pub(crate) fn hit_at(center: &Center, tangent: Across, u: f64, frame: &RayFrame) -> Option<RibbonPoint> {
    let [x, y, z, radius] = *center;
    let squared = x * x + y * y;
    // Also for NaN.
    if squared.is_nan() || squared > radius * radius {
        return None;
    }
    let length = radius * sqrt(dot(tangent, tangent));
    // The right of a ribbon is `direction × tangent`; the ray is at the origin, `(-x, -y)` from the center.
    let right = if length > 0.0 { (x * tangent[1] - y * tangent[0]) / length } else { 0.0 };
    let v = (0.5 + 0.5 * right).clamp(0.0, 1.0);
    Some(RibbonPoint { t: frame.t(z), u: nearest(u), v: v as f32 })
}

impl RibbonSegment {
    /// Where the line of a scaled ray hits the ribbon, regardless of the interval of the ray; `None` for a miss.
    ///
    /// In f64, in the frame of the ray. A line that certainly passes the center line at a greater distance than half the width is
    /// known by one triple product.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn point_scaled(&self, ray: &ScaledRay) -> Option<RibbonPoint> {
        let [p0, p1] = self.ends.map(to_f64);
        let greatest = f64::from(self.radii[0].max(self.radii[1]));
        if passes(sub(to_f64(ray.origin), p0), to_f64(ray.direction), sub(p1, p0), greatest) {
            return None;
        }
        let frame = RayFrame::new(ray.origin, ray.direction);
        let [a, b] = [0, 1].map(|end| frame.ball(self.ends[end], self.radii[end]));
        let tangent = between(&a, &b);
        // Half the derivatives of the squared distance at both ends.
        let [start, end] = [dot(across(&a), tangent), dot(across(&b), tangent)];
        if start > 0.0 {
            return None;
        }
        if end < 0.0 {
            let is_joint = self.next != self.ends[1];
            let next = between(&b, &frame.ball(self.next, 0.0));
            return if is_joint && is_before_next(&b, next) { hit_at(&b, tangent, 1.0, &frame) } else { None };
        }
        let u = if end > start { (-start / (end - start)).min(1.0) } else { 0.0 };
        let center = [0, 1, 2, 3].map(|k| a[k] + u * (b[k] - a[k]));
        hit_at(&center, tangent, u, &frame)
    }
}
