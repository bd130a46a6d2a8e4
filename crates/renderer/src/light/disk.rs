use std::f64::consts::PI;

use canted_trace::Ray;

use crate::sampling::uniform_disk;
use crate::vector::{Vector, add, dot, scale, sub, tangents, wide};

/// A disc that shines to the side of its normal, world space.
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

    /// A uniform point of it and its density per steradian about `from`; `None` from behind, where it is dark.
    pub(super) fn sample(&self, from: Vector, square: [f32; 2]) -> Option<(Vector, f64)> {
        let [x, y] = wide2(uniform_disk(square));
        let [t, b] = tangents(self.normal);
        let target = add(self.center, add(scale(t, self.radius * x), scale(b, self.radius * y)));
        let way = sub(target, from);
        let density = area_density(way, self.normal, self.area())?;
        (-dot(way, self.normal) > 0.0).then_some((target, density))
    }

    /// Density per steradian of a unit direction from `from` that meets it; 0 from behind.
    pub(super) fn density(&self, from: Vector, direction: Vector) -> f64 {
        plane_density(from, direction, self.center, self.normal, self.area())
            .filter(|_| dot(direction, self.normal) < 0.0)
            .unwrap_or(0.0)
    }

    /// Where a ray meets it, rim included, and whether on the side that shines.
    ///
    /// In `f64`, rounded once. Rays in its plane pass by.
    pub(super) fn hit(&self, ray: &Ray) -> Option<(f32, bool)> {
        let direction = wide(ray.direction);
        let slope = dot(direction, self.normal);
        let t = dot(sub(self.center, wide(ray.origin)), self.normal) / slope;
        let from_center = sub(ray.at(t), self.center);
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
        let rounded = t as f32;
        // What is not a number, for a ray in the plane, is in no interval.
        let meets = ray.t_min <= rounded
            && rounded <= ray.t_max
            && dot(from_center, from_center) <= self.radius.powi(2)
            && slope != 0.0;
        meets.then_some((rounded, slope < 0.0))
    }

    fn area(&self) -> f64 {
        PI * self.radius.powi(2)
    }
}

fn wide2(v: [f32; 2]) -> [f64; 2] {
    v.map(f64::from)
}

/// Density per steradian of a uniform point of a plane figure, from the way to it; `None` where it is seen edge-on.
pub(super) fn area_density(way: Vector, unit_normal: Vector, area: f64) -> Option<f64> {
    let square = dot(way, way);
    // dA·cosθ = r²·dω, and r·cosθ is the height over the plane.
    let density = square * square.sqrt() / (dot(way, unit_normal).abs() * area);
    (density > 0.0 && density.is_finite()).then_some(density)
}

/// The same at the point where a unit direction from `from` meets the plane; `None` where it does not.
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
