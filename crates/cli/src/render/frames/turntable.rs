//! `--turntable`: the camera on a circle around its target.

use canted_scene::Camera;

/// How far the camera has turned at a frame of a range, if it turns by `degrees` in all.
pub(super) fn degrees(degrees: f32, [first, end]: [u32; 2], frame: u32) -> f64 {
    f64::from(degrees) * (f64::from(frame - first) / f64::from(end - first))
}

/// Turns the eye of a camera around the axis through its target along its up direction, counter-clockwise seen from the tip
/// of that direction.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
pub(super) fn turned(camera: Camera, degrees: f64) -> Camera {
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| v.map(f64::from));
    let length = up.iter().map(|x| x * x).sum::<f64>().sqrt();
    let axis = up.map(|x| x / length);
    let arm: [f64; 3] = std::array::from_fn(|k| eye[k] - target[k]);
    // Rodrigues' formula. A camera without an up direction is rejected later.
    let [sin, cos] = sin_cos(degrees);
    let along = axis.iter().zip(arm).map(|(a, b)| a * b).sum::<f64>();
    let around: [f64; 3] =
        std::array::from_fn(|k| axis[(k + 1) % 3] * arm[(k + 2) % 3] - axis[(k + 2) % 3] * arm[(k + 1) % 3]);
    let eye =
        std::array::from_fn(|k| (target[k] + arm[k] * cos + around[k] * sin + axis[k] * along * (1.0 - cos)) as f32);
    Camera { eye, ..camera }
}

/// Sine and cosine, exact for multiples of 90 degrees.
fn sin_cos(degrees: f64) -> [f64; 2] {
    let turn = degrees.rem_euclid(360.0);
    let quarter = (turn / 90.0).round();
    let (sin, cos) = (turn - 90.0 * quarter).to_radians().sin_cos();
    #[expect(clippy::cast_possible_truncation, reason = "a whole number from 0 to 4")]
    match quarter as i32 {
        1 => [cos, -sin],
        2 => [-sin, -cos],
        3 => [-cos, sin],
        _ => [sin, cos],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eye(up: [f32; 3], degrees: f64) -> [f32; 3] {
        turned(Camera::pinhole([3.0, 5.0, 2.0], [1.0, 1.0, 1.0], up, 40.0), degrees).eye
    }

    #[test]
    fn quarter_turns_are_exact() {
        // Seen from above, with x to the right and z towards the viewer, counter-clockwise is from z to x.
        let up = [0.0, 1.0, 0.0];
        for (degrees, want) in [
            (0.0, [3.0, 5.0, 2.0]),
            (90.0, [2.0, 5.0, -1.0]),
            (180.0, [-1.0, 5.0, 0.0]),
            (270.0, [0.0, 5.0, 3.0]),
            (-90.0, [0.0, 5.0, 3.0]),
            (360.0, [3.0, 5.0, 2.0]),
            (-1080.0, [3.0, 5.0, 2.0]),
        ] {
            assert_eq!(eye(up, degrees), want, "{degrees}");
        }
        assert_eq!(eye([0.0, 0.0, 7.0], 90.0), [-3.0, 3.0, 2.0], "about z, for an up direction of any length");
    }

    /// The eye keeps its height and its distance from the target, and the turn has the angle that was asked for.
    #[test]
    fn turns_are_rotations() {
        let up = [0.0, 1.0, 0.0];
        for step in -40..40_i32 {
            let degrees = 17.3 * f64::from(step);
            let [x, y, z] = eye(up, degrees).map(f64::from);
            // x = 2 cos + 1 sin, z = 1 cos - 2 sin, relative to the target.
            let (sin, cos) = degrees.to_radians().sin_cos();
            let bound = 8.0 * f64::from(f32::EPSILON);
            assert!(
                (x - 1.0 - 2.0 * cos - sin).abs() < bound && (z - 1.0 - cos + 2.0 * sin).abs() < bound,
                "{degrees}"
            );
            assert!((y - 5.0).abs() < bound, "{degrees}");
        }
    }
}
