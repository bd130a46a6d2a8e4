//! How far from the origin kernels compute.

use crate::GpuError;

/// Greatest absolute coordinate of a mesh, and of an instance in the world, that kernels compute with: it lies below the 2^60 up
/// to which the pads of `shared/bvh.wgsl` are proven, and squares of distances stay far from overflow.
pub const MAX_COORDINATE: f32 = 1e18;

/// Refuses what reaches farther, by its name.
pub(super) fn check_reach(name: impl FnOnce() -> String, reach: f64) -> Result<(), GpuError> {
    // So written that what is not a number is refused.
    if reach <= MAX_COORDINATE.into() {
        return Ok(());
    }
    Err(GpuError::Unsupported { what: format!("{}, which has coordinates above {MAX_COORDINATE:e}", name()) })
}
