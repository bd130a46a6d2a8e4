use std::fmt;

use canted_scene::{Camera, Lens, Projection};
use canted_trace::Ray;

use crate::Cone;
use crate::sampling::uniform_disk;
use crate::vector::{Vector, add, cross, dot, narrow, scale, sub, unit, wide};

/// A camera joined to a picture size: it turns picture positions into world-space rays.
///
/// Positions are in pixels from the top left corner of the picture, x to the right and y down, so the middle of
/// pixel (0, 0) is (0.5, 0.5). Pixels are square.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub(crate) eye: Vector,
    /// Unit vector into the picture.
    pub(crate) forward: Vector,
    /// Step of one pixel to the right, on the plane at distance 1 of a perspective.
    pub(crate) right: Vector,
    /// Step of one pixel down, likewise.
    pub(crate) down: Vector,
    pub(crate) is_perspective: bool,
    pub(crate) lens: Option<Lens>,
    /// Picture size in pixels.
    size: [f64; 2],
}

impl View {
    /// Joins `camera` to a picture of `width` by `height` pixels.
    ///
    /// # Errors
    /// [`CameraError`] where the camera has no direction, no up, or no field of view.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Result<Self, CameraError> {
        let Camera { eye, target, up, projection, lens } = *camera;
        for (name, point) in [("eye", eye), ("target", target), ("up", up)] {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(CameraError::NotFinite { name, value: point });
            }
        }
        let (view_height, is_perspective) = match projection {
            // Written so that a NaN is refused too.
            Projection::Perspective { fov_degrees } if fov_degrees > 0.0 && fov_degrees < 180.0 => {
                (2.0 * (0.5 * f64::from(fov_degrees).to_radians()).tan(), true)
            }
            Projection::Perspective { fov_degrees } => return Err(CameraError::FieldOfView { degrees: fov_degrees }),
            Projection::Orthographic { height } if height > 0.0 && height.is_finite() => (f64::from(height), false),
            Projection::Orthographic { height } => return Err(CameraError::Height { height }),
        };
        let is_length = |x: f32| x > 0.0 && x.is_finite();
        if let Some(Lens { radius, focus_distance }) = lens
            && !(is_length(radius) && is_length(focus_distance))
        {
            return Err(CameraError::Lens { radius, focus_distance });
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
        let pixel = view_height / f64::from(height);
        Ok(Self {
            eye: wide(eye),
            forward,
            right: scale(right, pixel),
            down: scale(down, pixel),
            is_perspective,
            lens,
            size: [f64::from(width), f64::from(height)],
        })
    }

    /// The ray through a picture position, in pixels, and the middle of the lens; its direction has unit length up to
    /// rounding.
    #[must_use]
    pub fn ray(&self, position: [f64; 2]) -> Ray {
        let (origin, direction) = self.line(position);
        Ray::new(narrow(origin), narrow(direction))
    }

    /// The ray through a picture position and a point of the lens, given by a point of the unit square.
    ///
    /// All rays of one position meet in the plane of focus. Without a lens it is [`View::ray`].
    #[must_use]
    pub fn ray_through_lens(&self, position: [f64; 2], square: [f32; 2]) -> Ray {
        let (origin, direction) = self.line(position);
        let Some(Lens { radius, focus_distance }) = self.lens else {
            return Ray::new(narrow(origin), narrow(direction));
        };
        let [x, y] = uniform_disk(square).map(|c| f64::from(c) * f64::from(radius));
        // Steps of a pixel are perpendicular to each other and of one length.
        let pixel = crate::vector::length(self.right);
        let shift = add(scale(self.right, x / pixel), scale(self.down, y / pixel));
        // The direction has length one; along the view it gets on by its cosine.
        let way = scale(direction, f64::from(focus_distance) / dot(direction, self.forward));
        let direction = sub(way, shift);
        Ray::new(narrow(add(origin, shift)), narrow(scale(direction, 1.0 / crate::vector::length(direction))))
    }

    /// Whether rays of one position differ by where they pass the lens.
    #[must_use]
    pub fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// Origin and unit direction through a picture position and the middle of the lens.
    fn line(&self, position: [f64; 2]) -> (Vector, Vector) {
        let across = scale(self.right, position[0] - 0.5 * self.size[0]);
        let along = scale(self.down, position[1] - 0.5 * self.size[1]);
        if !self.is_perspective {
            return (add(self.eye, add(across, along)), self.forward);
        }
        let direction = add(self.forward, add(across, along));
        // At least as long as the unit vector forward, to which the other two are perpendicular.
        (self.eye, scale(direction, 1.0 / crate::vector::length(direction)))
    }

    /// What the ray through a picture position stands for, where it is the pixel's sample with this number.
    ///
    /// A perspective pixel fills a solid angle; the spread is its root. A lens does not widen it: what is out of focus is
    /// averaged by the samples.
    #[must_use]
    pub fn cone(&self, position: [f64; 2], sample: u32) -> Cone {
        let pixel = crate::vector::length(self.right);
        if !self.is_perspective {
            return Cone::of_pixel(pixel, 0.0, sample);
        }
        let [x, y] = std::array::from_fn(|k| (position[k] - 0.5 * self.size[k]) * pixel);
        // The plane of the picture is at distance 1: a pixel's angle falls by the square of the distance and the cosine.
        let cosine = 1.0 / (1.0 + x * x + y * y).sqrt();
        Cone::of_pixel(0.0, pixel * cosine * cosine.sqrt(), sample)
    }

    /// Distance of a world-space point along the view axis, as compositing tools take depth.
    #[must_use]
    pub fn depth(&self, point: [f64; 3]) -> f64 {
        dot(self.forward, sub(point, self.eye))
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
    /// The height of an orthographic picture is not above zero.
    Height {
        /// The height.
        height: f32,
    },
    /// Radius or distance of focus of the lens are not above zero.
    Lens {
        /// The radius.
        radius: f32,
        /// The distance.
        focus_distance: f32,
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
            Self::Height { height } => write!(f, "camera picture height {height} is not above zero"),
            Self::Lens { radius, focus_distance } => {
                write!(
                    f,
                    "camera lens radius {radius} and focus distance {focus_distance} are not both finite and above zero"
                )
            }
            Self::NoDirection { eye } => write!(f, "camera target equals its eye {eye:?}"),
            Self::NoUp { up } => write!(f, "camera up {up:?} does not differ from the view direction"),
        }
    }
}

impl std::error::Error for CameraError {}
