use canted_lbvh::{Child, NodeId, Sorted, Tree, radix};
use canted_obb::{Aabb, PrimId};

use crate::{lanes::Lanes, par, scale::unit_scale};

/// How far clusters look for a partner.
///
/// Near rounds save much time and cost little, most of it where slivers lie at random; `benches/TRIED.md` has the figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlocConfig {
    /// Places searched on either side along the curve; at least 1.
    pub radius: u32,
    /// First rounds that search two places only: of the many clusters there still are, most have a near partner.
    pub near_iterations: u32,
}

impl PlocConfig {
    /// Near rounds first.
    pub const NEAR: Self = Self { radius: 14, near_iterations: 3 };

    /// Every round searches far.
    pub const WIDE: Self = Self { radius: 14, near_iterations: 0 };
}

impl Default for PlocConfig {
    fn default() -> Self {
        Self::NEAR
    }
}

/// Places searched in the first rounds.
const NEAR: u32 = 2;

/// Clusters whose partners one job finds.
const CHUNK: usize = 1 << 11;

/// A round that joins less than one cluster in this many is followed by one that joins all neighbours.
const SLOW: usize = 16;

/// Up to this many clusters, slow rounds are cheap.
const FEW: usize = 128;

/// A cluster: a finished subtree and its box.
#[derive(Clone, Copy)]
struct Cluster {
    aabb: Lanes,
    child: Child,
}

/// Joins neighbours along a space-filling curve from the leaves up, the pair of smallest box first.
///
/// Reads: primitives in the order of their codes, a box each (finite); codes of the boxes' centres, which the halves
/// of a rectangle share, serve better than those of triangles' centroids. Writes: a tree with an order of leaves of its
/// own. Holds: the same bits for any number of threads; time linear in the number of primitives, whatever their boxes.
/// Source: Meister & Bittner 2018. Departures: of equal areas the pair whose places differ in the lower bits is
/// nearer, so equal boxes pair up at once; and where boxes grow along the curve, so that each wants the one before, a
/// slow round is followed by one that joins all neighbours.
///
/// # Panics
/// Where the boxes are not as many as the primitives.
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
    // Nodes are numbered downward, so that the one made last is the root, 0.
    let mut children = vec![[Child::inner(NodeId::ROOT); 2]; last];
    let (mut round, mut forced) = (0, false);
    while clusters.len() > 1 {
        let radius = if round < config.near_iterations { NEAR.min(config.radius) } else { config.radius };
        let partners = if forced { neighbours(clusters.len()) } else { nearest(&clusters, radius.max(1) as usize) };
        let before = clusters.len();
        clusters = join(&clusters, &partners, |pair| {
            last -= 1;
            children[last] = pair;
            #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
            Child::inner(NodeId(last as u32))
        });
        round += 1;
        let n_joined = before - clusters.len();
        forced = n_joined == 0 || !forced && before > FEW && n_joined < before / SLOW;
    }
    Tree::from_children(&children).expect("every cluster is joined once")
}

/// The partner of each cluster that makes the smallest box, of those at most `radius` places away.
fn nearest(clusters: &[Cluster], radius: usize) -> Vec<u32> {
    par::map_ranges(clusters.len(), CHUNK, |range| {
        // Each pair is weighed once, so those before the range that reach into it are gone through too.
        let start = range.start.saturating_sub(radius);
        let reach = &clusters[start..clusters.len().min(range.end + radius)];
        let mut best = vec![u64::MAX; reach.len()];
        for i in 0..range.end - start {
            let (done, open) = best.split_at_mut(i + 1);
            let (mut mine, own) = (done[i], reach[i].aabb);
            for ((place, other), best) in (start + i + 1..).zip(&reach[i + 1..]).zip(open).take(radius) {
                // Places that differ in low bits only are nearer: along equal areas the difference falls from partner
                // to partner, so chains are short. Areas are not negative, so their bits are in order.
                let area = own.union(&other.aabb).half_area();
                let key = u64::from(area.to_bits()) << 32 | ((start + i) ^ place) as u64;
                mine = mine.min(key);
                *best = key.min(*best);
            }
            done[i] = mine;
        }
        #[expect(clippy::cast_possible_truncation, reason = "the lower half is the difference of two places")]
        range.map(|i| i as u32 ^ best[i - start] as u32).collect::<Vec<_>>()
    })
    .concat()
}

/// Each cluster with the one beside it.
#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 clusters")]
fn neighbours(n: usize) -> Vec<u32> {
    (0..n).map(|i| if i ^ 1 < n { i as u32 ^ 1 } else { i as u32 }).collect()
}

/// Joins clusters that are each other's partner, in the place of the first.
fn join(clusters: &[Cluster], partners: &[u32], mut name: impl FnMut([Child; 2]) -> Child) -> Vec<Cluster> {
    let mut joined = Vec::with_capacity(clusters.len());
    for (i, cluster) in clusters.iter().enumerate() {
        let partner = partners[i] as usize;
        if partner == i || partners.get(partner).is_none_or(|&back| back as usize != i) {
            joined.push(*cluster);
        } else if i < partner {
            let other = &clusters[partner];
            let child = name([cluster.child, other.child]);
            joined.push(Cluster { aabb: cluster.aabb.union(&other.aabb), child });
        }
    }
    joined
}
