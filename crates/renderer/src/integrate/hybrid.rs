//! The hybrid integrator of Sabino 2020, section 3.7.7: direct lighting, diffuse bounces, ambient occlusion.
//!
//! A path has vertices `0..=bounces`. Each vertex adds, weighted by the path's throughput,
//!
//! ```text
//! emission                                         emissive triangles are not sampled
//! + direct lighting                                one shadow ray to each light of the scene file
//! + environment · albedo        on a miss          ends the path
//! + ambient · albedo · (1 - exp(-t/r))             at the last vertex, whose ray hits at distance t
//! ```
//!
//! One cosine-sampled ray per vertex, with weight `albedo`, or a uniformly sampled one with `2·cosθ·albedo`, serves the last three terms: it returns the environment,
//! the next vertex, or at the last vertex the ambient occlusion. If it hits a sphere or disk light the path ends with
//! zero, because the shadow ray accounts for that light; camera rays see it directly.
//!
//! `environment` is the radiance along the ray, so an environment map with a sun is noisy here. `ambient` is its mean
//! over all directions and approximates indirect light of unknown direction.
//!
//! # Light at the first surface
//!
//! `diffuse` and `ambient` are what the first vertex adds if nothing stands between it and the light, and the factors of what arrives are
//! quotients of sums. So `diffuse · shadow` is its direct lighting. Of the ray that leaves it, `ambient` is the environment in the direction of the
//! ray, and what arrives is that on a miss, and nothing on a hit. Where that ray is the last, a hit brings `ambient · (1 - exp(-t/r))`, which
//! stands in for the environment: there both take the mean of the environment, without and with the factor of the distance, so that no factor
//! exceeds 1. So
//!
//! ```text
//! diffuse · shadow + ambient · occlusion + emission found by the ray = direct               with bounces
//!                                                                    = direct + indirect    without
//! ```
//!
//! # Departures from the source
//!
//! The source adds the environment on a miss and again as ambient times occlusion; here each ray adds it once. Its
//! occlusion `exp(-t)` is inverted, has no unit and is applied one vertex late; here it is `1 - exp(-t/r)` of the ray
//! that leaves the vertex, with `t` in world units. Direct lighting includes `1/π` and `1/r²`. Directions are sampled
//! and shaded about one normal and kept outside the triangle.
//!
//! # Bias
//!
//! Light of more than `bounces` bounces is missing. The ambient term approximates it and is not physical: it passes
//! through occluders beyond about `r`. With infinite `r` it is off, and the integrator is a plain path tracer with
//! truncated paths, which is too dark.
//!
//! The ambient term does not add energy: without lights and emission, with environment 1 and albedo at most 1, no
//! sample exceeds 1. Proof by induction from the end of the path: the ray of the last vertex returns 1 or
//! `1 - exp(-t/r) <= 1`; any earlier ray returns 1 on a miss, else the next vertex's albedo times at most 1.

use std::f64::consts::PI;

use canted_trace::{Hit, Ray};
use glam::{DVec3, Vec3};

use super::{INDIRECT, Path, PathRadiance, Sample, Seen, ShadowRays, Transport};
use crate::light::{IncomingLight, LightId, Lights};
use crate::sampler::Drawn;
use crate::sampling::Basis;
use crate::times::Times;
use crate::{Surface, narrow, wide};

/// Sampler dimensions: the position in the pixel first, then one per bounce.
const FIRST_BOUNCE: u32 = 1;

/// Dimensions beyond all bounces, one per vertex and light.
const FIRST_LIGHT: u32 = 1 << 16;

impl Transport<'_> {
    /// Samples of the hybrid integrator; see [`Transport::samples`].
    pub(super) fn hybrid_samples(&self, seen: Seen, ao_radius: f64, times: &mut Times) -> Vec<Sample> {
        self.batch(
            seen,
            times,
            |n| {
                let of_lights = self.lights.shapes().iter().map(|&light| self.light_dimension(n, light));
                [std::iter::once(FIRST_BOUNCE + n).chain(of_lights).collect(), vec![]]
            },
            |path: &mut Path<()>, n, numbers, shadow_rays| self.hybrid_step(numbers, path, n, shadow_rays, ao_radius),
        )
    }

    /// Shades the `n`-th vertex of a path; returns whether there is a next ray.
    fn hybrid_step(
        &self,
        numbers: Drawn,
        path: &mut Path<()>,
        n: u32,
        shadow_rays: &mut ShadowRays,
        ao_radius: f64,
    ) -> bool {
        let Path { ray, cone, hit, first, accumulated, direct, .. } = path;
        let hit = match (self.lights.intersect_nth(n, ray, hit.as_ref()), &*hit) {
            (None, Some(hit)) => hit,
            (light, _) => {
                let is_sky = light.is_some_and(|light| light.light == LightId::Environment);
                self.add_ambient(n, ray, accumulated, is_sky);
                let visible = light.filter(|light| n == 0 || light.light == LightId::Environment);
                accumulated.add(n, visible.map_or([0.0; 3], |light| light.radiance), 1.0);
                return false;
            }
        };
        // The ray of the last vertex.
        if n > self.bounces {
            let passes = unoccluded(ray, hit, ao_radius);
            if let Some([.., ambient, arriving]) = accumulated.first.as_mut().filter(|_| n == 1) {
                let mean = accumulated.throughput * Vec3::from(self.lights.ambient());
                (*ambient, *arriving) = (mean, mean * passes);
            }
            // It stands for light of further bounces.
            accumulated.add(INDIRECT, self.lights.ambient(), passes);
            return false;
        }
        self.add_ambient(n, ray, accumulated, false);
        let computed;
        let surface = match first.take() {
            Some(surface) => surface,
            None => {
                computed = self.surfaces.at_ray(hit, ray, *cone);
                &computed
            }
        };
        accumulated.add(n, surface.emission, 1.0);
        let square = |light| numbers.pair(1 + self.lights.shapes().partition_point(|&shape| shape < light));
        direct.throughput = accumulated.throughput;
        let unoccluded = reflected(&self.lights, surface, square, |to, ray, light| {
            // The shadow ray to light `k` has number `k`.
            shadow_rays.add(ray, LightId::Light(to), to, light);
        });
        if let Some([diffuse, ..]) = accumulated.first.as_mut().filter(|_| n == 0) {
            *diffuse = unoccluded;
        }
        accumulated.count_scattering(false);

        // The weight of a cosine-sampled direction is the albedo.
        let local = self.hemisphere.direction(numbers.pair(0));
        accumulated.throughput *= Vec3::from(surface.bsdf.base_color) * self.hemisphere.weight(local[2]);
        let direction = Basis::about(narrow(surface.shading_normal.into())).direction(local);
        *ray = surface.spawn_ray(surface.mirror_outward(direction));
        *cone = surface.cone.scattered(self.hemisphere.density(local[2]));
        true
    }

    /// Keeps the environment in the direction of the ray that left the first surface, and the part of it that arrives.
    fn add_ambient(&self, n: u32, ray: &Ray, accumulated: &mut PathRadiance, arrives: bool) {
        let throughput = accumulated.throughput;
        if let Some([.., ambient, arriving]) = accumulated.first.as_mut().filter(|_| n == 1) {
            *ambient = throughput * Vec3::from(self.lights.radiance_from_afar(ray.direction));
            *arriving = if arrives { *ambient } else { Vec3::ZERO };
        }
    }

    fn light_dimension(&self, vertex: u32, light: u32) -> u32 {
        let n_lights = self.lights.list().len() as u32;
        FIRST_LIGHT.wrapping_add(vertex.wrapping_mul(n_lights)).wrapping_add(light)
    }
}

/// Fraction of the ambient light that passes an occluder: 0 at contact, near 1 beyond the radius.
fn unoccluded(ray: &Ray, occluder: &Hit, ao_radius: f64) -> f32 {
    let distance = f64::from(occluder.t) * wide(ray.direction).length();
    // 1 - exp(-x), exact for small x.
    -(-distance / ao_radius).exp_m1() as f32
}

/// What a diffuse surface reflects of the lights of the scene file if nothing occludes them. Passes the index of each light, the shadow ray
/// and the reflected light to `add`.
///
/// A Lambertian surface with reflectance `ρ` reflects `ρ/π` of its irradiance in every direction. The irradiance of a
/// sun is `E·cosθ`, that of a point light `I·cosθ/r²`; `square` samples a point of a sphere or disk light by the
/// light's index. Only light above the horizons of both the surface and the shading normal counts, on the viewer's
/// side.
fn reflected(
    lights: &Lights,
    surface: &Surface,
    mut square: impl FnMut(u32) -> [f32; 2],
    mut add: impl FnMut(u32, Option<Ray>, Vec3),
) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (index, light) in (0..).zip(lights.list()) {
        let Some(incoming) = IncomingLight::of(light, surface, || square(index)) else { continue };
        let cosine = DVec3::from(surface.shading_normal).dot(incoming.to_light);
        if cosine <= 0.0 || DVec3::from(surface.horizon()).dot(incoming.to_light) <= 0.0 {
            continue;
        }
        let reflected = (incoming.radiance * (cosine / PI)).as_vec3();
        let light = Vec3::from(surface.bsdf.base_color) * reflected;
        sum += light;
        add(index, incoming.shadow_ray, light);
    }
    sum
}
