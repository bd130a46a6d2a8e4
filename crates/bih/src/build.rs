//! The recursion of the build: primitives to nodes.

use canted_lbvh::par;

use crate::BihConfig;
use crate::node::{Node, lower_plane, upper_plane};
use crate::partition::{Content, Item};
use crate::split::{Decision, Region, decide, halve};

/// Greatest number of nodes on a path from the root to a leaf, the leaf and clip nodes included.
///
/// Departure from the source, which names a limit but no value: where the levels that are left are just enough to halve the
/// primitives by count, they are halved by count. So no input exceeds the depth, and leaves keep their size.
pub(crate) const MAX_DEPTH: u32 = 64;

/// Fewest primitives of a node whose children are built in parallel.
const FORK: usize = 1 << 12;

/// More primitives than this get no clip nodes, so that distances between nodes fit 32 bits: without them there are at most two
/// nodes a primitive, with them at most five.
const MAX_CLIPPED: usize = 1 << 29;

/// Levels that suffice to halve any number of primitives by count: 2^30 take 31.
const ALWAYS_ENOUGH: u32 = 32;

/// Builds the nodes over `items`, which it reorders into leaf order. At least one item. Returns the height, too.
///
/// `pad` is the part of the padding that planes carry, relative to the reach of their content.
pub(crate) fn build(items: &mut [Item], content: Content, config: &BihConfig, pad: f64) -> (Vec<Node>, u32) {
    let factor = if items.len() > MAX_CLIPPED { f32::INFINITY } else { config.factor() };
    let builder = Builder { max_leaf: config.max_leaf(items.len()), factor, pad, fork: par::n_threads() > 1 };
    let mut nodes = Vec::with_capacity(2 * items.len().div_ceil(builder.max_leaf));
    let mut region = Region { space: content.bounds, visible: content.bounds, content };
    let height = builder.subtree(items, 0, &mut region, MAX_DEPTH, &mut nodes);
    (nodes, height)
}

struct Builder {
    max_leaf: usize,
    factor: f32,
    pad: f64,
    /// Whether there are several threads. Joining their nodes changes no bit.
    fork: bool,
}

impl Builder {
    /// Appends the subtree over `items`, whose first reference is `first`; returns its height. `levels` is the greatest height that
    /// is allowed.
    ///
    /// Holds: `levels` suffice to halve the items by count.
    fn subtree(&self, items: &mut [Item], first: u32, region: &mut Region, levels: u32, nodes: &mut Vec<Node>) -> u32 {
        if items.len() <= self.max_leaf {
            nodes.push(Node::leaf(first, items.len() as u32));
            return 1;
        }
        let must_halve = levels < ALWAYS_ENOUGH && levels <= self.halving_levels(items.len());
        let decision = if must_halve { halve(items) } else { decide(items, region, self.factor) };
        match decision {
            Decision::Leaf => {
                nodes.push(Node::leaf(first, items.len() as u32));
                1
            }
            Decision::Clip { axis } => {
                let [min, max] = [region.content.bounds.min[axis], region.content.bounds.max[axis]];
                let pad = self.pad * f64::from(region.content.reach);
                nodes.push(Node::clip(axis, [upper_plane(max, pad), lower_plane(min, pad)]));
                for aabb in [&mut region.space, &mut region.visible] {
                    (aabb.min[axis], aabb.max[axis]) = (min, max);
                }
                1 + self.subtree(items, first, region, levels - 1, nodes)
            }
            Decision::Split { axis, split, n_left } => {
                let (left_items, right_items) = items.split_at_mut(n_left);
                let [left, right] = [Content::of(left_items), Content::of(right_items)];
                let (left_max, right_min) = (left.bounds.max[axis], right.bounds.min[axis]);
                let planes = [
                    upper_plane(left_max, self.pad * f64::from(left.reach)),
                    lower_plane(right_min, self.pad * f64::from(right.reach)),
                ];
                let mut right_region = Region { content: right, ..*region };
                let left_region = region;
                left_region.content = left;
                (left_region.space.max[axis], left_region.visible.max[axis]) = (split, left_max);
                (right_region.space.min[axis], right_region.visible.min[axis]) = (split, right_min);
                let at = nodes.len();
                // The distance to the second child is known after the first.
                nodes.push(Node::clip(axis, planes));
                let right_first = first + n_left as u32;
                let (heights, second);
                if self.fork && left_items.len() + right_items.len() > FORK {
                    let mut right_nodes = vec![];
                    heights = par::join(
                        || self.subtree(left_items, first, left_region, levels - 1, nodes),
                        || self.subtree(right_items, right_first, &mut right_region, levels - 1, &mut right_nodes),
                    );
                    second = nodes.len();
                    nodes.extend_from_slice(&right_nodes);
                } else {
                    let left_height = self.subtree(left_items, first, left_region, levels - 1, nodes);
                    second = nodes.len();
                    let right_height = self.subtree(right_items, right_first, &mut right_region, levels - 1, nodes);
                    heights = (left_height, right_height);
                }
                nodes[at] = Node::split(axis, (second - at) as u32, planes);
                1 + heights.0.max(heights.1)
            }
        }
    }

    /// Levels that halving `n` items by count takes, the leaf included.
    fn halving_levels(&self, n: usize) -> u32 {
        n.div_ceil(self.max_leaf).next_power_of_two().trailing_zeros() + 1
    }
}

#[cfg(test)]
mod tests;
