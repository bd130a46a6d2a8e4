//! Frames refined by small rotations.

use glam::Vec3A;

use super::fitted::{Fitted, half_area};
use super::vector::unit;

/// Most leaves of a node whose frame is refined.
pub(super) const MAX_LEAVES: usize = 64;

/// Tangent of half the first angle: 0.12 radians.
const FIRST: f32 = 0.06;

/// Factor of the angle when no rotation gains.
const FALL: f32 = 0.4;

/// A box: its rows, its sides and half of its surface area.
#[derive(Clone, Copy)]
struct RefinedBox {
    rows: [Vec3A; 3],
    sides: [f32; 3],
    half_area: f32,
}

/// Rotates `rows` about each of its axes both ways, `iterations` times, by ever smaller angles; returns the rows in which the
/// box of the items is smallest, and half of its area.
pub(super) fn refined<F: Fitted>(items: &[F], rows: [Vec3A; 3], iterations: u32) -> ([Vec3A; 3], f32) {
    let sides = F::extents(items, 1, &rows);
    let mut best = RefinedBox { rows, sides, half_area: half_area(sides) };
    let mut tangent = FIRST;
    for _ in 0..iterations {
        let before = best.half_area;
        for axis in 0..3 {
            for signed in [tangent, -tangent] {
                best = better(items, best, axis, signed);
            }
        }
        if best.half_area >= before {
            tangent *= FALL;
        }
    }
    (best.rows, best.half_area)
}

/// The box rotated about one of its axes where it has less area then; its extent along that axis stays.
fn better<F: Fitted>(items: &[F], from: RefinedBox, axis: usize, tangent: f32) -> RefinedBox {
    let Some(rows) = about_axis(&from.rows, axis, tangent) else { return from };
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut sides = from.sides;
    [sides[i], sides[j]] = F::extents(items, 1, &[rows[i], rows[j]]);
    let half_area = half_area(sides);
    if half_area < from.half_area { RefinedBox { rows, sides, half_area } } else { from }
}

/// The frame rotated about one of its axes, by twice the angle of this tangent.
///
/// From the tangent of the half angle cosine and sine follow by arithmetic alone, the same on every platform; their
/// common factor cancels when rows are normalized.
pub(super) fn about_axis(rows: &[Vec3A; 3], axis: usize, tangent: f32) -> Option<[Vec3A; 3]> {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let (cos, sin) = (1.0 - tangent * tangent, 2.0 * tangent);
    let mut rotated = *rows;
    rotated[i] = unit(rows[i] * cos + rows[j] * sin)?;
    rotated[j] = unit(rows[j] * cos - rows[i] * sin)?;
    Some(rotated)
}
