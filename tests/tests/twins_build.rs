//! Each stage of the build on the device compared with the same stage on the CPU.
//!
//! Integers are equal bit for bit. Oriented boxes contain everything below them, exactly.

#[path = "twins_build/compare.rs"]
mod compare;
#[path = "twins_build/models.rs"]
mod models;
#[path = "twins_build/ploc.rs"]
mod ploc;
#[path = "twins_build/repeated.rs"]
mod repeated;
#[path = "twins_build/scan.rs"]
mod scan;
#[path = "twins_build/setup.rs"]
mod setup;
#[path = "twins_build/sort.rs"]
mod sort;
#[path = "twins_build/stages.rs"]
mod stages;
#[path = "twins_build/two_levels.rs"]
mod two_levels;
#[path = "twins_build/volumes.rs"]
mod volumes;
#[path = "twins_build/wide.rs"]
mod wide;
#[path = "twins_build/wide_check.rs"]
mod wide_check;
