use std::fmt;

use canted_scene::{Camera, Lens, Projection};
use canted_trace::Ray;
use glam::DVec3;

use crate::sampling::uniform_disk;
use crate::{Cone, narrow, wide};

/// A camera with an image size: maps image positions to world-space rays.
///
/// Positions are in pixels from the top left corner, x to the right and y down. The center of pixel (0, 0) is at
/// (0.5, 0.5). Pixels are square.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub(crate) eye: DVec3,
    /// Unit vector of the view direction.
    pub(crate) forward: DVec3,
    /// One pixel to the right, for a perspective on the image plane at distance 1.
    pub(crate) right: DVec3,
    /// One pixel down, likewise.
    pub(crate) down: DVec3,
    pub(crate) is_perspective: bool,
    pub(crate) lens: Option<Lens>,
    /// Image size in pixels.
    size: [f64; 2],
}

impl View {
    /// Creates the view of `camera` for an image of `width` by `height` pixels.
    ///
    /// # Errors
    /// [`CameraError`] if the view direction, the up vector, the lens or the field of view is invalid.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Result<Self, CameraError> {
        let Camera { eye, target, up, projection, lens } = *camera;
        for (name, point) in [("eye", eye), ("target", target), ("up", up)] {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(CameraError::NotFinite { name, value: point });
            }
        }
        let (view_height, is_perspective) = match projection {
            // Also false for NaN.
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
        let forward = (wide(target) - wide(eye)).try_normalize().ok_or(CameraError::NoDirection { eye })?;
        let up_unit = wide(up).try_normalize().ok_or(CameraError::NoUp { up })?;
        let right = forward.cross(up_unit);
        // A sine below the rounding error of the f32 inputs does not define up.
        if right.length() < f64::from(f32::EPSILON) {
            return Err(CameraError::NoUp { up });
        }
        let right = right.try_normalize().ok_or(CameraError::NoUp { up })?;
        let down = forward.cross(right);
        let pixel = view_height / f64::from(height);
        Ok(Self {
            eye: wide(eye),
            forward,
            right: right * pixel,
            down: down * pixel,
            is_perspective,
            lens,
            size: [f64::from(width), f64::from(height)],
        })
    }

    /// The ray through an image position, in pixels, and the lens center. Its direction has unit length up to rounding.
    #[must_use]
    pub fn ray(&self, position: [f64; 2]) -> Ray {
        let (origin, direction) = self.origin_and_direction(position);
        Ray::new(narrow(origin), narrow(direction))
    }

    /// The ray through an image position and a point of the lens, given by a point of the unit square.
    ///
    /// All rays of one position intersect in the plane of focus. Without a lens this is [`View::ray`].
    #[must_use]
    pub fn ray_through_lens(&self, position: [f64; 2], square: [f32; 2]) -> Ray {
        let (origin, direction) = self.origin_and_direction(position);
        let Some(Lens { radius, focus_distance }) = self.lens else {
            return Ray::new(narrow(origin), narrow(direction));
        };
        let [x, y] = uniform_disk(square).map(|c| f64::from(c) * f64::from(radius));
        // `right` and `down` are perpendicular and of equal length.
        let pixel = self.right.length();
        let shift = self.right * (x / pixel) + self.down * (y / pixel);
        // The direction has unit length, so its depth is its cosine to the view direction.
        let to_focus = direction * (f64::from(focus_distance) / direction.dot(self.forward));
        let direction = to_focus - shift;
        Ray::new(narrow(origin + shift), narrow(direction * (1.0 / direction.length())))
    }

    /// Whether the camera has a lens, so that rays of one image position differ.
    #[must_use]
    pub fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// Origin and unit direction through an image position and the lens center.
    fn origin_and_direction(&self, position: [f64; 2]) -> (DVec3, DVec3) {
        let across = self.right * (position[0] - 0.5 * self.size[0]);
        let along = self.down * (position[1] - 0.5 * self.size[1]);
        if !self.is_perspective {
            return (self.eye + (across + along), self.forward);
        }
        let direction = self.forward + (across + along);
        // At least as long as `forward`, because the other two are perpendicular to it.
        (self.eye, direction * (1.0 / direction.length()))
    }

    /// The ray cone of a pixel's sample with this number, at an image position.
    ///
    /// The spread of a perspective pixel is the square root of its solid angle. A lens does not widen it: samples
    /// average what is out of focus.
    #[must_use]
    pub fn cone(&self, position: [f64; 2], sample: u32) -> Cone {
        let pixel = self.right.length();
        if !self.is_perspective {
            return Cone::of_pixel(pixel, 0.0, sample);
        }
        let [x, y] = [0, 1].map(|k| (position[k] - 0.5 * self.size[k]) * pixel);
        // Image plane at distance 1: the solid angle of a pixel falls with the squared distance and the cosine.
        let cosine = 1.0 / (1.0 + x * x + y * y).sqrt();
        Cone::of_pixel(0.0, pixel * cosine * cosine.sqrt(), sample)
    }

    /// Image size in pixels.
    pub(crate) fn size(&self) -> [f64; 2] {
        self.size
    }

    /// The image position in pixels of a world-space point at this depth; the depth is 1 for an orthographic view, whatever it is.
    pub(crate) fn position(&self, point: DVec3, depth: f64) -> [f64; 2] {
        let offset = point - self.eye;
        // `right` and `down` are perpendicular and as long as a pixel.
        let pixel_squared = self.right.dot(self.right);
        let along = |axis: DVec3, size: f64| offset.dot(axis) / (pixel_squared * depth) + 0.5 * size;
        [along(self.right, self.size[0]), along(self.down, self.size[1])]
    }

    /// Depth of a world-space point along the view direction, as compositing tools define it.
    #[must_use]
    pub fn depth(&self, point: [f64; 3]) -> f64 {
        self.forward.dot(DVec3::from(point) - self.eye)
    }
}

/// Why a camera is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraError {
    /// A coordinate is infinite or NaN.
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
    /// The height of an orthographic view is not positive.
    Height {
        /// The height.
        height: f32,
    },
    /// The radius or focus distance of the lens is not positive and finite.
    Lens {
        /// The radius.
        radius: f32,
        /// The distance.
        focus_distance: f32,
    },
    /// Eye and target coincide.
    NoDirection {
        /// That point.
        eye: [f32; 3],
    },
    /// The up vector is zero or parallel to the view direction.
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
            Self::Height { height } => write!(f, "camera height {height} is not positive"),
            Self::Lens { radius, focus_distance } => {
                write!(f, "camera lens radius {radius} and focus distance {focus_distance} must be positive and finite")
            }
            Self::NoDirection { eye } => write!(f, "camera target and eye coincide at {eye:?}"),
            Self::NoUp { up } => write!(f, "camera up {up:?} is zero or parallel to the view direction"),
        }
    }
}

impl std::error::Error for CameraError {}
