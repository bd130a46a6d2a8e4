//! Binary trees of low surface-area cost.
//!
//! ```text
//! sorted leaves + boxes -> ploc -> Tree
//! boxes -> references -> { midpoint, median, binned, sweep } -> assemble -> Tree            (top_down)
//! corners -> fragments -> { between, through } -> clip -> Tree over references             (spatial)
//! any Tree + leaf boxes -> pairs -> { select -> search -> apply } a round -> Tree      (reinsertion)
//! ```
//!
//! A radix tree is cheap to build, but lines meet too many of its boxes: codes know cells, not areas. [`ploc`] joins
//! neighbours along the same curve by area; [`reinsert`] takes subtrees out of any tree and puts each back where the
//! areas of all boxes sum to less. [`top_down`] parts primitives from the root down, [`spatial`] parts long triangles
//! too. [`build`] is the one entry to all that need boxes only. The trees stay those of `canted-lbvh`: fit their
//! volumes as before, over their own order of leaves.
#![forbid(unsafe_code)]

use canted_lbvh::par;

mod apply;
mod assemble;
mod binned;
mod builder;
mod chop;
mod clip;
mod config;
mod curve;
mod fragment;
mod lanes;
mod median;
mod pairs;
mod partition;
mod ploc;
mod reference;
mod reinsertion;
mod scale;
mod search;
mod select;
mod spatial;
mod sweep;
mod top_down;

pub use builder::{Builder, build};
pub use config::{Axes, ReinsertConfig, Split, TopDownConfig};
pub use ploc::{PlocConfig, ploc};
pub use reinsertion::reinsert;
pub use spatial::{References, SpatialConfig, spatial};
pub use top_down::top_down;
