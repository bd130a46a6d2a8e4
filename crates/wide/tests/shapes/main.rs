//! Shapes of the caller in aligned and oriented nodes: results equal a loop over all shapes, for every query, on every path,
//! after refits and loads.
//!
//! Not covered: shapes whose intersection contradicts their contract beyond the cases in `agree.rs`.

mod agree;
mod edits;
mod saved;
mod shape;
