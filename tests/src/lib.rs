//! Oracles shared by the tests in `tests/`; each is simpler than the code it checks.
#![forbid(unsafe_code)]

pub mod brute;
pub mod closed;
pub mod clouds;
pub mod crossings;
pub mod device;
pub mod exact;
pub mod extremes;
pub mod rays;
pub mod reference;
pub mod rotations;
pub mod scenes;
pub mod tracers;
pub mod variants;
