//! Frames: three axes as the columns of a matrix, in the space of the points.

use crate::round::{U, binade_inverse};
use crate::vector::{self, Vector, cross, dot};

/// Three axes; `frame[k]` is column `k` of the matrix that maps box coordinates to the space of the points.
pub type Frame = [[f32; 3]; 3];

/// The identity frame.
pub const IDENTITY: Frame = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Error of a dot product of two columns of an orthonormal frame rounded to `f32`.
///
/// Each entry errs by half a unit in the last place of one, `2⁻²⁵`; a dot product of unit columns errs by at most
/// `2 · √3 · 2⁻²⁵`; the next power of two is 2⁻²³.
pub const ORTHONORMAL_ERROR: f64 = 1.0 / 8_388_608.0;

/// Below this fraction of its length, what projection leaves of a vector is rounding error.
const PARALLEL: f64 = 8.0 * U;

/// The right-handed orthonormal frame whose first axis is parallel to `first` and whose second lies in the plane of both
/// (Gram-Schmidt).
///
/// Zero and parallel directions are completed deterministically, perpendicular to the axis of the least component.
/// Lengths do not matter, at any scale; directions must be finite.
#[must_use]
pub fn orthonormal(first: [f64; 3], second: [f64; 3]) -> Frame {
    basis(first, second).map(vector::to_f32)
}

/// [`orthonormal`] before rounding to `f32`.
pub(crate) fn basis(first: Vector, second: Vector) -> [Vector; 3] {
    let x = vector::normalized(first).or_else(|| vector::normalized(second)).unwrap_or([1.0, 0.0, 0.0]);
    let y = vector::normalized(second)
        .map(|s| vector::sub(s, vector::scale(x, dot(s, x))))
        .filter(|&rest| vector::length(rest) > PARALLEL)
        .and_then(vector::normalized)
        // A second projection removes the rounding error of the first.
        .and_then(|y| vector::normalized(vector::sub(y, vector::scale(x, dot(y, x)))))
        .unwrap_or_else(|| across(x));
    [x, y, cross(x, y)]
}

/// A unit vector perpendicular to the unit vector `x`.
pub(crate) fn across(x: Vector) -> Vector {
    let least = (1..3).fold(0, |least, k| if x[k].abs() < x[least].abs() { k } else { least });
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    vector::normalized(cross(x, axis)).unwrap_or([0.0, 1.0, 0.0])
}

/// The frame with its third axis reversed if it is left-handed: it bounds the same boxes.
#[must_use]
pub fn right_handed(frame: Frame) -> Frame {
    let [x, y, z] = frame.map(vector::to_f64);
    if dot(cross(x, y), z) < 0.0 { [frame[0], frame[1], frame[2].map(|c| -c)] } else { frame }
}

/// Whether the columns are orthonormal up to rounding to `f32`; left-handed frames included.
#[must_use]
pub fn is_orthonormal(frame: Frame) -> bool {
    let [x, y, z] = frame.map(vector::to_f64);
    let errors = [dot(x, x) - 1.0, dot(y, y) - 1.0, dot(z, z) - 1.0, dot(x, y), dot(y, z), dot(z, x)];
    errors.iter().all(|e| e.abs() <= ORTHONORMAL_ERROR)
}

/// Directions as a frame: each scaled by a power of two to a length between one and four, zeros replaced by vectors
/// perpendicular to the others. Singular where the non-zero directions are dependent.
pub(crate) fn complete(directions: [Vector; 3]) -> Frame {
    let known = directions.map(|d| d != [0.0; 3]);
    let mut axes = directions.map(|d| vector::scale(d, binade_inverse(vector::reach(d))));
    if let Some(missing) = known.iter().position(|&is_known| !is_known) {
        let [a, b] = [axes[(missing + 1) % 3], axes[(missing + 2) % 3]];
        let orthonormal = basis(a, b);
        axes[missing] = orthonormal[2];
        match [known[(missing + 1) % 3], known[(missing + 2) % 3]] {
            [true, true] => {}
            [true, false] => axes[(missing + 2) % 3] = orthonormal[1],
            [false, true] => axes[(missing + 1) % 3] = orthonormal[1],
            [false, false] => return IDENTITY,
        }
    }
    axes.map(vector::to_f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orthonormal_gives_a_rotation_for_any_two_directions() {
        let directions =
            [[0.0; 3], [1.0, 0.0, 0.0], [1e-300, 0.0, 0.0], [1e300, 1e300, -1e300], [1.0, 1e-9, 0.0], [3.0, -0.0, 4.0]];
        for first in directions {
            for second in directions {
                let frame = orthonormal(first, second);
                assert!(is_orthonormal(frame), "{first:?} {second:?} {frame:?}");
                assert_eq!(right_handed(frame), frame, "{first:?} {second:?}");
            }
        }
    }

    #[test]
    fn complete_replaces_zero_directions() {
        for mask in 0..8 {
            let skewed = [[2.0, 1.0, 0.0], [0.0, 3e-20, 0.0], [0.0, 1e20, 1e20]];
            let directions = core::array::from_fn(|k| if mask >> k & 1 == 1 { skewed[k] } else { [0.0; 3] });
            let [x, y, z] = complete(directions).map(vector::to_f64);
            assert!(dot(cross(x, y), z).abs() > 0.1, "{mask}");
        }
    }

    #[test]
    fn mirrored_frames_are_orthonormal_and_skewed_ones_are_not() {
        let mirrored = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        assert!(is_orthonormal(mirrored));
        assert_eq!(right_handed(mirrored), IDENTITY);
        let skewed = [[1.0, 0.0, 0.0], [1e-6, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(!is_orthonormal(skewed));
        let [x, y, _] = skewed.map(vector::to_f64);
        assert!(is_orthonormal(orthonormal(x, y)));
    }
}
