//! Disks, cones and ellipsoids as primitives.
//!
//! # Error
//! Let `S` be the greatest `|x - o|∞` of points of the bounds. Roots are computed in f64 from differences of coordinates; where the line grazes,
//! a relative error of some 2^-48 of the coefficients moves a root by up to 2^-24·S along the line, and from the surface by far less. Rounding
//! `t` adds 2^-24·S: two units of the 20 that are stated.

use canted_obb::{Aabb, Moments};
use canted_trace::{Cone, Disk, Ellipsoid, ScaledRay, Side};

use super::extents::extent_of_balls;
use super::primitive::{Primitive, PrimitiveHit, SavedPrimitive};
use super::shapes::entry_or_exit;

/// The interval of `direction·x` over a disk: that of its center, plus the radius times the part of the direction in its plane.
fn extent_of_disk(center: [f32; 3], normal: [f64; 3], radius: f32, direction: [f32; 3]) -> [f32; 2] {
    let d = direction.map(f64::from);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross =
        [d[1] * normal[2] - d[2] * normal[1], d[2] * normal[0] - d[0] * normal[2], d[0] * normal[1] - d[1] * normal[0]];
    // The margin covers the roundings of the square roots and of the quotient.
    let reach = f64::from(radius) * (dot(cross, cross) / dot(normal, normal)).sqrt() * (1.0 + 1e-12);
    // A ball of the reach that the direction sees, as the extent multiplies by its length.
    let [x, y, z] = center.map(f64::from);
    extent_of_balls(&[[x, y, z, reach / dot(d, d).sqrt().max(f64::MIN_POSITIVE)]], direction)
}

fn axis(ends: [[f32; 3]; 2]) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(ends[1][k]) - f64::from(ends[0][k]))
}

/// The bounds by the extents along the axes; NaN, which builds reject, where a number is not finite.
fn bounds_by(numbers: &[f32], extent: impl Fn([f32; 3]) -> [f32; 2]) -> Aabb {
    if numbers.iter().any(|x| !x.is_finite()) {
        return Aabb { min: [f32::NAN; 3], max: [f32::NAN; 3] };
    }
    let extents = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(extent);
    Aabb { min: extents.map(|[lo, _]| lo), max: extents.map(|[_, hi]| hi) }
}

/// `u` is the distance from the center relative to the radius, `v` is 0. The front is the side of the normal.
impl Primitive for Disk {
    const IS_LOCAL: bool = true;

    fn bounds(&self) -> Aabb {
        let Self { center: [x, y, z], normal: [a, b, c], radius } = *self;
        bounds_by(&[x, y, z, a, b, c, radius], |direction| self.extent_along(direction))
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_disk(self.center, self.normal.map(f64::from), self.radius, direction)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let (t, u, is_front) = self.point_scaled(ray)?;
        let side = if is_front { Side::Front } else { Side::Back };
        (ray.t_min <= t && t <= t_max).then_some(PrimitiveHit { t, u, v: 0.0, side })
    }
}

impl SavedPrimitive for Disk {
    /// Center and radius, then the normal and 0.
    type Data = [[f32; 4]; 2];

    fn to_data(&self) -> Self::Data {
        let Self { center: [x, y, z], normal: [a, b, c], radius } = *self;
        [[x, y, z, radius], [a, b, c, 0.0]]
    }

    fn from_data(&[[x, y, z, radius], [a, b, c, _]]: &Self::Data) -> Self {
        Self { center: [x, y, z], normal: [a, b, c], radius }
    }
}

/// Front where the ray enters, back where it leaves; `u` is the position along the axis, `v` is 0.
impl Primitive for Cone {
    const IS_LOCAL: bool = true;

    fn bounds(&self) -> Aabb {
        let numbers: Vec<f32> = self.ends.as_flattened().iter().chain(&self.radii).copied().collect();
        bounds_by(&numbers, |direction| self.extent_along(direction))
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        let axis = axis(self.ends);
        // A cone without length is never hit; any bounds will do.
        let axis = if axis == [0.0; 3] { [1.0, 0.0, 0.0] } else { axis };
        let [a, b] = [0, 1].map(|end| extent_of_disk(self.ends[end], axis, self.radii[end], direction));
        [a[0].min(b[0]), a[1].max(b[1])]
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.ends)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        entry_or_exit(self.span_scaled(ray)?, ray.t_min, t_max)
    }
}

impl SavedPrimitive for Cone {
    /// Both ends, each with its radius.
    type Data = [[f32; 4]; 2];

    fn to_data(&self) -> Self::Data {
        [0, 1].map(|end| {
            let [x, y, z] = self.ends[end];
            [x, y, z, self.radii[end]]
        })
    }

    fn from_data(data: &Self::Data) -> Self {
        Self { ends: data.map(|[x, y, z, _]| [x, y, z]), radii: data.map(|[.., radius]| radius) }
    }
}

/// Front where the ray enters, back where it leaves; surface coordinates are 0.
impl Primitive for Ellipsoid {
    const IS_LOCAL: bool = true;

    fn bounds(&self) -> Aabb {
        let numbers: Vec<f32> = self.axes.as_flattened().iter().chain(&self.center).copied().collect();
        bounds_by(&numbers, |direction| self.extent_along(direction))
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        let d = direction.map(f64::from);
        let squares = self.axes.map(|axis| (0..3).map(|k| d[k] * f64::from(axis[k])).sum::<f64>().powi(2));
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        // The margin is relative to the terms, which may cancel.
        let terms: f64 =
            self.axes.iter().map(|axis| (0..3).map(|k| (d[k] * f64::from(axis[k])).abs()).sum::<f64>()).sum();
        let reach = squares.iter().sum::<f64>().sqrt() * (1.0 + 1e-12) + 1e-14 * terms;
        let [x, y, z] = self.center.map(f64::from);
        extent_of_balls(&[[x, y, z, reach / length]], direction)
    }

    fn moments(&self) -> Moments {
        let tips = self
            .axes
            .iter()
            .flat_map(|axis| [-1.0, 1.0].map(|sign| std::array::from_fn(|k| self.center[k] + sign * axis[k])));
        Moments::from_points(tips)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        entry_or_exit(self.roots_scaled(ray)?.map(|t| (t, 0.0)), ray.t_min, t_max)
    }
}

impl SavedPrimitive for Ellipsoid {
    /// The center, then the axes.
    type Data = [[f32; 3]; 4];

    fn to_data(&self) -> Self::Data {
        let [a, b, c] = self.axes;
        [self.center, a, b, c]
    }

    fn from_data(&[center, a, b, c]: &Self::Data) -> Self {
        Self { center, axes: [a, b, c] }
    }
}
