use std::f64::consts::PI;

use canted_trace::Ray;

use crate::sampling::uniform_disk;
use crate::vector::{Vector, add, dot, scale, sub, tangents, wide};

/// A disk that emits on the side of its normal, world space.
#[derive(Clone, Copy)]
pub(super) struct DiskLight {
    center: Vector,
    normal: Vector,
    radius: f64,
}

impl DiskLight {
    pub(super) fn new(center: [f32; 3], normal: [f32; 3], radius: f32) -> Self {
        Self { center: wide(center), normal: wide(normal), radius: radius.into() }
    }

    /// A uniform point and its PDF per steradian at `from`; `None` from behind, where the disk is black.
    pub(super) fn sample(&self, from: Vector, square: [f32; 2]) -> Option<(Vector, f64)> {
        let [x, y] = wide2(uniform_disk(square));
        let [t, b] = tangents(self.normal);
        let target = add(self.center, add(scale(t, self.radius * x), scale(b, self.radius * y)));
        let offset = sub(target, from);
        let density = area_density(offset, self.normal, self.area())?;
        (-dot(offset, self.normal) > 0.0).then_some((target, density))
    }

    /// PDF of [`Self::sample`] for a unit direction that hits the disk; 0 from behind.
    pub(super) fn density(&self, from: Vector, direction: Vector) -> f64 {
        plane_density(from, direction, self.center, self.normal, self.area())
            .filter(|_| dot(direction, self.normal) < 0.0)
            .unwrap_or(0.0)
    }

    /// The `t` of a hit, and whether it is on the emitting side. The edge counts as a hit.
    ///
    /// Computed in `f64` and rounded once. Rays in the plane miss.
    pub(super) fn hit(&self, ray: &Ray) -> Option<(f32, bool)> {
        let direction = wide(ray.direction);
        let slope = dot(direction, self.normal);
        let t = dot(sub(self.center, wide(ray.origin)), self.normal) / slope;
        let from_center = sub(ray.at(t), self.center);
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
        let rounded = t as f32;
        // NaN, for a ray in the plane, fails the comparisons.
        let is_hit = ray.t_min <= rounded
            && rounded <= ray.t_max
            && dot(from_center, from_center) <= self.radius.powi(2)
            && slope != 0.0;
        is_hit.then_some((rounded, slope < 0.0))
    }

    fn area(&self) -> f64 {
        PI * self.radius.powi(2)
    }
}

fn wide2(v: [f32; 2]) -> [f64; 2] {
    v.map(f64::from)
}

/// PDF per steradian of a uniform point of a planar shape, at a vector `offset` from that point; `None` if it is seen
/// edge-on.
pub(super) fn area_density(offset: Vector, unit_normal: Vector, area: f64) -> Option<f64> {
    let square = dot(offset, offset);
    // dA·cosθ = r²·dω, and r·cosθ is the height over the plane.
    let density = square * square.sqrt() / (dot(offset, unit_normal).abs() * area);
    (density > 0.0 && density.is_finite()).then_some(density)
}

/// [`area_density`] at the point where a unit direction from `from` hits the plane; `None` on a miss.
pub(super) fn plane_density(
    from: Vector,
    direction: Vector,
    point: Vector,
    unit_normal: Vector,
    area: f64,
) -> Option<f64> {
    let distance = dot(sub(point, from), unit_normal) / dot(direction, unit_normal);
    if distance > 0.0 { area_density(scale(direction, distance), unit_normal, area) } else { None }
}
