//! Paths that solve the rendering equation (Kajiya 1986): light is sampled at each vertex, and found by chance by the ray
//! that leaves it; multiple importance sampling weighs the two (Veach and Guibas 1995).
//!
//! With `bounces` the light of longer paths is cut off, the only bias; the count is that of `hybrid`, so that both
//! gather the same light of flat triangles where that has no ambient: a path has vertices `0..=bounces`, surfaces'
//! emission is gathered at each of them, other lights and the environment also from the last. Russian roulette ends
//! paths that carry little without bias.
//!
//! Where shading normal and triangle disagree about the side of a direction, the direction is mirrored in the plane of the
//! triangle. Light from a direction is then scattered as from itself and from the one that is folded onto it, so no light
//! is lost and none comes through the back of a triangle; sampling and evaluation fold alike.

use canted_trace::{Hit, Ray};

use super::batch::{Path, PathRadiance};
use super::{Sample, Start, Transport, roulette};
use crate::bsdf::{Bsdf, Evaluation};
use crate::light::{LightId, LightSampler};
use crate::query::{RayKeyed, Timed};
use crate::sampling::Basis;
use crate::vector::{dot, narrow, scale, sub, unit, wide};
use crate::{Surface, Tracer};

/// Dimensions of the sampler at each vertex, behind the position in the pixel.
#[derive(Clone, Copy)]
enum Dimension {
    Light,
    LightChoice,
    Scattering,
    ScatteringChoice,
    Roulette,
}

impl Dimension {
    const COUNT: u32 = 5;

    fn at(self, vertex: u32) -> u32 {
        1 + vertex * Self::COUNT + self as u32
    }
}

/// What a path keeps from one vertex to the next.
struct Left {
    /// The vertex that the ray left.
    vertex: Option<Vertex>,
    /// The density of the ray's direction; `None` where no light was sampled for it.
    density: Option<f32>,
    /// The factor that boundaries put into the throughput, which comes out again where the path leaves the body.
    compression: f32,
}

impl Default for Left {
    fn default() -> Self {
        Self { vertex: None, density: None, compression: 1.0 }
    }
}

/// Weight of a sample of one technique beside another: the power heuristic with exponent 2.
///
/// Computed from the quotient, so that no square overflows; densities are finite, and both may be zero: what no other
/// technique finds has all of the weight.
fn weight(density: f32, other: f32) -> f32 {
    if other == 0.0 {
        return 1.0;
    }
    let quotient = other / density;
    1.0 / (1.0 + quotient * quotient)
}

/// A surface with the frame that its scattering is told in.
struct Vertex {
    surface: Surface,
    basis: Basis,
    /// Towards the viewer, in that frame.
    outgoing: [f32; 3],
    /// Whether the shading normal is not that of the triangle.
    is_bent: bool,
}

impl Vertex {
    fn new(surface: Surface, ray_direction: [f32; 3]) -> Self {
        let viewer = unit(wide(ray_direction)).map_or([0.0, 0.0, 1.0], |v| narrow(scale(v, -1.0)));
        // Where the shading normal turns its back on the viewer, the triangle's faces him.
        let faces = dot(surface.shading_normal, wide(viewer)) > 0.0;
        let normal = if faces { surface.shading_normal } else { surface.normal };
        let basis = Basis::about(narrow(normal));
        Self { surface, basis, outgoing: basis.coordinates(viewer), is_bent: normal != surface.normal }
    }

    fn bsdf(&self) -> &Bsdf {
        &self.surface.bsdf
    }

    /// Whether light from behind the triangle counts.
    fn transmits(&self) -> bool {
        self.bsdf().transmission > 0.0
    }

    /// What is scattered from a world-space direction: of itself, and of the direction that is folded onto it.
    fn evaluate(&self, to_light: [f32; 3]) -> Evaluation {
        let incident = self.basis.coordinates(to_light);
        if !self.is_bent {
            return self.bsdf().evaluate(self.outgoing, incident);
        }
        let height = self.height(to_light);
        let folded = self.basis.coordinates(self.mirrored(to_light));
        let mut sum = Evaluation::default();
        // A direction stays where triangle and frame agree on its side, and is folded where they do not.
        for local in [incident, folded].into_iter().filter(|local| f64::from(local[2]) * height > 0.0) {
            let Evaluation { value, density } = self.bsdf().evaluate(self.outgoing, local);
            sum.value = std::array::from_fn(|k| sum.value[k] + value[k]);
            sum.density += density;
        }
        sum
    }

    /// A sampled direction of the frame in world space, on the side of the triangle that it has in the frame.
    fn direction(&self, incident: [f32; 3]) -> [f32; 3] {
        let direction = self.basis.direction(incident);
        let agrees = !self.is_bent || f64::from(incident[2]) * self.height(direction) >= 0.0;
        if agrees { direction } else { self.mirrored(direction) }
    }

    fn height(&self, direction: [f32; 3]) -> f64 {
        dot(self.surface.normal, wide(direction))
    }

    /// A direction mirrored in the plane of the triangle.
    fn mirrored(&self, direction: [f32; 3]) -> [f32; 3] {
        narrow(sub(wide(direction), scale(self.surface.normal, 2.0 * self.height(direction))))
    }
}

impl<T: Tracer, Q: RayKeyed> Transport<'_, T, Q> {
    /// The light of paths that are traced until `bounces` or roulette end them; see [`Transport::samples`].
    pub(super) fn path_samples(
        &self,
        begun: impl Iterator<Item = (Start, Option<Hit>)>,
        lights: &LightSampler,
    ) -> Vec<Sample> {
        self.batch(begun, |path: &mut Path<Q, Left>, n| self.path_step(path, n, lights))
    }

    /// Takes a path on at its `n`-th vertex; whether it goes on.
    fn path_step(&self, path: &mut Path<Q, Left>, n: u32, lights: &LightSampler) -> bool {
        let Path { start, query, ray, cone, hit, gathered, own: Left { vertex: left, density, compression } } = path;
        // The share of light that was found by chance beside what is sampled.
        let share = |source: LightId| {
            left.as_ref().zip(*density).map_or(1.0, |(vertex, density)| {
                weight(density, lights.density(&vertex.surface, vertex.transmits(), ray.direction, source))
            })
        };
        if let Some(met) = lights.lights().intersect(ray, hit.as_ref()) {
            gathered.add(met.radiance, share(met.source));
            return false;
        }
        let Some(found) = hit.filter(|_| n <= self.bounces) else { return false };
        let surface = self.surfaces.at_time(&found, ray.direction, start.time, *cone);
        if surface.emission != [0.0; 3] {
            gathered.add(surface.emission, share(LightId::of_hit(&found)));
        }
        let vertex = &*left.insert(Vertex::new(surface, ray.direction));
        if !vertex.bsdf().is_delta_only() {
            self.add_light(gathered, lights, vertex, n, &query.keyed(1 + n), start);
        }
        let Some(next) = self.scatter(gathered, compression, vertex, n, start) else { return false };
        (*ray, *density) = next;
        *cone = density.map_or(vertex.surface.cone, |density| vertex.surface.cone.scattered(density));
        true
    }

    /// Adds light sampled for a vertex.
    fn add_light(
        &self,
        gathered: &mut PathRadiance,
        lights: &LightSampler,
        vertex: &Vertex,
        n: u32,
        query: &Timed<Q>,
        &Start { pixel, sample, .. }: &Start,
    ) {
        let choice =
            if lights.has_choice() { self.sampler.single(pixel, sample, Dimension::LightChoice.at(n)) } else { 0.0 };
        let square = self.sampler.pair(pixel, sample, Dimension::Light.at(n));
        let Some(light) = lights.sample(&vertex.surface, vertex.transmits(), choice, square) else { return };
        // Emission of surfaces belongs to the vertex there.
        if matches!(light.source, LightId::Triangle(..)) && n == self.bounces {
            return;
        }
        let Evaluation { value, density } = vertex.evaluate(light.to_light);
        if value == [0.0; 3] {
            return;
        }
        if let Some(ray) = &light.shadow_ray {
            gathered.n_rays += 1;
            // Another number than the ray that leaves the vertex has.
            if !lights.lights().is_unoccluded(ray, light.source, self.tracer, &mut query.keyed(0)) {
                return;
            }
        }
        // What has no extent is found by no other technique.
        let share = if light.is_delta { 1.0 } else { weight(light.density, density) };
        gathered.add(std::array::from_fn(|k| value[k] * light.radiance[k]), share);
    }

    /// The ray that leaves a vertex, and the density of its direction, `None` for a mirror's; takes what it carries along.
    fn scatter(
        &self,
        gathered: &mut PathRadiance,
        compression: &mut f32,
        vertex: &Vertex,
        n: u32,
        &Start { pixel, sample, .. }: &Start,
    ) -> Option<(Ray, Option<f32>)> {
        let choice = || self.sampler.single(pixel, sample, Dimension::Roulette.at(n));
        if !roulette::survives(gathered, *compression, n, choice) {
            return None;
        }
        let square = self.sampler.pair(pixel, sample, Dimension::Scattering.at(n));
        let is_lambert = vertex.bsdf().is_lambert();
        let choice =
            if is_lambert { 0.0 } else { self.sampler.single(pixel, sample, Dimension::ScatteringChoice.at(n)) };
        let scattered = vertex.bsdf().sample(vertex.outgoing, square, choice)?;
        let direction = vertex.direction(scattered.incident);
        gathered.throughput = std::array::from_fn(|k| gathered.throughput[k] * scattered.weight[k]);
        if scattered.is_transmitted {
            *compression *= vertex.bsdf().compression();
        }
        let is_lit = gathered.throughput.iter().any(|&x| x > 0.0);
        is_lit.then(|| {
            // Both densities that make a direction count, also that of the light that is folded onto it.
            let density = if vertex.is_bent { vertex.evaluate(direction).density } else { scattered.density };
            (vertex.surface.spawn_ray(direction), (!scattered.is_delta).then_some(density))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_numbers_for_any_densities() {
        for (density, other, want) in [
            (0.0, 0.0, 1.0),
            (1.0, 0.0, 1.0),
            (0.0, 1.0, 0.0),
            (2.0, 2.0, 0.5),
            (f32::MAX, f32::MIN_POSITIVE, 1.0),
            (f32::MIN_POSITIVE, f32::MAX, 0.0),
        ] {
            assert_eq!(weight(density, other), want, "{density} {other}");
        }
    }
}
