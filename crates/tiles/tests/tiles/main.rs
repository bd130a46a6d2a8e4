//! Stores of tiles against one BVH over everything.

mod common;
mod faults;
mod queries;
mod writing;
