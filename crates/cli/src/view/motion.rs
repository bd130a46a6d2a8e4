//! Motions of the camera: orbit, pan, zoom, fly. All keep `up` upright.

use canted_renderer::View;
use canted_scene::{Camera, Projection};
use glam::{DVec3, Vec3};

use crate::camera::rotated;

/// A motion, in pixels of a picture of a given height or in steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// Around the target, by pixels to the right and down: half a turn for the height of the picture.
    Orbit([f64; 2]),
    /// Moves the picture by pixels to the right and down, exactly so at the distance of the target.
    Pan([f64; 2]),
    /// Towards the target by notches; negative moves away.
    Zoom(f64),
    /// By steps to the right, up and forward.
    Fly([f64; 3]),
}

/// Factor of the distance for each notch.
const NOTCH: f64 = 0.9;

/// Part of the distance to the target that a step has.
const STEP: f64 = 0.05;

/// The camera after a motion, with this up direction; `None` where no valid camera results.
pub(super) fn moved(camera: &Camera, up: [f32; 3], motion: Motion, height: u32) -> Option<Camera> {
    let [eye, target, up_wide] = [camera.eye, camera.target, up].map(wide);
    let up_unit = up_wide.try_normalize()?;
    let offset = eye - target;
    let distance = offset.length();
    let forward = (-offset).try_normalize()?;
    let right = forward.cross(up_unit).try_normalize().or_else(|| any_across(up_unit).try_normalize())?;
    let above = right.cross(forward);
    let rows = f64::from(height.max(1));
    let mut moved = Camera { up, ..*camera };
    let (eye, target) = match motion {
        Motion::Orbit([x, y]) => {
            let per_pixel = std::f64::consts::PI / rows;
            let [offset, across] = [offset, right].map(|v| turned(v, up_unit, -x * per_pixel));
            // The elevation stays below the zenith, where up would be undefined.
            const LIMIT: f64 = 1.55;
            let elevation = (offset.dot(up_unit) / distance).clamp(-1.0, 1.0).asin();
            let wanted = (elevation + y * per_pixel).clamp(-LIMIT, LIMIT);
            (target + turned(offset, across, elevation - wanted), target)
        }
        Motion::Pan([x, y]) => {
            let visible = match camera.projection {
                Projection::Perspective { fov_degrees } => {
                    2.0 * distance * (0.5 * f64::from(fov_degrees)).to_radians().tan()
                }
                Projection::Orthographic { height } => f64::from(height),
            };
            let shift = (-x * visible / rows) * right + (y * visible / rows) * above;
            (eye + shift, target + shift)
        }
        Motion::Zoom(notches) => {
            let factor = NOTCH.powf(notches.clamp(-20.0, 20.0));
            if let Projection::Orthographic { height } = &mut moved.projection {
                *height = (f64::from(*height) * factor) as f32;
            }
            (target + factor * offset, target)
        }
        Motion::Fly([x, y, z]) => {
            let shift = STEP * distance * (x * right + y * up_unit + z * forward);
            (eye + shift, target + shift)
        }
    };
    moved.eye = eye.as_vec3().into();
    moved.target = target.as_vec3().into();
    View::new(&moved, 1, 1).ok().map(|_| moved)
}

/// The camera with its target at this distance along its axis; the same view.
pub(super) fn with_target_at(camera: &Camera, distance: f64) -> Camera {
    let [eye, target] = [camera.eye, camera.target].map(wide);
    let Some(forward) = (target - eye).try_normalize() else { return *camera };
    Camera { target: (eye + distance * forward).as_vec3().into(), ..*camera }
}

fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).into()
}

fn turned(v: DVec3, axis: DVec3, radians: f64) -> DVec3 {
    rotated(v, axis, radians.sin_cos().into())
}

/// A vector that is not parallel to a unit vector, made perpendicular to it.
fn any_across(up: DVec3) -> DVec3 {
    up.cross(if up.x.abs() < 0.5 { DVec3::X } else { DVec3::Z })
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f32; 3] = [0.0, 1.0, 0.0];
    const FRONT: Camera = Camera::pinhole([0.0, 0.0, 2.0], [0.0; 3], UP, 90.0);

    #[track_caller]
    fn assert_near(a: [f32; 3], b: [f32; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} is not {b:?}");
    }

    #[test]
    fn an_orbit_of_half_the_height_is_a_quarter_turn() {
        // The scene follows the pointer to the right, so the camera goes to the left.
        let side = moved(&FRONT, UP, Motion::Orbit([50.0, 0.0]), 100).unwrap();
        assert_near(side.eye, [-2.0, 0.0, 0.0]);
        assert_near(side.target, [0.0; 3]);
        let high = moved(&FRONT, UP, Motion::Orbit([0.0, 25.0]), 100).unwrap();
        assert_near(high.eye, [0.0, 2.0_f32.sqrt(), 2.0_f32.sqrt()]);
        let top = moved(&FRONT, UP, Motion::Orbit([0.0, 1e6]), 100).unwrap();
        assert!(top.eye[1] > 1.99 && top.eye[2] > 0.0, "{top:?}");
    }

    #[test]
    fn pans_move_the_picture_with_the_pointer() {
        let panned = moved(&FRONT, UP, Motion::Pan([25.0, 10.0]), 100).unwrap();
        // 4 units are visible at the target.
        assert_near(panned.eye, [-1.0, 0.4, 2.0]);
        assert_near(panned.target, [-1.0, 0.4, 0.0]);
    }

    #[test]
    fn zooms_scale_the_distance_and_flights_keep_it() {
        assert_near(moved(&FRONT, UP, Motion::Zoom(1.0), 9).unwrap().eye, [0.0, 0.0, 1.8]);
        let flown = moved(&FRONT, UP, Motion::Fly([1.0, 2.0, 3.0]), 9).unwrap();
        assert_near(flown.eye, [0.1, 0.2, 1.7]);
        assert_near(flown.target, [0.1, 0.2, -0.3]);
        let ortho = Camera { projection: Projection::Orthographic { height: 2.0 }, ..FRONT };
        let zoomed = moved(&ortho, UP, Motion::Zoom(-1.0), 9).unwrap();
        assert!(matches!(zoomed.projection, Projection::Orthographic { height } if (height - 2.0 / 0.9).abs() < 1e-6));
    }

    #[test]
    fn what_gives_no_camera_is_ignored() {
        let at_target = Camera { target: FRONT.eye, ..FRONT };
        assert_eq!(moved(&at_target, UP, Motion::Zoom(1.0), 9), None);
        assert_eq!(moved(&FRONT, [0.0; 3], Motion::Zoom(1.0), 9), None);
        assert_eq!(moved(&FRONT, UP, Motion::Pan([f64::NAN, 0.0]), 9), None);
    }
}
