//! All hits of many rays in one array.

use canted_trace::{Hit, InstanceId, Ray, Watertight};

use crate::batch::Tracer;
use crate::bvh::WideBvh;
use crate::crossings::{EdgeHit, cross};
use crate::leaf::LeafPrimitive;
use crate::simd::{Simd, Task};
use crate::traverse::{EightRays, Pads, Stack, TracedRay};
use crate::triangle::{Triangle, TriangleBvh};

/// The hits of a slice of rays, one ray after another, in memory that is used again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HitLists {
    hits: Vec<Hit>,
    /// Where the hits of each ray end.
    ends: Vec<usize>,
}

impl HitLists {
    /// Lists of no rays.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The hits of all rays: those of the first ray, then those of the second, and so on.
    #[must_use]
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }

    /// The hits of each ray, in order of the rays.
    pub fn of_rays(&self) -> impl Iterator<Item = &[Hit]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&start, &end)| &self.hits[start..end])
    }
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// Every hit of each ray, as [`WideBvh::all_hits`] returns them, at a lower cost per ray. Replaces the content of `lists`.
    pub fn all_hits_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        self.path.run(Listed { bvh: self, rays, lists, query: All });
    }
}

impl TriangleBvh<Watertight> {
    /// Every crossing of each ray, as [`WideBvh::crossings`] returns them, at a lower cost per ray. Replaces the content of `lists`.
    pub fn crossings_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        self.path.run(Listed { bvh: self, rays, lists, query: Crossings { on_edges: Vec::new() } });
    }
}

/// What is listed of each ray.
trait ListQuery<P: LeafPrimitive> {
    /// Appends the hits of a ray.
    fn run<S: Simd>(&mut self, tracer: &mut Tracer<S, P>, ray: &TracedRay, hits: &mut Vec<Hit>);
}

/// All hits.
struct All;

impl<P: LeafPrimitive> ListQuery<P> for All {
    #[inline(always)]
    fn run<S: Simd>(&mut self, tracer: &mut Tracer<S, P>, ray: &TracedRay, hits: &mut Vec<Hit>) {
        tracer.all_hits(ray, InstanceId(0), &mut (), hits);
    }
}

/// Crossings; the memory for hits on edges is kept from ray to ray.
struct Crossings {
    on_edges: Vec<EdgeHit>,
}

impl ListQuery<Triangle<Watertight>> for Crossings {
    #[inline(always)]
    fn run<S: Simd>(&mut self, tracer: &mut Tracer<S, Triangle<Watertight>>, ray: &TracedRay, hits: &mut Vec<Hit>) {
        cross(tracer.simd, tracer.bvh, ray, tracer.stack, &mut self.on_edges, hits);
    }
}

struct Listed<'a, P: LeafPrimitive, Q> {
    bvh: &'a WideBvh<P>,
    rays: &'a [Ray],
    lists: &'a mut HitLists,
    query: Q,
}

impl<P: LeafPrimitive, Q: ListQuery<P>> Task for Listed<'_, P, Q> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, rays, lists, mut query } = self;
        lists.hits.clear();
        lists.ends.clear();
        lists.ends.reserve(rays.len());
        let mut stack = Stack::new();
        let mut tracer = Tracer::new(simd, bvh, &mut stack);
        let mut eight = EightRays::new();
        for rays in rays.chunks(8) {
            eight.prepare(simd, rays, &bvh.frame, const { Pads::of(P::ERROR) });
            for lane in 0..rays.len() {
                if let Some(traced) = eight.ray(lane) {
                    query.run(&mut tracer, &traced, &mut lists.hits);
                }
                lists.ends.push(lists.hits.len());
            }
        }
    }
}
