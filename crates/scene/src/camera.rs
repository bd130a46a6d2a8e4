/// A camera in world space. Row 0 of the picture is the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Middle of the lens.
    pub eye: [f32; 3],
    /// A point in the middle of the picture.
    pub target: [f32; 3],
    /// Direction that points up in the picture; not parallel to the view.
    pub up: [f32; 3],
    /// How the world comes onto the picture.
    pub projection: Projection,
    /// What is out of focus; `None` for a pinhole, which shows all sharply.
    pub lens: Option<Lens>,
}

/// How the world comes onto the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays meet in the eye.
    Perspective {
        /// Vertical field of view in degrees, between 0 and 180.
        fov_degrees: f32,
    },
    /// All rays are parallel.
    Orthographic {
        /// Height of what the picture shows, world units, above zero.
        height: f32,
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the round aperture, world units, above zero.
    pub radius: f32,
    /// Distance from the eye, along the view, of the plane that is sharp; above zero.
    pub focus_distance: f32,
}

impl Camera {
    /// A perspective camera without a lens; the field of view is vertical, in degrees.
    #[must_use]
    pub const fn pinhole(eye: [f32; 3], target: [f32; 3], up: [f32; 3], fov_degrees: f32) -> Self {
        Self { eye, target, up, projection: Projection::Perspective { fov_degrees }, lens: None }
    }
}
