//! The exact containment oracle, and the point sets that tests share.
//!
//! Not covered: points that are not finite (refused by `fit`), more than a few hundred points a set.
#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::cast_possible_truncation, reason = "test data are rounded on purpose")]

pub(crate) mod clouds;
pub(crate) mod exact;
pub(crate) mod growth;
