//! Constants and scalar steps that the SIMD kernels repeat lane by lane, so that one proof covers both. Not part of the
//! stable interface.

pub use crate::rounding::{UNIT_ROUNDOFF, lower};
pub use crate::slab::slab_ray::{SQRT_3, reciprocal};
pub use crate::triangle::baldwin_weber::weights as baldwin_weber_weights;
pub use crate::triangle::filter::Weights;
pub use crate::triangle::finish::finish;
pub use crate::triangle::moller_trumbore::{
    ERROR as WEIGHTS_ERROR, HEADROOM as WEIGHTS_HEADROOM, weights as moller_trumbore_weights,
};
