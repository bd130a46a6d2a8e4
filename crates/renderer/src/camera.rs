use std::fmt;

use canted_scene::Camera;
use canted_trace::Ray;

use crate::vector::{Vector, add, cross, dot, narrow, scale, sub, unit, wide};

/// A camera joined to a picture size: it turns picture positions into world-space rays.
///
/// Positions are in pixels from the top left corner of the picture, x to the right and y down, so the middle of
/// pixel (0, 0) is (0.5, 0.5). Pixels are square.
#[derive(Clone, Copy, Debug)]
pub struct View {
    eye: [f32; 3],
    /// Middle of the picture on the plane at distance 1.
    forward: Vector,
    /// Step of one pixel to the right on that plane.
    right: Vector,
    /// Step of one pixel down on that plane.
    down: Vector,
    /// Picture size in pixels.
    size: [f64; 2],
}

impl View {
    /// Joins `camera` to a picture of `width` by `height` pixels.
    ///
    /// # Errors
    /// [`CameraError`] where the camera has no direction, no up, or no field of view.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Result<Self, CameraError> {
        let Camera { eye, target, up, fov_degrees } = *camera;
        for (name, point) in [("eye", eye), ("target", target), ("up", up)] {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(CameraError::NotFinite { name, value: point });
            }
        }
        // Written so that a NaN is refused too.
        if !(fov_degrees > 0.0 && fov_degrees < 180.0) {
            return Err(CameraError::FieldOfView { degrees: fov_degrees });
        }
        let forward = unit(sub(wide(target), wide(eye))).ok_or(CameraError::NoDirection { eye })?;
        let up_unit = unit(wide(up)).ok_or(CameraError::NoUp { up })?;
        let across = cross(forward, up_unit);
        // A sine below the rounding of the f32 inputs says nothing about where up is.
        if crate::vector::length(across) < f64::from(f32::EPSILON) {
            return Err(CameraError::NoUp { up });
        }
        let right = unit(across).ok_or(CameraError::NoUp { up })?;
        let down = cross(forward, right);
        let pixel = 2.0 * (0.5 * f64::from(fov_degrees).to_radians()).tan() / f64::from(height);
        Ok(Self {
            eye,
            forward,
            right: scale(right, pixel),
            down: scale(down, pixel),
            size: [f64::from(width), f64::from(height)],
        })
    }

    /// The ray through a picture position, in pixels; its direction has unit length up to rounding.
    #[must_use]
    pub fn ray(&self, position: [f64; 2]) -> Ray {
        let across = scale(self.right, position[0] - 0.5 * self.size[0]);
        let along = scale(self.down, position[1] - 0.5 * self.size[1]);
        let direction = add(self.forward, add(across, along));
        // At least as long as the unit vector forward, to which the other two are perpendicular.
        Ray::new(self.eye, narrow(scale(direction, 1.0 / crate::vector::length(direction))))
    }

    /// Distance of a world-space point along the view axis, as compositing tools take depth.
    #[must_use]
    pub fn depth(&self, point: [f64; 3]) -> f64 {
        dot(self.forward, sub(point, wide(self.eye)))
    }
}

/// Why a camera cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraError {
    /// A coordinate is infinite or not a number.
    NotFinite {
        /// Which point.
        name: &'static str,
        /// Its value.
        value: [f32; 3],
    },
    /// The field of view is not between 0 and 180 degrees.
    FieldOfView {
        /// The field of view.
        degrees: f32,
    },
    /// Eye and target are one point.
    NoDirection {
        /// That point.
        eye: [f32; 3],
    },
    /// The up direction is zero or along the view.
    NoUp {
        /// The up direction.
        up: [f32; 3],
    },
}

impl fmt::Display for CameraError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { name, value } => write!(f, "camera {name} {value:?} is not finite"),
            Self::FieldOfView { degrees } => {
                write!(f, "camera field of view {degrees} degrees is not between 0 and 180")
            }
            Self::NoDirection { eye } => write!(f, "camera target equals its eye {eye:?}"),
            Self::NoUp { up } => write!(f, "camera up {up:?} does not differ from the view direction"),
        }
    }
}

impl std::error::Error for CameraError {}
