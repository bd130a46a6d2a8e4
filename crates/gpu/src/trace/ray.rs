//! Rays and hits as the kernels lay them out: `shared/ray.wgsl`.

use bytemuck::{Pod, Zeroable};
use canted_trace::ScaledRay;

/// What stands for infinity in kernels.
pub(super) const FAR: f32 = 3e38;

/// The instance of a miss.
pub(super) const NONE: u32 = u32::MAX;

/// The instance of a ray whose walk was cut short.
pub(super) const CUT: u32 = u32::MAX - 1;

/// A ray in the device's memory.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceRay {
    /// Start, world space.
    pub origin: [f32; 3],
    /// Least accepted `t`.
    pub t_min: f32,
    /// Direction, world space; one of zeros hits nothing.
    pub direction: [f32; 3],
    /// Greatest accepted `t`: finite.
    pub t_max: f32,
}

impl DeviceRay {
    /// The ray that hits nothing.
    pub(super) const NOTHING: Self = Self { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 0.0 };

    /// A ray in scaled units, which kernels then need not scale.
    #[must_use]
    pub fn scaled(ray: &ScaledRay) -> Self {
        Self { origin: ray.origin, t_min: ray.t_min.min(FAR), direction: ray.direction, t_max: ray.t_max.min(FAR) }
    }
}

/// A hit in the device's memory.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// The triangle, numbered as in its mesh.
    pub primitive: u32,
    /// The instance, numbered as in the scene; its greatest values stand for no hit.
    pub instance: u32,
}
