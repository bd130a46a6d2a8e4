//! Three-component arithmetic in `f64`.

pub(crate) use canted_obb::vector::{
    Vector, add, cross, dot, length, scale, sub, to_f32 as narrow, to_f64 as wide, unit,
};
