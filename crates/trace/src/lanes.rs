//! Numbers and steps that wider code repeats lane by lane, so that what is proven of them here is proven there; no part of what
//! the crate promises.

pub use crate::rounding::UNIT_ROUNDOFF;
pub use crate::slab::slab_ray::{SQRT_3, reciprocal};
pub use crate::triangle::moller_trumbore::{ERROR as WEIGHTS_ERROR, HEADROOM as WEIGHTS_HEADROOM};
