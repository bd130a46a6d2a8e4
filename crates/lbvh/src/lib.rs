//! lbvh
