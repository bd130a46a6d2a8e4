//! Trees built from the root down, with and without spatial splits, and the entry point to all builders: on soups,
//! grids, lattices, needles, duplicates and boxes of any scale; not covered: traced rays.

mod entry;
mod grouped;
mod inputs;
mod spatial;
mod top_down;
