//! A line segment with a radius at each end: all points of the balls whose center and radius vary linearly along it.

use canted_obb::vector::{Vector, cross, dot, length, sqrt, sub, to_f64};

use crate::ScaledRay;
use crate::rounding::nearest;

/// A round linear segment: the convex hull of two balls, a cone with spherical ends. It is solid.
///
/// A hair, a wire or a path is a chain of them; neighbors share a ball, so there is no gap at a joint. Equal radii make a
/// capsule, equal ends a ball. Where one ball contains the other, the segment is the larger ball.
///
/// ```
/// use canted_trace::{Ray, RoundSegment, ScaledRay};
///
/// let segment = RoundSegment { ends: [[0.0; 3], [4.0, 0.0, 0.0]], radii: [1.0, 0.0] };
/// let ray = ScaledRay::new(&Ray::new([0.0, 0.0, 5.0], [0.0, 0.0, -1.0])).expect("a valid ray");
/// let [entry, exit] = segment.span_scaled(&ray).expect("the ray passes through the first ball");
/// assert!((entry.t - 4.0).abs() < 0.04 && (exit.t - 6.0).abs() < 0.04);
/// assert!(entry.u < 0.01);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundSegment {
    /// Centers of the balls, in the space of the rays.
    pub ends: [[f32; 3]; 2],
    /// Radii of the balls, at least 0.
    pub radii: [f32; 2],
}

/// Where a line passes through the surface of a [`RoundSegment`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentPoint {
    /// Distance in units of the direction.
    pub t: f32,
    /// Position along the segment: of the ball, 0..=1 from the first end to the second, that touches the surface there.
    pub u: f32,
}

impl RoundSegment {
    /// Where the line of a scaled ray enters and leaves the segment, regardless of the interval of the ray; `None` for a miss.
    ///
    /// # Method
    /// A point `p`, relative to the first end, is within the ball at the position `s` if
    /// `|p - s·a|² <= (r0 - s·δ)²`, where `a` leads from end to end and `δ = r0 - r1`. With `e = a² - δ²` the left side exceeds the right
    /// least at `s = (p·a - r0·δ)/e`, by `p² - r0² - e·s²`: zero on the lateral surface, a quadratic equation along the line. The hull is
    /// convex, and its surface consists of parts of the two spheres and of the lateral surface at `0 <= s <= 1`; all of these are in the hull. So
    /// the line enters at the least of their roots, and leaves at the greatest. Coefficients are computed in f64 by vector products, without
    /// squares of the length, from the point of the line that is nearest to the axis: then thin and distant segments have few
    /// cancellations.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn span_scaled(&self, ray: &ScaledRay) -> Option<[SegmentPoint; 2]> {
        let [p0, p1] = self.ends.map(to_f64);
        let from_end = sub(to_f64(ray.origin), p0);
        let points = span(from_end, to_f64(ray.direction), sub(p1, p0), self.radii.map(f64::from))?;
        Some(points.map(|(t, u)| SegmentPoint { t: nearest(t), u: u as f32 }))
    }
}

/// Where the line `from_origin + t·d`, relative to the first end, enters and leaves the segment along `a`: `t`, and the position along
/// the segment. See [`RoundSegment::span_scaled`].
#[inline(always)]
pub(crate) fn span(from_origin: Vector, d: Vector, a: Vector, [r0, r1]: [f64; 2]) -> Option<[(f64, f64); 2]> {
    let delta = r0 - r1;
    let d_squared = dot(d, d);
    let axis_squared = dot(a, a);
    let is_cone = axis_squared > delta * delta;
    let across = cross(d, a);
    let across_squared = dot(across, across);
    let greatest = r0.max(r1);
    // So it is with most lines.
    if passes(from_origin, d, a, greatest) {
        return None;
    }
    // The point of the line nearest to the middle, then, within the size of the segment, that nearest to the axis.
    let middle_t = (0.5 * dot(a, d) - dot(from_origin, d)) / d_squared;
    let at = |t: f64| core::array::from_fn(|k| from_origin[k] + t * d[k]);
    let mut base_t = middle_t;
    if is_cone && across_squared > 0.0 {
        let reach = (sqrt(axis_squared) + greatest) / sqrt(d_squared);
        let to_axis = -dot(cross(at(middle_t), a), across) / across_squared;
        base_t += to_axis.clamp(-reach, reach);
    }
    let m: [f64; 3] = at(base_t);
    let mut span = Span { entry: (f64::INFINITY, 0.0), exit: (f64::NEG_INFINITY, 0.0) };
    let mut n_lateral = 0;
    if is_cone {
        let (e, moment) = (axis_squared - delta * delta, cross(m, a));
        let (along_m, along_d) = (dot(m, a), dot(d, a));
        let a2 = across_squared - delta * delta * d_squared;
        let b = dot(moment, across) - delta * delta * dot(m, d) + r0 * delta * along_d;
        let c = dot(moment, moment) - delta * delta * dot(m, m) - axis_squared * r0 * r0 + 2.0 * r0 * delta * along_m;
        // Roots of a2·t² + 2·b·t + c without cancellation. NaN for a miss, and at infinity where the line is parallel to the surface.
        let root = sqrt(b * b - a2 * c);
        let q = if b < 0.0 { root - b } else { -root - b };
        for t in [q / a2, c / q] {
            let s = (along_m + t * along_d - r0 * delta) / e;
            if (0.0..=1.0).contains(&s) {
                span.add(t, s);
                n_lateral += 1;
            }
        }
    }
    // The hull is convex: where both points are on the lateral surface, the balls are between them.
    if n_lateral < 2 {
        for (u, to_ray, radius) in [(0.0, m, r0), (1.0, sub(m, a), r1)] {
            // As `Sphere::roots_scaled`.
            let closest = -dot(to_ray, d) / d_squared;
            let distance = length(core::array::from_fn(|k| to_ray[k] + closest * d[k]));
            let half_chord = sqrt((radius - distance) * (radius + distance) / d_squared);
            span.add(closest - half_chord, u);
            span.add(closest + half_chord, u);
        }
    }
    let Span { entry, exit } = span;
    // Also false where no part is hit.
    (entry.0 <= exit.0).then(|| [entry, exit].map(|(t, u)| (base_t + t, u)))
}

/// Whether the line `from_origin + t·d` certainly passes the line of `a` through the origin at a distance greater than `radius`: the triple
/// product, over the length of `d × a`.
#[inline(always)]
pub(crate) fn passes(from_origin: Vector, d: Vector, a: Vector, radius: f64) -> bool {
    let across = cross(d, a);
    let apart = dot(from_origin, across).abs() - ROUNDINGS * size(from_origin) * size(d) * size(a);
    apart > 0.0 && apart * apart > radius * radius * dot(across, across) * (1.0 + ROUNDINGS)
}

/// The sum of the absolute components.
#[inline(always)]
pub(crate) fn size(v: Vector) -> f64 {
    v[0].abs() + v[1].abs() + v[2].abs()
}

/// More than all roundings of a triple product, relative to the product of the sizes: ten of 2^-53, and those of squares.
const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// First and last root, each with the position along the segment.
struct Span {
    entry: (f64, f64),
    exit: (f64, f64),
}

impl Span {
    /// Adds a root; NaN is none.
    #[inline(always)]
    fn add(&mut self, t: f64, u: f64) {
        if t < self.entry.0 {
            self.entry = (t, u);
        }
        if t > self.exit.0 {
            self.exit = (t, u);
        }
    }
}
