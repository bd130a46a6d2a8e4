//! Lights: the radiance they send to a point, light sampling, and the PDF of each sample.
//!
//! ```text
//! Light            -> sun, point, spot, sphere, disk: a file for each kind         -> direct lighting (hybrid)
//! Environment      -> environment: radiance, importance sampling
//! emission         -> triangle: sampled by solid angle                             -> LightSampler (path)
//! all with a place -> tree: chooses one by its estimated contribution
//! ```
//!
//! A kind of light of the scene file is one type that answers all questions of [`LightKind`]; [`ask`] is the only place that lists the
//! kinds. Its twin on the GPU is one file of the same name, which `shared/light/list.wgsl` lists. A new kind is a variant of [`Light`] with its
//! table in scene files, these two files, and a line in each list; `ListLight` has twelve words for all its numbers. Tests find a kind that
//! a switch of `list.wgsl`, a scene file or a comparison with the GPU does not have.
//!
//! Sphere and disk lights are *shape lights*: camera rays and bounced rays hit them, and they occlude other lights.
//! They reflect nothing. The back of a disk and the inside of a sphere are black.

mod disk;
pub(crate) mod environment;
mod point;
mod sampler;
mod sphere;
mod spot;
mod sun;
pub(crate) mod tree;
pub(crate) mod triangle;

#[cfg(feature = "gpu")]
use bytemuck::{Pod, Zeroable};
use canted_film::srgb::luminance;
use canted_obb::PrimId;
use canted_scene::{Environment, Instance, Light, Material, Part, Scene};
use canted_trace::{Hit, InstanceId, Intersect, Query, Ray};
use glam::DVec3;

use crate::{Surface, narrow, wide};
use environment::Sky;
#[cfg(feature = "gpu")]
pub(crate) use sampler::Choice;
pub(crate) use sampler::LitPoint;
pub use sampler::{LightSample, LightSampler};
use tree::Cluster;

/// What the renderer asks a light of the scene file.
trait LightKind {
    /// Samples the light at a surface, before the occlusion test. Only lights with an area call `square`, for a point of the unit square.
    fn sample(&self, surface: &Surface, square: &mut dyn FnMut() -> [f32; 2]) -> Option<IncomingLight>;

    /// Where it is.
    fn place(&self) -> Place;

    /// What rays hit; `None` for a light without an area.
    fn shape(&self) -> Option<&dyn LightShape>;

    /// The light on the GPU, but for its kind.
    #[cfg(feature = "gpu")]
    fn packed(&self) -> ListLight;
}

/// Where a light is, and how bright.
enum Place {
    /// Infinitely far away, with the luminance of its irradiance on a surface that faces it.
    Infinite(f64),
    /// In the scene, with its power in watts of luminance. The cluster says where it is and where it shines; a black light has none.
    Local(f64, Option<Cluster>),
}

/// What the renderer asks a light that rays hit.
trait LightShape {
    /// PDF of [`LightKind::sample`] per steradian for a unit direction that hits the light.
    fn density(&self, from: DVec3, direction: DVec3) -> f64;

    /// Where a ray hits it within its closed interval, and the radiance there.
    fn hit(&self, ray: &Ray) -> Option<(f32, [f32; 3])>;

    /// A unit normal at a point that a ray hit, on either side.
    fn normal(&self, at: DVec3) -> Option<DVec3>;
}

/// Asks a light of the scene file.
fn ask<R>(light: &Light, question: impl FnOnce(&dyn LightKind) -> R) -> R {
    match *light {
        Light::Sun { direction, irradiance } => question(&sun::Sun { direction, irradiance }),
        Light::Point { position, intensity } => question(&point::Point { position, intensity }),
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            question(&spot::Spot { position, direction, intensity, cos_inner, cos_outer })
        }
        Light::Sphere { center, radius, radiance } => question(&sphere::SphereLight { center, radius, radiance }),
        Light::Disk { center, normal, radius, radiance } => {
            question(&disk::DiskLight { center, normal, radius, radiance })
        }
    }
}

/// Whether rays hit a light of the scene file.
pub(crate) fn is_shape(light: &Light) -> bool {
    ask(light, |kind| kind.shape().is_some())
}

/// Luminance of a linear color.
fn luminance_of(color: [f32; 3]) -> f64 {
    luminance(color.map(f64::from))
}

/// `ListLight` of `shared/light/list`, where the members are documented.
#[cfg(feature = "gpu")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct ListLight {
    pub(crate) position: [f32; 3],
    pub(crate) kind: u32,
    pub(crate) direction: [f32; 3],
    pub(crate) extent: f32,
    pub(crate) color: [f32; 3],
    pub(crate) cos_outer: f32,
}

#[cfg(feature = "gpu")]
impl From<&Light> for ListLight {
    fn from(light: &Light) -> Self {
        let packed = ask(light, |kind| kind.packed());
        Self { kind: light.kind() as u32, color: bounded(packed.color), ..packed }
    }
}

/// A color clamped for the GPU, so that products of colors do not overflow; NaN becomes black.
#[cfg(feature = "gpu")]
#[expect(clippy::manual_clamp, reason = "clamp keeps NaN")]
pub(crate) fn bounded(color: [f32; 3]) -> [f32; 3] {
    const MAX_RADIANCE: f32 = 1e18;
    color.map(|x| x.max(0.0).min(MAX_RADIANCE))
}

/// Light from one direction at a surface, before the occlusion test. World space.
pub(crate) struct IncomingLight {
    /// Unit vector.
    pub(crate) to_light: DVec3,
    /// Radiance over `density`. For a delta light, the irradiance on a surface that faces it.
    pub(crate) radiance: DVec3,
    /// PDF of `to_light` per steradian; `None` for a delta light.
    pub(crate) density: Option<f64>,
    /// `None` if the light is too close for an occluder.
    pub(crate) shadow_ray: Option<Ray>,
}

impl IncomingLight {
    /// Samples a light of the scene file. Only lights with an area call `square`, for a point of the unit square.
    pub(crate) fn of(light: &Light, surface: &Surface, mut square: impl FnMut() -> [f32; 2]) -> Option<Self> {
        ask(light, |kind| kind.sample(surface, &mut square))
    }

    /// Light from a point of a shape light, sampled with a PDF per steradian.
    fn of_target(surface: &Surface, target: DVec3, radiance: [f32; 3], density: f64) -> Option<Self> {
        Some(Self {
            to_light: (target - DVec3::from(surface.position)).try_normalize()?,
            radiance: wide(radiance) * (1.0 / density),
            density: Some(density),
            shadow_ray: surface.spawn_ray_to(narrow(target)),
        })
    }
}

/// Identifies a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightId {
    /// The environment, infinitely far away.
    Environment,
    /// A light of [`Scene::lights`], by index.
    Light(u32),
    /// An emissive triangle.
    Triangle(InstanceId, PrimId),
}

impl LightId {
    /// The triangle that a ray hit.
    #[must_use]
    pub fn of_hit(hit: &Hit) -> Self {
        Self::Triangle(hit.instance, hit.primitive)
    }
}

/// The environment or shape light that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Linear RGB.
    pub radiance: [f32; 3],
    /// Which light; never a triangle.
    pub light: LightId,
}

/// The lights of a scene that rays can hit, except for triangles.
#[derive(Clone, Debug)]
pub struct Lights<'a> {
    list: &'a [Light],
    /// Indices of the shape lights.
    shape_lights: Vec<u32>,
    sky: Sky<'a>,
    /// What camera rays see in place of the environment.
    background: Option<[f32; 3]>,
}

impl<'a> Lights<'a> {
    /// The lights of `scene` and its [`environment_of`].
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let shape_lights = (0..).zip(&scene.lights).filter(|(_, light)| is_shape(light)).map(|(index, _)| index);
        Self {
            list: &scene.lights,
            shape_lights: shape_lights.collect(),
            sky: Sky::new(environment_of(scene)),
            background: scene.background,
        }
    }

    /// Mean radiance of the environment over all directions, linear RGB.
    #[must_use]
    pub fn ambient(&self) -> [f32; 3] {
        self.sky.mean
    }

    /// The light that a ray hits before `hit`, its closest triangle hit. Without a hit, the environment.
    #[must_use]
    pub fn intersect(&self, ray: &Ray, hit: Option<&Hit>) -> Option<LightHit> {
        if let Some((_, index, radiance)) = self.first_shape_light(ray, hit) {
            return Some(LightHit { radiance, light: LightId::Light(index) });
        }
        hit.is_none().then(|| LightHit { radiance: self.sky.radiance(ray.direction), light: LightId::Environment })
    }

    /// [`Lights::intersect`] for the `n`-th ray of a path: the camera ray, which is the first, sees [`Scene::background`].
    pub(crate) fn intersect_nth(&self, n: u32, ray: &Ray, hit: Option<&Hit>) -> Option<LightHit> {
        let light = self.intersect(ray, hit)?;
        let background = self.background.filter(|_| n == 0 && light.light == LightId::Environment);
        Some(background.map_or(light, |radiance| LightHit { radiance, ..light }))
    }

    /// Radiance of the environment from a direction of any length, linear RGB.
    #[must_use]
    pub fn radiance_from_afar(&self, direction: [f32; 3]) -> [f32; 3] {
        self.sky.radiance(direction)
    }

    /// Irradiance on a surface with this unit normal that nothing occludes, by the environment and the suns; linear RGB.
    #[must_use]
    pub fn irradiance_from_afar(&self, normal: [f32; 3]) -> [f32; 3] {
        let normal = wide(normal);
        let mut sum = self.sky.irradiance_on(normal);
        for light in self.list {
            if let Light::Sun { direction, irradiance } = light {
                let cosine = -normal.dot(wide(*direction).normalize_or_zero());
                sum += wide(*irradiance) * cosine.max(0.0);
            }
        }
        narrow(sum)
    }

    /// The shape light that a ray hits before `hit`: its `t`, and the unit normal on the side of the ray.
    pub(crate) fn shape_light_before(&self, ray: &Ray, hit: Option<&Hit>) -> Option<(f32, DVec3)> {
        let (t, index, _) = self.first_shape_light(ray, hit)?;
        let normal = ask(&self.list[index as usize], |kind| kind.shape()?.normal(ray.at(t.into()).into()))?;
        let side = if normal.dot(wide(ray.direction)) > 0.0 { -1.0 } else { 1.0 };
        Some((t, normal * side))
    }

    /// Whether a shadow ray towards `to` is unoccluded. The ray must end before the light.
    #[must_use]
    pub fn is_unoccluded(&self, ray: &Ray, to: LightId, bvh: &dyn Intersect, query: &mut dyn Query) -> bool {
        !self.occlude(ray, to) && !bvh.occluded_with(ray, query)
    }

    /// Whether a shape light other than `to` occludes a shadow ray towards `to`.
    pub(crate) fn occlude(&self, ray: &Ray, to: LightId) -> bool {
        let mut others = self.shape_lights.iter().filter(|&&index| to != LightId::Light(index));
        others.any(|&index| self.intersect_shape_light(index, ray).is_some())
    }

    /// The lights of the scene file.
    pub(crate) fn list(&self) -> &'a [Light] {
        self.list
    }

    /// Indices of those that have an area, and so are sampled with a point of the unit square.
    pub(crate) fn shapes(&self) -> &[u32] {
        &self.shape_lights
    }

    /// `t`, index and radiance of the first shape light before `hit`. On a tie, the lowest index.
    fn first_shape_light(&self, ray: &Ray, hit: Option<&Hit>) -> Option<(f32, u32, [f32; 3])> {
        let before = Ray { t_max: hit.map_or(ray.t_max, |hit| hit.t), ..*ray };
        let mut first: Option<(f32, u32, [f32; 3])> = None;
        for &index in &self.shape_lights {
            let Some((t, radiance)) = self.intersect_shape_light(index, &before) else { continue };
            if first.is_none_or(|(nearest, ..)| t < nearest) {
                first = Some((t, index, radiance));
            }
        }
        first
    }

    /// Where a ray hits a shape light within its closed interval, and the radiance there.
    fn intersect_shape_light(&self, index: u32, ray: &Ray) -> Option<(f32, [f32; 3])> {
        ask(&self.list[index as usize], |kind| kind.shape()?.hit(ray))
    }
}

/// The environment of `scene`.
///
/// If the file has no environment: black if the scene has lights or emitters, else white, so that a picture is never
/// black by default.
#[must_use]
pub fn environment_of(scene: &Scene) -> &Environment {
    const BLACK: &Environment = &Environment::Constant([0.0; 3]);
    const WHITE: &Environment = &Environment::Constant([1.0; 3]);
    let emits = scene.materials.iter().any(Material::is_emissive);
    match &scene.environment {
        Some(environment) => environment,
        None if emits || !scene.lights.is_empty() => BLACK,
        None => WHITE,
    }
}

/// Whether a scene has more than one light, counting emissive triangles and the environment.
pub(crate) fn has_multiple_lights(scene: &Scene) -> bool {
    let n_emitters = |instance: &Instance| {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let emits = |part: &Part| scene.materials[part.material.0 as usize].is_emissive();
        if mesh.parts.iter().any(emits) { mesh.triangles.len().min(2) } else { 0 }
    };
    let is_black = *environment_of(scene) == Environment::Constant([0.0; 3]);
    let others = scene.lights.len() + usize::from(!is_black);
    others > 1 || others + scene.instances.iter().map(n_emitters).sum::<usize>() > 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers of the kinds are those of `list.wgsl`, and each of its switches lists every kind once.
    #[test]
    fn kinds_are_those_of_the_shaders() {
        let (_, list) = canted_shaders::FILES.iter().find(|(name, _)| *name == "shared/light/list").unwrap();
        let (constants, functions) = list.split_once("struct ListLight").unwrap();
        let kinds = Light::KINDS.map(str::to_uppercase);
        let known: Vec<&str> = constants.lines().filter(|line| line.starts_with("const ")).collect();
        let of_kind = |(number, kind)| format!("const {kind}: u32 = {number}u;");
        assert_eq!(known, kinds.iter().enumerate().map(of_kind).collect::<Vec<_>>());
        let switches =
            functions.split("switch light.kind {").skip(1).map(|after| after.split_once("\n    }").unwrap().0);
        let mut n_switches = 0;
        for switch in switches {
            let cases = switch.lines().filter_map(|line| line.trim().strip_prefix("case ")?.split_once(':'));
            let mut listed: Vec<&str> =
                cases.flat_map(|(kinds, _)| kinds.split(", ")).filter(|kind| *kind != "default").collect();
            listed.sort_by_key(|listed| kinds.iter().position(|kind| kind == listed));
            assert_eq!(listed, kinds, "{switch}");
            n_switches += 1;
        }
        assert!(n_switches > 0);
    }
}
