//! Triangles of instances that overlap regions of world space.

use std::borrow::Borrow;
use std::ops::ControlFlow;

use canted_obb::Obb;
use canted_trace::{Convex, Intersect, InvertedBox};
use canted_wide::TriangleBvh;

use crate::Tlas;
use crate::inside::InstancePrimitive;
use crate::instance::Rows;

/// # Overlaps
/// Touching counts. No overlap is missed; a gap below 2^-46 of the coordinates, times the condition number of the instance's map, may be reported as an
/// overlap. Only instances near the region are looked at.
///
/// Capsules, convex hulls and whole bodies as questions, and instances of other primitives: `canted_collide`.
impl<B: Intersect + Borrow<TriangleBvh>> Tlas<B> {
    /// All triangles that overlap the axis-aligned box from `min` to `max`, by instance, then primitive. Replaces the contents of `found`.
    ///
    /// # Errors
    /// A least coordinate that exceeds the greatest, unless the box is [`Aabb::EMPTY`](canted_obb::Aabb::EMPTY), which overlaps nothing. Nothing is then found.
    pub fn overlapping_aabb(
        &self,
        min: impl Into<[f32; 3]>,
        max: impl Into<[f32; 3]>,
        found: &mut Vec<InstancePrimitive>,
    ) -> Result<(), InvertedBox> {
        found.clear();
        Convex::checked_aabb(min, max).map(|region| self.overlapping(&region, found))
    }

    /// All triangles that overlap an oriented box; see [`Tlas::overlapping_aabb`].
    ///
    /// # Errors
    /// A negative half-extent.
    pub fn overlapping_obb(&self, obb: &Obb, found: &mut Vec<InstancePrimitive>) -> Result<(), InvertedBox> {
        found.clear();
        Convex::checked_obb(obb).map(|region| self.overlapping(&region, found))
    }

    /// All triangles that overlap a region, by instance, then primitive. Replaces the contents of `found`.
    pub fn overlapping(&self, region: &Convex, found: &mut Vec<InstancePrimitive>) {
        found.clear();
        self.each_overlapping(region, |one| {
            found.push(one);
            ControlFlow::Continue(())
        });
        found.sort_unstable();
        found.dedup();
    }

    /// Whether any triangle overlaps a region.
    #[must_use]
    pub fn overlaps(&self, region: &Convex) -> bool {
        let mut is_any = false;
        self.each_overlapping(region, |_| {
            is_any = true;
            ControlFlow::Break(())
        });
        is_any
    }

    /// The lowest (instance, primitive) that overlaps a region.
    #[must_use]
    pub fn first_overlapping(&self, region: &Convex) -> Option<InstancePrimitive> {
        let mut first: Option<InstancePrimitive> = None;
        self.each_overlapping(region, |one| {
            first = Some(first.map_or(one, |first| first.min(one)));
            ControlFlow::Continue(())
        });
        first
    }

    /// How many triangles overlap a region.
    #[must_use]
    pub fn count_overlapping(&self, region: &Convex) -> usize {
        let mut found = vec![];
        self.overlapping(region, &mut found);
        found.len()
    }

    /// Calls `visit` with each triangle that overlaps a region, in any order, until it breaks. A triangle may come twice.
    pub fn each_overlapping(&self, region: &Convex, mut visit: impl FnMut(InstancePrimitive) -> ControlFlow<()>) {
        self.each_instance_in(&region.bounds(), |id| {
            let Some(placed) = self.placed(id).filter(|placed| region.overlaps_aabb(&placed.aabb)) else {
                return ControlFlow::Continue(());
            };
            let columns = placed.columns;
            let forward: Rows = std::array::from_fn(|k| std::array::from_fn(|j| columns[j][k]));
            let (bvh, mut flow): (&TriangleBvh, _) = (placed.blas.borrow(), ControlFlow::Continue(()));
            bvh.each_overlapping(&region.transformed(&placed.inverse, &forward), |primitive| {
                flow = visit((id, primitive));
                flow
            });
            flow
        });
    }

    /// All triangles at most `radius` away from `center`, by instance, then primitive. Replaces the contents of `found`. Nothing is found for a negative
    /// radius.
    pub fn overlapping_sphere(&self, center: impl Into<[f64; 3]>, radius: f64, found: &mut Vec<InstancePrimitive>) {
        found.clear();
        self.visit_near(center.into(), radius, &mut |near| {
            found.push((near.instance, near.primitive));
            radius
        });
        found.sort_unstable();
        found.dedup();
    }
}
