//! Binary trees of low surface-area cost.
//!
//! ```text
//! any Tree + leaf boxes -> pairs -> { select -> search -> apply } a round -> Tree
//! ```
//!
//! A radix tree is cheap to build, but lines meet too many of its boxes: codes know cells, not areas. [`reinsert`]
//! takes subtrees out of any tree and puts each back where the areas of all boxes sum to less. The tree stays one of
//! `canted-lbvh`: fit its volumes as before, over the new order of leaves.
#![forbid(unsafe_code)]

mod apply;
mod config;
mod lanes;
mod pairs;
mod par;
mod reinsertion;
mod search;
mod select;

pub use config::ReinsertConfig;
pub use reinsertion::reinsert;
