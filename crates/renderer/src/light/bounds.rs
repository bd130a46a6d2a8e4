use super::cluster::Cluster;
use crate::vector::{Vector, dot, scale, sub};

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver {
    pub(super) position: Vector,
    /// Unit normal of the side that receives; `None` where both do.
    pub(super) normal: Option<Vector>,
}

/// What a cluster of lights might do to a point, in the form that is asked for it: a ball, and the cone by its cosines.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBounds {
    pub(super) middle: Vector,
    pub(super) radius: f64,
    pub(super) axis: Vector,
    pub(super) spread: Angle,
    /// Cosine of the angle to a light's axis beyond which it is dark.
    pub(super) cos_reach: f64,
    pub(super) is_two_sided: bool,
    /// W/sr by luminance.
    pub(super) intensity: f64,
}

/// Far enough below the greatest number that two of them add up.
const GREATEST_IMPORTANCE: f64 = 1e300;

impl LightBounds {
    pub(super) fn new(cluster: &Cluster) -> Self {
        let Cluster { cone, intensity, .. } = *cluster;
        let (sin, cos) = cone.spread_rad.sin_cos();
        Self {
            middle: cluster.middle(),
            radius: cluster.radius_squared().sqrt(),
            axis: cone.axis,
            spread: Angle { cos, sin },
            cos_reach: cone.reach_rad.cos(),
            is_two_sided: cone.is_two_sided,
            intensity,
        }
    }

    /// About the irradiance that the lights make at a point; zero only if none of them can reach it.
    ///
    /// Intensity over distance squared, times the greatest cosines that any axis of the cone has to the receiver and
    /// the receiver to any point of the ball. Within the ball the distance is the ball's radius. A cone's angles are
    /// known to about 10⁻⁸, so what is lost at a horizon is less than that share of a light.
    pub(super) fn importance(&self, receiver: &Receiver) -> f64 {
        let way = sub(receiver.position, self.middle);
        let (square, radius_squared) = (dot(way, way), self.radius * self.radius);
        let distance = square.sqrt();
        // Half the angle under which the ball is seen; all around from within.
        let ball = if square > radius_squared {
            Angle { cos: (1.0 - radius_squared / square).sqrt(), sin: self.radius / distance }
        } else {
            Angle { cos: -1.0, sin: 0.0 }
        };
        // Not a number where a light without extent lies in the receiver; then it shines, if it does, from all sides.
        let direction = scale(way, 1.0 / distance);
        let cosine = dot(self.axis, direction);
        let cosine = if self.is_two_sided { cosine.abs() } else { cosine };
        let emitted = Angle::of(cosine).less(self.spread).less(ball).cos;
        if emitted < self.cos_reach {
            return 0.0;
        }
        let received = receiver.normal.map_or(1.0, |normal| Angle::of(-dot(normal, direction)).less(ball).cos);
        let distance_squared = square.max(radius_squared).max(f64::MIN_POSITIVE);
        (self.intensity * emitted * received / distance_squared).clamp(0.0, GREATEST_IMPORTANCE)
    }
}

/// An angle in 0..=π.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle {
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl Angle {
    /// None at all for a cosine that is not a number.
    fn of(cos: f64) -> Self {
        let cos = if cos.is_nan() { 1.0 } else { cos.clamp(-1.0, 1.0) };
        Self { cos, sin: ((1.0 - cos) * (1.0 + cos)).sqrt() }
    }

    /// The difference, none where `other` is the greater.
    fn less(self, other: Self) -> Self {
        if self.cos >= other.cos {
            return Self { cos: 1.0, sin: 0.0 };
        }
        Self { cos: self.cos * other.cos + self.sin * other.sin, sin: self.sin * other.cos - self.cos * other.sin }
    }
}
