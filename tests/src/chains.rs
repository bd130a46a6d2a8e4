//! Binary trees of maximal depth.

use canted_lbvh::{Child, NodeId, Tree};

/// A chain over `n` primitives in order: each node has one leaf and the rest below it; `is_left` chooses the leaf's side.
///
/// # Panics
/// Panics for fewer than two primitives.
#[must_use]
pub fn chain(n: u32, is_left: impl Fn(u32) -> bool) -> Tree {
    let children: Vec<_> = (0..n - 1)
        .map(|i| {
            let rest = if i + 2 < n { Child::inner(NodeId(i + 1)) } else { Child::leaf(n - 1) };
            if is_left(i) { [Child::leaf(i), rest] } else { [rest, Child::leaf(i)] }
        })
        .collect();
    Tree::from_children(&children).expect("each node has one parent")
}
