//! Instances: two levels return the same bits as a loop over instances, and agree with exact geometry within bounds.
//!
//! Rotation, mirror, unequal scale, shear, scales 1e-3 and 1e3, offsets of 1e7, many overlapping instances; top-level volumes of
//! every strategy; moved and moving instances; mixed kinds of bottom levels. Not covered here: leaks through closed instances
//! (`hits/watertight.rs`), seams between two instances (not promised, because each rounds independently), speed.

mod edits;
mod geometry;
mod kinds;
mod moving;
mod queries;
mod setup;
