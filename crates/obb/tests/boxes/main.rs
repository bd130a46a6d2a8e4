//! Boxes, fits, merges and rotations, against exact arithmetic and definitions.

mod boxes;
mod common;
mod fits;
mod merges;
mod rotations;
