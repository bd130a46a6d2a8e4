use std::f64::consts::TAU;

use canted_trace::{Ray, Sphere};

use crate::vector::{Vector, add, dot, scale, sub, tangents, unit, wide};

/// A ball that shines outward, world space.
#[derive(Clone, Copy)]
pub(super) struct SphereLight {
    center: Vector,
    radius: f64,
    traced: Sphere,
}

/// The cone in which a point sees a ball.
struct SightCone {
    /// Unit vector to the middle.
    axis: Vector,
    /// From the point to the middle.
    distance: f64,
    /// One minus the cosine of half the angle, which keeps its digits for a far ball.
    height: f64,
}

impl SphereLight {
    pub(super) fn new(center: [f32; 3], radius: f32) -> Self {
        Self { center: wide(center), radius: radius.into(), traced: Sphere { center, radius } }
    }

    /// `None` from inside, where it is dark.
    fn sight_cone(&self, from: Vector) -> Option<SightCone> {
        let way = sub(self.center, from);
        let distance = dot(way, way).sqrt();
        if distance.is_nan() || distance <= self.radius {
            return None;
        }
        let sine = self.radius / distance;
        // As a product, so that a point near the surface loses no digits.
        let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
        Some(SightCone { axis: unit(way)?, distance, height: sine * sine / (1.0 + cosine) })
    }

    /// A point of the surface that is seen from `from`, uniform over the solid angle, and its density per steradian.
    pub(super) fn sample(&self, from: Vector, square: [f32; 2]) -> Option<(Vector, f64)> {
        let SightCone { axis, distance, height } = self.sight_cone(from)?;
        let below = f64::from(square[0]) * height;
        let (cosine, sine_squared) = (1.0 - below, below * (2.0 - below));
        // Half the chord that the ball cuts from the direction; none at the rim, where rounding may pass zero.
        let half_chord = (self.radius.powi(2) - distance.powi(2) * sine_squared).max(0.0).sqrt();
        let (s, c) = (TAU * f64::from(square[1])).sin_cos();
        let [t, b] = tangents(axis);
        let sine = sine_squared.sqrt();
        let direction = add(scale(axis, cosine), add(scale(t, sine * c), scale(b, sine * s)));
        let target = add(from, scale(direction, distance * cosine - half_chord));
        Some((target, 1.0 / (TAU * height)))
    }

    /// Density per steradian of all directions from `from` that meet it; 0 from inside.
    pub(super) fn density(&self, from: Vector) -> f64 {
        self.sight_cone(from).map_or(0.0, |sight_cone| 1.0 / (TAU * sight_cone.height))
    }

    /// Where a ray meets it first, and whether from outside, where it shines.
    pub(super) fn hit(&self, ray: &Ray) -> Option<(f32, bool)> {
        let [enters, leaves] = self.traced.roots(ray)?;
        let inside = |t: f32| ray.t_min <= t && t <= ray.t_max;
        if inside(enters) { Some((enters, true)) } else { inside(leaves).then_some((leaves, false)) }
    }
}
