//! Queries of a `Bih` against a loop over all triangles.

mod agree;
mod common;
mod counts;
mod input;
