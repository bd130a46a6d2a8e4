pub(crate) use canted_obb::round::{down, up};

/// Relative error of one f32 rounding, 2^-24.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;

/// Relative error of one f64 rounding, 2^-53.
pub(crate) const UNIT_ROUNDOFF_F64: f64 = canted_obb::round::U;

/// A finite f32 not above `x - pad` but for one f64 rounding; a plane of a padded box.
///
/// The f64 rounding is 2^-53 of the plane: the proofs of pads have 2^-24 to spare.
#[inline]
#[must_use]
pub fn lower(x: f32, pad: f64) -> f32 {
    down(f64::from(x) - pad).max(f32::MIN)
}

/// Nearest f32, with zero always positive, so that `-0.0` in a ray changes no bit of a result.
#[inline]
pub(crate) fn nearest(x: f64) -> f32 {
    x as f32 + 0.0
}
