//! The hybrid integrator of Sabino 2020, section 3.7.7: direct light, diffuse bounces, ambient with occlusion.
//!
//! Along a path with vertices `0..=bounces`, each vertex adds, weighted by the reflectances before it,
//!
//! ```text
//! emission                                         found by chance: triangles that emit are not sampled
//! + direct light                                   a shadow ray to each light of the list
//! + environment · albedo        on a miss          the path ends
//! + ambient · albedo · (1 - exp(-t/r))             at the last vertex, whose ray hits at distance t
//! ```
//!
//! The ray that leaves a vertex, one cosine-sampled direction with weight `albedo`, serves all of the last three: it
//! brings the sky, the next vertex, or at the last vertex the ambient occlusion. Where it meets a sphere or a disc of the
//! list the path ends with nothing, for the shadow ray to that light has brought its light; camera rays see it.
//!
//! `environment` is the radiance along the ray, so a picture with a sun in it is noisy here. `ambient` is its mean over all
//! directions, as it stands for light that has long forgotten where it came from.
//!
//! # Departures from the source
//!
//! Its listing adds the sky on a miss and again as ambient times occlusion; here each ray brings it once. Its
//! occlusion `exp(-t)` is inverted, without a unit, and applied one vertex late; here it is `1 - exp(-t/r)` of the ray
//! that leaves the vertex, `t` in world units. Direct light carries `1/π` and `1/r²`. Directions are sampled and shaded
//! about one normal, and kept on the outer side of the triangle.
//!
//! # Bias
//!
//! Light of more than `bounces` bounces is cut off. The ambient of the last vertex stands for it and is not physical:
//! it lights a surface through the occluders beyond about `r`. With `r` infinite it is off and the integrator is a
//! plain path tracer that stops, too dark by what was cut off.
//!
//! Ambient never makes energy: with no lights, no emission, environment 1 and albedo at most 1, no sample exceeds 1.
//! By induction from the end of the path: what the ray of the last vertex brings is 1 or `1 - exp(-t/r) <= 1`; what any
//! earlier ray brings is 1 on a miss, else the next vertex's albedo times at most 1. The film averages such samples.

use canted_trace::{Hit, Ray};

use super::batch::Path;
use super::direct::direct;
use super::{Sample, Start, Transport};
use crate::Tracer;
use crate::light::LightId;
use crate::query::RayKeyed;
use crate::sampling::{Basis, cosine_density, cosine_hemisphere};
use crate::vector::{length, narrow, wide};

/// Dimensions of the sampler: the position in the pixel first, then one a bounce.
const FIRST_BOUNCE: u32 = 1;

/// Beyond all bounces, one for each vertex and light.
const FIRST_LIGHT: u32 = 1 << 16;

impl<T: Tracer, Q: RayKeyed> Transport<'_, T, Q> {
    /// The light of paths of the hybrid integrator; see [`Transport::samples`].
    pub(super) fn hybrid_samples(
        &self,
        begun: impl Iterator<Item = (Start, Option<Hit>)>,
        ao_radius: f64,
    ) -> Vec<Sample> {
        self.batch(begun, |path: &mut Path<Q, ()>, n| self.hybrid_step(path, n, ao_radius))
    }

    /// Takes a path on at its `n`-th vertex; whether it goes on.
    fn hybrid_step(&self, path: &mut Path<Q, ()>, n: u32, ao_radius: f64) -> bool {
        let Path { start: Start { time, pixel, sample, .. }, query, ray, cone, hit, gathered, .. } = path;
        let hit = match (self.lights.intersect(ray, hit.as_ref()), &*hit) {
            (None, Some(hit)) => hit,
            (met, _) => {
                let seen = met.filter(|met| n == 0 || met.source == LightId::Environment);
                gathered.add(seen.map_or([0.0; 3], |seen| seen.radiance), 1.0);
                return false;
            }
        };
        // The ray of the last vertex.
        if n > self.bounces {
            gathered.add(self.lights.ambient(), unoccluded(ray, hit, ao_radius));
            return false;
        }
        let surface = self.surfaces.at_time(hit, ray.direction, *time, *cone);
        gathered.add(surface.emission, 1.0);
        let square = |light| self.sampler.pair(*pixel, *sample, self.light_dimension(n, light));
        let (radiance, n_shadow_rays) = direct(&self.lights, self.tracer, &query.keyed(1 + n), &surface, square);
        gathered.add(radiance, 1.0);
        gathered.n_rays += n_shadow_rays;

        // Leave along a cosine-sampled direction, whose weight is the albedo.
        gathered.throughput = std::array::from_fn(|k| gathered.throughput[k] * surface.bsdf.base_color[k]);
        let local = cosine_hemisphere(self.sampler.pair(*pixel, *sample, FIRST_BOUNCE + n));
        let direction = Basis::about(narrow(surface.shading_normal)).direction(local);
        *ray = surface.spawn_ray(surface.mirror_outward(direction));
        *cone = surface.cone.scattered(cosine_density(local[2]));
        true
    }

    fn light_dimension(&self, vertex: u32, light: u32) -> u32 {
        #[expect(clippy::cast_possible_truncation, reason = "any number will do, if it is hardly ever the same")]
        let n_lights = self.lights.list().len() as u32;
        FIRST_LIGHT.wrapping_add(vertex.wrapping_mul(n_lights)).wrapping_add(light)
    }
}

/// Share of the ambient light that comes through beside an occluder: 0 at contact, near 1 beyond the radius.
#[expect(clippy::cast_possible_truncation, reason = "a weight in 0..=1")]
fn unoccluded(ray: &Ray, occluder: &Hit, ao_radius: f64) -> f32 {
    let distance = f64::from(occluder.t) * length(wide(ray.direction));
    // 1 - exp(-x), exact for small x.
    -(-distance / ao_radius).exp_m1() as f32
}
