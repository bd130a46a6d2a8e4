use canted_lbvh::Tree;
use canted_obb::{Aabb, PrimId};

use crate::{
    Split, TopDownConfig,
    assemble::{Plot, assemble},
    binned::{Grid, MAX_CELLS, Plane, best_plane},
    median, par,
    partition::{halve, partition},
    reference::{Reference, centers},
    scale::unit_scale,
    sweep::{MAX_BLOCK, sweep, sweep_block},
};

/// Builds a tree from the root down, one primitive a leaf.
///
/// Reads: a box for each primitive (finite). Writes: a tree whose leaves lie in the order in which it parted them.
/// Holds: a depth of at most `max_depth`; the same bits for any number of threads; equal boxes are halved by count.
/// Source: surface area heuristic of Goldsmith & Salmon 1987 and MacDonald & Booth 1990; cells after Wald 2007.
#[must_use]
pub fn top_down(boxes: &[Aabb], config: &TopDownConfig) -> Tree {
    let scale = unit_scale(boxes).unwrap_or(1.0);
    let mut references: Vec<_> = (0..).zip(boxes).map(|(i, aabb)| Reference::new(i, aabb, scale)).collect();
    assemble(boxes.len(), |plot| {
        if config.split == Split::Sweep {
            return sweep(&references, config, plot, 1);
        }
        let mut room = references.clone();
        build(Span { references: &mut references, room: &mut room }, config, plot, 1)
    })
}

/// A node's references, and as much room to part them into.
struct Span<'a> {
    references: &'a mut [Reference],
    room: &'a mut [Reference],
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
    let n_left = part(&mut span, config, depth);
    let (references, room) = (span.references.split_at_mut(n_left), span.room.split_at_mut(n_left));
    let left = Span { references: references.0, room: room.0 };
    let right = Span { references: references.1, room: room.1 };
    let (left_plot, right_plot) = plot.split(n_left);
    let (build_left, build_right) =
        (|| build(left, config, left_plot, depth + 1), || build(right, config, right_plot, depth + 1));
    let (a, b) =
        if n > TopDownConfig::FORK { par::join(build_left, build_right) } else { (build_left(), build_right()) };
    1 + a.max(b)
}

/// Parts the references; returns how many are left. Never none or all.
fn part(span: &mut Span<'_>, config: &TopDownConfig, depth: u32) -> usize {
    let n = span.references.len();
    let centers = centers(span.references);
    if config.must_halve(n, depth) {
        return halve(span.references, centers.longest());
    }
    let axes = config.axes.at(depth, || centers);
    let n_cells = match config.split {
        Split::Median => return median::part(span.references, axes),
        Split::Sweep => unreachable!("sweeps are built by `sweep`"),
        Split::Midpoint => 2,
        Split::Binned { bins, .. } => bins.min(few_cells(n)),
    };
    let grid = Grid::new(&centers, n_cells);
    let plane = match (config.split, axes) {
        (Split::Midpoint, &[axis]) => Some(Plane { axis, cell: 1 }),
        _ => best_plane(span.references, &grid, axes),
    };
    let n_left = plane.map_or(0, |plane| partition(span.references, span.room, grid.left_of(plane)));
    if n_left == 0 || n_left == n {
        return halve(span.references, centers.longest());
    }
    std::mem::swap(&mut span.references, &mut span.room);
    n_left
}

/// Cells enough for `n` references: more would mostly be empty.
fn few_cells(n: usize) -> u32 {
    match n {
        ..64 => 8,
        64..256 => 16,
        _ => MAX_CELLS,
    }
}
