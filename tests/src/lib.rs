//! Oracles shared by the tests in `tests/`; each is simpler than the code it checks.
#![forbid(unsafe_code)]

pub mod brute;
pub mod chains;
pub mod closed;
pub mod clouds;
pub mod crossings;
pub mod device;
pub mod distance;
pub mod exact;
pub mod extremes;
pub mod fractions;
pub mod holes;
pub mod instances;
pub mod judge;
pub mod leaks;
pub mod models;
pub mod rays;
pub mod reference;
pub mod rotations;
pub mod scenes;
pub mod tracers;
pub mod transforms;
pub mod vector;
