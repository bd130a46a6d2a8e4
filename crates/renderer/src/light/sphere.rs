use std::f64::consts::{PI, TAU};

use canted_trace::{Ray, Sphere};
use glam::DVec3;

use crate::sampling::tangents;
use crate::{Surface, wide};

#[cfg(feature = "gpu")]
use super::ListLight;
use super::tree::{Cluster, Cone};
use super::{IncomingLight, LightKind, LightShape, Place, luminance_of};

/// [`Light::Sphere`](canted_scene::Light::Sphere): a sphere that emits outward, world space.
pub(super) struct SphereLight {
    pub(super) center: [f32; 3],
    pub(super) radius: f32,
    pub(super) radiance: [f32; 3],
}

/// The cone of directions towards a sphere.
struct SightCone {
    /// Unit vector to the center.
    axis: DVec3,
    /// Distance to the center.
    distance: f64,
    /// One minus the cosine of the half-angle: accurate for distant spheres, where the cosine is not.
    height: f64,
}

impl SphereLight {
    /// `None` from inside, where the sphere is black.
    fn sight_cone(&self, from: DVec3) -> Option<SightCone> {
        let radius = f64::from(self.radius);
        let offset = wide(self.center) - from;
        let distance = offset.length();
        if distance.is_nan() || distance <= radius {
            return None;
        }
        let sine = radius / distance;
        // A product, so that points near the surface lose no digits.
        let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
        Some(SightCone { axis: offset.try_normalize()?, distance, height: sine * sine / (1.0 + cosine) })
    }

    /// W/sr of luminance.
    fn intensity(&self) -> f64 {
        PI * f64::from(self.radius).powi(2) * luminance_of(self.radiance)
    }
}

impl LightKind for SphereLight {
    /// A visible point, uniform over the solid angle.
    fn sample(&self, surface: &Surface, square: &mut dyn FnMut() -> [f32; 2]) -> Option<IncomingLight> {
        let square = square();
        let from = DVec3::from(surface.position);
        let SightCone { axis, distance, height } = self.sight_cone(from)?;
        let below = f64::from(square[0]) * height;
        let (cosine, sine_squared) = (1.0 - below, below * (2.0 - below));
        // Half the length of the chord; at the silhouette, rounding may make its square negative.
        let half_chord = (f64::from(self.radius).powi(2) - distance.powi(2) * sine_squared).max(0.0).sqrt();
        let (s, c) = (TAU * f64::from(square[1])).sin_cos();
        let [t, b] = tangents(axis);
        let sine = sine_squared.sqrt();
        let direction = axis * cosine + (t * (sine * c) + b * (sine * s));
        let target = from + direction * (distance * cosine - half_chord);
        IncomingLight::of_target(surface, target, self.radiance, 1.0 / (TAU * height))
    }

    fn place(&self) -> Place {
        let (half, intensity) = (DVec3::splat(self.radius.into()), self.intensity());
        Place::Local(intensity * (4.0 * PI), Cluster::of_box(self.center, half, Cone::ALL, intensity))
    }

    fn shape(&self) -> Option<&dyn LightShape> {
        Some(self)
    }

    #[cfg(feature = "gpu")]
    fn packed(&self) -> ListLight {
        let Self { center: position, radius: extent, radiance: color } = *self;
        ListLight { position, extent, color, ..ListLight::default() }
    }
}

impl LightShape for SphereLight {
    /// The same for all directions that hit the sphere; 0 from inside.
    fn density(&self, from: DVec3, _: DVec3) -> f64 {
        self.sight_cone(from).map_or(0.0, |sight_cone| 1.0 / (TAU * sight_cone.height))
    }

    fn hit(&self, ray: &Ray) -> Option<(f32, [f32; 3])> {
        let Self { center, radius, radiance } = *self;
        let [enters, leaves] = Sphere { center, radius }.roots(ray)?;
        let inside = |t: f32| ray.t_min <= t && t <= ray.t_max;
        if inside(enters) { Some((enters, radiance)) } else { inside(leaves).then_some((leaves, [0.0; 3])) }
    }

    fn normal(&self, at: DVec3) -> Option<DVec3> {
        (at - wide(self.center)).try_normalize()
    }
}
