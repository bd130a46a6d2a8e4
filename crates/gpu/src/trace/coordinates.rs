//! The range of coordinates that kernels support.

use crate::GpuError;

/// Maximum absolute coordinate of a mesh, and of an instance in world space. It is below 2^60, up to which the pads of
/// `shared/bvh.wgsl` are proven, and squared distances do not overflow.
pub const MAX_COORDINATE: f32 = 1e18;

/// Rejects larger coordinates.
pub(super) fn check_coordinates(name: impl FnOnce() -> String, reach: f64) -> Result<(), GpuError> {
    // This form also rejects NaN.
    if reach <= MAX_COORDINATE.into() {
        return Ok(());
    }
    Err(GpuError::Unsupported { what: format!("{}, which has coordinates above {MAX_COORDINATE:e}", name()) })
}
