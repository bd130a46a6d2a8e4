use canted_lbvh::Tree;
use canted_obb::{Aabb, PrimId};

use crate::{
    Split, TopDownConfig,
    assemble::{Plot, assemble},
    binned::{Grid, MAX_BINS, Plane, best_plane},
    par,
    partition::{halve, partition, split_at_median},
    reference::{Reference, centers, unit_scale},
    sweep::{MAX_BLOCK, sweep, sweep_block},
};

/// Builds a tree from the root down, with one primitive per leaf.
///
/// Reads: a finite box for each primitive. Writes: a tree with its own leaf order.
/// Holds: a depth of at most `max_depth`; the same bits for any number of threads; equal boxes are halved by count.
/// Source: surface area heuristic of Goldsmith & Salmon 1987 and MacDonald & Booth 1990; binning after Wald 2007.
#[must_use]
pub fn top_down(boxes: &[Aabb], config: &TopDownConfig) -> Tree {
    let scale = unit_scale(boxes).unwrap_or(1.0);
    let mut references: Vec<_> = (0..).zip(boxes).map(|(i, aabb)| Reference::new(i, aabb, scale)).collect();
    assemble(boxes.len(), |plot| {
        if config.split == Split::Sweep {
            return sweep(&references, config, plot, 1);
        }
        let mut scratch = references.clone();
        build(Span { references: &mut references, scratch: &mut scratch }, config, plot, 1)
    })
}

/// The references of a node, and scratch memory of the same size.
struct Span<'a> {
    references: &'a mut [Reference],
    scratch: &'a mut [Reference],
}

/// Builds a subtree at `depth`; returns its height in nodes.
fn build(mut span: Span<'_>, config: &TopDownConfig, plot: Plot<'_>, depth: u32) -> u32 {
    let n = span.references.len();
    if let [reference] = span.references {
        plot.leaf(PrimId(reference.primitive()));
        return 1;
    }
    if let Split::Binned { sweep_threshold, .. } = config.split
        && n <= (sweep_threshold as usize).min(MAX_BLOCK)
    {
        return sweep_block(span.references, config, plot, depth);
    }
    let n_left = split(&mut span, config, depth);
    let (references, scratch) = (span.references.split_at_mut(n_left), span.scratch.split_at_mut(n_left));
    let left = Span { references: references.0, scratch: scratch.0 };
    let right = Span { references: references.1, scratch: scratch.1 };
    let (left_plot, right_plot) = plot.split(n_left);
    let (build_left, build_right) =
        (|| build(left, config, left_plot, depth + 1), || build(right, config, right_plot, depth + 1));
    let (a, b) =
        if n > TopDownConfig::FORK { par::join(build_left, build_right) } else { (build_left(), build_right()) };
    1 + a.max(b)
}

/// Splits the references; returns the number on the left, never none or all.
fn split(span: &mut Span<'_>, config: &TopDownConfig, depth: u32) -> usize {
    let n = span.references.len();
    let centers = centers(span.references);
    if config.must_halve(n, depth) {
        return halve(span.references, centers.longest());
    }
    let axes = config.axes.at(depth, || centers);
    let n_bins = match config.split {
        Split::Median => return split_at_median(span.references, axes),
        Split::Sweep => unreachable!("sweep splits are built by `sweep`"),
        Split::Midpoint => 2,
        Split::Binned { bins, .. } => bins.min(max_bins(n)),
    };
    let grid = Grid::new(&centers, n_bins);
    let plane = match (config.split, axes) {
        (Split::Midpoint, &[axis]) => Some(Plane { axis, bin: 1 }),
        _ => best_plane(span.references, &grid, axes),
    };
    let n_left = plane.map_or(0, |plane| partition(span.references, span.scratch, grid.left_of(plane)));
    if n_left == 0 || n_left == n {
        return halve(span.references, centers.longest());
    }
    std::mem::swap(&mut span.references, &mut span.scratch);
    n_left
}

/// Maximum number of bins for `n` references: more would be mostly empty.
fn max_bins(n: usize) -> u32 {
    match n {
        ..64 => 8,
        64..256 => 16,
        _ => MAX_BINS,
    }
}
