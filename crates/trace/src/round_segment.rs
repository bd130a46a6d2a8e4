//! A line segment with a radius at each end: all points of the balls whose center and radius vary linearly along it.

use canted_obb::vector::{Vector, cross, dot, sqrt, sub, to_f64};

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
    /// the line enters at the least of their roots, and leaves at the greatest. A root of the lateral surface is the entry where the form
    /// decreases, else the exit, and what is missing then is on a ball. The form is also zero on the other half of the cone, beyond its apex. A line
    /// that is steeper than the surface meets each half once: where radii decrease along it, it only leaves the half of the segment, otherwise it
    /// only enters it. Coefficients are computed in f64 by vector products, without squares of the length, from the point of the line that is
    /// nearest to the axis: then thin and distant segments have few cancellations.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn span_scaled(&self, ray: &ScaledRay) -> Option<[SegmentPoint; 2]> {
        let (from_end, d, a, radii) = self.relative(ray);
        to_points(span(from_end, d, a, radii, f64::INFINITY))
    }

    /// [`RoundSegment::span_scaled`] as far as the first hit of a ray needs it: `None` where the ray certainly leads away from the
    /// segment, and where it enters at its `t_min` or later, both points may be the entry.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn first_scaled(&self, ray: &ScaledRay) -> Option<[SegmentPoint; 2]> {
        let (from_end, d, a, radii) = self.relative(ray);
        if leads_away(from_end, d, a, radii) {
            return None;
        }
        to_points(span(from_end, d, a, radii, f64::from(ray.t_min)))
    }

    /// The origin of a ray from the first end, its direction, the axis, the radii.
    #[inline(always)]
    fn relative(&self, ray: &ScaledRay) -> (Vector, Vector, Vector, [f64; 2]) {
        let [p0, p1] = self.ends.map(to_f64);
        (sub(to_f64(ray.origin), p0), to_f64(ray.direction), sub(p1, p0), self.radii.map(f64::from))
    }
}

#[inline(always)]
fn to_points(ends: Option<[(f64, f64); 2]>) -> Option<[SegmentPoint; 2]> {
    Some(ends?.map(|(t, u)| SegmentPoint { t: nearest(t), u: u as f32 }))
}

/// Whether the segment along `a` is on one side of a plane, and the ray `from_origin + t·d` with `t >= 0`, relative to the first end, on
/// the other, by more than roundings: so rays lead away from what they start on.
///
/// The plane is across a vector `w` to the origin, from about the center of the ball that it is nearest to. All points of both balls are
/// behind it if `p·w` exceeds `r0·|w|` and `(p - a)·w` exceeds `r1·|w|`, where `p` is the origin, and no point of the ray is if `d·w` is positive, whatever `w` is.
#[inline(always)]
fn leads_away(from_origin: Vector, d: Vector, a: Vector, [r0, r1]: [f64; 2]) -> bool {
    let delta = r0 - r1;
    let recip_e = 1.0 / (dot(a, a) - delta * delta);
    // NaN becomes 0.
    let s = ((dot(from_origin, a) - r0 * delta) * recip_e).max(0.0);
    let s = if s > 1.0 { 1.0 } else { s };
    let w: Vector = core::array::from_fn(|k| from_origin[k] - s * a[k]);
    if dot(w, d) <= ROUNDINGS * size(w) * size(d) {
        return false;
    }
    let w_squared = dot(w, w) * (1.0 + ROUNDINGS);
    let margin = ROUNDINGS * size(w) * (size(from_origin) + size(a));
    let (first, second) = (dot(from_origin, w) - margin, dot(sub(from_origin, a), w) - margin);
    first > 0.0 && first * first > r0 * r0 * w_squared && second > 0.0 && second * second > r1 * r1 * w_squared
}

/// Where the line `from_origin + t·d`, relative to the first end, enters and leaves the segment along `a`: `t`, and the position along
/// the segment. Where it enters the lateral surface at `enough` or later, both may be the entry. See [`RoundSegment::span_scaled`].
#[inline(always)]
pub(crate) fn span(
    from_origin: Vector,
    d: Vector,
    a: Vector,
    [r0, r1]: [f64; 2],
    enough: f64,
) -> Option<[(f64, f64); 2]> {
    let delta = r0 - r1;
    let axis_squared = dot(a, a);
    let is_cone = axis_squared > delta * delta;
    let across = cross(d, a);
    let across_squared = dot(across, across);
    // Divisions wait for nothing but the ray and the axis; the others are products with these.
    let [recip, recip_e] = [1.0 / dot(d, d), 1.0 / (axis_squared - delta * delta)];
    let greatest = r0.max(r1);
    // So it is with most lines.
    if passes(from_origin, d, a, greatest) {
        return None;
    }
    // The point of the line nearest to the axis, within the size of the segment around that nearest to the center.
    let mut base_t = (0.5 * dot(a, d) - dot(from_origin, d)) * recip;
    if is_cone && across_squared > 0.0 {
        let reach = (size(a) + greatest) * sqrt(recip);
        let nearest_t = -dot(cross(from_origin, a), across) / across_squared;
        base_t = nearest_t.max(base_t - reach).min(base_t + reach);
    }
    let m: [f64; 3] = core::array::from_fn(|k| from_origin[k] + base_t * d[k]);
    let (mut entry, mut exit) = ((f64::INFINITY, 0.0), (f64::NEG_INFINITY, 0.0));
    let [mut has_entry, mut has_exit] = [false; 2];
    if is_cone {
        let moment = cross(m, a);
        let (along_m, along_d) = (dot(m, a) - r0 * delta, dot(d, a));
        let a2 = across_squared - delta * delta * dot(d, d);
        let b = dot(moment, across) - delta * delta * dot(m, d) + r0 * delta * along_d;
        let c = dot(moment, moment) - delta * delta * dot(m, m) - axis_squared * r0 * r0 + 2.0 * r0 * delta * dot(m, a);
        // Roots of a2·t² + 2·b·t + c without cancellation. NaN for a miss, and at infinity where the line is parallel to the surface. Where
        // the form decreases, the line enters: by half of its derivative, whatever the sign of a2. A line that is steeper than the surface meets
        // both halves of the cone; through an apex both roots are one, where roundings may leave a negative square.
        let square = b * b - a2 * c;
        let root = sqrt(if a2 < 0.0 { square.max(0.0) } else { square });
        let q = if b < 0.0 { root - b } else { -root - b };
        let (near, far) = (c / q, q / a2);
        let (first, last) = if b < 0.0 { (near, far) } else { (far, near) };
        entry = (first, (along_m + first * along_d) * recip_e);
        exit = (last, (along_m + last * along_d) * recip_e);
        has_entry = 0.0 <= entry.1 && entry.1 <= 1.0;
        has_exit = 0.0 <= exit.1 && exit.1 <= 1.0;
        if a2 < 0.0 {
            // Near an apex roundings may put the root of the other half of the cone on this one, and that of this one beyond its end, which is at
            // the apex at most.
            let is_exit = delta * along_d > 0.0;
            let u = if is_exit { &mut exit.1 } else { &mut entry.1 };
            let apex = r0 / delta;
            if (*u - apex) * delta > 0.0 {
                *u = apex;
            }
            let is_on = -APEX_ROUNDING <= *u && *u <= 1.0 + APEX_ROUNDING;
            *u = u.clamp(0.0, 1.0);
            [has_entry, has_exit] = [is_on && !is_exit, is_on && is_exit];
        }
        if has_entry && base_t + first >= enough {
            return Some([(base_t + first, entry.1); 2]);
        }
        // Where both are one but for roundings.
        if has_entry && has_exit && last < first {
            exit = entry;
        }
    }
    // The hull is convex: a point on the lateral surface is an end, beyond which there is no ball. The other end is on a ball, or, but for
    // roundings, the same point.
    if !(has_entry && has_exit) {
        let mut span = Span { entry: (f64::INFINITY, 0.0), exit: (f64::NEG_INFINITY, 0.0) };
        for (u, to_ray, radius) in [(0.0, m, r0), (1.0, sub(m, a), r1)] {
            // As `Sphere::roots_scaled`.
            let closest = -dot(to_ray, d) * recip;
            let aside: Vector = core::array::from_fn(|k| to_ray[k] + closest * d[k]);
            let half_chord = sqrt((radius * radius - dot(aside, aside)) * recip);
            span.add(closest - half_chord, u);
            span.add(closest + half_chord, u);
        }
        if has_entry {
            span.add(entry.0, entry.1);
        } else if has_exit {
            span.add(exit.0, exit.1);
        }
        entry = if has_entry { entry } else { span.entry };
        exit = if has_exit { exit } else { span.exit };
    }
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

/// How far beyond the end roundings may put the position of a root near an apex that is a little farther, relative to the length of the segment: as
/// far as the square root of some hundred roundings of 2^-53. There the surface is as far from the ball at most, less than a third of the error of hits.
const APEX_ROUNDING: f64 = 1e-7;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;

    /// Rays that start beside segments, and these.
    fn cases(n: usize) -> impl Iterator<Item = (RoundSegment, ScaledRay)> {
        let mut state = 9_u64;
        let mut unit = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        (0..n).filter_map(move |i| {
            let a = [unit(), unit(), unit()];
            let b = a.map(|x| x + [1.0, 0.05, 0.0][i % 3] * unit());
            let radii = [0.1 * unit().abs(), [0.1, 1e-4][i % 2] * unit().abs()];
            let origin = a.map(|x| x + [0.1, 0.3][i / 6 % 2] * unit());
            let ray = ScaledRay::new(&Ray::new(origin, [unit(), unit(), unit()]))?;
            Some((RoundSegment { ends: [a, b], radii }, ray))
        })
    }

    /// Of rays that start outside, those that hit; of these those that lead away from the segment with its radii times this; of the others
    /// those that lead away.
    fn counts(scale: f64) -> [u32; 3] {
        let mut counts = [0; 3];
        for (segment, ray) in cases(200_000) {
            let (from_end, d, a, radii) = segment.relative(&ray);
            let is_away = leads_away(from_end, d, a, radii.map(|r| scale * r));
            match segment.span_scaled(&ray) {
                Some([entry, exit]) if exit.t >= 0.0 => {
                    counts[0] += u32::from(entry.t >= 0.0);
                    counts[1] += u32::from(is_away);
                    if scale == 1.0 && entry.t >= 0.0 {
                        let [first, _] = segment.first_scaled(&ray).expect("the ray hits the segment");
                        assert_eq!(first, entry, "{segment:?} {ray:?}");
                    }
                }
                _ => counts[2] += u32::from(is_away),
            }
        }
        counts
    }

    #[test]
    fn rays_that_lead_away_do_not_hit() {
        let [n_hits, n_lost, n_away] = counts(1.0);
        assert!(n_hits > 5000 && n_lost == 0 && n_away > 50_000, "{n_lost} of {n_hits} lost, {n_away} lead away");
    }

    /// Lines through the tip of a cone, and along its axis, in both directions: the ball at the wide end is where they enter or leave.
    #[test]
    fn lines_through_a_tip_enter_at_the_ball() {
        let mut n = 0;
        for (segment, ray) in cases(40_000) {
            let ([wide, tip], r) = (segment.ends, 0.3 * segment.radii[0]);
            let from = ray.origin.map(|x| 3.0 * x);
            for (origin, is_along) in [(from, false), ([0, 1, 2].map(|k| 4.0 * wide[k] - 3.0 * tip[k]), true)] {
                let Some(ray) = ScaledRay::new(&Ray::new(origin, [0, 1, 2].map(|k| tip[k] - origin[k]))) else {
                    continue;
                };
                let (o, d) = (to_f64(ray.origin), to_f64(ray.direction));
                let to_ray = sub(o, to_f64(wide));
                let b = dot(to_ray, d) / dot(d, d);
                let aside: Vector = core::array::from_fn(|k| to_ray[k] - b * d[k]);
                let square = (f64::from(r) * f64::from(r) - dot(aside, aside)) / dot(d, d);
                // Lines that pass beside the ball, or graze it, meet the cone at its tip alone, or nothing.
                if r < 1e-3 || square < 1e-3 * f64::from(r) * f64::from(r) {
                    continue;
                }
                let cones = [([wide, tip], [r, 0.0]), ([tip, wide], [0.0, r])]
                    .map(|(ends, radii)| RoundSegment { ends, radii });
                for cone in cones {
                    let [entry, _] = cone.span_scaled(&ray).expect("the line meets the ball");
                    let expected = -b - sqrt(square);
                    let is_near = (f64::from(entry.t) - expected).abs() <= 1e-5 * (1.0 + expected.abs());
                    // A tip before the ball is on the way there.
                    let to_tip = dot(sub(to_f64(tip), o), d) / dot(d, d);
                    assert!(is_near || to_tip < expected, "{cone:?} {ray:?} {is_along}: {entry:?}, not at {expected}");
                    n += u32::from(is_near);
                }
            }
        }
        assert!(n > 10_000, "{n}");
    }

    /// Rays from beyond the tip of a cone that pass through it, but for the rounding of their directions: there they enter.
    #[test]
    fn rays_from_beyond_a_tip_enter_there() {
        let mut n = 0;
        for (i, (segment, ray)) in cases(40_000).enumerate() {
            let [wide, near] = segment.ends;
            // Some exactly along the axis.
            let tip = if i % 5 == 0 { [near[0], wide[1], wide[2]] } else { near };
            let axis = sub(to_f64(tip), to_f64(wide));
            // Some of blunt cones.
            let r = match i % 3 {
                0 => 0.3 * segment.radii[0],
                _ => ([0.9, 0.99, 0.999][i / 3 % 3] * sqrt(dot(axis, axis))) as f32,
            };
            let inside = [0, 1, 2].map(|k| wide[k] + if i % 4 == 0 { 0.0 } else { 0.1 * r * ray.direction[k] });
            let direction = [0, 1, 2].map(|k| inside[k] - tip[k]);
            let Some(ray) = ScaledRay::new(&Ray::new([0, 1, 2].map(|k| tip[k] - 2.0 * direction[k]), direction)) else {
                continue;
            };
            let slope = f64::from(r) / sqrt(dot(axis, axis));
            if r < 1e-3 || slope > 0.9995 {
                continue;
            }
            let (d, tip_from_origin) = (to_f64(ray.direction), sub(to_f64(tip), to_f64(ray.origin)));
            let to_tip = dot(tip_from_origin, d) / dot(d, d);
            // The ray is less than half as steep as the surface, which it enters where that is as far from the axis as the ray.
            let off = size(cross(tip_from_origin, d)) / sqrt(dot(d, d));
            let bound = 1e-6 + 4.0 * off / slope;
            for (ends, radii) in [([wide, tip], [r, 0.0]), ([tip, wide], [0.0, r])] {
                let cone = RoundSegment { ends, radii };
                let [entry, _] = cone.span_scaled(&ray).expect("the ray meets the ball");
                assert!((f64::from(entry.t) - to_tip).abs() <= bound, "{cone:?} {ray:?}: {entry:?}, not at {to_tip}");
                n += 1;
            }
        }
        assert!(n > 20_000, "{n}");
    }

    #[test]
    fn without_their_radii_some_hit() {
        let [_, n_lost, _] = counts(0.9);
        assert!(n_lost > 100, "{n_lost} lost");
    }
}
