//! The numerical contract, case by case, as data: what is promised, what judges it, and the worst that was measured.
//!
//! ```text
//! a case's inputs -> a routine -> an oracle simpler than it -> Row { promise, bound, worst }
//! ```
//!
//! A row is one routine on one case, over the inputs of which the oracle is certain. Tests assert that every row of ours holds;
//! `cargo xtask extremes` writes all of them, with what peers do on the same input, and the report shows them. Nothing here
//! depends on a clock: the same rows on every run. Not covered: how long anything takes (`degenerate.rs`, the benches).

mod built;
mod film;
mod fit;
pub mod hierarchy;
pub mod instance;
mod lanes;
mod limits;
mod merge;
mod none;
mod promise;
mod rotation;
pub mod slab;
mod table;
mod trackers;
mod tree;
pub mod triangle;

pub use promise::{Measure, Oracle, Promise, Row};
pub use table::{lines, summary, table};
pub use trackers::{TRACKERS, Tracker};

use crate::tracers::{self, Way, Word};

/// Every row of every station.
///
/// `effort` multiplies the inputs tried. `ways` are whom the cases with rays are put before.
#[must_use]
pub fn rows(effort: usize, ways: &[Way]) -> Vec<Row> {
    let mut rows =
        [fit::rows(effort), merge::rows(effort), rotation::rows(effort), tree::rows(), limits::rows()].concat();
    rows.extend(built::rows());
    rows.extend([slab::rows(effort), lanes::rows(effort), triangle::rows(effort)].concat());
    rows.extend([hierarchy::rows(effort, ways), none::rows(ways)].concat());
    let placed = tracers::two_levels();
    let placed: Vec<&Way> = placed.iter().chain(ways.iter().filter(|way| way.word == Word::Peer)).collect();
    rows.extend([instance::rows(effort, &placed), film::rows()].concat());
    rows.extend(TRACKERS.iter().flat_map(|tracker| (tracker.rows)(ways)));
    rows
}

/// What is not tried on this machine, in words: what it lacks, by the names that [`tracers::ours`] gives, and the stations that need a
/// device where there is none.
#[must_use]
pub fn not_tried(lacking: &[String]) -> Vec<String> {
    let lacking = lacking.iter().map(|name| format!("{name}, which this machine has not"));
    lacking.chain(built::not_tried()).collect()
}

/// What rounding a frame to `f32` may add to a box that is merged along it, relative to its greatest half-extent.
///
/// The frame is rounded in the child and in the parent, by half a unit in the last place of each of three entries, and
/// turns the box's diagonal, `√3` times as long at most.
pub(crate) const REFRAMED: f64 = 2.0 * 3.0 * 1.733 * 0.5 * f32::EPSILON as f64;
