//! Boxes for vertices that have moved, in the tree as it is.
//!
//! ```text
//! records -> outline -> triangles by place -> blocks, boxes -> predicted cost
//! ```
//!
//! Reads: a tree, its triangles with new vertices. Writes: blocks and boxes. Holds: what a build holds; every box is
//! that of the vertices now below it, in the frame that it had.
//! Source: Wald, Boulos & Shirley 2007 for when to refit and when to rebuild.

mod blocks;
mod boxes;
mod cost;
mod flaw;
mod outline;

use std::fmt;

use canted_lbvh::{self as lbvh, Corners, GeometryError};

use crate::WideBvh;
use crate::traverse::LaneKernel;

pub(crate) use blocks::{Triangles, unused_lanes_are_zero};
pub(crate) use boxes::{check_frame, check_row, compare, write as write_boxes};
pub(crate) use cost::{Prediction, Wear};
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
    /// How much dearer than as built: of the growth for a ray that enters the box, and the growth for as many rays as
    /// meet one triangle, the greater. The first alone sinks where the box grows, the second where triangles do.
    pub drift: f32,
}

impl Refit {
    /// Drift above which a rebuild is advised: see the table at [`WideBvh::refit`].
    pub const MOST_DRIFT: f32 = 1.5;

    fn between(built: Prediction, before: Prediction, now: Prediction) -> Self {
        let growth = |now: f32, built: f32| if built > 0.0 { now / built } else { 1.0 };
        let drift = growth(now.per_ray, built.per_ray).max(growth(now.per_triangle, built.per_triangle));
        Self { cost_built: built.per_ray, cost_before: before.per_ray, cost_now: now.per_ray, drift }
    }

    /// Whether the drift exceeds [`Refit::MOST_DRIFT`].
    #[must_use]
    pub fn rebuild_advised(&self) -> bool {
        self.drift > Self::MOST_DRIFT
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

impl<K: LaneKernel> WideBvh<K> {
    /// Takes new vertices for the same triangles; object space, in the order of the build.
    ///
    /// Hits are then those of every new triangle tried, whatever the motion. What suffers is speed: which triangles
    /// share a node, and which way boxes lean, is as it was built. By how much, the drift foretells: `benches/TRIED.md` has what
    /// trees of deformed meshes lost beside their drift. Where vertices move at random the mesh itself becomes dearer and a
    /// rebuild gains little; it is advised once, for the rebuilt tree starts anew. A refit takes a small part of a build's time.
    ///
    /// # Errors
    /// Another number of triangles, or the first triangle with a vertex that is missing or not finite. The tree is
    /// then as it was.
    pub fn refit(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Refit, RefitError> {
        if triangles.len() != self.n_triangles {
            return Err(RefitError::OtherCount { n_triangles: self.n_triangles, n_given: triangles.len() });
        }
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let outline = Outline::of(&self.records).expect("a tree that was built or loaded is whole");
        let old = Triangles::read(&outline, &self.records.halves);
        let before = self.predict(&outline, &old.corners);
        let built = *self.wear.fresh.get_or_insert(before);
        let corners = lbvh::in_leaf_order(&corners, &old.primitives);
        Triangles::write(&corners, &outline, &mut self.records.halves);
        write_boxes(&outline, &corners, &self.frame, &mut self.records.lines);
        self.bounds = bounds;
        Ok(Refit::between(built, before, self.predict(&outline, &corners)))
    }

    fn predict(&self, outline: &Outline, corners: &[Corners]) -> Prediction {
        cost::predict(outline, &self.records, corners, &self.bounds, &self.wear.costs)
    }
}

#[cfg(test)]
mod tests;
