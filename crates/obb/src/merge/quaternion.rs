use core::f64::consts::FRAC_1_SQRT_2;

use crate::frame::{self, Frame};
use crate::{Obb, Quaternion, bound_boxes, rotation, vector};

/// Box along the weighted average of two boxes' rotations, in closed form (Ericson 2004, 6.5.3, made safe).
///
/// `weights` are those of the children, e.g. areas or primitive counts; two zeros weigh equally. A skewed frame is
/// replaced by its nearest rotation, a mirrored one by that of the same box with an axis reversed. Of the 24 rotations
/// that map the axes of a box to its axes, the one that brings the second box nearest to the first is chosen. So neither
/// the sign of a quaternion nor the order of the axes matters.
#[must_use]
pub fn quaternion(a: &Obb, b: &Obb, weights: [f64; 2]) -> Obb {
    bound_boxes(average(a.frame, b.frame, weights), [a, b])
}

/// The weighted average of two frames, as [`quaternion`] uses it.
#[must_use]
pub fn average(a: Frame, b: Frame, weights: [f64; 2]) -> Frame {
    average_rotations(rotation_of(a), rotation_of(b), weights).frame()
}

/// The weighted average of two unit quaternions, after a symmetry of the box has brought the second nearest to the
/// first.
///
/// For equal weights this is the chordal mean, halfway along the rotation from one to the other (Markley et al. 2007).
#[inline]
#[must_use]
pub fn average_rotations(p: Quaternion, q: Quaternion, weights: [f64; 2]) -> Quaternion {
    let [w_p, w_q] = if weights[0] + weights[1] > 0.0 { weights } else { [1.0; 2] };
    // Both signs of a symmetry are considered; the chosen one has a positive product, so the sum cannot cancel.
    let near = q.times(nearest_symmetry(q.conjugate().times(p)));
    p.scaled(w_p).plus(near.scaled(w_q)).normalized()
}

fn rotation_of(axes: Frame) -> Quaternion {
    let axes = frame::right_handed(axes);
    if frame::is_orthonormal(axes) {
        Quaternion::from_frame(axes)
    } else {
        rotation::extract(axes.map(vector::to_f64), rotation::MAX_ITERATIONS).rotation
    }
}

/// The rotational symmetry of the cube nearest to `r`, as the unit quaternion with the nearer sign.
///
/// The 24 symmetries are, up to sign, the quaternions with one, two or four non-zero components of equal magnitude. The
/// best of each kind uses the largest components of `r`, the first of equals.
fn nearest_symmetry(r: Quaternion) -> Quaternion {
    let components = [r.w, r.x, r.y, r.z];
    let [w, x, y, z] = components.map(f64::abs);
    let largest = |a: usize, b: usize| if components[b].abs() > components[a].abs() { b } else { a };
    let first = largest(largest(0, 1), largest(2, 3));
    let second = (0..4).filter(|&k| k != first).reduce(largest).unwrap_or(first);
    let one = components[first].abs();
    let two = (one + components[second].abs()) * FRAC_1_SQRT_2;
    let four = 0.5 * ((w + x) + (y + z));
    let mut nearest = [0.0; 4];
    if one >= two && one >= four {
        nearest[first] = 1.0;
    } else if two >= four {
        nearest[first] = FRAC_1_SQRT_2;
        nearest[second] = FRAC_1_SQRT_2;
    } else {
        nearest = [0.5; 4];
    }
    let [w, x, y, z] = core::array::from_fn(|k| nearest[k].copysign(components[k]));
    Quaternion { w, x, y, z }
}
