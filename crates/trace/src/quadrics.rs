//! Disks, cones with flat ends (cylinders where both radii are equal) and ellipsoids.
//!
//! Roots are computed in f64 from the difference of origin and shape. Capsules are [`RoundSegment`](crate::RoundSegment)s of equal radii.

use canted_obb::vector::{Vector, cross, dot, length, sqrt, sub, to_f64};

use crate::ScaledRay;
use crate::rounding::nearest;

/// A flat disk. Its front is the side that the normal points to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// Center, in the space of the rays.
    pub center: [f32; 3],
    /// Normal of any length but 0.
    pub normal: [f32; 3],
    /// Radius, at least 0.
    pub radius: f32,
}

impl Disk {
    /// Where the line of a scaled ray meets the disk: `t`, the distance from the center relative to the radius, and whether from the front.
    #[doc(hidden)]
    #[must_use]
    pub fn point_scaled(&self, ray: &ScaledRay) -> Option<(f32, f32, bool)> {
        let (d, n) = (to_f64(ray.direction), to_f64(self.normal));
        let to_center = sub(to_f64(self.center), to_f64(ray.origin));
        let t = dot(to_center, n) / dot(d, n);
        let off = length(core::array::from_fn(|k| t * d[k] - to_center[k]));
        let radius = f64::from(self.radius);
        // False for NaN, where the ray is parallel to the disk.
        (off <= radius).then(|| (nearest(t), if radius > 0.0 { off / radius } else { 0.0 } as f32, dot(d, n) < 0.0))
    }
}

/// A solid cone between two disks, cut off where both radii are above 0; a cylinder where they are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Centers of the disks, not equal, in the space of the rays.
    pub ends: [[f32; 3]; 2],
    /// Radii of the disks, at least 0.
    pub radii: [f32; 2],
}

impl Cone {
    /// Where the line of a scaled ray enters and leaves the cone: `t`, and the position along the axis, 0..=1. `None` for a miss, and for
    /// a cone without length.
    ///
    /// # Method
    /// The solid is convex: a slab between the planes of the disks, and in it all points `p`, relative to the first end, with
    /// `|p x a|² <= a²·r²`, where `a` is the axis and the radius `r` is linear along the line. The coefficients are those of
    /// [`RoundSegment::span_scaled`](crate::RoundSegment::span_scaled), from the point of the line nearest to the center.
    #[doc(hidden)]
    #[must_use]
    pub fn span_scaled(&self, ray: &ScaledRay) -> Option<[(f32, f32); 2]> {
        let [p0, p1] = self.ends.map(to_f64);
        let [r0, r1] = self.radii.map(f64::from);
        let (d, a) = (to_f64(ray.direction), sub(p1, p0));
        let (axis_squared, along_d) = (dot(a, a), dot(d, a));
        let from_origin = sub(to_f64(ray.origin), p0);
        let base = (0.5 * along_d - dot(from_origin, d)) / dot(d, d);
        let m: Vector = core::array::from_fn(|k| from_origin[k] + base * d[k]);
        let along_m = dot(m, a);
        // Between the planes; a line parallel to them is between them everywhere or nowhere.
        let mut slab = [-along_m / along_d, (axis_squared - along_m) / along_d];
        if along_d == 0.0 {
            if !(0.0..=axis_squared).contains(&along_m) {
                return None;
            }
            slab = [f64::NEG_INFINITY, f64::INFINITY];
        } else if along_d < 0.0 {
            slab.reverse();
        }
        let (across, moment) = (cross(d, a), cross(m, a));
        let narrowing = (r0 - r1) / axis_squared;
        let radius = r0 - narrowing * along_m;
        let (a2, b, c) = (
            dot(across, across) - axis_squared * (narrowing * along_d) * (narrowing * along_d),
            dot(moment, across) + axis_squared * radius * narrowing * along_d,
            dot(moment, moment) - axis_squared * radius * radius,
        );
        let discriminant = b * b - a2 * c;
        let within = |[low, high]: [f64; 2]| {
            let both = [low.max(slab[0]), high.min(slab[1])];
            (both[0] <= both[1]).then_some(both)
        };
        let ends = if discriminant < 0.0 {
            // The line is inside or outside everywhere.
            if c <= 0.0 { within([f64::NEG_INFINITY, f64::INFINITY])? } else { return None }
        } else {
            let root = sqrt(discriminant);
            let q = if b < 0.0 { root - b } else { -root - b };
            let [x, y] = [q / a2, c / q];
            let [low, high] = if x < y { [x, y] } else { [y, x] };
            if a2 > 0.0 {
                within([low, high])?
            } else if a2 < 0.0 {
                // Outside of the roots, on the side where the radius is positive. The other side may meet the slab at a tip.
                within(if narrowing * along_d > 0.0 { [f64::NEG_INFINITY, low] } else { [high, f64::INFINITY] })?
            } else if q == 0.0 {
                // Parallel to the axis.
                if c <= 0.0 { within([f64::NEG_INFINITY, f64::INFINITY])? } else { return None }
            } else {
                let only = -0.5 * c / b;
                within(if b > 0.0 { [f64::NEG_INFINITY, only] } else { [only, f64::INFINITY] })?
            }
        };
        let point = |t: f64| (nearest(base + t), ((along_m + t * along_d) / axis_squared).clamp(0.0, 1.0) as f32);
        // False for NaN: a cone without length.
        (ends[0] <= ends[1] && axis_squared > 0.0).then(|| ends.map(point))
    }
}

/// A solid ellipsoid: the image of the unit ball under three semiaxes, which need not be orthogonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Center, in the space of the rays.
    pub center: [f32; 3],
    /// Images of the axes of the unit ball, linearly independent; their lengths may differ by a factor of up to 2^20.
    pub axes: [[f32; 3]; 3],
}

impl Ellipsoid {
    /// Where the line of a scaled ray enters and leaves the ellipsoid; `None` for a miss.
    ///
    /// # Method
    /// Origin and direction are taken to the space of the unit ball in f64.
    #[doc(hidden)]
    #[must_use]
    pub fn roots_scaled(&self, ray: &ScaledRay) -> Option<[f32; 2]> {
        let [a, b, c] = self.axes.map(to_f64);
        let rows = [cross(b, c), cross(c, a), cross(a, b)];
        let determinant = dot(a, rows[0]);
        let to_ball = |v: Vector| -> Vector { core::array::from_fn(|k| dot(rows[k], v) / determinant) };
        let o = to_ball(sub(to_f64(ray.origin), to_f64(self.center)));
        let d = to_ball(to_f64(ray.direction));
        let d_squared = dot(d, d);
        let closest = -dot(o, d) / d_squared;
        let off = length(core::array::from_fn(|k| o[k] + closest * d[k]));
        let half = sqrt((1.0 - off) * (1.0 + off) / d_squared);
        // False for NaN: a miss, and axes that are not independent.
        (closest - half <= closest + half).then(|| [nearest(closest - half), nearest(closest + half)])
    }
}
