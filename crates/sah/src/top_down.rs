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
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 primitives")]
    let mut references = par::from_fn(boxes.len(), CHUNK, |i| Reference::new(i as u32, &boxes[i], scale));
    assemble(boxes.len(), |plot| {
        if config.split == Split::Sweep {
            return sweep(&references, config, plot, 1);
        }
        let mut scratch = references.clone();
        build(Span { references: &mut references, scratch: &mut scratch }, config, plot, 1)
    })
}

/// Boxes per job.
const CHUNK: usize = 1 << 13;

/// The references of a node, and scratch memory of the same size.
pub(crate) struct Span<'a> {
    pub(crate) references: &'a mut [Reference],
    pub(crate) scratch: &'a mut [Reference],
}

impl<'a> Span<'a> {
    /// The first `n_left` references and the others.
    pub(crate) fn at(self, n_left: usize) -> [Span<'a>; 2] {
        let (left, right) = self.references.split_at_mut(n_left);
        let (left_scratch, right_scratch) = self.scratch.split_at_mut(n_left);
        [Span { references: left, scratch: left_scratch }, Span { references: right, scratch: right_scratch }]
    }
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
    let [left, right] = span.at(n_left);
    let (left_plot, right_plot) = plot.split(n_left);
    let (build_left, build_right) =
        (|| build(left, config, left_plot, depth + 1), || build(right, config, right_plot, depth + 1));
    let (a, b) =
        if n > TopDownConfig::FORK { par::join(build_left, build_right) } else { (build_left(), build_right()) };
    1 + a.max(b)
}

/// Splits the references; returns the number on the left, never none or all.
pub(crate) fn split(span: &mut Span<'_>, config: &TopDownConfig, depth: u32) -> usize {
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
