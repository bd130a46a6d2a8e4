//! The path integrator: an unbiased solution of the rendering equation (Kajiya 1986) up to the path length. It combines
//! light sampling and BSDF sampling at each vertex by multiple importance sampling (MIS; Veach and Guibas 1995).
//!
//! Truncation to `bounces` is the only bias. The count is that of `hybrid`, so that both compute the same light of flat
//! triangles without the ambient term: a path has vertices `0..=bounces`, surface emission counts at each of them,
//! other lights and the environment also for the ray that leaves the last. Russian roulette ends paths with low
//! throughput without bias.
//!
//! If shading normal and surface disagree about the side of a direction, the direction is mirrored at the horizon of the
//! surface: that of its triangle, or of the smooth surface that bulges out of it. Light from a direction is then scattered for that
//! direction and for the one folded onto it, so that no energy is lost and none leaks through the back of a triangle. Sampling and
//! evaluation fold in the same way.

use glam::{DVec3, Vec3};

use super::{Path, PathRadiance, Sample, Seen, ShadowRays, Transport};
use crate::bsdf::{Bsdf, Evaluation, SeenBsdf};
use crate::light::{LightId, LightSampler, LitPoint};
use crate::sampler::Drawn;
use crate::sampling::Basis;
use crate::times::Times;
use crate::{Surface, narrow, wide};

/// Numbers that a vertex draws, see [`Dimensions`].
#[derive(Clone, Copy)]
enum Pair {
    Light,
    Scattering,
}

/// Those that not all scenes need come last.
#[derive(Clone, Copy)]
enum Single {
    Roulette,
    ScatteringChoice,
    LightChoice,
}

/// Sampler dimensions at each vertex, after the position in the pixel: of the numbers in the order of their enums.
struct Dimensions;

impl Dimensions {
    const PAIRS: [u32; 2] = [0, 2];
    const SINGLES: [u32; 3] = [4, 3, 1];
    const COUNT: u32 = 5;

    fn at(vertex: u32, of: &[u32]) -> Vec<u32> {
        of.iter().map(|dimension| 1 + vertex * Self::COUNT + dimension).collect()
    }
}

/// The state between two vertices.
struct PathState {
    /// The previous vertex.
    vertex: Option<LitPoint>,
    /// PDF of the ray's direction; `None` without MIS (camera ray or delta lobe).
    density: Option<f32>,
    /// The scale of radiance by refraction that the throughput contains, see [`Bsdf::compression`].
    compression: f32,
}

impl Default for PathState {
    fn default() -> Self {
        Self { vertex: None, density: None, compression: 1.0 }
    }
}

/// MIS weight of a sample by the power heuristic with exponent 2.
///
/// Computed from the quotient, so that no square overflows. PDFs are finite, and both may be zero: a sample that no
/// other technique finds has weight 1.
fn weight(density: f32, other: f32) -> f32 {
    if other == 0.0 {
        return 1.0;
    }
    let quotient = other / density;
    1.0 / (1.0 + quotient * quotient)
}

/// A surface with its shading frame.
struct Vertex<'s> {
    surface: &'s Surface,
    basis: Basis,
    /// Towards the viewer, in that frame.
    outgoing: [f32; 3],
    /// Unit normal of the horizon.
    horizon: DVec3,
    /// Whether the shading normal differs from it.
    is_perturbed: bool,
}

impl<'s> Vertex<'s> {
    fn new(surface: &'s mut Surface, ray_direction: [f32; 3], transport: &Transport) -> Self {
        surface.bsdf.is_compensated = transport.is_compensated;
        surface.bsdf.hemisphere = transport.hemisphere;
        let along = surface.along;
        let viewer = wide(ray_direction).try_normalize().map_or([0.0, 0.0, 1.0], |v| narrow(-v));
        // If the shading normal faces away from the viewer, use the geometric normal.
        let faces = DVec3::from(surface.shading_normal).dot(wide(viewer)) > 0.0;
        let normal = if faces { surface.shading_normal } else { surface.normal };
        let basis = Basis::about(narrow(normal.into()));
        if let Some((lobes, along)) =
            surface.bsdf.lobes.as_mut().zip(along.and_then(|along| DVec3::from(along).try_normalize()))
        {
            let [x, y, _] = basis.coordinates(narrow(along));
            let length = x.hypot(y);
            if length > 0.0 {
                lobes.direction = [x / length, y / length];
            }
        }
        if let Some((hair, along)) = surface.bsdf.hair.as_mut().zip(along) {
            let [x, y, _] = basis.coordinates(narrow(along.into()));
            let length = x.hypot(y);
            if length > 0.0 {
                hair.direction = [x / length, y / length];
            }
        }
        let horizon = surface.horizon();
        let outgoing = basis.coordinates(viewer);
        Self { surface, basis, outgoing, horizon: horizon.into(), is_perturbed: normal != horizon }
    }

    fn bsdf(&self) -> &Bsdf {
        &self.surface.bsdf
    }

    /// Whether light from behind the triangle counts.
    fn transmits(&self) -> bool {
        self.bsdf().transmission > 0.0 || self.bsdf().hair.is_some()
    }

    /// Evaluates the BSDF, seen from the viewer, for a world-space direction and for the direction folded onto it.
    fn evaluate(&self, bsdf: &SeenBsdf, to_light: [f32; 3]) -> Evaluation {
        let incident = self.basis.coordinates(to_light);
        if !self.is_perturbed {
            return bsdf.evaluate(incident);
        }
        let height = self.height(to_light);
        let folded = self.basis.coordinates(self.mirrored(to_light));
        let mut total = Evaluation::default();
        // A direction is kept if horizon and frame agree on its side, else it is folded.
        for local in [incident, folded].into_iter().filter(|local| f64::from(local[2]) * height > 0.0) {
            let Evaluation { value, density } = bsdf.evaluate(local);
            total.value = (Vec3::from(total.value) + Vec3::from(value)).into();
            total.density += density;
        }
        total
    }

    /// World-space direction of a sample, folded to the side of the horizon that it has in the frame.
    fn direction(&self, incident: [f32; 3]) -> [f32; 3] {
        let direction = self.basis.direction(incident);
        let agrees = !self.is_perturbed || f64::from(incident[2]) * self.height(direction) >= 0.0;
        if agrees { direction } else { self.mirrored(direction) }
    }

    fn height(&self, direction: [f32; 3]) -> f64 {
        self.horizon.dot(wide(direction))
    }

    /// Mirrors a direction at the horizon.
    fn mirrored(&self, direction: [f32; 3]) -> [f32; 3] {
        narrow(wide(direction) - self.horizon * (2.0 * self.height(direction)))
    }
}

impl Transport<'_> {
    /// Samples of the path integrator; see [`Transport::samples`].
    pub(super) fn path_samples(&self, seen: Seen, lights: &LightSampler, times: &mut Times) -> Vec<Sample> {
        let n_singles = match (lights.has_choice(), self.surfaces.are_lambert()) {
            (true, _) => 3,
            (false, false) => 2,
            (false, true) => 1,
        };
        self.batch(
            seen,
            times,
            |n| [Dimensions::at(n, &Dimensions::PAIRS), Dimensions::at(n, &Dimensions::SINGLES[..n_singles])],
            |path: &mut Path<PathState>, n, numbers, shadow_rays| self.path_step(numbers, path, n, shadow_rays, lights),
        )
    }

    /// Shades the `n`-th vertex of a path; returns whether there is a next ray.
    fn path_step(
        &self,
        numbers: Drawn,
        path: &mut Path<PathState>,
        n: u32,
        shadow_rays: &mut ShadowRays,
        lights: &LightSampler,
    ) -> bool {
        let Path {
            ray,
            cone,
            hit,
            first,
            accumulated,
            direct,
            state: PathState { vertex: previous, density, compression },
            ..
        } = path;
        // The MIS weight of light found by BSDF sampling.
        let mis_weight = |light: LightId| {
            previous
                .as_ref()
                .zip(*density)
                .map_or(1.0, |(vertex, density)| weight(density, lights.density_at(vertex, ray.direction, light)))
        };
        if let Some(light) = lights.lights().intersect_nth(n, ray, hit.as_ref()) {
            accumulated.add(n, light.radiance, mis_weight(light.light));
            return false;
        }
        let Some(hit) = hit.filter(|_| n <= self.bounces) else { return false };
        let mut surface = match first.take() {
            Some(surface) => *surface,
            None => self.surfaces.at_ray(&hit, ray, *cone),
        };
        if let Some(lobes) = surface.bsdf.lobes.filter(|_| surface.bsdf.is_inside) {
            // Beer's law along the way through the solid.
            let way = (f64::from(hit.t) * wide(ray.direction).length()) as f32;
            accumulated.throughput *= (-Vec3::from(lobes.absorption) * way).exp();
        }
        if surface.emission != [0.0; 3] {
            accumulated.add(n, surface.emission, mis_weight(LightId::of_hit(&hit)));
        }
        let vertex = &Vertex::new(&mut surface, ray.direction, self);
        *previous = Some(LitPoint::of(vertex.surface, vertex.transmits()));
        let bsdf = vertex.bsdf().seen_from(vertex.outgoing);
        if !vertex.bsdf().is_delta_only() {
            self.sample_light(numbers, accumulated, lights, vertex, &bsdf, n, shadow_rays);
            direct.throughput = Vec3::ONE;
        }
        let Some((direction, found_by)) = self.scatter(numbers, accumulated, compression, vertex, &bsdf, n) else {
            return false;
        };
        *ray = vertex.surface.spawn_ray(direction);
        *density = found_by;
        *cone = density.map_or(vertex.surface.cone, |density| vertex.surface.cone.scattered(density));
        true
    }

    /// Samples a light at a vertex: adds a shadow ray and what the vertex reflects of the light.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the state of a vertex")]
    fn sample_light(
        &self,
        numbers: Drawn,
        accumulated: &PathRadiance,
        lights: &LightSampler,
        vertex: &Vertex,
        bsdf: &SeenBsdf,
        n: u32,
        shadow_rays: &mut ShadowRays,
    ) {
        let choice = if lights.has_choice() { numbers.single(Single::LightChoice as usize) } else { 0.0 };
        let square = numbers.pair(Pair::Light as usize);
        let Some(light) = lights.sample(vertex.surface, vertex.transmits(), choice, square) else { return };
        // Surface emission belongs to the vertex on the emitter, which here is beyond the last one.
        if matches!(light.light, LightId::Triangle(..)) && n == self.bounces {
            return;
        }
        let Evaluation { value, density } = vertex.evaluate(bsdf, light.to_light);
        if value == [0.0; 3] {
            return;
        }
        // BSDF sampling never finds delta lights.
        let mis_weight = if light.is_delta { 1.0 } else { weight(light.density, density) };
        let reflected = accumulated.direct(Vec3::from(value) * Vec3::from(light.radiance), mis_weight);
        // The shadow ray does not have the number of the ray that leaves the vertex.
        shadow_rays.add(light.shadow_ray, light.light, 0, reflected);
    }

    /// Samples the BSDF: the direction of the next ray and its PDF, `None` for a delta lobe. Updates the throughput.
    #[inline(always)]
    fn scatter(
        &self,
        numbers: Drawn,
        accumulated: &mut PathRadiance,
        compression: &mut f32,
        vertex: &Vertex,
        bsdf: &SeenBsdf,
        n: u32,
    ) -> Option<([f32; 3], Option<f32>)> {
        if !survives(accumulated, *compression, n, || numbers.single(Single::Roulette as usize)) {
            return None;
        }
        let square = numbers.pair(Pair::Scattering as usize);
        let is_lambert = vertex.bsdf().is_lambert();
        let choice = if is_lambert { 0.0 } else { numbers.single(Single::ScatteringChoice as usize) };
        let scattered = bsdf.sample(square, choice)?;
        let direction = vertex.direction(scattered.incident);
        accumulated.throughput *= Vec3::from(scattered.weight);
        accumulated.count_scattering(scattered.is_delta);
        if scattered.is_transmitted {
            *compression *= vertex.bsdf().compression();
        }
        let is_lit = accumulated.throughput.cmpgt(Vec3::ZERO).any();
        is_lit.then(|| {
            // The PDF includes that of the direction folded onto this one.
            let density =
                if vertex.is_perturbed { vertex.evaluate(bsdf, direction).density } else { scattered.density };
            (direction, (!scattered.is_delta).then_some(density))
        })
    }
}

// Russian roulette (Arvo and Kirk 1990): ends paths with low throughput at random and scales the survivors, without
// bias.

/// Throughput from which paths survive: ending paths above it adds more noise than it saves time, and below it the
/// reverse (`benches/TRIED.md`).
const SURVIVAL_THROUGHPUT: f32 = 0.5;

/// Minimum termination probability from vertex [`MIN_TERMINATION_FROM`] on, so that paths without loss end too.
const MIN_TERMINATION: f32 = 0.05;

/// The first vertices are exempt, because short specular paths add no noise.
const MIN_TERMINATION_FROM: u32 = 4;

/// Whether a path survives at its `n`-th vertex; if so, scales its throughput. `choice` is drawn only if the decision
/// is random.
pub(super) fn survives(accumulated: &mut PathRadiance, compression: f32, n: u32, choice: impl FnOnce() -> f32) -> bool {
    let throughput = accumulated.throughput.max_element().max(0.0) / compression;
    let probability =
        (throughput / SURVIVAL_THROUGHPUT).min(if n < MIN_TERMINATION_FROM { 1.0 } else { 1.0 - MIN_TERMINATION });
    if probability < 1.0 && choice() >= probability {
        return false;
    }
    accumulated.throughput /= probability;
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_finite_for_all_densities() {
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

    /// For evenly spaced choices, the survivors carry the total throughput to within one path. Paths with high
    /// throughput end only by the minimum probability.
    #[test]
    fn roulette_is_unbiased() {
        const N: u32 = 1000;
        for (throughput, compression) in
            [(1e-3, 1.0), (0.02, 1.0), (0.3, 1.0), (0.5, 1.0), (1.0, 1.0), (2.0, 2.25), (0.3, 2.25)]
        {
            for n in [0, MIN_TERMINATION_FROM - 1, MIN_TERMINATION_FROM] {
                let mut sum = 0.0;
                let mut n_left = 0;
                for choice in 0..N {
                    let rgb = Vec3::new(throughput, 0.5 * throughput, 0.0);
                    let mut path = PathRadiance { throughput: rgb, ..PathRadiance::new(f32::INFINITY, false) };
                    if survives(&mut path, compression, n, || (choice as f32 + 0.5) / N as f32) {
                        n_left += 1;
                        sum += path.throughput[0];
                        let [red, green, blue] = path.throughput.to_array();
                        assert!((green - 0.5 * red).abs() <= f32::EPSILON * red && blue == 0.0, "{throughput}");
                    }
                }
                let of_one = sum / n_left as f32;
                assert!((sum - N as f32 * throughput).abs() <= of_one, "{throughput} {compression}: {sum}");
                if throughput / compression >= SURVIVAL_THROUGHPUT {
                    assert_eq!(n_left, if n < MIN_TERMINATION_FROM { N } else { N * 19 / 20 }, "{throughput}");
                }
            }
        }
    }
}
