use std::f64::consts::PI;

use glam::DVec3;

use crate::{Surface, wide};

#[cfg(feature = "gpu")]
use super::ListLight;
use super::point::sample_point;
use super::tree::{Cluster, Cone};
use super::{IncomingLight, LightKind, LightShape, Place, luminance_of};

/// [`Light::Spot`](canted_scene::Light::Spot): a point that emits into a cone with a soft edge.
pub(super) struct Spot {
    pub(super) position: [f32; 3],
    /// Unit vector of the axis.
    pub(super) direction: [f32; 3],
    /// W/sr along the axis.
    pub(super) intensity: [f32; 3],
    pub(super) cos_inner: f32,
    pub(super) cos_outer: f32,
}

impl Spot {
    /// Fraction of the intensity at an angle to the axis.
    fn falloff(&self, cosine: f64) -> f64 {
        let [cos_inner, cos_outer] = [self.cos_inner, self.cos_outer].map(f64::from);
        if cosine >= cos_inner {
            1.0
        } else if cosine <= cos_outer {
            0.0
        } else {
            ((cosine - cos_outer) / (cos_inner - cos_outer)).powi(2)
        }
    }
}

impl LightKind for Spot {
    fn sample(&self, surface: &Surface, _: &mut dyn FnMut() -> [f32; 2]) -> Option<IncomingLight> {
        let axis = wide(self.direction);
        sample_point(self.position, self.intensity, surface, |to_light| self.falloff(-axis.dot(to_light)))
    }

    fn place(&self) -> Place {
        let [inner, outer] = [self.cos_inner, self.cos_outer].map(f64::from);
        // The mean square of a linear ramp from 0 to 1 is 1/3.
        let power = luminance_of(self.intensity) * (2.0 * PI * (1.0 - inner + (inner - outer) / 3.0));
        let cone = Cone {
            emission_rad: f64::from(self.cos_outer).clamp(-1.0, 1.0).acos(),
            ..Cone::about(wide(self.direction), false)
        };
        // Beyond 90 degrees the cosine in the importance would be negative.
        let cone = if self.cos_outer > 0.0 { cone } else { Cone::ALL };
        Place::Local(power, Cluster::of_box(self.position, DVec3::ZERO, cone, luminance_of(self.intensity)))
    }

    fn shape(&self) -> Option<&dyn LightShape> {
        None
    }

    #[cfg(feature = "gpu")]
    fn packed(&self) -> ListLight {
        let Self { position, direction, intensity: color, cos_inner: extent, cos_outer } = *self;
        ListLight { position, direction, extent, color, cos_outer, ..ListLight::default() }
    }
}
