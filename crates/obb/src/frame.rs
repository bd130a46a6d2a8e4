//! Frames: three axes as the columns of a matrix, in the space of the points.

use crate::round::{U, binade_inverse};
use crate::vector::{self, Vector, cross, dot};

/// Three axes; `frame[k]` is column `k` of the matrix that takes box coordinates to the space of the points.
pub type Frame = [[f32; 3]; 3];

/// What rounding an orthonormal frame to `f32` can do to a dot product of two of its columns.
///
/// Each entry errs by half a unit in the last place of one, `2⁻²⁵`; a dot product of unit columns then errs by at most
/// `2 · √3 · 2⁻²⁵`, of which 2⁻²³ is the next power of two.
pub const ORTHONORMAL_ERROR: f64 = 1.0 / 8_388_608.0;

/// Below this share of its length a vector left by projection is rounding, not direction.
const PARALLEL: f64 = 8.0 * U;

/// The right-handed orthonormal frame whose first axis is along `first` and whose second lies in the plane of both.
///
/// Zero and parallel directions are completed the same way every time: across the least component. Lengths do not
/// matter, at any scale; directions must be finite.
#[must_use]
pub fn orthonormal(first: [f64; 3], second: [f64; 3]) -> Frame {
    basis(first, second).map(vector::to_f32)
}

/// [`orthonormal`] before it is rounded to `f32`.
pub(crate) fn basis(first: Vector, second: Vector) -> [Vector; 3] {
    let x = vector::normalized(first).or_else(|| vector::normalized(second)).unwrap_or([1.0, 0.0, 0.0]);
    let y = vector::normalized(second)
        .map(|s| vector::sub(s, vector::scale(x, dot(s, x))))
        .filter(|&rest| vector::length(rest) > PARALLEL)
        .and_then(vector::normalized)
        // A short rest carries the rounding of the projection; a second one removes it.
        .and_then(|y| vector::normalized(vector::sub(y, vector::scale(x, dot(y, x)))))
        .unwrap_or_else(|| across(x));
    [x, y, cross(x, y)]
}

/// A unit vector at right angles to the unit vector `x`.
pub(crate) fn across(x: Vector) -> Vector {
    let least = (1..3).fold(0, |least, k| if x[k].abs() < x[least].abs() { k } else { least });
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    vector::normalized(cross(x, axis)).unwrap_or([0.0, 1.0, 0.0])
}

/// The frame with its third axis reversed where it mirrors: the same boxes, a proper rotation.
#[must_use]
pub fn right_handed(frame: Frame) -> Frame {
    let [x, y, z] = frame.map(vector::to_f64);
    if dot(cross(x, y), z) < 0.0 { [frame[0], frame[1], frame[2].map(|c| -c)] } else { frame }
}

/// Whether the columns are orthonormal up to the rounding to `f32`, either handed.
#[must_use]
pub fn is_orthonormal(frame: Frame) -> bool {
    let [x, y, z] = frame.map(vector::to_f64);
    let errors = [dot(x, x) - 1.0, dot(y, y) - 1.0, dot(z, z) - 1.0, dot(x, y), dot(y, z), dot(z, x)];
    errors.iter().all(|e| e.abs() <= ORTHONORMAL_ERROR)
}

/// Directions as a frame: each brought to a length between one and four, zeros replaced by directions across the
/// others. Singular where those that are not zero are dependent.
pub(crate) fn complete(directions: [Vector; 3]) -> Frame {
    let known = directions.map(|d| d != [0.0; 3]);
    let mut axes = directions.map(|d| vector::scale(d, binade_inverse(vector::reach(d))));
    if let Some(missing) = known.iter().position(|&is_known| !is_known) {
        let [a, b] = [axes[(missing + 1) % 3], axes[(missing + 2) % 3]];
        let orthonormal = basis(a, b);
        // The two others stay as they are where they are known.
        axes[missing] = orthonormal[2];
        match [known[(missing + 1) % 3], known[(missing + 2) % 3]] {
            [true, true] => {}
            [true, false] => axes[(missing + 2) % 3] = orthonormal[1],
            [false, true] => axes[(missing + 1) % 3] = orthonormal[1],
            [false, false] => return crate::Obb::IDENTITY_FRAME,
        }
    }
    axes.map(vector::to_f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_two_directions_give_a_rotation() {
        let ugly =
            [[0.0; 3], [1.0, 0.0, 0.0], [1e-300, 0.0, 0.0], [1e300, 1e300, -1e300], [1.0, 1e-9, 0.0], [3.0, -0.0, 4.0]];
        for first in ugly {
            for second in ugly {
                let frame = orthonormal(first, second);
                assert!(is_orthonormal(frame), "{first:?} {second:?} {frame:?}");
                assert_eq!(right_handed(frame), frame, "{first:?} {second:?}");
            }
        }
    }

    #[test]
    fn flattened_directions_are_completed_to_independent_ones() {
        for mask in 0..8 {
            let skewed = [[2.0, 1.0, 0.0], [0.0, 3e-20, 0.0], [0.0, 1e20, 1e20]];
            let directions = core::array::from_fn(|k| if mask >> k & 1 == 1 { skewed[k] } else { [0.0; 3] });
            let [x, y, z] = complete(directions).map(vector::to_f64);
            assert!(dot(cross(x, y), z).abs() > 0.1, "{mask}");
        }
    }

    #[test]
    fn the_mirrored_and_the_skewed_are_told_apart() {
        let mirrored = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        assert!(is_orthonormal(mirrored));
        assert_eq!(right_handed(mirrored), crate::Obb::IDENTITY_FRAME);
        let skewed = [[1.0, 0.0, 0.0], [1e-6, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(!is_orthonormal(skewed));
        let [x, y, _] = skewed.map(vector::to_f64);
        assert!(is_orthonormal(orthonormal(x, y)));
    }
}
