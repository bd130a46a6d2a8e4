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

    /// The cell of a reference on each axis, above [`INTEGERS`]; the last lane is none.
    ///
    /// Everything is rounded the same way for one reference, so it stays in its cell when it is asked again.
    #[inline]
    fn place(&self, reference: &Reference) -> Vec4 {
        // Half a cell down, then to the nearest: the floor, and no conversion that asks for NaN.
        let place = (reference.center() - self.low) * self.scale - Vec4::splat(0.5);
        place.max(Vec4::ZERO).min(self.last) + INTEGERS
    }

    /// Tells references left of a plane.
    #[expect(clippy::cast_precision_loss, reason = "at most 64 cells")]
    pub(crate) fn left_of(self, plane: Plane) -> impl Fn(&Reference) -> bool {
        let first_right = Vec4::splat(plane.cell as f32) + INTEGERS;
        let lane = 1 << plane.axis;
        move |reference| self.place(reference).cmplt(first_right).bitmask() & lane != 0
    }
}

/// Boxes and numbers of the references in each of `N` cells an axis.
#[derive(Clone, Copy)]
struct Cells<const AXES: usize, const N: usize> {
    bounds: [[Bounds; N]; AXES],
    counts: [[u32; N]; AXES],
}

impl<const AXES: usize, const N: usize> Cells<AXES, N> {
    const EMPTY: Self = Self { bounds: [[Bounds::EMPTY; N]; AXES], counts: [[0; N]; AXES] };

    fn fill(&mut self, references: &[Reference], grid: &Grid, axes: [usize; AXES]) {
        for reference in references {
            let places = grid.place(reference).to_array();
            for (lane, (bounds, counts)) in self.bounds.iter_mut().zip(&mut self.counts).enumerate() {
                // `N` is a power of two and at least as many as the grid has: the low bits are the cell.
                let lane = if AXES == 3 { lane } else { axes[lane] };
                let place = places[lane].to_bits() as usize % N;
                bounds[place] = bounds[place].union(reference.bounds());
                counts[place] += 1;
            }
        }
    }

    /// Minima and sums: the order in which parts are joined changes nothing.
    fn join(&mut self, other: &Self) {
        for (all, part) in self.bounds.as_flattened_mut().iter_mut().zip(other.bounds.as_flattened()) {
            *all = all.union(part);
        }
        for (all, part) in self.counts.as_flattened_mut().iter_mut().zip(other.counts.as_flattened()) {
            *all += part;
        }
    }
}

/// References from which cells are filled in chunks, and how long these are.
const LARGE: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

/// The plane between cells of least cost, over the axes given; `None` where all references share a cell on each.
///
/// The cost is that of Goldsmith & Salmon 1987 and MacDonald & Booth 1990 for leaves of equal cost: each side's area
/// times its number of references. Of equal costs the more even wins.
/// Source: Wald 2007.
pub(crate) fn best_plane(references: &[Reference], grid: &Grid, axes: &[usize]) -> Option<Plane> {
    match (axes, grid.n_cells) {
        (&[axis], ..=8) => best_of::<1, 8>(references, grid, [axis]),
        (&[axis], 9..=32) => best_of::<1, 32>(references, grid, [axis]),
        (&[axis], _) => best_of::<1, 64>(references, grid, [axis]),
        (_, ..=8) => best_of::<3, 8>(references, grid, [0, 1, 2]),
        (_, 9..=16) => best_of::<3, 16>(references, grid, [0, 1, 2]),
        (_, 17..=32) => best_of::<3, 32>(references, grid, [0, 1, 2]),
        (_, _) => best_of::<3, 64>(references, grid, [0, 1, 2]),
    }
}

// Never inlined: its arrays would lie on the stack of every node above.
#[inline(never)]
fn best_of<const AXES: usize, const N: usize>(
    references: &[Reference],
    grid: &Grid,
    axes: [usize; AXES],
) -> Option<Plane> {
    let mut cells = Cells::<AXES, N>::EMPTY;
    if references.len() < LARGE {
        cells.fill(references, grid, axes);
    } else {
        let parts = par::map_chunks(references, CHUNK, |_, chunk| {
            let mut cells = Cells::<AXES, N>::EMPTY;
            cells.fill(chunk, grid, axes);
            cells
        });
        parts.iter().for_each(|part| cells.join(part));
    }
    let mut best = Best { cost: f32::INFINITY, evenness: 0, plane: None };
    for ((bounds, counts), axis) in cells.bounds.iter().zip(&cells.counts).zip(axes) {
        best.consider(&bounds[..grid.n_cells], &counts[..grid.n_cells], axis);
    }
    best.plane
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
    fn consider(&mut self, cells: &[Bounds], counts: &[u32], axis: usize) {
        let mut right_costs = [(0.0, 0); MAX_CELLS as usize];
        let (mut bounds, mut n) = (Bounds::EMPTY, 0);
        for ((cell, count), right) in cells.iter().zip(counts).zip(&mut right_costs).rev() {
            bounds = bounds.union(cell);
            n += count;
            if n > 0 {
                *right = (bounds.half_area() * n as f32, n);
            }
        }
        (bounds, n) = (Bounds::EMPTY, 0);
        for (((place, cell), count), (right_cost, n_right)) in (1..).zip(cells).zip(counts).zip(&right_costs[1..]) {
            if *count == 0 {
                continue;
            }
            if *n_right == 0 {
                break;
            }
            bounds = bounds.union(cell);
            n += count;
            let (cost, evenness) = (bounds.half_area() * n as f32 + right_cost, n.min(*n_right));
            if cost < self.cost || cost == self.cost && evenness > self.evenness {
                *self = Self { cost, evenness, plane: Some(Plane { axis, cell: place }) };
            }
        }
    }
}
