//! New boxes for primitives that have moved, in the BVH as it is.
//!
//! ```text
//! records -> outline -> leaves: new vertices, contents -> boxes -> predicted cost
//! ```
//!
//! Reads: a BVH, its primitives after a motion. Writes: leaves and boxes. Holds: what a build holds; every box is that of
//! the primitives now below it, in its old frame, relative to a reference point near them, and with the padding that belongs to them.
//! Source: Wald, Boulos & Shirley 2007 for when to refit and when to rebuild.

mod blocks;
mod boxes;
mod cost;

use std::fmt;
use std::ops::Range;

use canted_lbvh::{self as lbvh, Corners, GeometryError};
use canted_obb::{Aabb, PrimId};

use crate::build::{PrimitiveError, bounds_of, reference_of, reference_of_triangles};
use crate::bvh::WideBvh;
use crate::costs::{Baseline, RayCost};
use crate::item::{self, Item, Placed};
use crate::layout::{Half, LeafLayout, NodeKind, Nodes};
use crate::outline::Outline;
use crate::par;
use crate::primitive::Primitive;
use crate::traverse::{BoxPads, LaneKernel, MeshFrame, Pads};
use crate::triangle::Triangle;

pub(crate) use blocks::{Triangles, unused_lanes_are_zero};
use boxes::{Boxes, LeafContent, SlabsOf};
pub(crate) use boxes::{check_frame, check_row, compare, write as write_boxes};

/// What a refit has done to a BVH, in predicted traversal costs of a ray that enters the box around all primitives, relative
/// to the test of an aligned node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refit {
    /// As the BVH was built.
    pub cost_built: f32,
    /// Before this refit.
    pub cost_before: f32,
    /// After it.
    pub cost_now: f32,
    /// How much more expensive the BVH is than when it was built: the growth for a ray that enters the box, or the growth
    /// for as many rays as hit one primitive, whichever is greater. The first alone sinks where the box grows, the second
    /// where primitives grow.
    pub drift: f32,
}

impl Refit {
    /// Drift above which a rebuild is advised: rays are then 1.2 to 3 times as slow as after one, as measured on twisted and
    /// bent meshes.
    pub const MAX_DRIFT: f32 = 1.5;

    fn between(built: RayCost, before: RayCost, now: RayCost) -> Self {
        let growth = |now: f32, built: f32| if built > 0.0 { now / built } else { 1.0 };
        let drift = growth(now.per_ray, built.per_ray).max(growth(now.per_primitive, built.per_primitive));
        Self { cost_built: built.per_ray, cost_before: before.per_ray, cost_now: now.per_ray, drift }
    }

    /// Whether the drift exceeds [`Refit::MAX_DRIFT`].
    #[must_use]
    pub fn rebuild_advised(&self) -> bool {
        self.drift > Self::MAX_DRIFT
    }
}

/// Why a BVH cannot be refitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RefitError {
    /// The BVH was built over another number of primitives.
    Count {
        /// Primitives of the BVH.
        n_primitives: usize,
        /// Primitives given.
        n_given: usize,
    },
    /// A triangle is invalid.
    Geometry(GeometryError),
    /// A primitive is invalid.
    Primitive(PrimitiveError),
}

impl fmt::Display for RefitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { n_primitives, n_given } => {
                write!(f, "the BVH has {n_primitives} primitives, but {n_given} are given")
            }
            Self::Geometry(error) => error.fmt(f),
            Self::Primitive(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for RefitError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Geometry(error) => Some(error),
            Self::Primitive(error) => Some(error),
            Self::Count { .. } => None,
        }
    }
}

impl From<GeometryError> for RefitError {
    fn from(error: GeometryError) -> Self {
        Self::Geometry(error)
    }
}

impl From<PrimitiveError> for RefitError {
    fn from(error: PrimitiveError) -> Self {
        Self::Primitive(error)
    }
}

impl<K: LaneKernel> WideBvh<Triangle<K>> {
    /// Updates the BVH to new vertices of the same triangles; object space, in the order of the build.
    ///
    /// Hits are then those of testing every new triangle, whatever the motion. What suffers is speed: which triangles share
    /// a node, and the frames of oriented boxes, stay as built. The drift predicts by how much: `benches/TRIED.md` lists
    /// the slowdown of deformed meshes next to their drift. Where vertices move at random the mesh itself becomes more
    /// expensive and a rebuild gains little; it is advised once, because a rebuild resets the drift. A refit takes a small
    /// part of a build's time.
    ///
    /// # Errors
    /// Another number of triangles, or the first triangle with an index out of range or a vertex that is not finite. The BVH
    /// is then unchanged.
    pub fn refit(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Refit, RefitError> {
        let bvh = Target {
            nodes: &mut self.nodes,
            pads: BoxPads::new(Pads::of(K::ERROR), self.frame.is_identity),
            frame: &mut self.frame,
            bounds: &mut self.bounds,
            baseline: &mut self.baseline,
        };
        refit_triangles(bvh, &mut self.leaves.halves, self.n_primitives, positions, triangles)
    }
}

impl<P: Primitive> WideBvh<P> {
    /// Replaces the primitives, in the order of the build, as they are after a motion.
    ///
    /// Hits are then those of testing every new primitive, whatever the motion. What suffers is speed, as for triangles.
    ///
    /// # Errors
    /// Another number of primitives, or the first whose bounds are empty or not finite. The BVH is then unchanged.
    pub fn refit(&mut self, primitives: Vec<P>) -> Result<Refit, RefitError> {
        check_number(self.n_primitives, primitives.len())?;
        let bounds = bounds_of(&primitives)?;
        let outline = Outline::of(&self.nodes, self.leaves.order.len(), &LeafLayout::IDS).expect("a BVH is valid");
        let ids = ids_by_place(&outline, &self.leaves.order);
        let (old, new) = (by_place(&ids, &self.leaves.primitives), by_place(&ids, &primitives));
        let bvh = Target {
            nodes: &mut self.nodes,
            pads: BoxPads::new(Pads::of(P::ERROR), self.frame.is_identity),
            frame: &mut self.frame,
            bounds: &mut self.bounds,
            baseline: &mut self.baseline,
        };
        let before = bvh.cost_before(&outline, |frame| LeafContent::of_leaves(&outline, &old, frame));
        bvh.frame.reference = reference_of(&primitives);
        let contents = LeafContent::of_leaves(&outline, &new, bvh.frame);
        let moved = item::moved(&new, bvh.frame.reference);
        let new = moved.as_deref().unwrap_or(&new);
        let slabs = |places: Range<usize>, rows| Placed::slabs(&new[places], rows);
        let refit = bvh.update(&outline, before, (&contents, &slabs), bounds);
        self.leaves.primitives = primitives;
        Ok(refit)
    }
}

/// The parts of a BVH that a refit changes, and the frame.
struct Target<'a> {
    nodes: &'a mut Nodes,
    frame: &'a mut MeshFrame,
    bounds: &'a mut Aabb,
    baseline: &'a mut Baseline,
    pads: BoxPads,
}

/// The same for every triangle test.
fn refit_triangles(
    bvh: Target,
    blocks: &mut [Half],
    n_triangles: usize,
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
) -> Result<Refit, RefitError> {
    check_number(n_triangles, triangles.len())?;
    check_vertices(positions, triangles)?;
    let outline = Outline::of(bvh.nodes, blocks.len(), &LeafLayout::BLOCKS).expect("a BVH is valid");
    let before = bvh.cost_before(&outline, |frame| {
        LeafContent::of_leaves(&outline, &Triangles::read(&outline, blocks).corners, frame)
    });
    bvh.frame.reference = reference_of_triangles(n_triangles, |i| triangles[i].map(|v| positions[v as usize]));
    let contents = blocks::replace(&outline, blocks, positions, triangles, bvh.frame);
    let bounds = contents.iter().fold(Aabb::EMPTY, |all, content| all.union(content.bounds));
    // Only oriented boxes are computed from all triangles below.
    let is_oriented = outline.nodes.iter().any(|node| node.kind == NodeKind::Oriented);
    let corners = if is_oriented { Triangles::read(&outline, blocks).corners } else { vec![] };
    let corners = item::moved(&corners, bvh.frame.reference).unwrap_or(corners);
    let slabs = |places: Range<usize>, rows| Corners::slabs(&corners[places], rows);
    Ok(bvh.update(&outline, before, (&contents, &slabs), bounds))
}

fn check_number(n_primitives: usize, n_given: usize) -> Result<(), RefitError> {
    if n_given == n_primitives { Ok(()) } else { Err(RefitError::Count { n_primitives, n_given }) }
}

/// Vertices and triangles of one job.
const CHUNK: usize = 1 << 14;

/// Rejects the first triangle with an index out of range or a vertex that is not finite.
fn check_vertices(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<(), GeometryError> {
    let n_vertices = positions.len();
    let are_inside = par::map_chunks(triangles, CHUNK, |_, chunk| {
        (chunk.as_flattened().iter().fold(0, |most, &vertex| most.max(vertex)) as usize) < n_vertices
    });
    let are_finite = par::map_chunks(positions, CHUNK, |_, chunk| {
        // A sum of products with zero is NaN if and only if a coordinate is not finite.
        chunk.as_flattened().iter().fold(0.0, |sum: f32, x| sum + x * 0.0) == 0.0
    });
    if are_inside.into_iter().chain(are_finite).all(|is| is) {
        return Ok(());
    }
    // A vertex that no triangle uses may be anything.
    lbvh::triangle_corners(positions, triangles).map(drop)
}

impl Target<'_> {
    /// The predicted cost as the BVH is, whose leaves have the contents that `old` returns.
    fn cost_before(&self, outline: &Outline, old: impl FnOnce(&MeshFrame) -> Vec<LeafContent>) -> RayCost {
        self.baseline.now.unwrap_or_else(|| self.cost(outline, &old(self.frame), self.bounds))
    }

    fn cost(&self, outline: &Outline, contents: &[LeafContent], bounds: &Aabb) -> RayCost {
        let boxes = Boxes { nodes: self.nodes, reaches: &boxes::reaches(outline, contents), pads: &self.pads };
        let area = contents.iter().map(|content| content.area).sum();
        cost::predict(outline, &boxes, area, bounds, &self.baseline.costs)
    }

    /// Writes the boxes around the new contents of the leaves.
    fn update(
        self,
        outline: &Outline,
        before: RayCost,
        (contents, slabs): (&[LeafContent], &SlabsOf),
        bounds: Aabb,
    ) -> Refit {
        let built = *self.baseline.built.get_or_insert(before);
        boxes::write_around(outline, contents, slabs, &self.pads, &mut self.nodes.lines);
        let now = self.cost(outline, contents, &bounds);
        *self.bounds = bounds;
        self.baseline.now = Some(now);
        Refit::between(built, before, now)
    }
}

/// Primitives by place, of these ids, as they are given.
pub(crate) fn by_place<'a, P>(ids: &[PrimId], primitives: &'a [P]) -> Vec<Placed<'a, P>> {
    ids.iter().map(|id| Placed::given(&primitives[id.index()])).collect()
}

/// The id at each place.
pub(crate) fn ids_by_place(outline: &Outline, order: &[PrimId]) -> Vec<PrimId> {
    outline.leaves.iter().flat_map(|leaf| &order[leaf.first..leaf.first + leaf.places.len()]).copied().collect()
}

#[cfg(test)]
mod tests;
