//! Frames in which subtrees' boxes are small.
//!
//! Reads: a binary tree, its primitives in leaf order, the areas of all boxes in the mesh frame. Writes: for each leaf
//! and each inner node of up to [`FrameConfig::max_leaves`] leaves three rows and half of the area of the box along
//! them. Holds: rows are finite and of length one but for rounding, at most 1 + 4u; no area exceeds that in the
//! mesh frame; the same bits for any number of threads. Areas are estimates in `f32`: stored boxes are computed from the
//! rows separately.
//! Source: Wald et al. 2020 for oriented boxes over a binary tree; Gottschalk et al. 1996 for the principal axes.

mod fitted;
mod inner;
pub(crate) mod mesh_frame;
mod vector;

use canted_lbvh::{ChildKind, NodeId, Task, Tree};

use crate::par;
use fitted::half_area;
pub(crate) use fitted::{Fitted, ScaledBalls, ScaledShape, ScaledTriangle};
use inner::Below;
use vector::from_glam;

/// Frame of a subtree and what its box costs there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Directions across the three pairs of faces, of length one but for rounding.
    pub(crate) rows: [[f32; 3]; 3],
    /// Half of the surface area, in squares of the scaled unit; never more than that of the box in the mesh frame.
    pub(crate) half_area: f32,
}

/// Frames of all subtrees.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Fits {
    /// By [`NodeId`].
    pub(crate) inner: Vec<Fit>,
    /// By position in the leaf order.
    pub(crate) leaf: Vec<Fit>,
}

/// Half of the surface areas of boxes in the mesh frame, in squares of the scaled unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxAreas<'a> {
    /// By [`NodeId`].
    pub(crate) inner: &'a [f32],
    /// By position in the leaf order.
    pub(crate) leaf: &'a [f32],
}

/// How much is spent on frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameConfig {
    /// Nodes of more leaves keep the mesh frame; so do those above all of a tree's tasks.
    pub(crate) max_leaves: u32,
}

impl Default for FrameConfig {
    fn default() -> Self {
        Self { max_leaves: 1 << 12 }
    }
}

/// By how much an oriented box must be smaller, relative to the one in the mesh frame; testing it costs more than that.
const MIN_GAIN: f32 = 1.0 / 64.0;

/// Leaves whose frames one job finds.
const CHUNK: usize = 1 << 12;

/// Finds a frame for each leaf and inner node.
///
/// `items` are in leaf order, finite, and scaled by a power of two that brings the largest extent to about one; so are the
/// areas in `boxes`.
pub(crate) fn fit<F: Fitted>(
    tree: &Tree,
    items: &[F],
    mesh_frame: [[f32; 3]; 3],
    boxes: &BoxAreas,
    config: &FrameConfig,
) -> Fits {
    let fallback = |half_area: &f32| Fit { rows: mesh_frame, half_area: *half_area };
    let mut fits =
        Fits { inner: boxes.inner.iter().map(fallback).collect(), leaf: boxes.leaf.iter().map(fallback).collect() };
    let jobs = fits.leaf.chunks_mut(CHUNK).zip(items.chunks(CHUNK)).collect();
    par::for_jobs(jobs, |(fits, items): (&mut [Fit], &[F])| {
        for (fit, item) in fits.iter_mut().zip(items) {
            *fit = fit_leaf(item, *fit);
        }
    });
    let jobs: Vec<_> = tree.tasks.iter().zip(task_slices(tree, &mut fits.inner)).collect();
    par::for_jobs(jobs, |(task, own)| fit_task(tree, task, items, &fits.leaf, own, config));
    fits
}

/// The primitive's own frame where its box has less area than `aligned`, the one in the mesh frame.
fn fit_leaf<F: Fitted>(item: &F, aligned: Fit) -> Fit {
    let most = (1.0 - MIN_GAIN) * aligned.half_area;
    let Some(rows) = item.own_frame(most) else { return aligned };
    let half_area = half_area(F::extents(std::slice::from_ref(item), 1, &rows));
    if half_area < most { Fit { rows: from_glam(rows), half_area } } else { aligned }
}

/// Fits the nodes of one task, children first; `own` are those in the mesh frame and become the best.
fn fit_task<F: Fitted>(tree: &Tree, task: &Task, items: &[F], leaves: &[Fit], own: &mut [Fit], config: &FrameConfig) {
    let index = |NodeId(id): NodeId| (id - task.leaves.start) as usize;
    let mut below = vec![Below::NOTHING; own.len()];
    for &id in &tree.bottom_up[task.nodes.clone()] {
        let node = &tree.nodes[id.index()];
        if node.n_leaves() > config.max_leaves {
            continue;
        }
        let [left, right] = [node.left, node.right].map(|child| match child.kind() {
            ChildKind::Leaf(i) => (Below::of_leaf(items, i as usize), leaves[i as usize]),
            ChildKind::Inner(id) => (below[index(id)], own[index(id)]),
        });
        let joined = Below::joined(&left.0, &right.0);
        let range = node.first as usize..=node.last as usize;
        own[index(id)] = inner::fit(items, range, &joined, [left.1, right.1], own[index(id)]);
        below[index(id)] = joined;
    }
}

/// The slice of per-node values that each task owns; those of nodes above all tasks are skipped.
fn task_slices<'a>(tree: &Tree, mut values: &'a mut [Fit]) -> Vec<&'a mut [Fit]> {
    let mut start = 0;
    let mut slices = Vec::with_capacity(tree.tasks.len());
    for task in &tree.tasks {
        let from = std::mem::take(&mut values).split_at_mut((task.leaves.start - start) as usize).1;
        // The last number may lie past the last node: there is one node fewer than leaves.
        let n_own = from.len().min(task.leaves.len());
        let (own, after) = from.split_at_mut(n_own);
        slices.push(own);
        (values, start) = (after, task.leaves.end);
    }
    slices
}

#[cfg(test)]
mod tests;
