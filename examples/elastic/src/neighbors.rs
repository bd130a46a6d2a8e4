//! Which phyxels act on which.
//! A grid finds them.

use std::ops::Range;

use canted_lbvh::{Bits, Domain, Sorted, morton_codes_of_boxes, sort_by_code};
use canted_obb::Aabb;
use glam::{DMat3, DVec3};

/// A radius of action in units of the mean distance to the nearest phyxels: in a cubic lattice it reaches the 26 around.
const SUPPORT: f64 = 1.9;

/// Nearest phyxels whose mean distance is the local spacing: as many as a cubic lattice has at its spacing.
const N_NEAREST: usize = 6;

/// Largest condition number of a moment matrix. The gradients then keep 32 of the 52 bits of `f64`.
const MAX_CONDITION: f64 = (1 << 20) as f64;

/// One phyxel in the radius of action of another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// The phyxel acted on.
    pub(crate) to: u32,
    /// From the acting phyxel to it, at rest.
    pub(crate) offset: DVec3,
    /// The displacement gradient of the acting phyxel is the sum of `(u[to] - u[from]) * gradient^T` over its links.
    pub(crate) gradient: DVec3,
    /// Kernel weight, divided by the sum of `weight * |offset|²` over the links of the acting phyxel; 1/m².
    pub(crate) weight: f64,
}

/// Weight of a phyxel at a distance, in a radius of action: the kernel of Müller et al., without its constant factor, which cancels.
pub(crate) fn kernel(distance_squared: f64, radius: f64) -> f64 {
    let inside = (1.0 - distance_squared / (radius * radius)).max(0.0);
    inside * inside * inside
}

/// Positions as `f64`.
pub(crate) fn vector(point: [f32; 3]) -> DVec3 {
    DVec3::from(point.map(f64::from))
}

/// `a * b^T`.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The radius of action of each phyxel: larger where phyxels are sparse.
pub(crate) fn radii_of_action(points: &[[f32; 3]]) -> Vec<f64> {
    let mut radii = vec![0.0; points.len()];
    let mut pending: Vec<usize> = (0..points.len()).collect();
    let Some(first) = points.first() else { return radii };
    let farthest = points.iter().map(|&point| distance_squared(*first, point)).fold(0.0, f64::max).sqrt();
    // All pairs are closer than twice that. A first guess is the spacing of a cube of as many points.
    let mut radius = 2.0 * farthest / (points.len() as f64).cbrt();
    while !pending.is_empty() {
        let is_last = radius >= 2.0 * farthest;
        let grid = Grid::new(points, radius);
        pending.retain(|&i| {
            let near = grid.within(points[i], radius);
            if near.len() <= N_NEAREST && !is_last {
                return true;
            }
            let others = near.iter().filter(|&&j| j as usize != i);
            let mut distances: Vec<f64> =
                others.map(|&j| distance_squared(points[i], points[j as usize]).sqrt()).collect();
            distances.sort_unstable_by(f64::total_cmp);
            distances.truncate(N_NEAREST);
            let n = distances.len().max(1) as f64;
            radii[i] = SUPPORT * distances.iter().sum::<f64>() / n;
            false
        });
        radius *= 2.0;
    }
    radii
}

/// The links of all phyxels, or the first phyxel whose neighbors do not span space, with their number.
pub(crate) fn links(points: &[[f32; 3]], radii: &[f64]) -> Result<Vec<Vec<Link>>, (usize, usize)> {
    let grid = Grid::new(points, radii.iter().copied().fold(0.0, f64::max));
    points
        .iter()
        .zip(radii)
        .enumerate()
        .map(|(i, (&from, &radius))| of_phyxel(&grid, points, i, from, radius))
        .collect()
}

fn of_phyxel(
    grid: &Grid,
    points: &[[f32; 3]],
    i: usize,
    from: [f32; 3],
    radius: f64,
) -> Result<Vec<Link>, (usize, usize)> {
    let mut links = Vec::new();
    let (mut moments, mut sum) = (DMat3::ZERO, 0.0);
    for to in grid.within(from, radius) {
        let offset = vector(points[to as usize]) - vector(from);
        let weight = kernel(offset.length_squared(), radius);
        if to as usize == i || weight == 0.0 {
            continue;
        }
        moments += outer(weight * offset, offset);
        sum += weight * offset.length_squared();
        links.push(Link { to, offset, gradient: weight * offset, weight });
    }
    // Dimensionless, of trace 1. The greatest eigenvalue is at most 1; the product of the two greatest is at most 1/4,
    // so that the least one is at least 4 times the determinant.
    let shape = moments * (1.0 / sum);
    let is_spanning = sum.is_normal() && 4.0 * shape.determinant() >= 1.0 / MAX_CONDITION;
    if !is_spanning {
        return Err((i, links.len()));
    }
    let inverse = shape.inverse();
    for link in &mut links {
        link.gradient = inverse * (link.gradient / sum);
        link.weight /= sum;
    }
    Ok(links)
}

/// Bits of a Morton code: 10 per axis. With 21, the rounding of an `f32` would be a fraction of a cell that matters.
const BITS: Bits = Bits::B30;

/// Points, hashed by space: finds those near a point.
///
/// Space is divided into cells at least as wide as the radius of a query. The points are sorted by the Morton code of their
/// cell, so the points of a cell are a range of the sorted ones. A table that is addressed by a hash of the code has the ranges, and a query
/// looks up 27 of them, however many points there are (Teschner et al. 2003).
pub struct Grid<'a> {
    points: &'a [[f32; 3]],
    radius: f64,
    domain: Domain,
    sorted: Sorted,
    /// A power of two of entries, at least twice as many as cells with points; the others are empty ranges.
    table: Vec<Cell>,
}

/// The points of a cell, as a range of the sorted ones.
#[derive(Clone, Copy, Default)]
struct Cell {
    code: u64,
    start: u32,
    end: u32,
}

impl<'a> Grid<'a> {
    /// Hashes finite points, for queries with at most the given radius.
    ///
    /// Two points within the radius of each other are in the same or in adjacent cells: a cell number at most 1024 is computed
    /// with three roundings of 2^-24, so two of them are off by at most 2·3·2^10·2^-24 < 2^-11 cells together, and the cells are
    /// wider than the radius by 2^-10. Clamping to the first and the last cell only moves cells closer together.
    #[must_use]
    pub fn new(points: &'a [[f32; 3]], radius: f64) -> Self {
        const PAD: f64 = 1.0 / 1024.0;
        let mut bounds = Aabb::EMPTY;
        points.iter().for_each(|&point| bounds.grow(point));
        let extent = (0..3).map(|k| f64::from(bounds.max[k]) - f64::from(bounds.min[k])).fold(0.0, f64::max);
        let width = (radius * (1.0 + PAD)).max(extent / f64::from(1 << BITS.per_axis()));
        // A box is located by the sum of two points.
        let scale = (0.5 / width) as f32;
        // Where the scale is not a normal number, one cell holds everything.
        let scale = if scale.is_normal() { scale } else { 0.0 };
        let domain = Domain { offset: bounds.min.map(|x| 2.0 * x), scale, bits: BITS };
        let boxes: Vec<Aabb> = points.iter().map(|&point| Aabb { min: point, max: point }).collect();
        let sorted = sort_by_code(&morton_codes_of_boxes(&domain, &boxes), BITS);
        let table = table(&sorted.codes);
        Self { points, radius, domain, sorted, table }
    }

    /// Indices of all points at most `radius` from `center`, ascending; the radius is at most that of the grid.
    ///
    /// # Panics
    /// Where the radius is larger than that of the grid.
    #[must_use]
    pub fn within(&self, center: [f32; 3], radius: f64) -> Vec<u32> {
        assert!(radius <= self.radius, "a grid for the radius {} cannot search {radius}", self.radius);
        let near = |&i: &u32| distance_squared(self.points[i as usize], center) <= radius * radius;
        let cells = self.cells_around(center);
        let in_cells = cells.iter().flat_map(|&code| &self.sorted.leaves[self.range(code)]);
        let mut found: Vec<u32> = in_cells.map(|leaf| leaf.0).filter(near).collect();
        found.sort_unstable();
        found
    }

    /// The points of a cell, as a range of the sorted ones.
    fn range(&self, code: u64) -> Range<usize> {
        let Cell { start, end, .. } = self.table[slot(&self.table, code)];
        start as usize..end as usize
    }

    /// Morton codes of the cell of a point and of those around it.
    fn cells_around(&self, [x, y, z]: [f32; 3]) -> Vec<u64> {
        // Cell numbers are exact in f32; at half a cell per unit of the sum, the code of a box at a number is that of the cell.
        const NUMBERS: Domain = Domain { offset: [0.0; 3], scale: 0.5, bits: BITS };
        let last = (1_u32 << BITS.per_axis()) - 1;
        let around = |axis: usize, x: f32| {
            let cell = self.domain.cell(axis, x + x);
            cell.saturating_sub(1)..=(cell + 1).min(last)
        };
        let mut cells = Vec::with_capacity(27);
        for i in around(0, x) {
            for j in around(1, y) {
                for k in around(2, z) {
                    let cell = [i, j, k].map(|n| n as f32);
                    cells.push(Aabb { min: cell, max: cell });
                }
            }
        }
        morton_codes_of_boxes(&NUMBERS, &cells)
    }
}

/// The table of the cells of sorted codes.
fn table(codes: &[u64]) -> Vec<Cell> {
    let cells = codes.chunk_by(|a, b| a == b);
    let mut table = vec![Cell::default(); (2 * cells.clone().count()).next_power_of_two().max(2)];
    let mut start = 0;
    for cell in cells {
        // Points are numbered in 32 bits.
        let end = start + cell.len() as u32;
        let slot = slot(&table, cell[0]);
        table[slot] = Cell { code: cell[0], start, end };
        start = end;
    }
    table
}

/// The entry of a cell, or the empty one where it belongs: the first at or after the hash of its code.
fn slot(table: &[Cell], code: u64) -> usize {
    // Multiplicative hashing by the golden ratio: neighbors in space are spread.
    let hash = code.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - table.len().ilog2());
    let mut slot = hash as usize;
    while table[slot].end > 0 && table[slot].code != code {
        #[cfg(test)]
        tests::N_STEPS.set(tests::N_STEPS.get() + 1);
        slot = (slot + 1) & (table.len() - 1);
    }
    slot
}

/// Squared distance; the differences are exact up to one rounding of `f64`.
pub(crate) fn distance_squared(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|k| f64::from(a[k]) - f64::from(b[k])).map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    thread_local! {
        /// Entries of tables that were passed.
        pub(super) static N_STEPS: Cell<u64> = const { Cell::new(0) };
    }

    /// Entries passed and points read by a query, on average over the points of a cubic lattice.
    fn mean_work(side: u16) -> [f64; 2] {
        let cells = (0..side).flat_map(|x| (0..side).flat_map(move |y| (0..side).map(move |z| [x, y, z])));
        let points: Vec<[f32; 3]> = cells.map(|cell| cell.map(|k| 0.1 * f32::from(k))).collect();
        let grid = Grid::new(&points, 0.2);
        N_STEPS.set(0);
        let mut n_read = 0;
        for &point in &points {
            n_read += grid.cells_around(point).into_iter().map(|code| grid.range(code).len()).sum::<usize>();
        }
        let n = points.len() as f64;
        [N_STEPS.get() as f64 / n, n_read as f64 / n]
    }

    /// Entries passed depend on how full the table is, a quarter to a half; points read on the share of points at the surface.
    #[test]
    fn the_work_of_a_query_does_not_grow_with_the_number_of_points() {
        for side in [10, 22, 46] {
            let [steps, read] = mean_work(side);
            assert!(steps < 27.0, "{side}: {steps} entries passed for 27 cells");
            assert!(read < 27.0 * 8.0 * 1.01, "{side}: {read} points read");
        }
    }
}
