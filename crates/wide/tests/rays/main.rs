//! What rays ask of trees, against every primitive tried.

mod common;
mod hits;
