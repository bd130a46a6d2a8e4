//! Rays through nodes.
//!
//! # No lost hit
//! A plane bounds its child on one side, as a plane of an axis-aligned box does, so the proof is that of
//! `trace/src/slab/mod.rs`, plane by plane. Let u = 2^-24, ρ∞ the greatest coordinate of the triangles *below this child*, and
//! `S = |o|∞ + ρ∞`. All coordinates are relative to the reference point of the BIH, so a hit that a kernel reports at `t` lies
//! within `e = (HIT_ERROR + u)·S` of its triangle in each coordinate ([`canted_trace::ReferencePoint`]): its point `P = o + t·d` satisfies `P_k <= max_k + e` and `P_k >= min_k - e` for the content of the child, with `t <= S + e`.
//!
//! *Who carries the padding.* Let `c` be [`AABB_PAD`](canted_trace::AABB_PAD) `= HIT_ERROR + 6 u`. The build stores the upper plane
//! `h⁺ >= max_k + c·ρ∞` and the lower plane `l⁻ <= min_k - c·ρ∞`, rounded outward. The ray carries `o⁺ = fl(o + c·|o|∞)`, from
//! which lower planes are hit, and `o⁻ = fl(o - c·|o|∞)`, from which upper ones are.
//!
//! *Lower plane, `d > 0`:* the child is entered at `fl(fl(l⁻ - o⁺)·fl(1/d))`. Its exact counterpart `x = (l⁻ - o⁺)/d` is at
//! most 0, and so is the computed value, or `0 < l⁻ - o⁺ <= S`, and three roundings exceed `x` by at most 3.01 u·S/d. Then
//! the value is at most `t` if `(min_k - l⁻) + (o⁺ - o) >= e + 3.01 u·S + 2^-62·S`, where the last term is for a component of `d`
//! replaced by 2^-64. The left side is at least `c·S` less one rounding of `o⁺`, u·S: `e + 4 u·S`, which leaves nearly u·S for second
//! order, the rounding of `c·|o|∞`, and the f64 rounding of the plane.
//!
//! *Upper plane, `d > 0`:* the child is left at `fl(fl(h⁺ - o⁻)·fl(1/d))`. If `P_k >= o_k`, then
//! `h⁺ - o⁻ >= t·d + e + 4 u·S - e = t·d + 4 u·S`, where `t·d <= S + e`: three roundings lower it by less than 3.01 u of it,
//! and it stays at least `t`. As `t >= 0` and `d > 0`, `P_k >= o_k` always holds. For `d < 0` the planes exchange roles.
//!
//! *Intervals.* So the interval `[t0, t1]` in which a child is visited, made of maxima of entries and minima of exits, always
//! contains `t`; it starts with that of the root's box, from the same planes. A child is skipped only where `t0 > t1`, and a
//! subtree on the stack only where `t0 > t_max`. A hit at `t <= t_max` is therefore never skipped, and ties reach the leaf.
//!
//! Underflow loses a few 2^-149 in position; the smallest normal number is added to every pad of a ray. Planes are finite and
//! `1 / 2 < |1/d| <= 2^64`, so no test produces a NaN: a ray parallel to a plane gets a distance of great absolute value and
//! the sign of the side, as the source requires it to test by hand.
//!
//! # Departures from the source
//! A ray in the gap between both children ends the subtree, not the ray: the listing falls through into a leaf test. The root's
//! box is tested once and the root visited once. Stack entries keep their interval, and one that starts behind the best
//! hit is dropped. The traversal ends when the stack is empty, not at the first hit: children may overlap.

use canted_trace::{Leaves, Query, SlabRay};

use crate::boxes::BoxBih;
use crate::build::MAX_DEPTH;
use crate::node::NodeKind;
use crate::partition::{greatest, least};

/// A subtree on the stack, and the interval in which the ray may hit it.
#[derive(Clone, Copy)]
struct StackEntry {
    node: u32,
    interval: [f32; 2],
}

/// What node tests need of a ray along one axis.
#[derive(Clone, Copy)]
struct AxisRay {
    recip: f32,
    /// Which plane of a node the ray leaves through: 0, the upper one, if it runs forward. Also which child is nearer.
    exit: usize,
    /// The origins for that plane and for the other one.
    origins: [f32; 2],
}

impl AxisRay {
    #[inline(always)]
    fn new(ray: &SlabRay, axis: usize) -> Self {
        let recip = ray.recip()[axis];
        let [upper, lower] = [ray.origin_hi()[axis], ray.origin_lo()[axis]];
        match recip > 0.0 {
            true => Self { recip, exit: 0, origins: [upper, lower] },
            false => Self { recip, exit: 1, origins: [lower, upper] },
        }
    }

    /// Where the ray leaves the nearer child of a split node, or the child of a clip node; and where it enters the farther
    /// child, or the child of a clip node.
    #[inline(always)]
    fn exit_and_entry(&self, planes: &[f32; 2]) -> (f32, f32) {
        let [exit, entry] = [planes[self.exit & 1], planes[!self.exit & 1]];
        ((exit - self.origins[0]) * self.recip, (entry - self.origins[1]) * self.recip)
    }
}

impl BoxBih {
    /// Calls `leaf` with each leaf position whose box `ray` may hit at or before `t_max`, nearer subtrees first.
    ///
    /// `ray` is prepared with a reach of 0: the planes are padded. `t_max` is scaled, and `leaf` returns the new one; one below zero
    /// ends the traversal. `leaf` receives every box that the ray enters at or before `t_max`, so all hits of equal `t`, and others
    /// of the same leaves.
    #[inline]
    pub fn traverse_ordered<Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.traverse::<true, Q>(ray, t_max, query, leaf);
    }
}

impl Leaves for BoxBih {
    /// Nodes are visited front to back in both orders: it costs nothing.
    #[inline(always)]
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        ray: &SlabRay,
        mut t_max: f32,
        query: &mut Q,
        mut leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        query.boxes(1);
        let (mut t0, mut t1) = ray.clip_aabb(&self.padded_bounds, t_max);
        if t0 > t1 {
            return;
        }
        let axes = [0, 1, 2].map(|axis| AxisRay::new(ray, axis));
        let nodes = &self.nodes[..];
        // At most one sibling for each level above is on the stack.
        let mut stack = [StackEntry { node: 0, interval: [0.0; 2] }; MAX_DEPTH as usize];
        let mut n_stacked = 0;
        let mut at = 0;
        loop {
            let node = &nodes[at as usize];
            let is_open = match node.kind() {
                NodeKind::Split { axis, second } => {
                    query.boxes(2);
                    let (exit, entry) = axes[axis].exit_and_entry(&node.planes);
                    let near_end = least(t1, exit);
                    let far_start = greatest(t0, entry);
                    let children = [at + 1, at + second];
                    let (near, far) = (children[axes[axis].exit & 1], children[!axes[axis].exit & 1]);
                    if t0 <= near_end {
                        if far_start <= t1 {
                            stack[n_stacked] = StackEntry { node: far, interval: [far_start, t1] };
                            n_stacked += 1;
                        }
                        (at, t1) = (near, near_end);
                        true
                    } else {
                        (at, t0) = (far, far_start);
                        t0 <= t1
                    }
                }
                NodeKind::Clip { axis } => {
                    query.boxes(1);
                    let (exit, entry) = axes[axis].exit_and_entry(&node.planes);
                    (at, t0, t1) = (at + 1, greatest(t0, entry), least(t1, exit));
                    t0 <= t1
                }
                NodeKind::Leaf { first, n } => {
                    for position in first..first + n {
                        t_max = leaf(position, t_max, query);
                        if !ORDERED && t_max < 0.0 {
                            return;
                        }
                    }
                    false
                }
            };
            if is_open {
                continue;
            }
            // Continue with the last subtree that can still contain a hit at or before t_max.
            loop {
                if n_stacked == 0 {
                    return;
                }
                n_stacked -= 1;
                let StackEntry { node, interval } = stack[n_stacked];
                if interval[0] <= t_max {
                    at = node;
                    [t0, t1] = interval;
                    t1 = least(t1, t_max);
                    break;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Each half of the padding is needed, and both together are enough.

    use super::*;
    use crate::partition::{Content, Item};
    use crate::{BihConfig, LeafSize};
    use canted_fixtures::{Grazing, Mesh, coplanar_quads, grazing, soup};
    use canted_obb::Aabb;
    use canted_trace::{AABB_PAD, Kernel, LeafTriangles, Ray, ReferencePoint, ScaledRay, TriangleTest, Watertight};

    /// A traversal whose rays carry no padding.
    struct WithoutRayPads<'a>(&'a BoxBih, Ray);

    impl Leaves for WithoutRayPads<'_> {
        fn traverse<const ORDERED: bool, Q: Query>(
            &self,
            _: &SlabRay,
            t_max: f32,
            query: &mut Q,
            leaf: impl FnMut(u32, f32, &mut Q) -> f32,
        ) {
            let ray = ScaledRay::new(&self.1).expect("it was scaled before");
            self.0.traverse::<ORDERED, Q>(&SlabRay::with_pads(&ray, 0.0, 0.0), t_max, query, leaf);
        }
    }

    /// Numbers of rays that hit, and of those that the BIH loses: with both pads, without those of planes, without those of rays.
    struct Outcome {
        n_hits: usize,
        n_lost: [usize; 3],
    }

    fn trace(mesh: &Mesh, rays: &[Ray]) -> Outcome {
        let corners: Vec<_> = mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect();
        let boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::from_points(*corners)).collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
        let config = BihConfig { leaf_size: LeafSize::AtMost(1), tight_factor: 1.0, ..BihConfig::default() };
        let bih = |pad: f32| {
            let items: Vec<Item> = (0..).zip(&boxes).map(|(i, aabb)| Item::new(i, aabb)).collect();
            let content = Content::of(&items);
            let mut bih = BoxBih::with_pad(items, content, &config, pad);
            // The box of the root stays padded: the planes of nodes are tested here.
            bih.padded_bounds = canted_trace::pad_aabb(&bounds, 8.0 * bounds.reach());
            bih
        };
        let (padded, bare) = (bih(AABB_PAD), bih(0.0));
        fn hits(nodes: &impl Leaves, bih: &BoxBih, corners: &[[[f32; 3]; 3]], ray: &Ray) -> usize {
            let sorted = bih.primitives.iter().map(|primitive| corners[primitive.index()]).collect();
            let triangles = LeafTriangles::new(TriangleTest::Watertight, sorted, ReferencePoint::ORIGIN);
            let (ray, mut hits) = (ScaledRay::new(ray).expect("rays of fixtures are valid"), vec![]);
            triangles.all_hits(nodes, &bih.primitives, &ray, &mut (), &mut hits);
            hits.len()
        }
        let mut outcome = Outcome { n_hits: 0, n_lost: [0; 3] };
        for ray in rays {
            let scaled = ScaledRay::new(ray).expect("rays of fixtures are valid");
            let prepared = Watertight::prepare(&scaled);
            let is_hit = |c: &[[f32; 3]; 3]| {
                Watertight::intersect(&prepared, &scaled, &Watertight::record(*c), scaled.t_max).is_some()
            };
            let want = corners.iter().filter(|corners| is_hit(corners)).count();
            let found = [
                hits(&padded, &padded, &corners, ray),
                hits(&bare, &bare, &corners, ray),
                hits(&WithoutRayPads(&padded, *ray), &padded, &corners, ray),
            ];
            outcome.n_hits += want;
            for (lost, found) in outcome.n_lost.iter_mut().zip(found) {
                *lost += want - found;
            }
        }
        outcome
    }

    #[test]
    fn each_half_of_the_padding_is_needed() {
        // Far content needs the padding of planes, far origins that of rays.
        // At an edge of flat content, a ray enters through one plane and leaves through another at the same point.
        let near = coplanar_quads(8).placed(|p| p.map(|x| 0.1 * x + 0.3)).joined(&soup(3, 100));
        let far = near.placed(|p| [p[0] + 1e4, p[1] - 1e4, p[2] + 1e4]);
        let mut n_lost = [0; 3];
        for (mesh, origin_scale) in [(&far, 1.0), (&near, 1e4)] {
            let rays: Vec<Ray> = Grazing::ALL
                .into_iter()
                .flat_map(|class| grazing(mesh, class, 2_000, 4))
                .map(|ray| {
                    // From near the origin of the space, or from far away, at the point that the ray aims at.
                    let aim: [f32; 3] = std::array::from_fn(|k| ray.origin[k] + ray.direction[k]);
                    let origin: [f32; 3] = std::array::from_fn(|k| (aim[k] - mesh.center()[k] as f32) * origin_scale);
                    Ray::new(origin, std::array::from_fn(|k| aim[k] - origin[k]))
                })
                .collect();
            let outcome = trace(mesh, &rays);
            assert!(outcome.n_hits > 1_000, "{} hits", outcome.n_hits);
            for (sum, n) in n_lost.iter_mut().zip(outcome.n_lost) {
                *sum += n;
            }
        }
        let [with_both, without_planes, without_rays] = n_lost;
        assert_eq!(with_both, 0);
        assert!(without_planes > 0 && without_rays > 0, "lost {without_planes} and {without_rays} hits");
    }
}
