//! Shapes of the caller in aligned and oriented nodes: results equal a loop over all shapes, for every query, on every path,
//! after refits and loads.
//!
//! Not covered: shapes whose intersection contradicts their contract beyond the cases in `rays/primitives.rs`.

mod agree;
mod extents;
mod file;
mod refit;
mod scenes;
mod shape;
