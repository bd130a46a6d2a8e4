//! What rays ask of trees, against every primitive tried.

mod common;
mod crossings;
mod hits;
mod primitives;
mod slices;
