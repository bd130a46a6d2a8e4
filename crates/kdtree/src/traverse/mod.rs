//! Rays through cells and leaves.
//!
//! # No lost hit
//! Let a kernel report a hit of a triangle at `t`. All coordinates are relative to the reference point of the tree, so there is a point
//! `x` of the triangle within `(HIT_ERROR + 2^-24)·(|o|∞ + ρ∞)` of `P = o + t·d` ([`canted_trace::ReferencePoint`]). [`canted_trace::SlabRay`] is proven to enter, on every axis, the box `[x - p, x + p]` with `p = AABB_PAD·ρ∞`
//! at most at `t`, and to leave it at `t` or later: the first part of the padding is that of the box, the second is carried by the
//! ray.
//!
//! A kd-tree has planes instead of boxes, and a plane lies between triangles of any size, so no padding can be part of it. Here the
//! *triangle* is padded by `p`: a leaf refers to it if a point of the padded triangle is in its cell ([`crate::extent`]). The ray is
//! that of the boxes. For a plane `s` on an axis, let the ray leave what is below at `e(s)` and enter what is above at `f(s)`:
//!
//! ```text
//! e(s) = fl(fl(s - o⁻)·r)     o⁻ = fl(o - AABB_PAD·|o|∞ - 2^-126)     r = fl(1/d), here positive
//! f(s) = fl(fl(s - o⁺)·r)     o⁺ = fl(o + AABB_PAD·|o|∞ + 2^-126)
//! ```
//!
//! A negative `r` exchanges below and above, and `o⁻` and `o⁺`. Of a node's interval `[t_0, t_1]` the near cell gets
//! `[t_0, min(t_1, e(s))]` and the far one `[max(t_0, f(s)), t_1]`. These overlap: `f(s) <= e(s)`.
//!
//! *There is a leaf whose interval contains `t` and that refers to the triangle.* Rounding is monotonic, so both functions
//! are. Hence the planes that the ray leaves at `t` or later, `e(s) >= t`, are all from some `a` upward, those with `f(s) <= t`
//! all up to some `b`, and no number is between `b` and `a`. The proof for boxes says `a <= x + p` and `b >= x - p`, both
//! rounded outward. So on each axis there is a real `y` with `|y - x| <= p` such that `e(s) >= t` for all planes `s >= y`, and
//! `f(s) <= t` for all `s <= y`. The point `y` belongs to the padded triangle. Go down from the root to a leaf whose cell
//! contains `y` and that refers to the triangle; where `y` is on a plane, [`crate::sweep::Split::sides`] says which. Every plane on the way
//! leaves `t` in the interval, and so do the faces of the root.
//!
//! Errors are thus relative to the triangle and the ray's origin only, although a plane may be far from both.
//!
//! # Order and end
//! Nearer cells come first, but the intervals overlap, so a hit does not end the walk: a leaf is skipped only if its interval
//! begins after the best hit so far. Every hit of equal `t` is thus found, and ties go to the lowest primitive.
//!
//! # Two walks
//! [`stack`] keeps the far cells on a stack. [`ropes`] continues from a leaf across a face. Both visit the same leaves in
//! the same order.

pub(crate) mod ropes;
pub(crate) mod stack;

use canted_obb::Aabb;
use canted_trace::{Leaves, Query, SlabRay};

use crate::node::{Node, NodeKind, Reference};
use crate::{KdNodes, KdTraversal};

/// A ray on one axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisRay {
    /// The moved origin for planes that the ray leaves.
    exit_origin: f32,
    /// The moved origin for planes that the ray enters.
    entry_origin: f32,
    recip: f32,
    /// Whether the ray runs downward, so that the upper cell is near.
    pub(crate) is_down: bool,
}

impl AxisRay {
    /// Where the ray leaves what is before a plane.
    #[inline(always)]
    pub(crate) fn exit(&self, plane: f32) -> f32 {
        (plane - self.exit_origin) * self.recip
    }

    /// Where the ray enters what is behind a plane.
    #[inline(always)]
    pub(crate) fn entry(&self, plane: f32) -> f32 {
        (plane - self.entry_origin) * self.recip
    }
}

/// A ray prepared for planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneRay {
    pub(crate) axes: [AxisRay; 3],
    pub(crate) t_min: f32,
}

impl PlaneRay {
    /// `ray` is prepared with a reach of 0: triangles carry the padding relative to themselves.
    pub(crate) fn new(ray: &SlabRay) -> Self {
        let axis = |k: usize| {
            let (recip, above, below) = (ray.recip()[k], ray.origin_lo()[k], ray.origin_hi()[k]);
            let is_down = recip < 0.0;
            let (exit_origin, entry_origin) = if is_down { (above, below) } else { (below, above) };
            AxisRay { exit_origin, entry_origin, recip, is_down }
        };
        Self { axes: [axis(0), axis(1), axis(2)], t_min: ray.t_min() }
    }

    /// The interval of the ray in the root.
    pub(crate) fn clip(&self, cell: &Aabb, t_max: f32) -> (f32, f32) {
        let mut interval = (self.t_min, t_max);
        for (k, axis) in self.axes.iter().enumerate() {
            let (near, far) = if axis.is_down { (cell.max[k], cell.min[k]) } else { (cell.min[k], cell.max[k]) };
            interval = (interval.0.max(axis.entry(near)), interval.1.min(axis.exit(far)));
        }
        interval
    }
}

/// Near and far child of a node.
#[inline(always)]
pub(crate) fn ordered(axis: &AxisRay, node: u32, upper: u32) -> (u32, u32) {
    if axis.is_down { (upper, node + 1) } else { (node + 1, upper) }
}

/// Calls `visit` with the triangles of a leaf; returns the new `t_max`.
#[inline(always)]
pub(crate) fn visit_leaf<Q: Query>(
    references: &[Reference],
    first: Option<u32>,
    mut t_max: f32,
    query: &mut Q,
    visit: &mut impl FnMut(u32, f32, &mut Q) -> f32,
) -> f32 {
    let Some(first) = first else { return t_max };
    for reference in &references[first as usize..] {
        t_max = visit(reference.triangle(), t_max, query);
        if reference.is_last() || t_max < 0.0 {
            break;
        }
    }
    t_max
}

/// A leaf on the way of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached {
    pub(crate) first: Option<u32>,
    pub(crate) number: u32,
}

/// Goes down from `node` to the first leaf in the order of the ray whose interval is not empty; the interval of `node` begins at `t_0`
/// and is not empty.
#[inline(always)]
pub(crate) fn first_leaf<Q: Query>(nodes: &[Node], ray: &PlaneRay, mut node: u32, t_0: f32, query: &mut Q) -> Reached {
    loop {
        match nodes[node as usize].kind() {
            NodeKind::Leaf { first, number } => return Reached { first, number },
            NodeKind::Inner { axis, plane, upper } => {
                query.boxes(1);
                let axis = &ray.axes[axis];
                let (near, far) = ordered(axis, node, upper);
                // If the near interval is empty, the far one begins at t_0 too.
                node = if t_0 <= axis.exit(plane) { near } else { far };
            }
        }
    }
}

impl KdNodes {
    /// Calls `visit` with the number of each triangle in the leaves that `ray` enters at or before `t_max`, nearer leaves first. A
    /// triangle in several leaves is reported for each.
    ///
    /// `ray` is prepared with a reach of 0: `SlabRay::new(&ray, 0.0)`. `t_max` is scaled, and `visit` returns the new one; a
    /// `t_max` below zero ends the walk. Every triangle with a hit at or before the last `t_max` is visited. A query counts
    /// each plane as a box.
    #[inline]
    pub fn traverse<Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        visit: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.traverse_leaves(&PlaneRay::new(ray), t_max, query, |_| (), visit);
    }

    /// As [`Self::traverse`]; `leaf` receives the number of each leaf.
    #[inline(always)]
    pub(crate) fn traverse_leaves<Q: Query>(
        &self,
        ray: &PlaneRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32),
        visit: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        match self.traversal {
            KdTraversal::Stack => stack::walk(self, ray, t_max, query, leaf, visit),
            KdTraversal::Ropes => ropes::walk(self, ray, t_max, query, leaf, visit),
        }
    }
}

/// Leaf positions are the numbers of triangles; order and end are those of [`KdNodes::traverse`] in both cases.
impl Leaves for KdNodes {
    #[inline(always)]
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.traverse(ray, t_max, query, leaf);
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{Grazing, Mesh, SplitMix64, grazing, soup, torus};
    use canted_lbvh::Corners;
    use canted_trace::{Kernel, Ray, ScaledRay, Watertight};

    use super::*;
    use crate::build::build_padded;
    use crate::{KdNodes, KdTraversal, KdTreeConfig};

    fn deep() -> KdTreeConfig {
        KdTreeConfig { traversal_cost: 0.01, traversal: KdTraversal::Ropes, ..KdTreeConfig::default() }
    }

    fn corners(mesh: &Mesh) -> Vec<Corners> {
        mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect()
    }

    fn rays(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
        let of = |class| grazing(mesh, class, n, seed);
        Grazing::ALL.into_iter().flat_map(of).map(|ray| Ray::new(ray.origin, ray.direction)).collect()
    }

    /// The numbers of the leaves on the way of a ray. Each hit shortens the ray, as in a query, if `shrinks`.
    fn leaves(tree: &KdNodes, corners: &[Corners], ray: &Ray, shrinks: bool) -> Vec<u32> {
        let Some(ray) = ScaledRay::new(ray) else { return vec![] };
        let (prepared, mut numbers) = (Watertight::prepare(&ray), vec![]);
        let hit = |triangle: u32, t_max: f32| {
            let record = Watertight::record(corners[triangle as usize]);
            Watertight::intersect(&prepared, &ray, &record, t_max).map(|hit| hit.t)
        };
        let plane_ray = PlaneRay::new(&SlabRay::new(&ray, 0.0));
        tree.traverse_leaves(
            &plane_ray,
            ray.t_max,
            &mut (),
            |leaf| numbers.push(leaf),
            |triangle, t_max, ()| hit(triangle, t_max).filter(|_| shrinks).unwrap_or(t_max),
        );
        numbers
    }

    #[test]
    fn both_walks_visit_the_same_leaves_in_the_same_order() {
        let mut n_leaves = 0;
        for mesh in [
            soup(2, 300),
            torus(12, 9),
            canted_fixtures::coplanar_quads(60),
            soup(3, 200).placed(|p| p.map(|x| x + 1e7)),
            soup(4, 200).placed(|p| p.map(|x| 1e-3 * x + 3e4)),
        ] {
            let corners = corners(&mesh);
            let ropes = KdNodes::new(&corners, &deep());
            let stack = ropes.clone().with_traversal(KdTraversal::Stack);
            let (planes, mut rng) = (ropes.planes(), SplitMix64::new(1));
            for (i, mut ray) in rays(&mesh, 400, 3).into_iter().enumerate() {
                if i % 4 == 0 && !planes.is_empty() {
                    // In a plane, or from its edge.
                    let [(a, plane), (b, second)] = [0; 2].map(|_| planes[rng.below(planes.len())]);
                    (ray.origin[a], ray.origin[b]) = (plane, second);
                    ray.direction[a] = [0.0, -0.0, 1e-30, ray.direction[a]][rng.below(4)];
                }
                for shrinks in [false, true] {
                    let [a, b] = [&stack, &ropes].map(|tree| leaves(tree, &corners, &ray, shrinks));
                    assert_eq!(a, b, "{ray:?}");
                    n_leaves += a.len();
                }
            }
        }
        assert!(n_leaves > 30_000, "{n_leaves} leaves");
    }

    /// How many hits of a loop over all triangles a tree does not visit, and how many there are.
    fn n_lost(tree: &KdNodes, corners: &[Corners], rays: &[Ray], is_ray_padded: bool) -> (usize, usize) {
        let (mut n_lost, mut n_hits) = (0, 0);
        for ray in rays.iter().filter_map(ScaledRay::new) {
            let (prepared, mut seen) = (Watertight::prepare(&ray), vec![false; corners.len()]);
            let slab_ray = if is_ray_padded { SlabRay::new(&ray, 0.0) } else { SlabRay::with_pads(&ray, 0.0, 0.0) };
            // Every hit alone: the walk ends at the hit, where the interval of its leaf is the narrowest.
            for (triangle, record) in corners.iter().map(|&c| Watertight::record(c)).enumerate() {
                let Some(hit) = Watertight::intersect(&prepared, &ray, &record, ray.t_max) else { continue };
                seen.fill(false);
                tree.traverse(&slab_ray, hit.t, &mut (), |triangle, t_max, ()| {
                    seen[triangle as usize] = true;
                    t_max
                });
                n_hits += 1;
                n_lost += usize::from(!seen[triangle]);
            }
        }
        (n_lost, n_hits)
    }

    /// Both halves of the padding are needed: without either, hits are lost, and with both none is.
    #[test]
    fn without_either_half_of_the_padding_hits_are_lost() {
        // Relative to the origin: a small mesh, and rays from afar.
        let near = torus(24, 16).placed(|p| p.map(|x| x * 0.5));
        let from_afar: Vec<Ray> = rays(&near, 400, 5)
            .into_iter()
            .map(|ray| Ray { origin: std::array::from_fn(|k| ray.origin[k] - 300.0 * ray.direction[k]), ..ray })
            .collect();
        // Relative to the triangles: a mesh far away, and rays from 0.
        let far = torus(24, 16).placed(|p| p.map(|x| x + 100.0));
        let from_zero: Vec<Ray> = rays(&far, 400, 6)
            .into_iter()
            .zip(far.positions.iter().cycle())
            .map(|(_, &target)| Ray::new([0.0; 3], target))
            .collect();
        for traversal in [KdTraversal::Stack, KdTraversal::Ropes] {
            let [near, far] = [&near, &far].map(corners);
            let config = KdTreeConfig { traversal, ..deep() };
            let padded = |corners: &[Corners]| KdNodes::new(corners, &config);
            let (lost, n_hits) = n_lost(&padded(&near), &near, &from_afar, true);
            assert!(lost == 0 && n_hits > 500, "{lost} of {n_hits} hits are lost");
            let (lost, _) = n_lost(&padded(&near), &near, &from_afar, false);
            assert!(lost > 0, "{traversal:?}: rays need no padding");
            let (lost, n_hits) = n_lost(&padded(&far), &far, &from_zero, true);
            assert!(lost == 0 && n_hits > 500, "{lost} of {n_hits} hits are lost");
            let unpadded = KdNodes::from_built(build_padded(&far, &config, 0.0), &config);
            let (lost, _) = n_lost(&unpadded, &far, &from_zero, true);
            assert!(lost > 0, "{traversal:?}: triangles need no padding");
        }
    }

    /// Every way in which a ray and its interval can lie to a plane, in both directions and parallel to it.
    #[test]
    fn cells_are_visited_in_order_if_the_interval_reaches_them() {
        let triangle = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 0.5, 1.0]];
        let corners = [triangle(0.0), triangle(7.0)];
        let tree = KdNodes::new(&corners, &KdTreeConfig { max_depth: Some(1), traversal_cost: 0.01, ..deep() });
        let [(0, plane)] = tree.planes()[..] else { panic!("one plane on the first axis: {tree:?}") };
        let (start, end) = (f64::from(tree.cell().min[0]), f64::from(tree.cell().max[0]));
        let trees = [tree.clone().with_traversal(KdTraversal::Stack), tree];
        let (mut seen, plane) = (std::collections::BTreeSet::new(), f64::from(plane));
        for origin in [-3.0, 0.3, plane, 0.5 * (plane + end), 11.0] {
            for direction in [4.0, 1.0, 0.0, -0.0, -1.0, -4.0] {
                for [t_min, t_max] in [[0.0, f64::INFINITY], [0.0, 0.2], [0.5, 0.9], [1.5, 3.6], [2.7, 30.0]] {
                    let ray = Ray {
                        origin: [origin as f32, 0.4, 0.3],
                        direction: [direction as f32, 0.0, 1e-3],
                        t_min: t_min as f32,
                        t_max: (t_max as f32).min(600.0),
                        ..Ray::new([0.0; 3], [0.0; 3])
                    };
                    // The part of the axis that the ray covers in the root.
                    let ends = [t_min, t_max.min(600.0)].map(|t| origin + t * direction);
                    let (least, greatest) = (ends[0].min(ends[1]).max(start), ends[0].max(ends[1]).min(end));
                    let mut want = vec![];
                    if least <= greatest {
                        want.extend((least <= plane).then_some(0));
                        want.extend((greatest >= plane).then_some(1));
                    }
                    if direction < 0.0 {
                        want.reverse();
                    }
                    for tree in &trees {
                        let mut found = leaves(tree, &corners, &ray, false);
                        if direction == 0.0 {
                            found.sort_unstable();
                        }
                        assert_eq!(found, want, "{ray:?}");
                    }
                    seen.insert((want, direction > 0.0, direction < 0.0, origin < plane, origin > plane));
                }
            }
        }
        assert!(seen.len() > 20, "{} configurations", seen.len());
    }

    /// A hit is not always in the cell in which its triangle is met first: a walk that ends at the first leaf with a hit is wrong.
    #[test]
    fn ending_at_the_first_leaf_with_a_hit_finds_other_hits() {
        let mesh = soup(5, 400);
        let corners = corners(&mesh);
        let tree = KdNodes::new(&corners, &deep());
        let (mut n_hits, mut n_wrong) = (0, 0);
        for ray in rays(&mesh, 200, 7).iter().filter_map(ScaledRay::new) {
            let prepared = Watertight::prepare(&ray);
            let leaf = std::cell::Cell::new(0);
            // The least `t` of all leaves, and of the first leaf with a hit.
            let (mut best, mut first): (f32, Option<(u32, f32)>) = (f32::INFINITY, None);
            let plane_ray = PlaneRay::new(&SlabRay::new(&ray, 0.0));
            tree.traverse_leaves(
                &plane_ray,
                ray.t_max,
                &mut (),
                |number| leaf.set(number),
                |triangle, t_max, ()| {
                    let record = Watertight::record(corners[triangle as usize]);
                    let Some(hit) = Watertight::intersect(&prepared, &ray, &record, ray.t_max) else { return t_max };
                    best = best.min(hit.t);
                    first = match first {
                        None => Some((leaf.get(), hit.t)),
                        Some((number, t)) if number == leaf.get() => Some((number, t.min(hit.t))),
                        later => later,
                    };
                    t_max
                },
            );
            n_hits += usize::from(first.is_some());
            n_wrong += usize::from(first.is_some_and(|(_, t)| t > best));
        }
        assert!(n_hits > 500 && n_wrong > 0, "{n_wrong} of {n_hits} are wrong");
    }
}
