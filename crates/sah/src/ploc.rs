use canted_lbvh::{Child, NodeId, Sorted, Tree, radix};
use canted_obb::{Aabb, PrimId};

use crate::{
    par,
    reference::{Lanes, unit_scale},
};

/// The search for partners in [`ploc()`].
///
/// Iterations with a small radius save much time at little cost, measured in `benches/TRIED.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlocConfig {
    /// Search radius along the curve, at least 1.
    pub radius: u32,
    /// Number of first iterations with a radius of 2: most of the many clusters have a near partner.
    pub near_iterations: u32,
}

impl PlocConfig {
    /// Three iterations with a small radius first.
    pub const NEAR: Self = Self { radius: 14, near_iterations: 3 };

    /// The full radius in every iteration.
    pub const WIDE: Self = Self { radius: 14, near_iterations: 0 };
}

impl Default for PlocConfig {
    fn default() -> Self {
        Self::NEAR
    }
}

/// Search radius of the first iterations.
const NEAR: u32 = 2;

/// Clusters per job.
const CHUNK: usize = 1 << 11;

/// An iteration that merges fewer than one in this many clusters is followed by one that merges all neighbors.
const SLOW: usize = 16;

/// Slow iterations are acceptable for at most this many clusters.
const FEW: usize = 128;

/// A cluster: a finished subtree and its box.
#[derive(Clone, Copy)]
struct Cluster {
    aabb: Lanes,
    child: Child,
}

/// Parallel locally-ordered clustering (PLOC): merges neighbors along a space-filling curve, smallest boxes first.
///
/// Reads: primitives sorted by code, with finite boxes; codes of box centers work better than those of triangle centroids,
/// since the two triangles of a rectangle share them. Writes: a tree with its own leaf order. Holds: the same bits for any
/// number of threads; linear time for any boxes.
/// Source: Meister & Bittner 2018. Differences: among equal areas the pair whose positions differ in lower bits is nearer,
/// so equal boxes pair up at once; and a slow iteration, as for boxes that grow along the curve, is followed by one that
/// merges all neighbors.
///
/// # Panics
/// If the numbers of boxes and primitives differ.
#[must_use]
pub fn ploc(sorted: Sorted, leaf_boxes: &[Aabb], config: &PlocConfig) -> Tree {
    let leaves = &sorted.leaves;
    assert_eq!(leaf_boxes.len(), leaves.len(), "one box for each leaf");
    if leaves.len() < 2 {
        return radix(sorted);
    }
    let mut last = leaves.len() - 1;
    let scale = unit_scale(leaf_boxes).unwrap_or(1.0);
    let cluster = |(leaf, aabb): (&PrimId, &Aabb)| Cluster { aabb: Lanes::of(aabb, scale), child: Child::leaf(leaf.0) };
    let mut clusters: Vec<_> = leaves.iter().zip(leaf_boxes).map(cluster).collect();
    // Nodes are numbered downward, so that the last one is the root, 0.
    let mut children = vec![[Child::inner(NodeId::ROOT); 2]; last];
    let (mut iteration, mut forced) = (0, false);
    while clusters.len() > 1 {
        let radius = if iteration < config.near_iterations { NEAR.min(config.radius) } else { config.radius };
        let partners = if forced { neighbors(clusters.len()) } else { nearest(&clusters, radius.max(1) as usize) };
        let before = clusters.len();
        clusters = merge(&clusters, &partners, |pair| {
            last -= 1;
            children[last] = pair;
            Child::inner(NodeId(last as u32))
        });
        iteration += 1;
        let n_merged = before - clusters.len();
        forced = n_merged == 0 || !forced && before > FEW && n_merged < before / SLOW;
    }
    // Every cluster is merged once.
    Tree::numbered(children.len() + 1, NodeId::ROOT, |id| children[id.index()], PrimId)
}

/// The partner of each cluster with the smallest union, within `radius` positions.
fn nearest(clusters: &[Cluster], radius: usize) -> Vec<u32> {
    par::map_ranges(clusters.len(), CHUNK, |range| {
        // Each pair is evaluated once, so pairs that start before the range are included.
        let start = range.start.saturating_sub(radius);
        let window = &clusters[start..clusters.len().min(range.end + radius)];
        let mut best = vec![u64::MAX; window.len()];
        for i in 0..range.end - start {
            let (done, open) = best.split_at_mut(i + 1);
            let (mut mine, own) = (done[i], window[i].aabb);
            for ((position, other), best) in (start + i + 1..).zip(&window[i + 1..]).zip(open).take(radius) {
                // Positions that differ in low bits are nearer: for equal areas the difference decreases from partner to
                // partner, so chains are short. Areas are not negative, so their bits are ordered.
                let area = own.union(&other.aabb).half_area();
                let key = u64::from(area.to_bits()) << 32 | ((start + i) ^ position) as u64;
                mine = mine.min(key);
                *best = key.min(*best);
            }
            done[i] = mine;
        }
        range.map(|i| i as u32 ^ best[i - start] as u32).collect::<Vec<_>>()
    })
    .concat()
}

/// Pairs of adjacent clusters.
fn neighbors(n: usize) -> Vec<u32> {
    (0..n).map(|i| if i ^ 1 < n { i as u32 ^ 1 } else { i as u32 }).collect()
}

/// Merges clusters that are each other's partner, at the position of the first.
fn merge(clusters: &[Cluster], partners: &[u32], mut add_node: impl FnMut([Child; 2]) -> Child) -> Vec<Cluster> {
    let mut merged = Vec::with_capacity(clusters.len());
    for (i, cluster) in clusters.iter().enumerate() {
        let partner = partners[i] as usize;
        if partner == i || partners.get(partner).is_none_or(|&back| back as usize != i) {
            merged.push(*cluster);
        } else if i < partner {
            let other = &clusters[partner];
            let child = add_node([cluster.child, other.child]);
            merged.push(Cluster { aabb: cluster.aabb.union(&other.aabb), child });
        }
    }
    merged
}
