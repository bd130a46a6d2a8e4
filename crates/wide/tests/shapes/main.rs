//! Curves, patches, solids and shapes of the caller in aligned and oriented nodes: results equal a loop over all of them, for every query, on every
//! path, after refits and loads; and each kind against an oracle of its own.
//!
//! One program: in several, the code of a kind of primitive would be compiled several times, for minutes.
//!
//! Not covered: shapes whose intersection contradicts their contract beyond the cases in `agree.rs`.

mod agree;
mod edits;
mod kinds;
mod moving_curves;
mod patches;
mod quadrics;
mod ribbon;
mod round_cubic;
mod round_segment;
mod saved;
mod shape;
mod solids;
