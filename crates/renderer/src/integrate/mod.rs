//! Integrators: radiance along camera rays.

use canted_trace::{Hit, Intersect, Query, Ray};
use glam::Vec3;

use crate::light::{LightId, LightSampler, Lights};
use crate::sampler::{Drawn, Numbers};
use crate::times::{Stage, Times};
use crate::{Cone, Hemisphere, HitFilter, Sampler, Surface, Surfaces};

mod hybrid;
mod path;

/// The data shared by all paths of an image.
pub(crate) struct Transport<'a> {
    pub(crate) bvh: &'a dyn Intersect,
    pub(crate) surfaces: &'a Surfaces<'a>,
    pub(crate) filter: HitFilter<'a>,
    pub(crate) sampler: Sampler,
    pub(crate) lights: Lights<'a>,
    pub(crate) bounces: u32,
    /// Greatest radiance of light that several surfaces scattered, see [`crate::Settings::clamp`]; infinite for no limit.
    pub(crate) clamp: f32,
    /// Whether rough surfaces are compensated for multiple scattering; `hybrid` has none.
    pub(crate) is_compensated: bool,
    /// How diffuse directions are sampled.
    pub(crate) hemisphere: Hemisphere,
    /// Whether the light at the first surface is kept.
    pub(crate) keeps_first: bool,
    pub(crate) method: Method<'a>,
}

/// The integrator.
pub(crate) enum Method<'a> {
    /// See `hybrid`.
    Hybrid {
        /// World units; positive, may be infinite.
        ao_radius: f64,
    },
    /// See `path`.
    Path(&'a LightSampler<'a>),
}

/// Sampler dimension of the ray keys for stochastic alpha, far from the other dimensions.
const ALPHA_DIMENSION: u32 = u32::MAX - 2;

/// The start of a path at the camera.
#[derive(Clone, Copy)]
pub(crate) struct Start {
    /// The camera ray, at the time of the entire path.
    pub(crate) ray: Ray,
    /// The ray cone.
    pub(crate) cone: Cone,
    /// Index of the pixel.
    pub(crate) pixel: u32,
    /// Index of the sample in the pixel.
    pub(crate) sample: u32,
}

/// What camera rays hit.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'s> {
    pub(crate) starts: &'s [Start],
    /// For each start, the closest hit.
    pub(crate) hits: &'s [Option<Hit>],
    /// The surfaces there, where they are known; empty where none is.
    pub(crate) surfaces: &'s [Option<Surface>],
}

/// The result of one path.
pub(crate) struct Sample {
    /// Linear RGB; not finite if the value of a light or material is not finite.
    pub(crate) radiance: [f32; 3],
    /// The same by how often it was scattered, as in [`canted_film::Components`].
    pub(crate) components: [[f32; 3]; 3],
    /// What the first surface reflects of lights and environment, as in [`canted_film::Components`]; `path` does not separate it.
    pub(crate) first: Option<[[f32; 3]; 4]>,
    /// Number of rays traced, including the camera ray.
    pub(crate) n_rays: u64,
}

impl<'a> Transport<'a> {
    /// Radiance along camera rays whose closest hits are known, one sample each.
    pub(crate) fn samples(&self, seen: Seen, times: &mut Times) -> Vec<Sample> {
        match self.method {
            Method::Hybrid { ao_radius } => self.hybrid_samples(seen, ao_radius, times),
            Method::Path(lights) => self.path_samples(seen, lights, times),
        }
    }

    /// The query of a camera ray: number 0 of its path.
    pub(crate) fn camera_query(&self, start: &Start) -> HitFilter<'a> {
        self.path_query(start.pixel, start.sample).keyed(0)
    }

    /// The query of a path; each ray derives its own key.
    fn path_query(&self, pixel: u32, sample: u32) -> HitFilter<'a> {
        self.filter.sampled(sample).keyed(self.sampler.bits(pixel, 0, ALPHA_DIMENSION))
    }

    /// The closest hits of camera rays.
    pub(crate) fn camera_hits(&self, starts: &[Start]) -> Vec<Option<Hit>> {
        let rays: Vec<Ray> = starts.iter().map(|start| start.ray).collect();
        let mut hits = vec![None; rays.len()];
        if self.filter.may_reject() {
            let accept = |i: usize, _: &Ray, hit: &Hit| self.camera_query(&starts[i]).shows(hit);
            self.bvh.closest_hits_with(&rays, &mut hits, &accept);
        } else {
            self.bvh.closest_hits(&rays, &mut hits);
        }
        hits
    }
}

/// Rays of paths that are traced together.
#[derive(Default)]
struct RaySlice<'a> {
    rays: Vec<Ray>,
    /// One for each ray; empty where no hit is rejected.
    queries: Vec<HitFilter<'a>>,
    hits: Vec<Option<Hit>>,
    occluded: Vec<bool>,
}

impl RaySlice<'_> {
    fn clear(&mut self) {
        self.rays.clear();
        self.queries.clear();
    }

    /// Finds what the rays hit.
    fn find_hits(&mut self, bvh: &dyn Intersect) {
        let Self { rays, queries, hits, .. } = self;
        hits.resize(rays.len(), None);
        if queries.is_empty() {
            bvh.closest_hits(rays, hits);
        } else {
            bvh.closest_hits_with(rays, hits, &|i, _: &Ray, hit: &Hit| queries[i].shows(hit));
        }
    }

    /// Finds whether the rays hit anything.
    fn find_occluded(&mut self, bvh: &dyn Intersect) {
        let Self { rays, queries, occluded, .. } = self;
        occluded.resize(rays.len(), false);
        if queries.is_empty() {
            bvh.occluded_many(rays, occluded);
        } else {
            bvh.occluded_many_with(rays, occluded, &|i, _: &Ray, hit: &Hit| queries[i].shows(hit));
        }
    }
}

// Batched path tracing: all paths shade their hits, then all trace their shadow rays, then their next ray, until every path has ended.
//
// A single path stalls on memory for indices, vertices and texels in turn. In a batch these stalls overlap, see
// [`Surfaces::prefetch`](crate::Surfaces). Paths are otherwise independent, so results do not depend on the batch.

/// The state of a path between two rays.
struct Path<'a, W> {
    /// Index of the pixel.
    pixel: u32,
    /// Index of the sample in the pixel.
    sample: u32,
    /// The last ray traced, or the next one to trace.
    ray: Ray,
    /// The ray cone.
    cone: Cone,
    /// The closest hit of the ray.
    hit: Option<Hit>,
    /// The surface at the first hit, if it is known.
    first: Option<&'a Surface>,
    accumulated: PathRadiance,
    direct: DirectLight,
    /// State of the integrator.
    state: W,
}

/// Light of the listed lights at a vertex, whose shadow rays are traced after all vertices are shaded.
#[derive(Default)]
struct DirectLight {
    /// The sum over lights that nothing occludes.
    sum: Vec3,
    /// Factor of the sum.
    throughput: Vec3,
}

/// A ray from a vertex to a light.
struct ShadowRay {
    /// Index of the path.
    path: usize,
    /// `None` where the light is too close for an occluder.
    ray: Option<Ray>,
    to: LightId,
    /// Number of the ray among the shadow rays of its vertex.
    number: u32,
    /// What the vertex reflects of the light if nothing occludes it.
    light: Vec3,
}

/// Adds the shadow rays of a path.
struct ShadowRays<'s> {
    all: &'s mut Vec<ShadowRay>,
    path: usize,
}

impl ShadowRays<'_> {
    fn add(&mut self, ray: Option<Ray>, to: LightId, number: u32, light: Vec3) {
        self.all.push(ShadowRay { path: self.path, ray, to, number, light });
    }
}

/// Index of indirect light, which at least two surfaces scattered, among the parts of the radiance.
const INDIRECT: u32 = 2;

/// The radiance that a path has accumulated.
struct PathRadiance {
    radiance: Vec3,
    /// The radiance in its parts: emission, direct and indirect light.
    components: [Vec3; 3],
    /// What the first surface reflects: light of the listed lights, what arrives of it, and both of the environment.
    first: Option<[Vec3; 4]>,
    /// Factor of light at the next vertex.
    throughput: Vec3,
    n_rays: u64,
    /// Surfaces that scattered the path. Mirrors and clear glass in front of the first one do not count.
    n_scattered: u32,
    /// See [`Transport::clamp`].
    clamp: f32,
}

impl PathRadiance {
    fn new(clamp: f32, keeps_first: bool) -> Self {
        Self {
            radiance: Vec3::ZERO,
            components: [Vec3::ZERO; 3],
            first: keeps_first.then_some([Vec3::ZERO; 4]),
            throughput: Vec3::ONE,
            n_rays: 1,
            n_scattered: 0,
            clamp,
        }
    }

    /// Adds light that the `n`-th ray found.
    fn add(&mut self, n: u32, radiance: impl Into<Vec3>, weight: f32) {
        self.add_light(n, self.clamped(self.n_scattered, radiance.into(), weight));
    }

    /// Light that the surface scatters at which the last ray ended.
    fn direct(&self, radiance: Vec3, weight: f32) -> Vec3 {
        self.clamped(self.n_scattered + 1, radiance, weight)
    }

    fn clamped(&self, n_scattered: u32, radiance: Vec3, weight: f32) -> Vec3 {
        let light = self.throughput * radiance * weight;
        let greatest = light.max_element();
        let is_clamped = n_scattered > 1 && greatest > self.clamp;
        if is_clamped { light * (self.clamp / greatest) } else { light }
    }

    /// Adds light after `n` vertices, mirrors and glass included.
    fn add_light(&mut self, n: u32, light: Vec3) {
        self.radiance += light;
        self.components[n.min(INDIRECT) as usize] += light;
    }

    /// Counts a surface that scattered the path.
    fn count_scattering(&mut self, is_delta: bool) {
        self.n_scattered += u32::from(self.n_scattered > 0 || !is_delta);
    }
}

impl Transport<'_> {
    /// Traces paths from camera rays whose hits are known.
    ///
    /// `dimensions` are those of the pairs and of the single numbers that the `n`-th vertices may draw. `step` shades the `n`-th vertex, or
    /// ends the path, and returns whether there is a next ray.
    fn batch<'a, W: Default>(
        &'a self,
        seen: Seen<'a>,
        times: &mut Times,
        dimensions: impl Fn(u32) -> [Vec<u32>; 2],
        mut step: impl FnMut(&mut Path<'a, W>, u32, Drawn, &mut ShadowRays) -> bool,
    ) -> Vec<Sample> {
        let begin = |(i, (&Start { ray, cone, pixel, sample }, &hit)): (usize, (&Start, &Option<Hit>))| Path {
            pixel,
            sample,
            ray,
            cone,
            hit,
            first: seen.surfaces.get(i).and_then(Option::as_ref),
            accumulated: PathRadiance::new(self.clamp, self.keeps_first),
            direct: DirectLight::default(),
            state: W::default(),
        };
        let mut paths: Vec<Path<'a, W>> = seen.starts.iter().zip(seen.hits).enumerate().map(begin).collect();
        let mut active: Vec<usize> = (0..paths.len()).collect();
        let (mut shadow_rays, mut lit) = (vec![], vec![]);
        let mut slice = RaySlice::default();
        let mut numbers = Numbers::new(self.sampler);
        for n in 0.. {
            // The hit of the last ray is not shaded.
            if n <= self.bounces {
                self.surfaces.prefetch(active.iter().filter_map(|&i| paths[i].hit.as_ref()));
                let [pairs, singles] = dimensions(n);
                numbers.draw(active.iter().map(|&i| (paths[i].pixel, paths[i].sample)), &pairs, &singles);
            }
            lit.clone_from(&active);
            let mut drawn = (0..).map(|k| numbers.of(k));
            active.retain(|&i| {
                let mut shadow_rays = ShadowRays { all: &mut shadow_rays, path: i };
                drawn.next().is_some_and(|drawn| step(&mut paths[i], n, drawn, &mut shadow_rays))
            });
            times.end(Stage::Shading);
            slice.clear();
            shadow_rays.retain(|&ShadowRay { path, ray, to, number, .. }: &ShadowRay| {
                let Some(ray) = ray else { return true };
                let Path { pixel, sample, accumulated, .. } = &mut paths[path];
                accumulated.n_rays += 1;
                if self.lights.occlude(&ray, to) {
                    return false;
                }
                slice.rays.push(ray);
                if self.filter.may_reject() {
                    let query = self.path_query(*pixel, *sample).keyed(1 + n).lighting(ray.time);
                    slice.queries.push(query.keyed(number));
                }
                true
            });
            slice.find_occluded(self.bvh);
            let mut occluded = slice.occluded.iter();
            for ShadowRay { path, ray, light, .. } in shadow_rays.drain(..) {
                if !(ray.is_some() && occluded.next().is_some_and(|is_occluded| *is_occluded)) {
                    paths[path].direct.sum += light;
                }
            }
            times.end(Stage::Rays);
            for &i in &lit {
                let Path { accumulated, direct, .. } = &mut paths[i];
                accumulated.add_light(n + 1, direct.throughput * direct.sum);
                if n == 0
                    && let Some([_, arriving, ..]) = &mut accumulated.first
                {
                    *arriving = direct.sum;
                }
                *direct = DirectLight::default();
            }
            times.end(Stage::Shading);
            if active.is_empty() {
                break;
            }
            slice.clear();
            for &i in &active {
                let Path { pixel, sample, ray, accumulated, .. } = &mut paths[i];
                accumulated.n_rays += 1;
                slice.rays.push(*ray);
                if self.filter.may_reject() {
                    let query = self.path_query(*pixel, *sample).keyed(1 + n);
                    slice.queries.push(if accumulated.n_scattered == 0 { query } else { query.scattered() });
                }
            }
            slice.find_hits(self.bvh);
            for (k, (&i, &found)) in active.iter().zip(&slice.hits).enumerate() {
                let Path { ray, hit, accumulated, .. } = &mut paths[i];
                *hit = found.filter(|hit| {
                    // Without queries no face is hidden.
                    let Some(query) = slice.queries.get(k).filter(|_| accumulated.n_scattered > 0) else { return true };
                    self.ends_at(hit, ray, *query, &mut accumulated.n_rays)
                });
            }
            times.end(Stage::Rays);
        }
        let sample = |Path { accumulated: PathRadiance { radiance, components, first, n_rays, .. }, .. }| Sample {
            radiance: radiance.into(),
            components: components.map(Into::into),
            first: first.map(|parts| parts.map(Into::into)),
            n_rays,
        };
        paths.into_iter().map(sample).collect()
    }

    /// Whether a scattered ray ends at its first hit; not where it leaves the scene through hidden faces, see [`HitFilter`].
    fn ends_at(&self, hit: &Hit, ray: &Ray, query: HitFilter, n_rays: &mut u64) -> bool {
        if !query.hides(hit, ray.time) {
            return true;
        }
        *n_rays += 1;
        self.bvh.occluded_with(ray, &mut query.lighting(ray.time))
    }
}
