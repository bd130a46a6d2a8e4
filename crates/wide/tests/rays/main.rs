//! Queries of rays, compared with tests of every primitive.

mod access;
mod boxes;
mod common;
mod costs;
mod crossings;
mod hits;
mod local;
mod moving;
mod primitives;
mod slices;
