/// A camera in world space. Row 0 of the image is the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Center of the lens.
    pub eye: [f32; 3],
    /// A point on the optical axis, at the image center.
    pub target: [f32; 3],
    /// Up direction in the image; not parallel to the view direction.
    pub up: [f32; 3],
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Depth of field; `None` for a pinhole camera.
    pub lens: Option<Lens>,
}

/// Camera projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays start at the eye.
    Perspective {
        /// Vertical field of view in degrees, between 0 and 180.
        fov_degrees: f32,
    },
    /// All rays are parallel to the view direction.
    Orthographic {
        /// Height of the visible region in world units, above zero.
        height: f32,
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the round aperture, world units, above zero.
    pub radius: f32,
    /// Distance from the eye to the plane in focus, along the view direction; above zero.
    pub focus_distance: f32,
}

impl Camera {
    /// A pinhole camera with a vertical field of view in degrees.
    #[must_use]
    pub const fn pinhole(eye: [f32; 3], target: [f32; 3], up: [f32; 3], fov_degrees: f32) -> Self {
        Self { eye, target, up, projection: Projection::Perspective { fov_degrees }, lens: None }
    }
}
