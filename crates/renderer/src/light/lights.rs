use canted_obb::PrimId;
use canted_scene::{Environment, Instance, Light, Material, Part, Scene};
use canted_trace::{Hit, InstanceId, Query, Ray};

use super::disk::DiskLight;
use super::environment::Sky;
use super::sphere::SphereLight;
use crate::Tracer;
use crate::vector::{Vector, dot, scale, sub, unit, wide};

/// What light came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightId {
    /// From infinitely far away.
    Environment,
    /// A light of [`Scene::lights`], by its index.
    Light(u32),
    /// A triangle that emits.
    Triangle(InstanceId, PrimId),
}

impl LightId {
    /// The triangle that a ray hit.
    #[must_use]
    pub fn of_hit(hit: &Hit) -> Self {
        Self::Triangle(hit.instance, hit.primitive)
    }
}

/// Light that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Linear RGB.
    pub radiance: [f32; 3],
    /// Where from; never a triangle.
    pub source: LightId,
}

/// The lights of a scene as rays meet them, triangles aside.
#[derive(Clone, Debug)]
pub struct Lights<'a> {
    pub(super) list: &'a [Light],
    /// Those of the list that have a surface.
    bodies: Vec<u32>,
    pub(super) sky: Sky<'a>,
}

impl<'a> Lights<'a> {
    /// The lights of `scene` and the environment that a picture of it uses.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let is_body = |light: &Light| matches!(light, Light::Sphere { .. } | Light::Disk { .. });
        let bodies = (0..).zip(&scene.lights).filter(|(_, light)| is_body(light)).map(|(index, _)| index).collect();
        Self { list: &scene.lights, bodies, sky: Sky::new(environment_of(scene)) }
    }

    /// Mean radiance of the environment over all directions, linear RGB.
    #[must_use]
    pub fn ambient(&self) -> [f32; 3] {
        self.sky.mean
    }

    /// What a ray meets before `hit`, its first among the triangles, or where that is `None`, behind everything.
    #[must_use]
    pub fn intersect(&self, ray: &Ray, hit: Option<&Hit>) -> Option<LightHit> {
        if let Some((_, index, radiance)) = self.first_shape_light(ray, hit) {
            return Some(LightHit { radiance, source: LightId::Light(index) });
        }
        hit.is_none().then(|| LightHit { radiance: self.sky.radiance(ray.direction), source: LightId::Environment })
    }

    /// The ball or disc that a ray meets before `hit`: where, as its `t`, and its unit normal on the ray's side.
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

    /// Whether nothing stands along a shadow ray to a light, which ends before it.
    #[must_use]
    pub fn is_unoccluded<T: Tracer, Q: Query>(&self, ray: &Ray, to: LightId, tracer: &T, query: &mut Q) -> bool {
        let others = self.bodies.iter().filter(|&&index| to != LightId::Light(index));
        others.clone().all(|&index| self.body(index, ray).is_none()) && !tracer.occluded(ray, query)
    }

    /// The lights of the list.
    pub(crate) fn list(&self) -> &'a [Light] {
        self.list
    }

    /// `t`, index and radiance of the first body before `hit`; of equals the one that comes first in the list.
    fn first_shape_light(&self, ray: &Ray, hit: Option<&Hit>) -> Option<(f32, u32, [f32; 3])> {
        let before = Ray { t_max: hit.map_or(ray.t_max, |hit| hit.t), ..*ray };
        let mut first: Option<(f32, u32, [f32; 3])> = None;
        for &index in &self.bodies {
            let Some((t, radiance)) = self.body(index, &before) else { continue };
            if first.is_none_or(|(nearest, ..)| t < nearest) {
                first = Some((t, index, radiance));
            }
        }
        first
    }

    /// Where a ray meets a body of the list, within its closed interval, and the radiance from there.
    fn body(&self, index: u32, ray: &Ray) -> Option<(f32, [f32; 3])> {
        let (found, radiance) = match self.list[index as usize] {
            Light::Sphere { center, radius, radiance } => (SphereLight::new(center, radius).hit(ray), radiance),
            Light::Disk { center, normal, radius, radiance } => {
                (DiskLight::new(center, normal, radius).hit(ray), radiance)
            }
            _ => return None,
        };
        found.map(|(t, shines)| (t, if shines { radiance } else { [0.0; 3] }))
    }
}

/// Radiance from outside that a picture of `scene` uses.
///
/// What the file says; else none where the file has lights or emitters of its own, and white where it has neither,
/// so that no picture is black for want of light.
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

/// Whether a scene has more than one light, a triangle that emits and an environment counted as such.
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
