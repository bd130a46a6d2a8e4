//! How often a ray crosses surfaces, where it may run through edges and vertices.
//!
//! Through an edge or a vertex a ray hits all triangles around it. Of these, those count that the ray would hit if it
//! were moved by an infinitesimal `(ε, ε²)` across itself: a ray in general position, which crosses one triangle at a
//! time. So a surface is crossed once, a closed one as often inward as outward, whatever the shape around a vertex and
//! whether or not faces are seen edge-on. The watertight kernel makes that exact: all triangles see a shared vertex at
//! the same f32 coordinates across the ray, and signs of edge functions are exact in f64.
//! Source: the rule is that of rasterisers for shared edges, by the perturbation of Edelsbrunner & Mücke 1990; naming
//! the lowest primitive is ours.

use canted_trace::{Hit, Ray, ScaledRay, Shear, Side, Watertight};

use crate::WideBvh;
use crate::layout::NodeKind;
use crate::simd::{Simd, Task};
use crate::traced::{HitSink, Traced, by_t, trace};
use crate::traverse::Stack;

impl WideBvh<Watertight> {
    /// Every crossing of a surface with `t_min <= t <= t_max`, once, in order: least `t`, then lowest primitive.
    ///
    /// Replaces what `crossings` held. They are the hits of [`WideBvh::all_hits`] but for those exactly on an edge or a
    /// vertex: of the triangles around it count those that a ray would cross which is moved, next to nothing, to a
    /// side that depends on its direction alone. They go under the lowest primitives that are hit there from the same
    /// side. So a ray that starts and ends outside of a closed mesh crosses it an even number of times, half of them
    /// inward, and equal copies of a surface count as many times.
    ///
    /// A ray that touches a silhouette without crossing anything is without an entry there. The border of an open
    /// surface belongs to it or not, as of two surfaces side by side one is crossed. Triangles share a vertex if its
    /// coordinates are equal; its number does not matter.
    pub fn crossings(&self, ray: &Ray, crossings: &mut Vec<Hit>) {
        self.path.run(Crossings { wide: self, ray, crossings });
    }
}

struct Crossings<'a> {
    wide: &'a WideBvh<Watertight>,
    ray: &'a Ray,
    crossings: &'a mut Vec<Hit>,
}

impl Task for Crossings<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        self.crossings.clear();
        let Some(ray) = ScaledRay::new(self.ray) else { return };
        let mut stack = Stack::new(self.wide.records().depth);
        let mut met = Met { shear: Shear::new(&ray), inner: self.crossings, rim: Vec::new() };
        trace(simd, self.wide, &ray, &mut stack, &mut met);
        let Met { inner, rim, .. } = met;
        inner.sort_unstable_by(by_t);
        inner.dedup_by_key(|hit| (hit.t.to_bits(), hit.primitive));
        inner.extend(once_each(rim));
        inner.sort_unstable_by(by_t);
        for hit in inner {
            hit.t = ray.caller_t(hit.t);
        }
    }
}

/// Hits inside of triangles, and those on their rims; `t` scaled.
struct Met<'a> {
    shear: Shear,
    inner: &'a mut Vec<Hit>,
    rim: Vec<Rim>,
}

/// A hit on an edge or a vertex of its triangle.
#[derive(Clone, Copy, Debug)]
struct Rim {
    hit: Hit,
    /// Bits of the edge's ends, the lesser first; twice the vertex.
    place: [[u32; 3]; 2],
    /// Whether the moved ray hits the triangle, too.
    counts: bool,
}

impl HitSink<[[f32; 3]; 3]> for Met<'_> {
    const ORDERED: bool = false;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, vertices: &[[f32; 3]; 3], t_max: f32) -> f32 {
        match rim(&self.shear, ray, vertices) {
            None => self.inner.push(hit),
            Some((place, counts)) => self.rim.push(Rim { hit, place, counts }),
        }
        t_max
    }

    #[inline(always)]
    fn primitives(&mut self, _: u32) {}

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {}
}

/// On which edge or vertex of a triangle that it hits a ray lies, and whether the moved ray hits the triangle;
/// `None` inside.
fn rim(shear: &Shear, ray: &ScaledRay, vertices: &[[f32; 3]; 3]) -> Option<([[u32; 3]; 2], bool)> {
    // Across the ray: the kernel's own f32 coordinates.
    let [a, b, c] = vertices.map(|v| shear.vertex(ray, v)).map(|[x, y, _]| [x, y]);
    // An edge function belongs to the vertex that it faces.
    let functions = [across(c, b), across(a, c), across(b, a)];
    let mut on = (0..3).filter(|&i| functions[i] != 0.0).map(|i| vertices[i].map(|x| (x + 0.0).to_bits()));
    let (first, second) = (on.next()?, on.next());
    if on.next().is_some() {
        return None;
    }
    let second = second.unwrap_or(first);
    let moved = [moved(c, b), moved(a, c), moved(b, a)];
    let is_positive = functions.iter().any(|&f| f > 0.0);
    let counts = (0..3).all(|i| functions[i] != 0.0 || moved[i] == is_positive);
    Some(([first.min(second), first.max(second)], counts))
}

/// Edge function of the origin; its sign is exact, as the products are.
fn across(b: [f32; 2], c: [f32; 2]) -> f64 {
    f64::from(b[0]) * f64::from(c[1]) - f64::from(b[1]) * f64::from(c[0])
}

/// Whether an edge function that is zero at the origin is positive at `(ε, ε²)`: it grows by
/// `(b_y - c_y)·ε + (c_x - b_x)·ε²`. Exchanged ends give the opposite answer, unless they are the same point.
fn moved(b: [f32; 2], c: [f32; 2]) -> bool {
    if b[1] == c[1] { c[0] > b[0] } else { b[1] > c[1] }
}

/// Of the hits in one place, as many of each side as count.
fn once_each(mut rim: Vec<Rim>) -> Vec<Hit> {
    let is_back = |rim: &Rim| rim.hit.side == Side::Back;
    rim.sort_unstable_by(|a, b| a.place.cmp(&b.place).then(is_back(a).cmp(&is_back(b))).then(by_t(&a.hit, &b.hit)));
    rim.dedup_by_key(|rim| (rim.hit.t.to_bits(), rim.hit.primitive));
    let mut kept = Vec::new();
    for around in rim.chunk_by(|a, b| a.place == b.place && a.hit.side == b.hit.side) {
        let n = around.iter().filter(|rim| rim.counts).count();
        kept.extend(around[..n].iter().map(|rim| rim.hit));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_neighbours_exactly_one_sees_the_moved_ray() {
        let ends = [[0.0, 1.0], [0.0, -1.0], [-2.0, 0.0], [3.0, 0.0], [-1.0, 1.0], [1.5, -1.5]];
        for b in ends {
            for c in ends.into_iter().filter(|&c| c != b) {
                assert_ne!(moved(b, c), moved(c, b), "{b:?} {c:?}");
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
            assert_eq!(across(b, c), 0.0);
            assert_eq!(moved(b, c), b_x * c_y - b_y * c_x > 0.0, "{b:?} {c:?}");
        }
    }
}
