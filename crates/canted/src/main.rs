//! The program `canted`.
fn main() {}
