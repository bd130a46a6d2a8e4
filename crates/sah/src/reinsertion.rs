use canted_lbvh::{MAX_DEPTH, Tree};
use canted_obb::Aabb;

use crate::{ReinsertConfig, pairs::Pairs, par, reference::unit_scale, search, select};

/// Subtrees per job.
const CHUNK: usize = 64;

/// Moves subtrees to positions that reduce the sum of the surface areas of all boxes.
///
/// Reads: a tree, the finite box of each leaf in leaf order. Writes: a tree over the same primitives with its own leaf
/// order. Holds: the sum of areas does not increase; the depth is at most that of the tree or [`MAX_DEPTH`], whichever is
/// greater; the same bits for any number of threads.
/// Source: Bittner, Hapala & Havran 2013; parallel search per iteration after Meister & Bittner 2018. Instead of locks,
/// each move is evaluated again when it is applied.
///
/// # Panics
/// If the numbers of boxes and leaves differ.
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
    for iteration in 0..config.iterations {
        let gain = improve(&mut pairs, n_searched(tree, config, iteration), max_depth);
        moved |= gain > 0.0;
        sum -= gain;
        if gain <= f64::from(config.min_gain) * sum {
            break;
        }
    }
    if !moved {
        return tree.clone();
    }
    let children = pairs.children(tree);
    drop(pairs);
    Tree::from_children(&children).expect("moving a subtree keeps the tree valid")
}

/// One iteration over the `n` largest boxes; returns the reduction of the sum of half areas.
fn improve(pairs: &mut Pairs, n: usize, max_depth: u32) -> f64 {
    let slots = select::largest(pairs, n);
    let found = par::map_chunks(&slots, CHUNK, |_, slots| {
        let mut stack = vec![];
        slots.iter().filter_map(|&slot| search::best_move(pairs, slot, &mut stack)).collect::<Vec<_>>()
    });
    let mut moves = found.concat();
    moves.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    moves.iter().filter_map(|found| pairs.apply(found, max_depth)).sum()
}

/// Number of subtrees searched in an iteration.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "a fraction of at most 2^31 nodes, saturating"
)]
fn n_searched(tree: &Tree, config: &ReinsertConfig, iteration: u32) -> usize {
    let n_nodes = 2 * tree.nodes.len();
    let fraction = f64::from(config.fraction.min(1.0)) / f64::from(2 * iteration + 1);
    ((n_nodes as f64 * fraction).ceil() as usize).min(n_nodes)
}
