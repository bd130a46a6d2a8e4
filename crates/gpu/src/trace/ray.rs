//! Rays and hits in the layout of `shared/ray.wgsl`.

use bytemuck::{Pod, Zeroable};
use canted_trace::ScaledRay;

/// Infinity in kernels.
pub(super) const FAR: f32 = 3e38;

/// Instance of a ray whose traversal was incomplete.
pub(super) const INCOMPLETE: u32 = u32::MAX - 1;

/// A ray in device memory.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceRay {
    /// Origin, world space.
    pub origin: [f32; 3],
    /// Minimum accepted `t`.
    pub t_min: f32,
    /// Direction, world space; a zero direction hits nothing.
    pub direction: [f32; 3],
    /// Maximum accepted `t`, finite.
    pub t_max: f32,
}

impl DeviceRay {
    /// A ray that hits nothing.
    pub(super) const NOTHING: Self = Self { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 0.0 };

    /// A ray in scaled units, so that kernels need not scale it.
    #[must_use]
    pub fn scaled(ray: &ScaledRay) -> Self {
        Self { origin: ray.origin, t_min: ray.t_min.min(FAR), direction: ray.direction, t_max: ray.t_max.min(FAR) }
    }
}

/// A hit in device memory.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DeviceHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index of the instance in the scene; [`DeviceHit::NONE`] for a miss.
    pub instance: u32,
}

impl DeviceHit {
    /// The instance of a miss: `NONE` in WGSL.
    pub const NONE: u32 = u32::MAX;
}
