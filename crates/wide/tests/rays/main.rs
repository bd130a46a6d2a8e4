//! Queries of rays, compared with tests of every primitive.

mod boxes;
mod common;
mod costs;
mod crossings;
mod file;
mod hits;
mod local;
mod moving;
mod refit;
