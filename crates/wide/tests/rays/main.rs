//! What rays ask of trees, against every primitive tried.

mod boxes;
mod common;
mod costs;
mod crossings;
mod hits;
mod primitives;
mod slices;
