//! Frames in which subtrees' boxes are small.
//!
//! Reads: a binary tree, its triangles in leaf order, the areas of all boxes in the mesh's frame. Writes: for each leaf
//! and each inner node of up to [`FrameConfig::max_leaves`] leaves three rows and half of the area of the box along
//! them. Holds: rows are finite and of length one but for rounding, at most 1 + 4u; no area exceeds the one in the
//! mesh's frame; the same bits for any number of threads. Areas are estimates in `f32`: who stores a box computes its
//! extents anew.
//! Source: Wald et al. 2020 for oriented boxes over a binary tree; Gottschalk et al. 1996 for the principal axes.

mod inner;
mod leaf;
pub(crate) mod mesh_frame;
mod points;
mod refine;
mod vector;

use canted_lbvh::{ChildKind, Corners, NodeId, Task, Tree};

use crate::par;
use inner::Below;
use points::{Points, Triangle};

/// Frame of a subtree and what its box costs there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Directions across the three pairs of faces, of length one but for rounding.
    pub(crate) rows: [[f32; 3]; 3],
    /// Half of the surface area, in squares of the scaled unit; never more than the box's in the mesh's frame.
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

/// Half of the surface areas of boxes in the mesh's frame, in squares of the scaled unit.
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
    /// Nodes of more leaves keep the mesh's frame; so do those above all of a tree's tasks.
    pub(crate) max_leaves: u32,
    /// Times that each frame of up to 64 leaves is turned about its axes in search of less area; 0 saves most of the time.
    pub(crate) rounds: u32,
}

impl Default for FrameConfig {
    /// Without rounds, which take longer than all the rest and save little area: `benches/TRIED.md`.
    fn default() -> Self {
        Self { max_leaves: 1 << 12, rounds: 0 }
    }
}

/// By how much a leaning box must be smaller, as a part of the one in the mesh's frame; testing it costs more than that.
const MIN_GAIN: f32 = 1.0 / 64.0;

/// Leaves whose frames one job finds.
const CHUNK: usize = 1 << 12;

/// Finds a frame for each leaf and inner node.
///
/// `corners` are in leaf order and finite. `scale` is a power of two that brings the largest extent to about one; the
/// areas in `boxes` and the areas found are those of the scaled scene.
pub(crate) fn fit(
    tree: &Tree,
    corners: &[Corners],
    mesh_frame: [[f32; 3]; 3],
    boxes: &BoxAreas,
    scale: f32,
    config: &FrameConfig,
) -> Fits {
    let points = Points::of(corners, scale);
    let fallback = |half_area: &f32| Fit { rows: mesh_frame, half_area: *half_area };
    let mut fits =
        Fits { inner: boxes.inner.iter().map(fallback).collect(), leaf: boxes.leaf.iter().map(fallback).collect() };
    let jobs = fits.leaf.chunks_mut(CHUNK).zip(points.triangles().chunks(CHUNK)).collect();
    par::for_jobs(jobs, |(fits, triangles): (&mut [Fit], &[Triangle])| {
        for (fit, triangle) in fits.iter_mut().zip(triangles) {
            *fit = leaf::fit(triangle, *fit);
        }
    });
    let jobs: Vec<_> = tree.tasks.iter().zip(task_slices(tree, &mut fits.inner)).collect();
    par::for_jobs(jobs, |(task, own)| fit_task(tree, task, &points, &fits.leaf, own, config));
    fits
}

/// Fits the nodes of one task, children first; `own` are those in the mesh's frame and become the best.
fn fit_task(tree: &Tree, task: &Task, points: &Points, leaves: &[Fit], own: &mut [Fit], config: &FrameConfig) {
    let place = |NodeId(id): NodeId| (id - task.leaves.start) as usize;
    let mut below = vec![Below::NOTHING; own.len()];
    for &id in &tree.bottom_up[task.nodes.clone()] {
        let node = &tree.nodes[id.index()];
        if node.n_leaves() > config.max_leaves {
            continue;
        }
        let [left, right] = [node.left, node.right].map(|child| match child.kind() {
            ChildKind::Leaf(i) => (Below::of_leaf(points, i as usize), leaves[i as usize]),
            ChildKind::Inner(id) => (below[place(id)], own[place(id)]),
        });
        let joined = Below::joined(&left.0, &right.0);
        let triangles = &points.triangles()[node.first as usize..=node.last as usize];
        own[place(id)] = inner::fit(points, triangles, &joined, [left.1, right.1], own[place(id)], config);
        below[place(id)] = joined;
    }
}

/// The slice of per-node values that each task owns; those of nodes above all tasks are left out.
fn task_slices<'a>(tree: &Tree, mut values: &'a mut [Fit]) -> Vec<&'a mut [Fit]> {
    let mut start = 0;
    let mut slices = Vec::with_capacity(tree.tasks.len());
    for task in &tree.tasks {
        let from = std::mem::take(&mut values).split_at_mut((task.leaves.start - start) as usize).1;
        // The last number may lie past the last node: there is one node less than leaves.
        let n_own = from.len().min(task.leaves.len());
        let (own, after) = from.split_at_mut(n_own);
        slices.push(own);
        (values, start) = (after, task.leaves.end);
    }
    slices
}

#[cfg(test)]
mod tests;
