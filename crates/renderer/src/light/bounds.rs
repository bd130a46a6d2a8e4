use super::cluster::Cluster;
use crate::vector::{Vector, dot, scale, sub};

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver {
    pub(super) position: Vector,
    /// Unit normal of the receiving side; `None` if both sides receive light.
    pub(super) normal: Option<Vector>,
}

/// Bounds of a cluster of lights for importance sampling: a bounding sphere and a direction cone.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBounds {
    pub(super) center: Vector,
    pub(super) radius: f64,
    pub(super) axis: Vector,
    pub(super) spread: Angle,
    /// Cosine of the angle to a light's axis beyond which the light is black.
    pub(super) cos_emission: f64,
    pub(super) is_two_sided: bool,
    /// W/sr of luminance.
    pub(super) intensity: f64,
}

/// The sum of two importances must be finite.
const MAX_IMPORTANCE: f64 = 1e300;

impl LightBounds {
    pub(super) fn new(cluster: &Cluster) -> Self {
        let Cluster { cone, intensity, .. } = *cluster;
        let (sin, cos) = cone.spread_rad.sin_cos();
        Self {
            center: cluster.center(),
            radius: cluster.radius_squared().sqrt(),
            axis: cone.axis,
            spread: Angle { cos, sin },
            cos_emission: cone.emission_rad.cos(),
            is_two_sided: cone.is_two_sided,
            intensity,
        }
    }

    /// Estimate of the irradiance of the lights at a point; zero only if no light can reach it.
    ///
    /// Intensity over squared distance, times the maximum cosines of emission (over the cone's axes) and of reception
    /// (over the sphere's points). Inside the sphere the distance is the radius. Angles have an error of about 10⁻⁸, so
    /// a light within that angle of a horizon may be missed.
    pub(super) fn importance(&self, receiver: &Receiver) -> f64 {
        let offset = sub(receiver.position, self.center);
        let (square, radius_squared) = (dot(offset, offset), self.radius * self.radius);
        let distance = square.sqrt();
        // Half-angle of the sphere as seen from the point; all directions from inside.
        let sphere = if square > radius_squared {
            Angle { cos: (1.0 - radius_squared / square).sqrt(), sin: self.radius / distance }
        } else {
            Angle { cos: -1.0, sin: 0.0 }
        };
        // NaN if a light without extent is at the receiver: such a light counts from all directions.
        let direction = scale(offset, 1.0 / distance);
        let cosine = dot(self.axis, direction);
        let cosine = if self.is_two_sided { cosine.abs() } else { cosine };
        let emitted = Angle::of(cosine).minus(self.spread).minus(sphere).cos;
        if emitted < self.cos_emission {
            return 0.0;
        }
        let received = receiver.normal.map_or(1.0, |normal| Angle::of(-dot(normal, direction)).minus(sphere).cos);
        let distance_squared = square.max(radius_squared).max(f64::MIN_POSITIVE);
        (self.intensity * emitted * received / distance_squared).clamp(0.0, MAX_IMPORTANCE)
    }
}

/// An angle in 0..=π.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle {
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl Angle {
    /// Zero for a NaN cosine.
    fn of(cos: f64) -> Self {
        let cos = if cos.is_nan() { 1.0 } else { cos.clamp(-1.0, 1.0) };
        Self { cos, sin: ((1.0 - cos) * (1.0 + cos)).sqrt() }
    }

    /// The difference, clamped to zero.
    fn minus(self, other: Self) -> Self {
        if self.cos >= other.cos {
            return Self { cos: 1.0, sin: 0.0 };
        }
        Self { cos: self.cos * other.cos + self.sin * other.sin, sin: self.sin * other.cos - self.cos * other.sin }
    }
}
