use super::disk::{area_density, plane_density};
use super::spherical::SphericalTriangle;
use crate::vector::{Vector, add, cross, dot, length, scale, sub, wide};

/// A triangle that emits on both sides, world space.
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
        let perpendicular = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let twice_area = length(perpendicular);
        (twice_area > 0.0 && twice_area.is_finite()).then(|| Self {
            corners,
            normal: scale(perpendicular, 1.0 / twice_area),
            area: 0.5 * twice_area,
        })
    }

    /// Samples a point: the weights of the second and third corner, and the PDF per steradian at `from`.
    ///
    /// Uniform over the solid angle, or over the area if both are nearly the same.
    pub(super) fn sample(&self, from: Vector, square: [f32; 2]) -> Option<([f64; 2], f64)> {
        let square = square.map(f64::from);
        if let Some(spherical) = SphericalTriangle::new(self.corners, from) {
            let weights = self.weights_along(from, spherical.sample(square)?)?;
            return Some((weights, 1.0 / spherical.solid_angle));
        }
        let weights = uniform_weights(square);
        let density = area_density(sub(self.point(weights), from), self.normal, self.area)?;
        Some((weights, density))
    }

    /// PDF per steradian of [`Self::sample`] for a unit direction from `from` that hits the triangle.
    pub(super) fn density(&self, from: Vector, direction: Vector) -> f64 {
        match SphericalTriangle::new(self.corners, from) {
            Some(spherical) => 1.0 / spherical.solid_angle,
            None => plane_density(from, direction, self.corners[0], self.normal, self.area).unwrap_or(0.0),
        }
    }

    /// Weights of the point that a direction from `from` hits, clamped to the triangle.
    fn weights_along(&self, from: Vector, direction: Vector) -> Option<[f64; 2]> {
        let [a, b, c] = self.corners;
        let distance = dot(sub(a, from), self.normal) / dot(direction, self.normal);
        let from_a = sub(add(from, scale(direction, distance)), a);
        let weight = |perpendicular: Vector| (dot(perpendicular, self.normal) / (2.0 * self.area)).clamp(0.0, 1.0);
        let u = weight(cross(from_a, sub(c, a)));
        let v = weight(cross(sub(b, a), from_a)).min(1.0 - u);
        // NaN if the plane is seen edge-on.
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

/// Barycentric weights of two corners, uniform over the triangle, from a point of the unit square.
///
/// The square is folded along its diagonal, which distorts strata less than the square-root map (Heitz 2019, *A
/// Low-Distortion Map Between Triangle and Square*).
fn uniform_weights([x, y]: [f64; 2]) -> [f64; 2] {
    if x < y { [0.5 * x, y - 0.5 * x] } else { [x - 0.5 * y, 0.5 * y] }
}
