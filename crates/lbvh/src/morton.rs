//! Cells of a domain and their Morton codes.

use canted_obb::Aabb;

use crate::{Corners, par};

/// Length of a Morton code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Bits {
    /// 10 bits per axis.
    B30,
    /// 21 bits per axis.
    #[default]
    B63,
}

impl Bits {
    /// Bits per axis.
    #[must_use]
    pub fn per_axis(self) -> u32 {
        match self {
            Self::B30 => 10,
            Self::B63 => 21,
        }
    }
}

/// The grid of Morton cells.
///
/// Reads: the bounding box of all corners. Writes: offset and scale for all later stages.
/// Holds: both are rounded here, once, so the cells are the same integers on every device.
/// Source: Lauterbach et al. 2009; uniform scale by the largest extent, 0 for a zero extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Least coordinates times the number of points summed per primitive.
    pub offset: [f32; 3],
    /// Cells per unit of that sum; 0 for a box of zero or infinite extent.
    pub scale: f32,
    /// Length of the codes.
    pub bits: Bits,
}

impl Domain {
    /// The grid over `bounds` for primitives located by the sum of `n_points` points: 3 for triangles, 2 for boxes.
    #[must_use]
    pub fn new(bounds: &Aabb, n_points: u8, bits: Bits) -> Self {
        let n = f32::from(n_points);
        let extent = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(0.0, f32::max);
        let cells = (1u32 << bits.per_axis()) as f32;
        let scale = cells / (n * extent);
        Self { offset: bounds.min.map(|m| n * m), scale: if scale.is_finite() { scale } else { 0.0 }, bits }
    }

    /// The cell of a sum of coordinates on one axis; the upper end belongs to the last cell.
    ///
    /// A subtraction followed by a product cannot be fused by a compiler.
    #[inline]
    #[must_use]
    pub fn cell(&self, axis: usize, sum: f32) -> u32 {
        let last = (1u32 << self.bits.per_axis()) - 1;
        // `as` truncates like floor above zero, and maps negative numbers and NaN (∞·0) to 0.
        let cell = ((sum - self.offset[axis]) * self.scale) as u32;
        cell.min(last)
    }
}

const CHUNK: usize = 1 << 14;

/// Morton codes of triangles, in input order; the x bit is the highest of each triple.
///
/// Reads: the domain, the corners. Writes: one code per triangle.
/// Holds: `cell = clamp(floor(((a + b) + c - 3m)·s))` on each axis, in f32, in this order.
/// Source: Lauterbach et al. 2009.
#[must_use]
pub fn morton_codes(domain: &Domain, corners: &[Corners]) -> Vec<u64> {
    let mut codes = vec![0; corners.len()];
    par::for_chunks(&mut codes, CHUNK, |first, out| {
        for (code, [a, b, c]) in out.iter_mut().zip(&corners[first..]) {
            *code = interleave(domain.bits, std::array::from_fn(|k| domain.cell(k, (a[k] + b[k]) + c[k])));
        }
    });
    codes
}

/// Morton codes of boxes by their centers: as [`morton_codes`], with `(min + max) - 2m`.
#[must_use]
pub fn morton_codes_of_boxes(domain: &Domain, boxes: &[Aabb]) -> Vec<u64> {
    par::map(boxes, CHUNK, |b| interleave(domain.bits, std::array::from_fn(|k| domain.cell(k, b.min[k] + b.max[k]))))
}

/// Interleaves the bits of three cells, x highest.
#[inline]
fn interleave(bits: Bits, [x, y, z]: [u32; 3]) -> u64 {
    match bits {
        Bits::B30 => u64::from(spread_10(x) << 2 | spread_10(y) << 1 | spread_10(z)),
        Bits::B63 => spread_21(x) << 2 | spread_21(y) << 1 | spread_21(z),
    }
}

/// Moves bit `i` of 10 to bit `3i`, halving the runs step by step.
#[inline]
fn spread_10(mut x: u32) -> u32 {
    x = (x | x << 16) & 0x0300_00ff;
    x = (x | x << 8) & 0x0300_f00f;
    x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Moves bit `i` of 21 to bit `3i`.
#[inline]
fn spread_21(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One bit at a time.
    fn interleave_by_bit(bits: Bits, cells: [u32; 3]) -> u64 {
        (0..bits.per_axis()).fold(0, |code, i| {
            (0..3).fold(code, |code, k| code | u64::from(cells[k] >> i & 1) << (3 * i + 2 - k as u32))
        })
    }

    #[test]
    fn interleave_equals_one_bit_at_a_time() {
        let mut state = 7u64;
        for _ in 0..10_000 {
            let cells = std::array::from_fn(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 40) as u32
            });
            let cells_10 = cells.map(|c| c & 1023);
            assert_eq!(interleave(Bits::B30, cells_10), interleave_by_bit(Bits::B30, cells_10));
            let cells_21 = cells.map(|c| c & 0x1f_ffff);
            assert_eq!(interleave(Bits::B63, cells_21), interleave_by_bit(Bits::B63, cells_21));
        }
        assert_eq!(interleave(Bits::B63, [0x1f_ffff; 3]), (1 << 63) - 1);
        assert_eq!(interleave(Bits::B30, [1, 0, 0]), 4);
    }

    #[test]
    fn ends_and_degenerate_extents() {
        let unit = Domain::new(&Aabb { min: [0.0; 3], max: [1.0; 3] }, 3, Bits::B30);
        assert_eq!((unit.cell(0, 0.0), unit.cell(0, 3.0), unit.cell(0, -1.0)), (0, 1023, 0));
        let point = Domain::new(&Aabb { min: [2.0; 3], max: [2.0; 3] }, 3, Bits::B63);
        assert_eq!((point.scale, point.cell(1, 6.0)), (0.0, 0));
        let huge = Domain::new(&Aabb { min: [f32::MIN; 3], max: [f32::MAX; 3] }, 3, Bits::B30);
        assert_eq!((huge.scale, huge.cell(2, f32::INFINITY)), (0.0, 0));
        let tiny = Domain::new(&Aabb { min: [0.0; 3], max: [1e-45; 3] }, 3, Bits::B63);
        assert_eq!(tiny.cell(0, 3e-45), 0);
    }
}
