//! The numerical contract as data: each promise on each case, its reference, and the worst measured value.
//!
//! ```text
//! a case's inputs -> a routine -> a simpler oracle -> Row { promise, bound, worst }
//! ```
//!
//! A row is one routine on one case, over the inputs that the oracle decides with certainty. Tests assert that each of our rows
//! holds; `cargo xtask extremes` writes all rows, with the results of peers on the same input, and the report shows them. Nothing
//! depends on a clock: every run gives the same rows. Not covered: run time (`hits/degenerate.rs`, the benches).

pub mod curves;
mod film;
mod fit;
pub mod hierarchy;
pub mod instance;
mod merge;
mod patches;
mod promise;
mod rotation;
pub mod slab;
mod trackers;
mod tree;
pub mod triangle;

pub use promise::{Measure, Oracle, Promise, Row, lines, summary, table};
pub use trackers::{TRACKERS, Tracker};

use crate::tracers::{self, Guarantee, Method};

/// Every row of every stage.
///
/// `effort` multiplies the inputs. `methods` are the tracers of the cases with rays.
#[must_use]
pub fn rows(effort: usize, methods: &[Method]) -> Vec<Row> {
    let placed = tracers::two_levels();
    let placed: Vec<&Method> =
        placed.iter().chain(methods.iter().filter(|method| method.guarantee == Guarantee::Peer)).collect();
    let mut rows = [
        fit::rows(effort),
        merge::rows(effort),
        rotation::rows(effort),
        tree::rows(),
        tree::rows_of_limits(),
        tree::rows_of_device(),
        slab::rows(effort),
        slab::rows_of_nodes(effort),
        triangle::rows(effort),
        hierarchy::rows(effort, methods),
        hierarchy::rows_of_invalid_rays(methods),
        instance::rows(effort, &placed),
        instance::rows_of_many(effort),
        curves::rows(effort),
        patches::rows(effort),
        film::rows(),
    ]
    .concat();
    rows.extend(TRACKERS.iter().flat_map(|tracker| (tracker.rows)(methods)));
    rows
}

/// What this machine cannot test: the tracers that it lacks, by the names that [`tracers::ours`] returns, and the stages that need a
/// device if there is none.
#[must_use]
pub fn not_tried(lacking: &[String]) -> Vec<String> {
    let lacking = lacking.iter().map(|name| format!("{name}: not available on this machine"));
    lacking.chain(tree::not_tried()).collect()
}

/// Greatest growth of a box merged along an `f32` frame, relative to its greatest half-extent.
///
/// The frame is rounded in the child and in the parent by half a unit in the last place of each of three entries, which
/// rotates the box's diagonal, at most `√3` times as long.
pub(crate) const REFRAMED: f64 = 2.0 * 3.0 * 1.733 * 0.5 * f32::EPSILON as f64;
