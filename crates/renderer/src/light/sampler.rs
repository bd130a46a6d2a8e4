use std::f64::consts::PI;

use canted_film::srgb::luminance;
use canted_scene::{Light, Scene};
use canted_trace::Ray;

use super::bounds::Receiver;
use super::cluster::Cluster;
use super::disk::DiskLight;
use super::emitters::Emitters;
use super::environment::SkySampler;
use super::incoming::{IncomingLight, intensity_of, spread_of};
use super::lights::{LightId, Lights};
use super::sphere::SphereLight;
use super::tree::Tree;
use crate::sampling::cosine_hemisphere;
use crate::vector::{Vector, add, dot, narrow, scale, tangents, wide};
use crate::{Surface, Surfaces};

/// Light from one direction, chosen among all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector, world space.
    pub to_light: [f32; 3],
    /// Radiance over the density of its choice, linear RGB: times scattering and cosine it is a sample of the reflected
    /// light, if nothing stands between.
    pub radiance: [f32; 3],
    /// Density of `to_light` per steradian, the choice among lights included; 0 where `is_delta`. Very great at most, never infinite.
    pub density: f32,
    /// Whether the light has no extent, so that no other technique finds it.
    pub is_delta: bool,
    /// What must be clear for the light to arrive, see [`Lights::is_unoccluded`]; `None` where the light is too close for anything to
    /// stand between.
    pub shadow_ray: Option<Ray>,
    /// The light.
    pub source: LightId,
}

/// Chooses one light of a scene for a point, and knows how likely the choice was.
///
/// The environment and each sun are chosen with shares that are the same everywhere, all other lights together by a
/// tree that looks at where the point is. A share is the mean of an equal one and of one by power, so that a light that
/// an estimate takes for weak keeps some: power is the irradiance of the sun, π times the mean radiance of the
/// environment, and for lights with a place their power over the cross section of the scene's ball.
///
/// Unbiased for every light but what is no number or above all numbers, which is left out. Triangles of moving instances
/// are found by chance only: their density is 0.
pub struct LightSampler<'a> {
    lights: Lights<'a>,
    pub(super) emitters: Emitters<'a>,
    pub(super) tree: Option<Tree>,
    /// Number in the tree of each light of the list; emitters come first.
    pub(super) places: Vec<Option<u32>>,
    /// The list's index of each light of the tree that is no emitter.
    pub(super) placed: Vec<u32>,
    pub(super) sky: Option<SkySampler<'a>>,
    /// What is chosen first, with the shares.
    pub(super) shares: Vec<(Choice, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Choice {
    Tree,
    Environment,
    Sun(u32),
}

impl<'a> LightSampler<'a> {
    /// Prepares the choice among `lights` and the emitters of the same scene's `surfaces`.
    #[must_use]
    pub fn new(lights: Lights<'a>, surfaces: &'a Surfaces<'a>) -> Self {
        let (emitters, mut clusters) = Emitters::new(surfaces);
        let mut placed = Vec::new();
        let places = (0..)
            .zip(lights.list)
            .map(|(index, light)| {
                let cluster = Cluster::of_light(light)?;
                #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^32 lights")]
                let place = clusters.len() as u32;
                clusters.push(cluster);
                placed.push(index);
                Some(place)
            })
            .collect();
        let sky = lights.sky.image().and_then(SkySampler::new);
        let local = clusters[..emitters.len()].iter().map(|cluster| 2.0 * PI * cluster.intensity).sum::<f64>()
            + lights.list.iter().map(power_of).filter(|power| power.is_finite()).sum::<f64>();
        let far = if lights.sky.image().is_some() && sky.is_none() { 0.0 } else { luminance(wide(lights.sky.mean)) };
        let suns = (0..).zip(lights.list).filter_map(|(index, light)| match light {
            Light::Sun { irradiance, .. } => Some((Choice::Sun(index), luminance(wide(*irradiance)))),
            _ => None,
        });
        let near = if local > 0.0 { local / cross_section(surfaces.scene()) } else { 0.0 };
        let powers = [(Choice::Tree, near), (Choice::Environment, PI * far)];
        let shares = shares(powers.into_iter().chain(suns));
        Self { tree: Tree::new(&clusters), lights, emitters, places, placed, sky, shares }
    }

    /// The lights that are chosen from.
    #[must_use]
    pub fn lights(&self) -> &Lights<'a> {
        &self.lights
    }

    /// Whether the number that chooses matters: not where there is one light.
    pub(crate) fn has_choice(&self) -> bool {
        self.shares.len() > 1 || self.tree.as_ref().is_some_and(|tree| tree.leaves.len() > 1)
    }

    /// Light that would arrive at a surface, from a number in `[0, 1)` that chooses and a point of the unit square.
    ///
    /// Light from behind the triangle is looked for only where `transmits`. `None` where no light was found.
    #[must_use]
    pub fn sample(&self, from: &Surface, transmits: bool, choice: f32, square: [f32; 2]) -> Option<LightSample> {
        let (chosen, share, choice) = self.choose(choice.into())?;
        let (incoming, probability, source) = match chosen {
            Choice::Tree => {
                let (number, probability) = self.tree.as_ref()?.choose(&receiver(from, transmits), choice)?;
                let (incoming, source) = self.local(number, from, square)?;
                (incoming, share * probability, source)
            }
            Choice::Environment => (self.environment(from, square)?, share, LightId::Environment),
            Choice::Sun(index) => {
                let incoming = IncomingLight::of(&self.lights.list[index as usize], from, || square)?;
                (incoming, share, LightId::Light(index))
            }
        };
        Some(LightSample {
            to_light: narrow(incoming.to_light),
            radiance: narrow(scale(incoming.radiance, 1.0 / probability)),
            density: incoming.density.map_or(0.0, |density| finite(density * probability)),
            is_delta: incoming.density.is_none(),
            shadow_ray: incoming.shadow_ray,
            source,
        })
    }

    /// Density per steradian with which [`Self::sample`] finds a unit direction from `from` that meets `source`.
    #[must_use]
    pub fn density(&self, from: &Surface, transmits: bool, to_light: [f32; 3], source: LightId) -> f32 {
        let direction = wide(to_light);
        let (number, density) = match source {
            LightId::Environment => {
                return finite(self.share(Choice::Environment) * self.environment_density(from, direction));
            }
            LightId::Light(index) => {
                let density = match self.lights.list[index as usize] {
                    Light::Sphere { center, radius, .. } => SphereLight::new(center, radius).density(from.position),
                    Light::Disk { center, normal, radius, .. } => {
                        DiskLight::new(center, normal, radius).density(from.position, direction)
                    }
                    _ => return 0.0,
                };
                (self.places[index as usize], density)
            }
            LightId::Triangle(instance, primitive) => {
                let Some(number) = self.emitters.find(instance, primitive) else { return 0.0 };
                #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^32 lights")]
                let place = number as u32;
                (Some(place), self.emitters.density(number, from, direction))
            }
        };
        let (Some(tree), Some(number)) = (&self.tree, number) else { return 0.0 };
        finite(self.share(Choice::Tree) * tree.probability(number, &receiver(from, transmits)) * density)
    }

    /// Light of a number of the tree.
    fn local(&self, number: u32, from: &Surface, square: [f32; 2]) -> Option<(IncomingLight, LightId)> {
        let number = number as usize;
        if let Some(index) = number.checked_sub(self.emitters.len()) {
            let index = self.placed[index];
            let incoming = IncomingLight::of(&self.lights.list[index as usize], from, || square)?;
            return Some((incoming, LightId::Light(index)));
        }
        Some((self.emitters.sample(number, from, square)?, self.emitters.source(number)))
    }

    /// A constant environment is sampled by the cosine to the shading normal, a picture by its brightness.
    fn environment(&self, from: &Surface, square: [f32; 2]) -> Option<IncomingLight> {
        let (to_light, density) = match &self.sky {
            Some(sky) => sky.sample(square),
            None => {
                let [x, y, z] = cosine_hemisphere(square).map(f64::from);
                let [t, b] = tangents(from.shading_normal);
                (add(scale(t, x), add(scale(b, y), scale(from.shading_normal, z))), z / PI)
            }
        };
        let direction = narrow(to_light);
        let radiance = scale(wide(self.lights.sky.radiance(direction)), 1.0 / density);
        Some(IncomingLight { to_light, radiance, density: Some(density), shadow_ray: Some(from.spawn_ray(direction)) })
    }

    fn environment_density(&self, from: &Surface, direction: Vector) -> f64 {
        match &self.sky {
            Some(sky) => sky.density(direction),
            None => dot(from.shading_normal, direction).max(0.0) / PI,
        }
    }

    /// What is chosen first, its share, and the rest of the number.
    fn choose(&self, choice: f64) -> Option<(Choice, f64, f64)> {
        let (last, others) = self.shares.split_last()?;
        let mut rest = choice;
        for &(chosen, share) in others {
            if rest < share {
                return Some((chosen, share, rest / share));
            }
            rest -= share;
        }
        let &(chosen, share) = last;
        Some((chosen, share, (rest / share).clamp(0.0, 1.0 - f64::EPSILON)))
    }

    pub(super) fn share(&self, choice: Choice) -> f64 {
        self.shares.iter().find(|(known, _)| *known == choice).map_or(0.0, |&(_, share)| share)
    }
}

/// The mean of equal shares and shares by power, of what has any.
fn shares(powers: impl Iterator<Item = (Choice, f64)>) -> Vec<(Choice, f64)> {
    let powers: Vec<(Choice, f64)> = powers.filter(|(_, power)| *power > 0.0 && power.is_finite()).collect();
    let sum: f64 = powers.iter().map(|(_, power)| power).sum();
    #[expect(clippy::cast_precision_loss, reason = "few")]
    let equal = 1.0 / powers.len() as f64;
    powers.into_iter().map(|(choice, power)| (choice, 0.5 * (equal + power / sum))).collect()
}

/// Watts by luminance of a light that has a place; 0 for a sun.
fn power_of(light: &Light) -> f64 {
    intensity_of(light).map_or(0.0, |intensity| intensity * spread_of(light))
}

/// Area of a disc as wide as the scene's bounds, which visits every vertex; 1 where they have no extent.
fn cross_section(scene: &Scene) -> f64 {
    let squared: f64 = scene.bounds_world().extent().iter().map(|x| x * x).sum();
    let area = 0.25 * PI * squared;
    if area > 0.0 && area.is_finite() { area } else { 1.0 }
}

fn receiver(from: &Surface, transmits: bool) -> Receiver {
    Receiver { position: from.position, normal: (!transmits).then_some(from.normal) }
}

/// A density that `f32` can hold.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn finite(density: f64) -> f32 {
    density.min(f32::MAX.into()) as f32
}

#[cfg(test)]
mod tests {
    use canted_obb::Affine;
    use canted_scene::{Instance, Material, MaterialId, Mesh, MeshId, Part};

    use super::super::lights::has_multiple_lights;
    use super::*;

    /// A triangle in this light; it emits by itself where `emission` is not black.
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

    /// What is said to be left out of one light is left out: no number chooses it, and its probability is 1.
    #[test]
    fn one_light_is_not_chosen() {
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
            assert!(chooses || sampler.shares[0].1 == 1.0, "{what}");
        }
    }
}
