use super::disk::{area_density, plane_density};
use super::spherical::SphericalTriangle;
use crate::vector::{Vector, add, cross, dot, length, scale, sub, wide};

/// A triangle that shines to both sides, world space.
#[derive(Clone, Copy)]
pub(super) struct TriangleLight {
    corners: [Vector; 3],
    /// Unit vector.
    pub(super) normal: Vector,
    pub(super) area: f64,
}

impl TriangleLight {
    /// `None` for a triangle without area.
    pub(super) fn new(corners: [[f32; 3]; 3]) -> Option<Self> {
        let corners = corners.map(wide);
        let across = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let twice = length(across);
        (twice > 0.0 && twice.is_finite()).then(|| Self {
            corners,
            normal: scale(across, 1.0 / twice),
            area: 0.5 * twice,
        })
    }

    /// The weights of the second and third corner at a point, and its density per steradian about `from`.
    ///
    /// Uniform over the solid angle, or over the area where that comes to the same.
    pub(super) fn sample(&self, from: Vector, square: [f32; 2]) -> Option<([f64; 2], f64)> {
        let square = square.map(f64::from);
        if let Some(seen) = SphericalTriangle::new(self.corners, from) {
            let weights = self.weights_along(from, seen.sample(square)?)?;
            return Some((weights, 1.0 / seen.solid_angle));
        }
        let weights = uniform_weights(square);
        let density = area_density(sub(self.point(weights), from), self.normal, self.area)?;
        Some((weights, density))
    }

    /// Density per steradian with which [`Self::sample`] finds a unit direction from `from` that meets the triangle.
    pub(super) fn density(&self, from: Vector, direction: Vector) -> f64 {
        match SphericalTriangle::new(self.corners, from) {
            Some(seen) => 1.0 / seen.solid_angle,
            None => plane_density(from, direction, self.corners[0], self.normal, self.area).unwrap_or(0.0),
        }
    }

    /// Weights of the point that a direction from `from` meets, rounded into the triangle.
    fn weights_along(&self, from: Vector, direction: Vector) -> Option<[f64; 2]> {
        let [a, b, c] = self.corners;
        let distance = dot(sub(a, from), self.normal) / dot(direction, self.normal);
        let from_a = sub(add(from, scale(direction, distance)), a);
        let share = |across: Vector| (dot(across, self.normal) / (2.0 * self.area)).clamp(0.0, 1.0);
        let u = share(cross(from_a, sub(c, a)));
        let v = share(cross(sub(b, a), from_a)).min(1.0 - u);
        // What is not a number comes of a plane seen edge-on.
        (u + v <= 1.0).then_some([u, v])
    }

    pub(super) fn point(&self, [u, v]: [f64; 2]) -> Vector {
        let [a, b, c] = self.corners;
        add(scale(a, 1.0 - u - v), add(scale(b, u), scale(c, v)))
    }

    /// The normal on the side of `from`.
    pub(super) fn normal_towards(&self, from: Vector) -> Vector {
        let side = dot(self.normal, sub(from, self.corners[0]));
        scale(self.normal, 1.0_f64.copysign(side))
    }
}

/// Weights of two corners, uniform over the triangle, from a point of the unit square.
///
/// The square is folded along its diagonal's middle, which bends strata less than a square root does (Heitz 2019, *A
/// Low-Distortion Map Between Triangle and Square*).
fn uniform_weights([x, y]: [f64; 2]) -> [f64; 2] {
    if x < y { [0.5 * x, y - 0.5 * x] } else { [x - 0.5 * y, 0.5 * y] }
}
