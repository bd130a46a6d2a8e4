use std::collections::HashMap;

use canted_film::srgb::{self, luminance};
use canted_obb::PrimId;
use canted_scene::{Encoding, Light, Material, Scene, Texture, TextureRef};
use canted_trace::{Hit, InstanceId, Side};

use super::cluster::Cluster;
use super::cone::Cone;
use super::incoming::{IncomingLight, intensity_of};
use super::lights::LightId;
use super::triangle::TriangleLight;
use crate::vector::{Vector, add, narrow, scale, unit, wide};
use crate::{Surface, Surfaces};

/// An emissive triangle that does not move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emitter {
    pub(super) instance: InstanceId,
    pub(super) primitive: PrimId,
    /// World space.
    pub(super) corners: [[f32; 3]; 3],
}

/// All emissive triangles that do not move while the shutter is open, ordered by instance and primitive.
///
/// Triangles of moving instances and deforming meshes are not sampled, because their position depends on the time of the ray. Only BSDF
/// sampling finds them.
pub(super) struct Emitters<'a> {
    surfaces: &'a Surfaces<'a>,
    pub(super) list: Vec<Emitter>,
}

impl<'a> Emitters<'a> {
    /// The emitters, and the light bounds of each.
    pub(super) fn new(surfaces: &'a Surfaces<'a>) -> (Self, Vec<Cluster>) {
        let scene = surfaces.scene();
        let radiances = mean_radiances(scene);
        let (mut list, mut clusters) = (Vec::new(), Vec::new());
        for (number, instance) in (0..).map(InstanceId).zip(&scene.instances) {
            let mesh = &scene.meshes[instance.mesh.0 as usize];
            let moves = instance.world_from_object_close.is_some_and(|close| close != instance.world_from_object);
            if moves || mesh.close.is_some() {
                continue;
            }
            for (i, part) in mesh.parts.iter().enumerate() {
                let radiance = radiances[part.material.0 as usize];
                if !(radiance > 0.0 && radiance.is_finite()) {
                    continue;
                }
                let start = part.first_triangle as usize;
                let end = mesh.parts.get(i + 1).map_or(mesh.triangles.len(), |next| next.first_triangle as usize);
                for (primitive, triangle) in (part.first_triangle..).map(PrimId).zip(&mesh.triangles[start..end]) {
                    let corner = |i: u32| instance.world_from_object.point(mesh.positions[i as usize]);
                    let corners = triangle.map(corner);
                    let Some(triangle_light) = TriangleLight::new(corners) else { continue };
                    list.push(Emitter { instance: number, primitive, corners });
                    clusters.push(Cluster::of_points(
                        corners.map(wide),
                        Cone::about(triangle_light.normal, true),
                        triangle_light.area * radiance,
                    ));
                }
            }
        }
        (Self { surfaces, list }, clusters)
    }

    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    pub(super) fn id(&self, number: usize) -> LightId {
        LightId::Triangle(self.list[number].instance, self.list[number].primitive)
    }

    /// Index of the emitter that was hit; `None` if it moves, has no area or is black.
    pub(super) fn find(&self, instance: InstanceId, primitive: PrimId) -> Option<usize> {
        self.list.binary_search_by_key(&(instance, primitive), |emitter| (emitter.instance, emitter.primitive)).ok()
    }

    /// Samples a point of an emitter; `None` if that point is black or transparent.
    pub(super) fn sample(&self, number: usize, from: &Surface, square: [f32; 2]) -> Option<IncomingLight> {
        let Emitter { instance, primitive, corners } = self.list[number];
        let triangle_light = TriangleLight::new(corners)?;
        let ([u, v], density) = triangle_light.sample(from.position, square)?;
        let target = triangle_light.point([u, v]);
        let to_light = unit(std::array::from_fn(|k| target[k] - from.position[k]))?;
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
        let hit = Hit { t: 1.0, u: u as f32, v: v as f32, primitive, instance, side: Side::Front };
        let radiance = self.radiance(&hit, narrow(to_light))?;
        // The ray ends at the offset of rays that leave the emitter, so that rounding never puts its end behind the
        // emitter.
        let normal = triangle_light.normal_towards(from.position);
        let off = add(target, scale(normal, self.surfaces.offset(instance, normal)));
        Some(IncomingLight {
            to_light,
            radiance: scale(radiance, 1.0 / density),
            density: Some(density),
            shadow_ray: from.spawn_ray_to(narrow(off)),
        })
    }

    /// PDF per steradian of [`Self::sample`] for a unit direction that hits the emitter.
    pub(super) fn density(&self, number: usize, from: &Surface, direction: Vector) -> f64 {
        TriangleLight::new(self.list[number].corners)
            .map_or(0.0, |triangle_light| triangle_light.density(from.position, direction))
    }

    pub(super) fn material(&self, instance: InstanceId, primitive: PrimId) -> &'a Material {
        let scene = self.surfaces.scene();
        let mesh = &scene.meshes[scene.instances[instance.0 as usize].mesh.0 as usize];
        &scene.materials[mesh.material_of(primitive.0).0 as usize]
    }

    fn radiance(&self, hit: &Hit, direction: [f32; 3]) -> Option<Vector> {
        let material = self.material(hit.instance, hit.primitive);
        // With stochastic alpha, light sampling must carry the fraction of rays that would hit the surface.
        let presence = if material.uses_alpha() { self.surfaces.presence(hit) } else { 1.0 };
        let radiance = match material.emission_texture {
            None => material.emission,
            Some(_) => self.surfaces.at(hit, direction).emission,
        };
        (presence > 0.0 && radiance.iter().any(|&x| x > 0.0)).then(|| scale(wide(radiance), presence.into()))
    }
}

impl Cluster {
    fn of_points<const N: usize>(points: [Vector; N], cone: Cone, intensity: f64) -> Self {
        let fold = |f: fn(f64, f64) -> f64, start: f64| {
            std::array::from_fn(|k| points.iter().map(|point| point[k]).fold(start, f))
        };
        Self { min: fold(f64::min, f64::INFINITY), max: fold(f64::max, f64::NEG_INFINITY), cone, intensity }
    }

    /// The bounds of a light of the scene file that has a position and is not black.
    pub(super) fn of_light(light: &Light) -> Option<Self> {
        let intensity = intensity_of(light).filter(|&x| x > 0.0 && x.is_finite())?;
        let (center, half, cone) = match *light {
            Light::Sun { .. } => return None,
            Light::Point { position, .. } => (position, [0.0; 3], Cone::ALL),
            Light::Spot { position, direction, cos_outer, .. } => {
                let cone = Cone {
                    emission_rad: f64::from(cos_outer).clamp(-1.0, 1.0).acos(),
                    ..Cone::about(wide(direction), false)
                };
                // Beyond 90 degrees the cosine in the importance would be negative.
                (position, [0.0; 3], if cos_outer > 0.0 { cone } else { Cone::ALL })
            }
            Light::Sphere { center, radius, .. } => (center, [f64::from(radius); 3], Cone::ALL),
            Light::Disk { center, normal, radius, .. } => {
                // The extent of a disk along an axis is its radius times the sine between the axis and its normal.
                let half = wide(normal).map(|n| f64::from(radius) * ((1.0 - n) * (1.0 + n)).max(0.0).sqrt());
                (center, half, Cone::about(wide(normal), false))
            }
        };
        let center = wide(center);
        let corner = |sign: f64| add(center, scale(half, sign));
        Some(Self::of_points([corner(-1.0), corner(1.0)], cone, intensity))
    }
}

/// Mean luminance of each material's emission over its texture.
fn mean_radiances(scene: &Scene) -> Vec<f64> {
    // Many materials may share one large texture.
    let mut means = HashMap::new();
    let mut mean_radiance = |material: &Material| {
        let tint = material.emission_texture.as_ref().map_or([1.0; 3], |TextureRef { texture, .. }| {
            *means.entry(*texture).or_insert_with(|| mean_texel(&scene.textures[texture.0 as usize]))
        });
        let emission = wide(material.emission);
        luminance(std::array::from_fn(|k| emission[k] * tint[k]))
    };
    scene.materials.iter().map(|material| if material.is_emissive() { mean_radiance(material) } else { 0.0 }).collect()
}

/// Mean of all texels, linear RGB; white for a texture without texels.
fn mean_texel(texture: &Texture) -> Vector {
    let mut counts = [[0_u32; 256]; 3];
    for texel in &texture.texels {
        for (counts, byte) in counts.iter_mut().zip(texel) {
            counts[usize::from(*byte)] += 1;
        }
    }
    let value = |byte: u8| match texture.encoding {
        Encoding::Srgb => f64::from(srgb::decode(byte)),
        Encoding::Linear => f64::from(byte) / 255.0,
    };
    counts.map(|counts| {
        let sum: f64 = (0..=255).zip(counts).map(|(byte, n)| value(byte) * f64::from(n)).sum();
        let n: f64 = counts.into_iter().map(f64::from).sum();
        if n > 0.0 { sum / n } else { 1.0 }
    })
}
