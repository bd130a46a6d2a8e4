use std::f64::consts::TAU;

use canted_trace::{Ray, Sphere};

use crate::vector::{Vector, add, dot, scale, sub, tangents, unit, wide};

/// A sphere that emits outward, world space.
#[derive(Clone, Copy)]
pub(super) struct SphereLight {
    center: Vector,
    radius: f64,
    traced: Sphere,
}

/// The cone of directions towards a sphere.
struct SightCone {
    /// Unit vector to the center.
    axis: Vector,
    /// Distance to the center.
    distance: f64,
    /// One minus the cosine of the half-angle: accurate for distant spheres, where the cosine is not.
    height: f64,
}

impl SphereLight {
    pub(super) fn new(center: [f32; 3], radius: f32) -> Self {
        Self { center: wide(center), radius: radius.into(), traced: Sphere { center, radius } }
    }

    /// `None` from inside, where the sphere is black.
    fn sight_cone(&self, from: Vector) -> Option<SightCone> {
        let offset = sub(self.center, from);
        let distance = dot(offset, offset).sqrt();
        if distance.is_nan() || distance <= self.radius {
            return None;
        }
        let sine = self.radius / distance;
        // A product, so that points near the surface lose no digits.
        let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
        Some(SightCone { axis: unit(offset)?, distance, height: sine * sine / (1.0 + cosine) })
    }

    /// A visible point, uniform over the solid angle, and its PDF per steradian.
    pub(super) fn sample(&self, from: Vector, square: [f32; 2]) -> Option<(Vector, f64)> {
        let SightCone { axis, distance, height } = self.sight_cone(from)?;
        let below = f64::from(square[0]) * height;
        let (cosine, sine_squared) = (1.0 - below, below * (2.0 - below));
        // Half the length of the chord; at the silhouette, rounding may make its square negative.
        let half_chord = (self.radius.powi(2) - distance.powi(2) * sine_squared).max(0.0).sqrt();
        let (s, c) = (TAU * f64::from(square[1])).sin_cos();
        let [t, b] = tangents(axis);
        let sine = sine_squared.sqrt();
        let direction = add(scale(axis, cosine), add(scale(t, sine * c), scale(b, sine * s)));
        let target = add(from, scale(direction, distance * cosine - half_chord));
        Some((target, 1.0 / (TAU * height)))
    }

    /// PDF of [`Self::sample`] for all directions that hit the sphere; 0 from inside.
    pub(super) fn density(&self, from: Vector) -> f64 {
        self.sight_cone(from).map_or(0.0, |sight_cone| 1.0 / (TAU * sight_cone.height))
    }

    /// The `t` of the closest hit, and whether it is on the emitting outside.
    pub(super) fn hit(&self, ray: &Ray) -> Option<(f32, bool)> {
        let [enters, leaves] = self.traced.roots(ray)?;
        let inside = |t: f32| ray.t_min <= t && t <= ray.t_max;
        if inside(enters) { Some((enters, true)) } else { inside(leaves).then_some((leaves, false)) }
    }
}
