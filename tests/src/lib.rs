//! Oracles that the tests in `tests/` share: each is simpler than what it judges.
#![forbid(unsafe_code)]

pub mod brute;
pub mod exact;
pub mod instances;
pub mod scenes;
