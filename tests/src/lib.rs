//! Tests of the promises; see `tests/`.
