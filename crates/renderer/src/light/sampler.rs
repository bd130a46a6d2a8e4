use std::f64::consts::PI;

use canted_scene::Scene;
use canted_trace::Ray;
use glam::DVec3;

use super::environment::{Sky, SkySampler};
use super::tree::{Receiver, Tree};
use super::triangle::Emitters;
use super::{IncomingLight, LightId, Lights, Place, ask};
use crate::{Surface, Surfaces, narrow, wide};

/// A sample of the incoming light at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector, world space.
    pub to_light: [f32; 3],
    /// Radiance over the probability of the choice of the light and over its own PDF, linear RGB. Times BSDF and cosine
    /// it is a sample of the reflected radiance, if the shadow ray is unoccluded.
    pub radiance: [f32; 3],
    /// PDF of `to_light` per steradian, including the choice of the light; 0 if `is_delta`. Always finite.
    pub density: f32,
    /// Whether this is a delta light, which BSDF sampling never finds.
    pub is_delta: bool,
    /// The ray to test with [`Lights::is_unoccluded`]; `None` if the light is too close for an occluder.
    pub shadow_ray: Option<Ray>,
    /// The light.
    pub light: LightId,
}

/// Samples one light of a scene for a point, and evaluates the PDF.
///
/// First it chooses between the environment, each sun and all other lights, with probabilities that do not depend on
/// the point. Among the other lights, a light tree chooses by importance at the point. The fixed probabilities are the
/// mean of a uniform distribution and one by power, so that an underestimated light is still sampled. Power is the
/// irradiance of a sun, π times the mean radiance of the environment, and for local lights their power over the cross
/// section of the scene's bounding sphere.
///
/// The estimate is unbiased for every light with finite radiance; others are ignored. Triangles of moving instances are
/// found by BSDF sampling only: their PDF is 0.
pub struct LightSampler<'a> {
    lights: Lights<'a>,
    pub(crate) emitters: Emitters<'a>,
    pub(crate) tree: Option<Tree>,
    /// Number in the tree of each light of the scene file; emitters come first.
    pub(crate) tree_lights: Vec<Option<u32>>,
    /// Index in the scene file of each light of the tree that is no emitter.
    pub(crate) listed: Vec<u32>,
    pub(crate) sky: Option<SkySampler<'a>>,
    /// The first choice, with probabilities.
    pub(crate) kinds: Vec<(Choice, f64)>,
}

/// What is chosen first: one of the lights of the tree, the environment, or a light without a position, by its index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Choice {
    Tree,
    Environment,
    Sun(u32),
}

impl<'a> LightSampler<'a> {
    /// Prepares sampling of `lights` and of the emissive `surfaces` of the same scene.
    #[must_use]
    pub fn new(lights: Lights<'a>, surfaces: &'a Surfaces<'a>) -> Self {
        let (emitters, mut clusters) = Emitters::new(surfaces);
        let of_emitters = clusters.iter().map(|cluster| 2.0 * PI * cluster.intensity).sum::<f64>();
        let (mut of_list, mut suns) = (0.0, Vec::new());
        let (mut listed, mut tree_lights) = (Vec::new(), Vec::new());
        for (index, light) in (0..).zip(lights.list) {
            let cluster = match ask(light, |kind| kind.place()) {
                Place::Infinite(irradiance) => {
                    suns.push((Choice::Sun(index), irradiance));
                    None
                }
                Place::Local(power, cluster) => {
                    of_list += if power.is_finite() { power } else { 0.0 };
                    cluster
                }
            };
            tree_lights.push(cluster.is_some().then_some(clusters.len() as u32));
            listed.extend(cluster.is_some().then_some(index));
            clusters.extend(cluster);
        }
        let sky = lights.sky.image().and_then(SkySampler::new);
        let local = of_emitters + of_list;
        let local_irradiance = if local > 0.0 { local / cross_section(surfaces.scene()) } else { 0.0 };
        let powers = [(Choice::Tree, local_irradiance), (Choice::Environment, lights.sky.irradiance(sky.as_ref()))];
        let kinds = kind_probabilities(powers.into_iter().chain(suns));
        Self { tree: Tree::new(&clusters), lights, emitters, tree_lights, listed, sky, kinds }
    }

    /// The lights that are sampled.
    #[must_use]
    pub fn lights(&self) -> &Lights<'a> {
        &self.lights
    }

    /// Whether there is more than one light, so that `choice` has an effect.
    pub(crate) fn has_choice(&self) -> bool {
        self.kinds.len() > 1 || self.tree.as_ref().is_some_and(|tree| tree.leaves.len() > 1)
    }

    /// Samples a light, from a number `choice` in `[0, 1)` and a point of the unit square.
    ///
    /// Light from behind the triangle is sampled only if `transmits`. `None` if there is no light.
    #[inline]
    #[must_use]
    pub fn sample(&self, from: &Surface, transmits: bool, choice: f32, square: [f32; 2]) -> Option<LightSample> {
        let (kind, kind_probability, choice) = self.choose(choice.into())?;
        let (incoming, probability, light) = match kind {
            Choice::Tree => {
                let (number, probability) =
                    self.tree.as_ref()?.choose(&LitPoint::of(from, transmits).receiver, choice)?;
                let (incoming, light) = self.local(number, from, square)?;
                (incoming, kind_probability * probability, light)
            }
            Choice::Environment => {
                (self.lights.sky.sample(self.sky.as_ref(), from, square)?, kind_probability, LightId::Environment)
            }
            Choice::Sun(index) => {
                let incoming = IncomingLight::of(&self.lights.list[index as usize], from, || square)?;
                (incoming, kind_probability, LightId::Light(index))
            }
        };
        Some(LightSample {
            to_light: narrow(incoming.to_light),
            radiance: narrow(incoming.radiance * (1.0 / probability)),
            density: incoming.density.map_or(0.0, |density| finite(density * probability)),
            is_delta: incoming.density.is_none(),
            shadow_ray: incoming.shadow_ray,
            light,
        })
    }

    /// PDF per steradian of [`Self::sample`] for a unit direction from `from` that hits `light`.
    #[must_use]
    pub fn density(&self, from: &Surface, transmits: bool, to_light: [f32; 3], light: LightId) -> f32 {
        self.density_at(&LitPoint::of(from, transmits), to_light, light)
    }

    /// [`Self::density`] at a point.
    pub(crate) fn density_at(&self, from: &LitPoint, to_light: [f32; 3], light: LightId) -> f32 {
        let LitPoint { receiver, shading_normal } = from;
        let direction = wide(to_light);
        let (number, density) = match light {
            LightId::Environment => {
                let density = Sky::density(self.sky.as_ref(), *shading_normal, direction);
                return finite(self.kind_probability(Choice::Environment) * density);
            }
            LightId::Light(index) => {
                let density = ask(&self.lights.list[index as usize], |kind| {
                    kind.shape().map_or(0.0, |shape| shape.density(receiver.position, direction))
                });
                (self.tree_lights[index as usize], density)
            }
            LightId::Triangle(instance, primitive) => {
                let Some(emitter) = self.emitters.find(instance, primitive) else { return 0.0 };
                let number = emitter as u32;
                (Some(number), self.emitters.density(emitter, receiver.position, direction))
            }
        };
        let (Some(tree), Some(number)) = (&self.tree, number) else { return 0.0 };
        finite(self.kind_probability(Choice::Tree) * tree.probability(number, receiver) * density)
    }

    /// Samples a light of the tree.
    fn local(&self, number: u32, from: &Surface, square: [f32; 2]) -> Option<(IncomingLight, LightId)> {
        let number = number as usize;
        if let Some(index) = number.checked_sub(self.emitters.len()) {
            let index = self.listed[index];
            let incoming = IncomingLight::of(&self.lights.list[index as usize], from, || square)?;
            return Some((incoming, LightId::Light(index)));
        }
        Some((self.emitters.sample(number, from, square)?, self.emitters.id(number)))
    }

    /// The first choice, its probability, and the remapped random number.
    fn choose(&self, choice: f64) -> Option<(Choice, f64, f64)> {
        let (last, others) = self.kinds.split_last()?;
        let mut rest = choice;
        for &(kind, kind_probability) in others {
            if rest < kind_probability {
                return Some((kind, kind_probability, rest / kind_probability));
            }
            rest -= kind_probability;
        }
        let &(kind, kind_probability) = last;
        Some((kind, kind_probability, (rest / kind_probability).clamp(0.0, 1.0 - f64::EPSILON)))
    }

    pub(crate) fn kind_probability(&self, choice: Choice) -> f64 {
        self.kinds.iter().find(|(kind, _)| *kind == choice).map_or(0.0, |&(_, kind_probability)| kind_probability)
    }
}

/// The mean of a uniform distribution and one by power, over the lights that have power.
fn kind_probabilities(powers: impl Iterator<Item = (Choice, f64)>) -> Vec<(Choice, f64)> {
    let powers: Vec<(Choice, f64)> = powers.filter(|(_, power)| *power > 0.0 && power.is_finite()).collect();
    let sum: f64 = powers.iter().map(|(_, power)| power).sum();
    let equal = 1.0 / powers.len() as f64;
    powers.into_iter().map(|(choice, power)| (choice, 0.5 * (equal + power / sum))).collect()
}

/// Area of a great circle of the scene's bounding sphere; 1 for a scene without extent. Visits every vertex.
fn cross_section(scene: &Scene) -> f64 {
    let squared: f64 = scene.bounds_world().extent().iter().map(|x| x * x).sum();
    let area = 0.25 * PI * squared;
    if area > 0.0 && area.is_finite() { area } else { 1.0 }
}

/// A point that receives light: what the PDF of a direction depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LitPoint {
    receiver: Receiver,
    shading_normal: DVec3,
}

impl LitPoint {
    /// Of a surface; `transmits` as for [`LightSampler::sample`].
    pub(crate) fn of(surface: &Surface, transmits: bool) -> Self {
        let receiver =
            Receiver { position: surface.position.into(), normal: (!transmits).then(|| surface.horizon().into()) };
        Self { receiver, shading_normal: surface.shading_normal.into() }
    }
}

/// Clamps a PDF to the range of `f32`.
fn finite(density: f64) -> f32 {
    density.min(f32::MAX.into()) as f32
}

#[cfg(test)]
mod tests {
    use canted_obb::Affine;
    use canted_scene::{Instance, Light, Material, MaterialId, Mesh, MeshId, Part};

    use super::super::has_multiple_lights;
    use super::*;

    /// A scene of one triangle; it is an emitter unless `emission` is black.
    fn lit(lights: &[Light], environment: [f32; 3], emission: [f32; 3]) -> Scene {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
        Scene {
            meshes: vec![Mesh { positions, triangles: vec![[0, 1, 2]], parts, ..Mesh::default() }],
            instances: vec![Instance {
                mesh: MeshId(0),
                world_from_object: Affine::IDENTITY,
                world_from_object_close: None,
                first_primitive: 0,
            }],
            materials: vec![Material { emission, ..Material::default() }],
            lights: lights.to_vec(),
            environment: Some(environment.into()),
            ..Scene::default()
        }
    }

    /// With one light, there is no choice and its probability is 1.
    #[test]
    fn single_light_has_probability_one() {
        let sun = Light::Sun { direction: [0.0, 0.0, -1.0], irradiance: [1.0; 3] };
        let point = Light::Point { position: [0.25, 0.25, 3.0], intensity: [1.0; 3] };
        let [black, white] = [[0.0; 3], [1.0; 3]];
        for (lights, environment, emission, chooses) in [
            (&[][..], white, black, false),
            (&[sun], black, black, false),
            (&[point], black, black, false),
            (&[], black, white, false),
            (&[point], white, black, true),
            (&[point], black, white, true),
            (&[point, point], black, black, true),
            (&[sun, sun], black, black, true),
        ] {
            let scene = lit(lights, environment, emission);
            let surfaces = Surfaces::new(&scene);
            let sampler = LightSampler::new(Lights::new(&scene), &surfaces);
            let what = format!("{lights:?} {environment:?} {emission:?}");
            assert_eq!((sampler.has_choice(), has_multiple_lights(&scene)), (chooses, chooses), "{what}");
            assert!(chooses || sampler.kinds[0].1 == 1.0, "{what}");
        }
    }
}
