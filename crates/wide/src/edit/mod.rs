//! Changes of single primitives: a box of a leaf, then those above it, until nothing changes.
//!
//! ```text
//! insert     descent by the least growth -> a free slot, or a new node in place of a leaf -> boxes above
//! remove     the slot -> a node whose children fit into the node above is dissolved -> boxes above
//! move_one   the box of the leaf; out and in again where it leaves its neighbors, and now and then -> boxes above
//! ```
//!
//! Reads, writes: records of nodes, ids of leaves, and [`Links`](crate::node::Links), which the first change makes. Holds: every box is that
//! of the primitives below with the padding that belongs to them, as a build and a refit write it; no path is longer than
//! [`Links::most_depth`](crate::node::Links::most_depth). Oriented nodes above a change become aligned: a tight oriented box needs all
//! primitives below. Sources: Kopta et al. 2012 for changes in place that a measure of cost accompanies; Galperin & Rivest 1993 for the
//! subtree that is balanced where a path becomes too long.

mod balance;
mod tree;

use std::fmt;

use canted_obb::PrimId;

use crate::build::{PrimitiveError, is_valid, reference_of};
use crate::bvh::WideBvh;
use crate::leaf::Primitive;
use crate::node::MAX_PRIMITIVES;
use tree::Tree;

/// Why a primitive cannot be changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EditError {
    /// There is no primitive of this number.
    NoSuchPrimitive {
        /// The number.
        primitive: PrimId,
        /// Number of primitives.
        n_primitives: usize,
    },
    /// The new primitive is invalid.
    Primitive(PrimitiveError),
}

impl fmt::Display for EditError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchPrimitive { primitive, n_primitives } => {
                write!(f, "there is no primitive {primitive}: the BVH has {n_primitives} primitives")
            }
            Self::Primitive(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for EditError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NoSuchPrimitive { .. } => None,
            Self::Primitive(error) => Some(error),
        }
    }
}

/// Changes of single primitives, for scenes in which few of many move.
///
/// Each takes time that grows with the depth of the BVH, not with the number of primitives; the first one after a build, a refit of all or
/// a load prepares the BVH for them, in linear time. Hits are then those of testing every primitive, as of a new BVH over
/// [`WideBvh::primitives`]. What suffers is speed: [`WideBvh::drift`] measures by how much, [`WideBvh::rebuild_advised`] when a new BVH is
/// worth it. The depth is at most that before the first change, or 2 + log₂ of the greatest number of primitives, whichever is greater; memory
/// that a removed primitive leaves is used again.
///
/// ```
/// use canted_trace::{Intersect, Ray, Sphere};
/// use canted_wide::WideBvh;
///
/// let at = |x: f32| Sphere { center: [x, 0.0, 0.0], radius: 1.0 };
/// let mut bvh = WideBvh::over((0..100_u8).map(|i| at(4.0 * f32::from(i))).collect())?;
/// let ray = Ray::new([-20.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
/// let near = bvh.insert(at(-10.0))?;
/// assert_eq!(bvh.closest_hit(&ray).map(|hit| (hit.t, hit.primitive)), Some((9.0, near)));
/// bvh.move_one(near, at(-5.0))?;
/// assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.t), Some(14.0));
/// assert_eq!(bvh.remove(near)?, at(-5.0));
/// assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.t), Some(19.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<P: Primitive> WideBvh<P> {
    /// Adds a primitive, in a leaf of its own, where a build puts up to 32 spheres into one; returns its number, which is the number of
    /// primitives before.
    ///
    /// # Errors
    /// A primitive whose bounds are empty or not finite; more than [`MAX_PRIMITIVES`]. The BVH is then unchanged.
    pub fn insert(&mut self, primitive: P) -> Result<PrimId, PrimitiveError> {
        let id = PrimId(self.n_primitives as u32);
        check(id, &primitive)?;
        if self.n_primitives == MAX_PRIMITIVES {
            return Err(PrimitiveError::TooMany { n_primitives: MAX_PRIMITIVES + 1 });
        }
        if self.n_primitives == 0 {
            self.frame.reference = reference_of(std::slice::from_ref(&primitive));
        }
        let mut tree = Tree::open(self);
        tree.insert(primitive);
        tree.close();
        Ok(id)
    }

    /// Removes a primitive and returns it. The last one takes its number, as in [`Vec::swap_remove`].
    ///
    /// # Errors
    /// A primitive that does not exist.
    pub fn remove(&mut self, primitive: PrimId) -> Result<P, EditError> {
        self.check_number(primitive)?;
        let mut tree = Tree::open(self);
        let removed = tree.remove(primitive);
        tree.close();
        Ok(removed)
    }

    /// Replaces a primitive, as it is after a motion, and returns the old one.
    ///
    /// # Errors
    /// A primitive that does not exist; a new one whose bounds are empty or not finite. The BVH is then unchanged.
    pub fn move_one(&mut self, primitive: PrimId, moved: P) -> Result<P, EditError> {
        self.check_number(primitive)?;
        check(primitive, &moved).map_err(EditError::Primitive)?;
        let mut tree = Tree::open(self);
        let old = tree.move_one(primitive, moved);
        tree.close();
        Ok(old)
    }

    fn check_number(&self, primitive: PrimId) -> Result<(), EditError> {
        let n_primitives = self.n_primitives;
        let error = EditError::NoSuchPrimitive { primitive, n_primitives };
        if primitive.index() < n_primitives { Ok(()) } else { Err(error) }
    }
}

/// Rejects a new primitive whose bounds are not valid.
fn check<P: Primitive>(id: PrimId, primitive: &P) -> Result<(), PrimitiveError> {
    if is_valid(&primitive.bounds()) { Ok(()) } else { Err(PrimitiveError::Bounds { primitive: id }) }
}

#[cfg(test)]
mod tests;
