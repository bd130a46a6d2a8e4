//! New boxes for primitives that have moved, in the BVH as it is.
//!
//! ```text
//! memory of subtrees, each on a thread: leaves (new vertices, contents) -> boxes, sums
//! subtrees -> nodes above them -> predicted cost
//! ```
//!
//! Reads: a BVH, its primitives after a motion. Writes: leaves and boxes. Holds: what a build holds; every box is that of the primitives
//! now below it, relative to a reference point near them, and with the padding that belongs to them. Its frame is the old one; of oriented
//! nodes over triangles, turned as the triangles have. Source: Wald, Boulos & Shirley 2007 for when to refit and when to rebuild.

mod boxes;
mod extremes;
mod leaves;
mod rotation;
mod subtree;
mod vertices;

use std::fmt;

use canted_lbvh::{self as lbvh, GeometryError};
use canted_obb::{Aabb, PrimId};

use crate::build::{PrimitiveError, bounds_of, reference_of, reference_of_triangles};
use crate::bvh::{TriangleBvh, WideBvh};
use crate::config::{Baseline, RayCost};
use crate::leaf::{LeafPrimitive, Placed, Primitive, Primitives};
use crate::node::checked::Hierarchy;
use crate::node::{HalfBlock, Nodes, PARTS};
use crate::par;
use crate::simd::{AvailablePath, Simd, Task};
use crate::traverse::{BoxPads, Pads};

pub(crate) use boxes::{check_frame, check_row, compare, write as write_boxes};
pub(crate) use extremes::{Sums, half_area, visit};
pub(crate) use leaves::content_of;
use leaves::{MovedPrimitives, MovedTriangles};
use subtree::{After, Before, Kept, LeafSlots, LeafStates, Shared};
use vertices::Vertices;

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

impl<P: LeafPrimitive> WideBvh<P> {
    /// How many times as expensive the BVH is as when it was built, as [`Refit::drift`] after the last refit or change of a single primitive;
    /// 1 before the first.
    #[must_use]
    pub fn drift(&self) -> f32 {
        match (self.baseline.built, self.baseline.now) {
            (Some(built), Some(now)) => Refit::between(built, now, now).drift,
            _ => 1.0,
        }
    }

    /// Whether the drift exceeds [`Refit::MAX_DRIFT`].
    #[must_use]
    pub fn rebuild_advised(&self) -> bool {
        self.drift() > Refit::MAX_DRIFT
    }
}

impl TriangleBvh {
    /// Updates the BVH to new vertices of the same triangles; object space, in the order of the build.
    ///
    /// Hits are then those of testing every new triangle, whatever the motion. What suffers is speed: which triangles share a node stays as
    /// built, and so does the mesh frame of aligned boxes; oriented ones turn with their triangles. The drift predicts by how much:
    /// `benches/TRIED.md` lists the slowdown of deformed meshes next to their drift. Where vertices move at random the mesh itself becomes
    /// more expensive and a rebuild gains little; it is advised once, because a rebuild resets the drift. A refit takes a small part of a
    /// build's time.
    ///
    /// # Errors
    /// Another number of triangles, or the first triangle with an index out of range or a vertex that is not finite. The BVH
    /// is then unchanged.
    pub fn refit<V, I>(&mut self, positions: &[V], triangles: &[[I; 3]]) -> Result<Refit, RefitError>
    where
        V: Into<[f32; 3]> + Copy + 'static,
        I: TryInto<u32> + Copy + 'static,
    {
        self.refit_indexed(&lbvh::as_positions(positions), &lbvh::as_triangles(triangles))
    }

    fn refit_indexed(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Refit, RefitError> {
        check_number(self.n_primitives, triangles.len())?;
        check_vertices(self.path, positions, triangles)?;
        let reference = reference_of_triangles(triangles.len(), |i| triangles[i].map(|v| positions[v as usize]));
        let old = self.frame;
        self.frame.reference = reference;
        let pads = BoxPads::new(self.pads(), self.frame.is_identity);
        let bvh = Target { nodes: &mut self.nodes, bounds: &mut self.bounds, baseline: &mut self.baseline, pads };
        let path = self.path;
        let moved = MovedTriangles { positions, triangles, frames: [old, self.frame], path };
        let before = |units: &[HalfBlock], leaves: &[LeafSlots], states: &mut LeafStates<Vertices>| {
            moved.before(units, leaves, states);
        };
        let after = |units: &mut [HalfBlock], leaves: &[LeafSlots], states: &mut LeafStates<Vertices>| {
            moved.after(units, leaves, states);
        };
        let leaves = Leaves { n_parts: PARTS, path, keeps_items: !self.frame.is_identity, turns_frames: true };
        let refit = bvh.update(&mut self.leaves.halves, leaves, &before, &after);
        self.leaves.vertices_changed();
        Ok(refit)
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
        bounds_of(&primitives)?;
        if let Some((nodes, order)) = self.nodes.packed(&self.leaves.order) {
            (self.nodes, self.leaves.order) = (nodes, order);
        }
        self.nodes.links = None;
        let was_sorted = self.leaves.is_sorted();
        self.leaves.unsort();
        let reference = reference_of(&primitives);
        let old_frame = self.frame;
        self.frame.reference = reference;
        let bvh = Target {
            nodes: &mut self.nodes,
            bounds: &mut self.bounds,
            baseline: &mut self.baseline,
            pads: BoxPads::new(Pads::of(P::ERROR), self.frame.is_identity),
        };
        let old = std::mem::replace(&mut self.leaves.primitives, primitives);
        let moved = MovedPrimitives { primitives: [&old, &self.leaves.primitives], frames: [old_frame, self.frame] };
        let refit = bvh.update_primitives(&mut self.leaves.order, self.path, &moved);
        if was_sorted {
            self.leaves.sort();
        }
        Ok(refit)
    }
}

/// The parts of a BVH that a refit changes.
struct Target<'a> {
    nodes: &'a mut Nodes,
    bounds: &'a mut Aabb,
    baseline: &'a mut Baseline,
    pads: BoxPads,
}

fn check_number(n_primitives: usize, n_given: usize) -> Result<(), RefitError> {
    if n_given == n_primitives { Ok(()) } else { Err(RefitError::Count { n_primitives, n_given }) }
}

/// Vertices and triangles of one job.
const CHUNK: usize = 1 << 14;

/// Rejects the first triangle with an index out of range or a vertex that is not finite.
fn check_vertices(path: AvailablePath, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<(), GeometryError> {
    let n_vertices = positions.len();
    let are_inside =
        par::map_chunks(triangles, CHUNK, |_, chunk| (path.run(Greatest(chunk.as_flattened())) as usize) < n_vertices);
    let are_finite = par::map_chunks(positions, CHUNK, |_, chunk| path.run(AreFinite(chunk.as_flattened())));
    if are_inside.into_iter().chain(are_finite).all(|is| is) {
        return Ok(());
    }
    // A vertex that no triangle uses may be anything.
    lbvh::triangle_corners(positions, triangles).map(drop)
}

/// The greatest index; 0 of none.
struct Greatest<'a>(&'a [u32]);

impl Task for Greatest<'_> {
    type Output = u32;

    #[inline(always)]
    fn on<S: Simd>(self, _: S) -> u32 {
        self.0.iter().fold(0, |most, &index| most.max(index))
    }
}

/// Whether all numbers are finite.
struct AreFinite<'a>(&'a [f32]);

impl Task for AreFinite<'_> {
    type Output = bool;

    #[inline(always)]
    fn on<S: Simd>(self, _: S) -> bool {
        // Without its sign, an infinity or a NaN is no less than this number.
        let least_other = f32::INFINITY.to_bits();
        self.0.iter().fold(0, |most, x| most.max(x.to_bits() & (u32::MAX >> 1))) < least_other
    }
}

/// How the leaves of a BVH are refitted.
struct Leaves {
    /// Parts of a unit.
    n_parts: usize,
    path: AvailablePath,
    /// Whether leaves need items; oriented nodes always do.
    keeps_items: bool,
    /// Whether frames turn with what is inside.
    turns_frames: bool,
}

impl Target<'_> {
    /// Writes the boxes around the primitives that leaves name.
    fn update_primitives(self, order: &mut [PrimId], path: AvailablePath, moved: &MovedPrimitives) -> Refit {
        let before = |units: &[PrimId], leaves: &[LeafSlots], states: &mut LeafStates<Vec<_>>| {
            moved.add(0, units, leaves, states);
        };
        let after = |units: &mut [PrimId], leaves: &[LeafSlots], states: &mut LeafStates<Vec<_>>| {
            moved.add(1, units, leaves, states);
        };
        let leaves = Leaves { n_parts: 1, path, keeps_items: false, turns_frames: false };
        self.update(order, leaves, &before, &after)
    }

    /// Writes the boxes around what the leaves in `units` hold after the motion.
    fn update<K: Kept, U: Send>(
        self,
        units: &mut [U],
        leaves: Leaves,
        before: &Before<K, U>,
        after: &After<K, U>,
    ) -> Refit {
        let Self { nodes, bounds, baseline, pads } = self;
        let Leaves { n_parts, path, keeps_items, turns_frames } = leaves;
        let costs = baseline.costs;
        let shared = Shared {
            before,
            after,
            path,
            pads: &pads,
            costs: &costs,
            n_parts,
            keeps_items: nodes.has_oriented || keeps_items,
            turns_frames: nodes.has_oriented && turns_frames,
            measures_before: baseline.now.is_none(),
        };
        let [after, before] = subtree::update_all(nodes, units, &shared);
        let visit = visit(nodes.root, &costs);
        let sums = |state: Option<(Aabb, Sums)>| state.map_or_else(Sums::default, |(_, sums)| sums);
        let before = baseline.now.unwrap_or_else(|| predicted(sums(before), visit, bounds));
        let built = *baseline.built.get_or_insert(before);
        *bounds = after.map_or(Aabb::EMPTY, |(bounds, _)| bounds);
        let now = predicted(sums(after), visit, bounds);
        baseline.now = Some(now);
        Refit::between(built, before, now)
    }
}

/// The predicted cost of a BVH whose root costs `visit`; `bounds` enclose all primitives.
///
/// A ray enters a convex body inside another with the probability of the ratio of their surface areas. Where `bounds` have no
/// area, every ray enters all boxes. In a mesh frame that is not that of `bounds`, the boxes of a few nodes near the root may have
/// a greater area, and count for it.
pub(crate) fn predicted(Sums { area, weighted, visits }: Sums, visit: f64, bounds: &Aabb) -> RayCost {
    let all = 0.5 * bounds.area();
    let per_ray = visit + if all > 0.0 { weighted / all } else { visits };
    let per_primitive = if area > 0.0 { per_ray * all / area } else { 0.0 };
    RayCost { per_ray: finite(per_ray), per_primitive: finite(per_primitive) }
}

/// A prediction in `f32`, finite.
fn finite(x: f64) -> f32 {
    x.min(f64::from(f32::MAX)) as f32
}

/// Primitives by place, of these ids, as they are given.
pub(crate) fn by_place<'a>(ids: &[PrimId], primitives: &'a dyn Primitives) -> Vec<Placed<'a>> {
    ids.iter().map(|id| Placed::given(primitives.at(id.index()))).collect()
}

/// The id at each place.
pub(crate) fn ids_by_place(hierarchy: &Hierarchy, order: &[PrimId]) -> Vec<PrimId> {
    hierarchy.leaves.iter().flat_map(|leaf| &order[leaf.first..leaf.first + leaf.places.len()]).copied().collect()
}

#[cfg(test)]
mod tests;
