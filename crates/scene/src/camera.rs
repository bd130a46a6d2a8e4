/// A pinhole camera in world space. Row 0 of the picture is the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pinhole.
    pub eye: [f32; 3],
    /// A point in the middle of the picture.
    pub target: [f32; 3],
    /// Direction that points up in the picture; not parallel to the view.
    pub up: [f32; 3],
    /// Vertical field of view in degrees, between 0 and 180.
    pub fov_degrees: f32,
}
