use glam::Vec4;

use crate::{
    par,
    reference::{Bounds, Reference},
};

/// Most cells an axis.
pub(crate) const MAX_CELLS: u32 = 64;

/// Cells of equal width between the least and the greatest middle, on each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    low: Vec4,
    scale: Vec4,
    last: Vec4,
    n_cells: usize,
}

/// Between two cells of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: usize,
    /// First cell on the right.
    pub(crate) cell: u32,
}

/// `2^23`: from here on floats are integers, which then lie in their low bits.
const INTEGERS: Vec4 = Vec4::splat(8_388_608.0);

impl Grid {
    /// The grid over `centers`; `n_cells` of 2 to [`MAX_CELLS`].
    #[expect(clippy::cast_precision_loss, reason = "at most 64 cells")]
    pub(crate) fn new(centers: &Bounds, n_cells: u32) -> Self {
        let n_cells = n_cells.clamp(2, MAX_CELLS);
        // Without an extent the scale is finite too, so that everything lies in cell 0.
        let scale = (Vec4::splat(n_cells as f32) / centers.extent()).min(Vec4::MAX);
        Self { low: centers.low(), scale, last: Vec4::splat((n_cells - 1) as f32), n_cells: n_cells as usize }
    }

    /// The cell of a reference on each axis; the last lane is none.
    ///
    /// Everything is rounded the same way for one reference, so it stays in its cell when it is asked again.
    #[inline]
    pub(crate) fn cells(&self, reference: &Reference) -> [u32; 4] {
        // Half a cell down, then to the nearest: the floor, and no conversion that asks for NaN.
        let place = (reference.center() - self.low) * self.scale - Vec4::splat(0.5);
        let integer = place.max(Vec4::ZERO).min(self.last) + INTEGERS;
        integer.to_array().map(|x| x.to_bits() & (MAX_CELLS - 1))
    }

    /// Whether a reference lies left of a plane.
    #[inline]
    pub(crate) fn is_left(&self, plane: Plane, reference: &Reference) -> bool {
        self.cells(reference)[plane.axis] < plane.cell
    }
}

/// Box and number of the references in a cell.
#[derive(Clone, Copy)]
struct Cell {
    bounds: Bounds,
    n: u32,
}

type Cells<const AXES: usize> = [[Cell; MAX_CELLS as usize]; AXES];

const EMPTY: Cell = Cell { bounds: Bounds::EMPTY, n: 0 };

/// References from which cells are filled in chunks, and how long these are.
const LARGE: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

/// The plane between cells of least cost, over the axes given; `None` where all references share a cell on each.
///
/// The cost is that of Goldsmith & Salmon 1987 and MacDonald & Booth 1990 for leaves of equal cost: each side's area
/// times its number of references. Of equal costs the more even wins.
/// Source: Wald 2007.
pub(crate) fn best_plane(references: &[Reference], grid: &Grid, axes: &[usize]) -> Option<Plane> {
    match *axes {
        [axis] => best_of(references, grid, [axis]),
        _ => best_of(references, grid, [0, 1, 2]),
    }
}

// Never inlined: its arrays would lie on the stack of every node above.
#[inline(never)]
fn best_of<const AXES: usize>(references: &[Reference], grid: &Grid, axes: [usize; AXES]) -> Option<Plane> {
    let mut cells: Cells<AXES> = [[EMPTY; MAX_CELLS as usize]; AXES];
    if references.len() < LARGE {
        fill(references, grid, axes, &mut cells);
    } else {
        // Minima and counts do not depend on the order in which they are joined.
        for part in par::map_chunks(references, CHUNK, |chunk| {
            let mut cells: Cells<AXES> = [[EMPTY; MAX_CELLS as usize]; AXES];
            fill(chunk, grid, axes, &mut cells);
            cells
        }) {
            for (all, part) in cells.iter_mut().flatten().zip(part.iter().flatten()) {
                *all = Cell { bounds: all.bounds.union(&part.bounds), n: all.n + part.n };
            }
        }
    }
    let mut best = Best { cost: f32::INFINITY, evenness: 0, plane: None };
    for (cells, axis) in cells.iter().zip(axes) {
        best.consider(&cells[..grid.n_cells], axis);
    }
    best.plane
}

fn fill<const AXES: usize>(references: &[Reference], grid: &Grid, axes: [usize; AXES], cells: &mut Cells<AXES>) {
    for reference in references {
        let places = grid.cells(reference);
        for (cells, axis) in cells.iter_mut().zip(axes) {
            let cell = &mut cells[places[axis] as usize];
            cell.bounds = cell.bounds.union(reference.bounds());
            cell.n += 1;
        }
    }
}

struct Best {
    cost: f32,
    /// References on the lesser side.
    evenness: u32,
    plane: Option<Plane>,
}

impl Best {
    /// Considers every plane between two cells of an axis that parts the references.
    #[expect(clippy::cast_precision_loss, reason = "a cost, compared with others made the same way")]
    fn consider(&mut self, cells: &[Cell], axis: usize) {
        let mut right_costs = [(0.0, 0); MAX_CELLS as usize];
        let (mut bounds, mut n) = (Bounds::EMPTY, 0);
        for (cell, right) in cells.iter().zip(&mut right_costs).rev() {
            if cell.n > 0 {
                bounds = bounds.union(&cell.bounds);
                n += cell.n;
            }
            if n > 0 {
                *right = (bounds.half_area() * n as f32, n);
            }
        }
        (bounds, n) = (Bounds::EMPTY, 0);
        for ((place, cell), (right_cost, n_right)) in (1..).zip(cells).zip(&right_costs[1..]) {
            if cell.n == 0 {
                continue;
            }
            if *n_right == 0 {
                break;
            }
            bounds = bounds.union(&cell.bounds);
            n += cell.n;
            let (cost, evenness) = (bounds.half_area() * n as f32 + right_cost, n.min(*n_right));
            if cost < self.cost || cost == self.cost && evenness > self.evenness {
                *self = Self { cost, evenness, plane: Some(Plane { axis, cell: place }) };
            }
        }
    }
}
