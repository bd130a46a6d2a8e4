//! Whether oriented nodes may pay, judged by some of a mesh's subtrees.
//!
//! Reads: a binary tree with the costs of its aligned collapses. Writes: an estimate of what oriented nodes would leave of
//! the cost. Holds: the same for any number of threads; time that hardly grows with the mesh.
//!
//! Frames and their plan take longer than all the rest of a quick build, and on scans, terrain and architecture the plan then
//! has few oriented nodes or none. So subtrees are sampled, in proportion to their cost; each is built again with a
//! primitive per leaf, and planned with frames and without.

use canted_lbvh::{Child, ChildKind};
use canted_sah::{Axes, Builder, Split, TopDownConfig};

use crate::binary::{Chosen, costs_of_subset};
use crate::collapse::Plan;
use crate::config::Config;
use crate::item::Items;
use crate::par;

/// Frames are found for the whole mesh where the estimate is at most this part of the cost of aligned nodes. The sample does
/// not see nodes above its subtrees, so it may miss some of the gain.
pub(crate) const MAX_COST: f32 = 0.91;

/// Most primitives of a sampled subtree.
const MAX_SAMPLED: usize = 256;

/// Most subtrees that are sampled.
const N_SAMPLED: usize = 16;

/// Builds sampled subtrees.
pub(crate) const BUILDER: Builder = Builder::TopDown(
    TopDownConfig { split: Split::Binned { bins: 16, sweep_threshold: 8 }, axes: Axes::All, ..TopDownConfig::BINNED },
    None,
);

/// An estimate of the cost with oriented nodes, relative to that with aligned nodes only.
pub(crate) fn oriented_cost<S: Items>(chosen: &Chosen<S>, config: &Config, scale: f32) -> f32 {
    let leaf_areas = |i: usize| chosen.aligned_leaf(i);
    let (tree, members) = (&chosen.tree, chosen.members());
    let plan = Plan { tree, members, costs: config.costs, tables: &chosen.aligned_tables, leaf_areas: &leaf_areas };
    let Some(root) = tree.root() else { return 1.0 };
    let range = |child: Child| {
        let range = match child.kind() {
            ChildKind::Leaf(position) => members.range(position, position),
            ChildKind::Inner(id) => members.range(tree.nodes[id.index()].first, tree.nodes[id.index()].last),
        };
        range.start as usize..range.end as usize
    };
    // Subtrees, and the sum of the costs of those before and of each.
    let mut subtrees = vec![];
    let (mut below, mut open) = (0.0f64, vec![root]);
    while let Some(child) = open.pop() {
        match child.kind() {
            ChildKind::Inner(id) if range(child).len() > MAX_SAMPLED => {
                let node = &tree.nodes[id.index()];
                open.extend([node.right, node.left]);
            }
            _ => {
                below += f64::from(plan.cost(child));
                subtrees.push((child, below));
            }
        }
    }
    let mut sampled: Vec<usize> = (0..N_SAMPLED)
        .map(|i| {
            let at = (i as f64 + 0.5) / N_SAMPLED as f64 * below;
            subtrees.partition_point(|&(_, end)| end < at).min(subtrees.len() - 1)
        })
        .collect();
    sampled.dedup();
    let costs =
        par::map(&sampled, 1, |&i| costs_of_subset(&chosen.sorted(range(subtrees[i].0)), chosen.rows, scale, config));
    // Expensive subtrees are sampled more often, so each counts by the part that remains.
    let remaining: f64 = costs.iter().map(|&[aligned, oriented]| f64::from(oriented / aligned)).sum();
    let part = remaining / costs.len() as f64;
    let total = f64::from(plan.cost(root)).max(below);
    let cost = ((total - below + part * below) / total) as f32;
    cost
}
