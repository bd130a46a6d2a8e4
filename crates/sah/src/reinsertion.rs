use canted_lbvh::{MAX_DEPTH, Tree};
use canted_obb::Aabb;

use crate::{ReinsertConfig, pairs::Pairs, par, scale::unit_scale, search, select};

/// Subtrees searched by one job.
const CHUNK: usize = 64;

/// Moves subtrees to where the surface areas of all boxes sum to less.
///
/// Reads: a tree, the box of each leaf (finite, in leaf order). Writes: a tree over the same primitives, renumbered,
/// with an order of leaves of its own. Holds: the sum of areas does not rise; the depth is at most the greater of the
/// tree's and [`MAX_DEPTH`]; the same bits for any number of threads.
/// Source: Bittner, Hapala & Havran 2013; in rounds of parallel search after Meister & Bittner 2018. In place of locks
/// each move is weighed as it is made.
///
/// # Panics
/// Where the boxes are not as many as the leaves.
#[must_use]
pub fn reinsert(tree: &Tree, leaf_boxes: &[Aabb], config: &ReinsertConfig) -> Tree {
    assert_eq!(leaf_boxes.len(), tree.leaves.len(), "one box for each leaf");
    let Some(scale) = unit_scale(leaf_boxes) else { return tree.clone() };
    if tree.nodes.len() < 2 {
        return tree.clone();
    }
    let mut pairs = Pairs::new(tree, leaf_boxes, scale);
    let mut sum = pairs.sum_of_areas();
    let max_depth = tree.depth.max(MAX_DEPTH);
    let mut moved = false;
    for round in 0..config.iterations {
        let gain = improve(&mut pairs, n_searched(tree, config, round), max_depth);
        moved |= gain > 0.0;
        sum -= gain;
        if gain <= f64::from(config.min_gain) * sum {
            break;
        }
    }
    if !moved {
        return tree.clone();
    }
    Tree::from_children(&pairs.children(tree)).expect("a moved subtree leaves a tree a tree")
}

/// One round over the `n` largest boxes; returns by how much the sum of half areas falls.
fn improve(pairs: &mut Pairs, n: usize, max_depth: u32) -> f64 {
    let slots = select::largest(pairs, n);
    let found = par::map_chunks(&slots, CHUNK, |_, slots| {
        let mut stack = vec![];
        slots.iter().filter_map(|&slot| search::better_place(pairs, slot, &mut stack)).collect::<Vec<_>>()
    });
    let mut moves = found.concat();
    moves.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    moves.iter().filter_map(|found| pairs.apply(found, max_depth)).sum()
}

/// Number of subtrees searched in a round.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "a share of at most 2^31 nodes, saturating"
)]
fn n_searched(tree: &Tree, config: &ReinsertConfig, round: u32) -> usize {
    let n_nodes = 2 * tree.nodes.len();
    let share = f64::from(config.fraction.min(1.0)) / f64::from(2 * round + 1);
    ((n_nodes as f64 * share).ceil() as usize).min(n_nodes)
}
