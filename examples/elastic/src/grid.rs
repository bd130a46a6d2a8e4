use std::ops::Range;

use canted_lbvh::{Bits, Domain, Sorted, morton_codes_of_boxes, sort_by_code};
use canted_obb::Aabb;

/// Bits of a Morton code: 10 per axis. With 21, the rounding of an `f32` would be a fraction of a cell that matters.
const BITS: Bits = Bits::B30;

/// Points, hashed by space: finds those near a point.
///
/// Space is divided into cells at least as wide as the radius of a query. The points are sorted by the Morton code of their
/// cell, so the points of a cell are a range of the sorted codes, and a query reads 27 ranges.
pub struct Grid<'a> {
    points: &'a [[f32; 3]],
    radius: f64,
    domain: Domain,
    sorted: Sorted,
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
        #[expect(clippy::cast_possible_truncation, reason = "one of the three roundings")]
        let scale = (0.5 / width) as f32;
        // Where the scale is not a normal number, one cell holds everything.
        let scale = if scale.is_normal() { scale } else { 0.0 };
        let domain = Domain { offset: bounds.min.map(|x| 2.0 * x), scale, bits: BITS };
        let boxes: Vec<Aabb> = points.iter().map(|&point| Aabb { min: point, max: point }).collect();
        let sorted = sort_by_code(&morton_codes_of_boxes(&domain, &boxes), BITS);
        Self { points, radius, domain, sorted }
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

    /// The points of a cell, as a range of the sorted codes.
    fn range(&self, code: u64) -> Range<usize> {
        let codes = &self.sorted.codes;
        let start = codes.partition_point(|&c| c < code);
        start..start + codes[start..].partition_point(|&c| c == code)
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
                    #[expect(clippy::cast_precision_loss, reason = "below 2^10")]
                    let cell = [i, j, k].map(|n| n as f32);
                    cells.push(Aabb { min: cell, max: cell });
                }
            }
        }
        morton_codes_of_boxes(&NUMBERS, &cells)
    }
}

/// Squared distance; the differences are exact up to one rounding of `f64`.
pub(crate) fn distance_squared(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|k| f64::from(a[k]) - f64::from(b[k])).map(|x| x * x).sum()
}
