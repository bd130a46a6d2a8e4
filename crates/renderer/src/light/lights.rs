use canted_obb::PrimId;
use canted_scene::{Environment, Instance, Light, Material, Part, Scene};
use canted_trace::{Hit, InstanceId, Query, Ray};

use super::disk::DiskLight;
use super::environment::Sky;
use super::sphere::SphereLight;
use crate::Tracer;
use crate::vector::{Vector, dot, scale, sub, unit, wide};

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
    pub(super) list: &'a [Light],
    /// Indices of the sphere and disk lights.
    shape_lights: Vec<u32>,
    pub(super) sky: Sky<'a>,
}

impl<'a> Lights<'a> {
    /// The lights of `scene` and its [`environment_of`].
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let has_shape = |light: &Light| matches!(light, Light::Sphere { .. } | Light::Disk { .. });
        let shape_lights =
            (0..).zip(&scene.lights).filter(|(_, light)| has_shape(light)).map(|(index, _)| index).collect();
        Self { list: &scene.lights, shape_lights, sky: Sky::new(environment_of(scene)) }
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

    /// The sphere or disk light that a ray hits before `hit`: its `t`, and the unit normal on the side of the ray.
    pub(crate) fn shape_light_before(&self, ray: &Ray, hit: Option<&Hit>) -> Option<(f32, Vector)> {
        let (t, index, _) = self.first_shape_light(ray, hit)?;
        let normal = match self.list[index as usize] {
            Light::Sphere { center, .. } => unit(sub(ray.at(t.into()), wide(center)))?,
            Light::Disk { normal, .. } => wide(normal),
            _ => return None,
        };
        let side = if dot(normal, wide(ray.direction)) > 0.0 { -1.0 } else { 1.0 };
        Some((t, scale(normal, side)))
    }

    /// Whether a shadow ray towards `to` is unoccluded. The ray must end before the light.
    #[must_use]
    pub fn is_unoccluded<T: Tracer, Q: Query>(&self, ray: &Ray, to: LightId, tracer: &T, query: &mut Q) -> bool {
        let others = self.shape_lights.iter().filter(|&&index| to != LightId::Light(index));
        others.clone().all(|&index| self.intersect_shape_light(index, ray).is_none()) && !tracer.occluded(ray, query)
    }

    /// The lights of the scene file.
    pub(crate) fn list(&self) -> &'a [Light] {
        self.list
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
        let (crossing, radiance) = match self.list[index as usize] {
            Light::Sphere { center, radius, radiance } => (SphereLight::new(center, radius).hit(ray), radiance),
            Light::Disk { center, normal, radius, radiance } => {
                (DiskLight::new(center, normal, radius).hit(ray), radiance)
            }
            _ => return None,
        };
        crossing.map(|(t, is_front)| (t, if is_front { radiance } else { [0.0; 3] }))
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
