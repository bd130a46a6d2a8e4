//! Lights as kernels read them.

use bytemuck::{Pod, Zeroable};
use canted_scene::Light;

/// Greatest colour of a light on a device, so that no product of a kernel overflows.
const BRIGHTEST: f32 = 1e18;

/// A light of the list: `ListLight` of `shared/light/list`, which says what each kind has.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct ListLight {
    pub(super) place: [f32; 3],
    pub(super) kind: u32,
    pub(super) direction: [f32; 3],
    pub(super) extent: f32,
    pub(super) color: [f32; 3],
    pub(super) cos_outer: f32,
}

impl From<&Light> for ListLight {
    fn from(light: &Light) -> Self {
        let light = match *light {
            Light::Sun { direction, irradiance } => Self { kind: 0, direction, color: irradiance, ..Self::default() },
            Light::Point { position, intensity } => {
                Self { kind: 1, place: position, color: intensity, ..Self::default() }
            }
            Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
                Self { kind: 2, place: position, direction, color: intensity, extent: cos_inner, cos_outer }
            }
            Light::Sphere { center, radius, radiance } => {
                Self { kind: 3, place: center, extent: radius, color: radiance, ..Self::default() }
            }
            Light::Disc { center, normal, radius, radiance } => {
                Self { kind: 4, place: center, direction: normal, extent: radius, color: radiance, cos_outer: 0.0 }
            }
        };
        Self { color: bounded(light.color), ..light }
    }
}

/// A colour that a device can compute with; what is no number is black.
pub(super) fn bounded(color: [f32; 3]) -> [f32; 3] {
    color.map(|x| x.max(0.0).min(BRIGHTEST))
}
