use canted_obb::Aabb;

use crate::{Bits, Corners, Domain, par};

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
#[expect(clippy::cast_possible_truncation, reason = "small counts")]
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
}
