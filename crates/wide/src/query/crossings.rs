//! How often a ray crosses surfaces, where it may pass through edges and vertices.
//!
//! A ray through an edge or a vertex hits all triangles around it. Of these, the crossings are those that the ray would hit
//! if it were moved by an infinitesimal `(ε, ε²)` across itself: then it is in general position and crosses one triangle at
//! a time. So a surface is crossed once, and a closed one as often inward as outward, whatever the shape around a vertex
//! and whether or not faces are seen edge-on. The watertight kernel makes that exact: all triangles see a shared vertex at
//! the same f32 coordinates across the ray, and signs of edge functions are exact in f64.
//! Source: the rule is that of rasterizers for shared edges, by the perturbation of Edelsbrunner & Mücke 1990; reporting
//! the lowest primitive is ours.

use canted_obb::PrimId;
use canted_trace::{
    Answer, Answers, Crossings, Hit, HitLists, Intersect, Ray, ScaledRay, Shear, Side, alternate_sides, with_stack,
};

use super::pass::pass_hits;
use super::sink::{HitSink, by_t, sort_from, to_caller};
use crate::bvh::TriangleBvh;
use crate::simd::{Simd, Task};
use crate::traverse::{TracedRay, for_each_of_eight};

impl Crossings for TriangleBvh {
    fn crossings_scaled(&self, ray: &ScaledRay, stack: &mut [u64], crossings: &mut Vec<Hit>) {
        let ray = &self.prepare(ray);
        self.path.run(CrossingsOf { bvh: self, ray, stack, on_edges: &mut vec![], crossings });
    }

    fn crossings_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        lists.clear(rays.len());
        let (mut on_edges, mut answers) = (vec![], Answers::Lists(lists));
        with_stack(self.stack_len(), |stack| {
            for_each_of_eight(self.path, rays, &self.frame, self.pads(), &mut |i, ray| {
                answers.fill(i, |answer| {
                    if let (Answer::All(crossings), Some(ray)) = (answer, ray) {
                        self.path.run(CrossingsOf { bvh: self, ray, stack, on_edges: &mut on_edges, crossings });
                    }
                });
            });
        });
    }
}

/// Appends the crossings of a ray; `on_edges` is empty memory. The test is the watertight one, for whose hits all boxes are large enough.
struct CrossingsOf<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a TracedRay,
    stack: &'a mut [u64],
    on_edges: &'a mut Vec<EdgeHit>,
    crossings: &'a mut Vec<Hit>,
}

impl Task for CrossingsOf<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, ray, stack, on_edges, crossings } = self;
        let first = crossings.len();
        let mut sink = CrossingSink { inner: &mut *crossings, on_edges: &mut *on_edges };
        pass_hits::<S, _, true>(simd, bvh, ray, stack, &mut sink);
        finish(&ray.scaled, on_edges, crossings, first);
    }
}

/// Makes crossings of the hits from `first` on, which are inside of triangles, and of those on edges.
fn finish(ray: &ScaledRay, on_edges: &mut Vec<EdgeHit>, crossings: &mut Vec<Hit>, first: usize) {
    sort_from(crossings, first);
    if !on_edges.is_empty() {
        once_each(on_edges, crossings);
        on_edges.clear();
        sort_from(crossings, first);
    }
    to_caller(ray, &mut crossings[first..]);
    alternate_sides(&mut crossings[first..]);
}

/// The crossings of a ray with one mesh whose triangles are in several BVHs: those of one BVH over all of them.
///
/// Triangles around an edge may be in different BVHs, so hits are gathered before edges are decided.
#[derive(Clone, Debug, Default)]
pub struct CrossingParts {
    inner: Vec<Hit>,
    on_edges: Vec<EdgeHit>,
}

impl CrossingParts {
    /// Adds what the ray hits in one of the BVHs; `number` is the number in the mesh of a triangle of the BVH.
    pub fn add(&mut self, bvh: &TriangleBvh, ray: &ScaledRay, number: impl Fn(PrimId) -> PrimId) {
        let (inner, on_edges) = (self.inner.len(), self.on_edges.len());
        let ray = &bvh.prepare(ray);
        with_stack(bvh.stack_len(), |stack| bvh.path.run(HitsOf { bvh, ray, stack, parts: self }));
        self.inner[inner..].iter_mut().for_each(|hit| hit.primitive = number(hit.primitive));
        self.on_edges[on_edges..].iter_mut().for_each(|on_edge| on_edge.hit.primitive = number(on_edge.hit.primitive));
    }

    /// Appends the crossings of all BVHs that were added, in the order of [`Crossings::crossings`]; `ray` is that of [`Self::add`].
    pub fn finish(mut self, ray: &ScaledRay, crossings: &mut Vec<Hit>) {
        let first = crossings.len();
        crossings.append(&mut self.inner);
        finish(ray, &mut self.on_edges, crossings, first);
    }
}

/// Gathers the hits of a ray.
struct HitsOf<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a TracedRay,
    stack: &'a mut [u64],
    parts: &'a mut CrossingParts,
}

impl Task for HitsOf<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, ray, stack, parts } = self;
        let mut sink = CrossingSink { inner: &mut parts.inner, on_edges: &mut parts.on_edges };
        pass_hits::<S, _, true>(simd, bvh, ray, stack, &mut sink);
    }
}

/// Hits inside triangles, and hits on their edges; `t` scaled.
struct CrossingSink<'a> {
    inner: &'a mut Vec<Hit>,
    on_edges: &'a mut Vec<EdgeHit>,
}

/// A hit on an edge or a vertex of its triangle.
#[derive(Clone, Copy, Debug)]
struct EdgeHit {
    hit: Hit,
    /// Bits of the edge's ends, the lesser first; twice the vertex.
    ends: [[u32; 3]; 2],
    /// Whether the moved ray hits the triangle, too.
    counts: bool,
}

impl HitSink for CrossingSink<'_> {
    const ORDERED: bool = false;
    const ALL: bool = true;
    const SPLITS: bool = true;

    #[inline(always)]
    fn take_inside(&mut self, hit: Hit, t_max: f32) -> f32 {
        self.inner.push(hit);
        t_max
    }

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, vertices: &[[f32; 3]; 3], t_max: f32) -> f32 {
        match edge_of_hit(ray, vertices) {
            None => self.inner.push(hit),
            Some((ends, counts)) => self.on_edges.push(EdgeHit { hit, ends, counts }),
        }
        t_max
    }
}

/// The edge or vertex that a ray passes through, of a triangle that it hits, and whether the moved ray hits the triangle;
/// `None` for a hit inside.
///
/// Few hits come here: the lanes' filter knows of most that they are inside, as signs of its edge functions are exact.
#[inline(never)]
fn edge_of_hit(ray: &ScaledRay, vertices: &[[f32; 3]; 3]) -> Option<([[u32; 3]; 2], bool)> {
    let shear = Shear::new(ray);
    // Across the ray: the kernel's own f32 coordinates.
    let [a, b, c] = vertices.map(|v| shear.vertex(ray, v)).map(|[x, y, _]| [x, y]);
    // An edge function belongs to the opposite vertex.
    let functions = [edge_function(c, b), edge_function(a, c), edge_function(b, a)];
    let mut on = (0..3).filter(|&i| functions[i] != 0.0).map(|i| vertices[i].map(|x| (x + 0.0).to_bits()));
    let (first, second) = (on.next()?, on.next());
    if on.next().is_some() {
        return None;
    }
    let second = second.unwrap_or(first);
    let moved = [moved_is_positive(c, b), moved_is_positive(a, c), moved_is_positive(b, a)];
    let is_positive = functions.iter().any(|&f| f > 0.0);
    let counts = (0..3).all(|i| functions[i] != 0.0 || moved[i] == is_positive);
    Some(([first.min(second), first.max(second)], counts))
}

/// Edge function of the origin; its sign is exact, as the products are.
fn edge_function(b: [f32; 2], c: [f32; 2]) -> f64 {
    f64::from(b[0]) * f64::from(c[1]) - f64::from(b[1]) * f64::from(c[0])
}

/// Whether an edge function that is zero at the origin is positive at `(ε, ε²)`: it grows by
/// `(b_y - c_y)·ε + (c_x - b_x)·ε²`. Exchanged ends give the opposite answer, unless they are the same point.
fn moved_is_positive(b: [f32; 2], c: [f32; 2]) -> bool {
    if b[1] == c[1] { c[0] > b[0] } else { b[1] > c[1] }
}

/// Appends of the hits at one edge or vertex as many from each side as count.
fn once_each(hits: &mut Vec<EdgeHit>, kept: &mut Vec<Hit>) {
    let is_back = |on_edge: &EdgeHit| on_edge.hit.side == Side::Back;
    hits.sort_unstable_by(|a, b| a.ends.cmp(&b.ends).then(is_back(a).cmp(&is_back(b))).then(by_t(&a.hit, &b.hit)));
    hits.dedup_by_key(|on_edge| (on_edge.hit.t.to_bits(), on_edge.hit.primitive));
    for around in hits.chunk_by(|a, b| a.ends == b.ends && a.hit.side == b.hit.side) {
        let n = around.iter().filter(|on_edge| on_edge.counts).count();
        kept.extend(around[..n].iter().map(|on_edge| on_edge.hit));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_neighbors_exactly_one_sees_the_moved_ray() {
        let ends = [[0.0, 1.0], [0.0, -1.0], [-2.0, 0.0], [3.0, 0.0], [-1.0, 1.0], [1.5, -1.5]];
        for b in ends {
            for c in ends.into_iter().filter(|&c| c != b) {
                assert_ne!(moved_is_positive(b, c), moved_is_positive(c, b), "{b:?} {c:?}");
            }
        }
    }

    #[test]
    fn the_moved_edge_function_has_the_sign_of_a_slightly_moved_one() {
        // Edges through the origin, and a displacement small but real.
        let (x, y) = (2f64.powi(-20), 2f64.powi(-40));
        for [b, c] in [
            [[0.0, 1.0], [0.0, -1.0]],
            [[-2.0, 0.0], [3.0, 0.0]],
            [[-1.0, 1.0], [1.5, -1.5]],
            [[1.0, 2.0], [-2.0, -4.0]],
        ] {
            let shifted = |[p, q]: [f32; 2]| [f64::from(p) - x, f64::from(q) - y];
            let ([b_x, b_y], [c_x, c_y]) = (shifted(b), shifted(c));
            assert_eq!(edge_function(b, c), 0.0);
            assert_eq!(moved_is_positive(b, c), b_x * c_y - b_y * c_x > 0.0, "{b:?} {c:?}");
        }
    }
}
