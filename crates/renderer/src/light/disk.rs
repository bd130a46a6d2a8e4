use std::f64::consts::PI;

use canted_trace::Ray;
use glam::{DVec3, Vec2};

use crate::sampling::{tangents, uniform_disk};
use crate::{Surface, wide};

#[cfg(feature = "gpu")]
use super::ListLight;
use super::tree::{Cluster, Cone};
use super::{IncomingLight, LightKind, LightShape, Place, luminance_of};

/// [`Light::Disk`](canted_scene::Light::Disk): a disk that emits on the side of its normal, world space.
pub(super) struct DiskLight {
    pub(super) center: [f32; 3],
    /// Unit vector.
    pub(super) normal: [f32; 3],
    pub(super) radius: f32,
    pub(super) radiance: [f32; 3],
}

impl DiskLight {
    fn area(&self) -> f64 {
        PI * f64::from(self.radius).powi(2)
    }

    /// W/sr of luminance along the normal.
    fn intensity(&self) -> f64 {
        self.area() * luminance_of(self.radiance)
    }
}

impl LightKind for DiskLight {
    /// A uniform point; `None` from behind, where the disk is black.
    fn sample(&self, surface: &Surface, square: &mut dyn FnMut() -> [f32; 2]) -> Option<IncomingLight> {
        let (normal, radius) = (wide(self.normal), f64::from(self.radius));
        let [x, y] = Vec2::from(uniform_disk(square())).as_dvec2().to_array();
        let [t, b] = tangents(normal);
        let target = wide(self.center) + (t * (radius * x) + b * (radius * y));
        let offset = target - DVec3::from(surface.position);
        let density = area_density(offset, normal, self.area())?;
        if -offset.dot(normal) > 0.0 { IncomingLight::of_target(surface, target, self.radiance, density) } else { None }
    }

    fn place(&self) -> Place {
        let (normal, intensity) = (wide(self.normal), self.intensity());
        // The extent of a disk along an axis is its radius times the sine between the axis and its normal.
        let half = normal.map(|n| f64::from(self.radius) * ((1.0 - n) * (1.0 + n)).max(0.0).sqrt());
        let cluster = Cluster::of_box(self.center, half, Cone::about(normal, false), intensity);
        // The mean cosine over a hemisphere is 1/2.
        Place::Local(intensity * PI, cluster)
    }

    fn shape(&self) -> Option<&dyn LightShape> {
        Some(self)
    }

    #[cfg(feature = "gpu")]
    fn packed(&self) -> ListLight {
        let Self { center: position, normal: direction, radius: extent, radiance: color } = *self;
        ListLight { position, direction, extent, color, ..ListLight::default() }
    }
}

impl LightShape for DiskLight {
    /// 0 from behind.
    fn density(&self, from: DVec3, direction: DVec3) -> f64 {
        let normal = wide(self.normal);
        plane_density(from, direction, wide(self.center), normal, self.area())
            .filter(|_| direction.dot(normal) < 0.0)
            .unwrap_or(0.0)
    }

    /// The edge counts as a hit. Computed in `f64` and rounded once. Rays in the plane miss.
    fn hit(&self, ray: &Ray) -> Option<(f32, [f32; 3])> {
        let (center, normal) = (wide(self.center), wide(self.normal));
        let slope = wide(ray.direction).dot(normal);
        let t = (center - wide(ray.origin)).dot(normal) / slope;
        let from_center = DVec3::from(ray.at(t)) - center;
        let rounded = t as f32;
        // NaN, for a ray in the plane, fails the comparisons.
        let is_hit = ray.t_min <= rounded
            && rounded <= ray.t_max
            && from_center.dot(from_center) <= f64::from(self.radius).powi(2)
            && slope != 0.0;
        is_hit.then_some((rounded, if slope < 0.0 { self.radiance } else { [0.0; 3] }))
    }

    fn normal(&self, _: DVec3) -> Option<DVec3> {
        Some(wide(self.normal))
    }
}

/// PDF per steradian of a uniform point of a planar shape, at a vector `offset` from that point; `None` if it is seen
/// edge-on.
pub(super) fn area_density(offset: DVec3, unit_normal: DVec3, area: f64) -> Option<f64> {
    let square = offset.dot(offset);
    // dA·cosθ = r²·dω, and r·cosθ is the height over the plane.
    let density = square * square.sqrt() / (offset.dot(unit_normal).abs() * area);
    (density > 0.0 && density.is_finite()).then_some(density)
}

/// [`area_density`] at the point where a unit direction from `from` hits the plane; `None` on a miss.
pub(super) fn plane_density(from: DVec3, direction: DVec3, point: DVec3, unit_normal: DVec3, area: f64) -> Option<f64> {
    let distance = (point - from).dot(unit_normal) / direction.dot(unit_normal);
    if distance > 0.0 { area_density(direction * distance, unit_normal, area) } else { None }
}
