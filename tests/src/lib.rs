//! Oracles that the tests in `tests/` share: each is simpler than what it judges.
#![forbid(unsafe_code)]

pub mod brute;
pub mod closed;
pub mod exact;
pub mod instances;
pub mod judge;
pub mod models;
pub mod rays;
pub mod scenes;
pub mod transforms;
