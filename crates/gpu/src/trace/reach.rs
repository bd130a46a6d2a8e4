//! How far from the origin kernels compute.

use crate::GpuError;

/// Greatest absolute coordinate of a mesh, and of an instance in the world, that kernels compute with: it lies below the 2^60 up
/// to which the pads of `shared/tree.wgsl` are proven, and squares of distances stay far from overflow.
pub const MOST_REACH: f32 = 1e18;

/// Refuses what reaches farther, by its name.
pub(super) fn check_reach(name: impl FnOnce() -> String, reach: f64) -> Result<(), GpuError> {
    // So written that what is not a number is refused.
    if reach <= MOST_REACH.into() {
        return Ok(());
    }
    Err(GpuError::Untraceable { what: format!("{}, which has coordinates above {MOST_REACH:e}", name()) })
}
