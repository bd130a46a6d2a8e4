//! Instances: two levels find what a loop over instances finds, to the bit, and what exact geometry says, within bounds.
//!
//! Rotation, mirror, unequal scale, shear, scales 1e-3 and 1e3, offsets of 1e7, many overlapping instances; top-level
//! volumes of every strategy; moved instances and moving ones; different kinds of bottom level side by side.
//! Not covered here: leaks through closed instances (`watertight.rs`), seams between two instances (not promised: each
//! rounds its own way), how fast it is.

mod instances {
    mod agree;
    mod edits;
    mod geometry;
    mod kinds;
    mod mixed;
    mod moved;
    mod moving;
    mod queries;
    mod refused;
    mod setup;
}
