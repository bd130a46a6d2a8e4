//! Boxes for vertices that have moved, in the tree as it is.
//!
//! ```text
//! records -> outline -> triangles by place -> blocks, boxes -> predicted cost
//! ```
//!
//! Reads: a tree, its triangles with new vertices. Writes: blocks and boxes. Holds: what a build holds; every box is
//! that of the vertices now below it, in the frame that it had. Takes a tenth of a build's time or less.
//! Source: Wald, Boulos & Shirley 2007 for when to refit and when to rebuild.

mod blocks;
mod boxes;
mod cost;
mod flaw;
mod outline;

use std::fmt;

use canted_lbvh::{self as lbvh, GeometryError};

use crate::Wide;
use crate::traverse::LaneKernel;

pub(crate) use blocks::{Triangles, unused_lanes_are_zero};
pub(crate) use boxes::{check_frame, check_row, compare, write as write_boxes};
pub(crate) use cost::Wear;
pub use flaw::Flaw;
pub(crate) use outline::Outline;

/// What a refit has done to a tree, in predicted costs of a ray that enters the box around the mesh: visits of box
/// nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refit {
    /// As the tree was built.
    pub cost_built: f32,
    /// Before this refit.
    pub cost_before: f32,
    /// After it.
    pub cost_now: f32,
}

impl Refit {
    /// Growth of the predicted cost from which on a rebuild is advised.
    ///
    /// A rebuilt tree gains less than what has grown, for motion makes the mesh itself dearer to trace: see the table
    /// at [`Wide::refit`].
    pub const MOST_DRIFT: f32 = 1.5;

    /// Predicted cost now, over that of the tree as it was built.
    #[must_use]
    pub fn drift(&self) -> f32 {
        if self.cost_built > 0.0 { self.cost_now / self.cost_built } else { 1.0 }
    }

    /// Whether the drift exceeds [`Refit::MOST_DRIFT`].
    #[must_use]
    pub fn rebuild_advised(&self) -> bool {
        self.drift() > Self::MOST_DRIFT
    }
}

/// Why a tree cannot take new vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RefitError {
    /// The tree was built over another number of triangles.
    OtherCount {
        /// Triangles of the tree.
        n_triangles: usize,
        /// Triangles given.
        n_given: usize,
    },
    /// A triangle is not usable.
    Geometry(GeometryError),
}

impl fmt::Display for RefitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherCount { n_triangles, n_given } => {
                write!(f, "the tree holds {n_triangles} triangles, {n_given} are given")
            }
            Self::Geometry(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for RefitError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Geometry(error) => Some(error),
            Self::OtherCount { .. } => None,
        }
    }
}

impl From<GeometryError> for RefitError {
    fn from(error: GeometryError) -> Self {
        Self::Geometry(error)
    }
}

impl<K: LaneKernel> Wide<K> {
    /// Takes new vertices for the same triangles; object space, in the order of the build.
    ///
    /// Hits are then those of every new triangle tried, whatever the motion. What suffers is speed: which triangles
    /// share a node, and which way boxes lean, is as it was built.
    ///
    /// # Errors
    /// Another number of triangles, or the first triangle with a vertex that is missing or not finite. The tree is
    /// then as it was.
    pub fn refit(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Refit, RefitError> {
        if triangles.len() != self.n_triangles {
            return Err(RefitError::OtherCount { n_triangles: self.n_triangles, n_given: triangles.len() });
        }
        let (corners, bounds) = lbvh::gather(positions, triangles)?;
        let outline = Outline::of(&self.records).expect("a tree that was built or loaded is whole");
        let cost_before = self.predicted_cost(&outline);
        let cost_built = *self.wear.fresh.get_or_insert(cost_before);
        let primitives = Triangles::read(&outline, &self.records.halves).primitives;
        let corners = lbvh::in_leaf_order(&corners, &primitives);
        Triangles::write(&corners, &outline, &mut self.records.halves);
        write_boxes(&outline, &corners, &self.frame, &mut self.records.lines);
        self.bounds = bounds;
        Ok(Refit { cost_built, cost_before, cost_now: self.predicted_cost(&outline) })
    }

    fn predicted_cost(&self, outline: &Outline) -> f32 {
        cost::predicted(outline, &self.records, &self.bounds, &self.wear.costs)
    }
}

#[cfg(test)]
mod tests;
