//! Trees built by PLOC and improved by reinsertion: on soups, grids, lattices, needles, duplicates and boxes of any scale; not covered: traced rays.

mod baseline;
mod build;
mod invariants;
mod ploc;
