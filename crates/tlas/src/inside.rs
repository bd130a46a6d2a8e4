//! Whether points are inside of instances, and how often their surfaces wind around points.

use std::borrow::Borrow;
use std::ops::ControlFlow;

use canted_lbvh::par;
use canted_obb::round::{down, up};
use canted_obb::vector::{cross, dot, to_f64};
use canted_obb::{Aabb, PrimId};
use canted_trace::{InstanceId, Intersect, ReferencePoint};
use canted_wide::TriangleBvh;

use crate::Tlas;
use crate::instance::{Columns, Rows, invert};

/// Points of one parallel job.
const CHUNK: usize = 1 << 8;

/// A primitive of an instance.
pub type InstancePrimitive = (InstanceId, PrimId);

impl<B: Intersect> Tlas<B> {
    /// The box around an instance, world space, at all times while the shutter is open; `None` for one that cannot be hit: it is removed or hidden by its mask or a scale by
    /// zero, or its BVH is empty. The first call, of this or of another query about places, finds the bounds of all instances, which take 48 bytes each.
    #[must_use]
    pub fn instance_bounds(&self, instance: InstanceId) -> Option<Aabb> {
        let bounds = self.bounds_of_instances().get(instance.0 as usize)?;
        let mut made = None;
        let placement = self.placements.of(instance.index(), &mut made);
        (placement.mask != 0 && !placement.map.is_hidden() && !bounds.is_empty()).then_some(bounds.aabb)
    }

    /// Calls `visit` with each instance whose bounds share a point with `aabb`, world space, and perhaps with others that are no farther away than
    /// hits may be wrong, in any order, until it breaks: the broad phase of queries of your own. The cost grows with the instances near the box.
    pub fn each_instance_in(&self, aabb: &Aabb, mut visit: impl FnMut(InstanceId) -> ControlFlow<()>) {
        if aabb.is_empty() {
            return;
        }
        let _ = self.top.each_in(aabb, &mut |number| {
            if self.instance_bounds(InstanceId(number)).is_none() {
                return ControlFlow::Continue(());
            }
            let own = self.bounds_of_instances()[number as usize].grown(ReferencePoint::ORIGIN);
            let is_near = (0..3).all(|k| own.min[k] <= aabb.max[k] && aabb.min[k] <= own.max[k]);
            if is_near { visit(InstanceId(number)) } else { ControlFlow::Continue(()) }
        });
    }

    /// Whether `is_inside` holds for the point in the object space of any instance, rounded to `f32`. It gets the index of the bottom-level
    /// BVH, the BVH and the point.
    #[must_use]
    pub fn contains_with(
        &self,
        point: impl Into<[f64; 3]>,
        mut is_inside: impl FnMut(u32, &B, [f32; 3]) -> bool,
    ) -> bool {
        let mut is_found = false;
        self.each_around(point.into(), |placed, point| {
            is_found = is_inside(placed.index, placed.blas, point);
            if is_found { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        is_found
    }

    /// The sum of the winding numbers of all instances at a point, each by `number`, which gets the index of the bottom-level BVH, the BVH and
    /// the point in the object space of an instance, rounded to `f32`. Those of mirrored instances are subtracted; NaN for a point that is not finite.
    ///
    /// The number of a closed mesh is the same under any affine map. That of a mesh with a border is exact under similarities; under other maps it is the
    /// number in object space. The cost grows with the number of instances.
    #[must_use]
    pub fn winding_number_with(
        &self,
        point: impl Into<[f64; 3]>,
        mut number: impl FnMut(u32, &B, [f32; 3]) -> f64,
    ) -> f64 {
        let point = point.into();
        if !point.iter().all(|x| x.is_finite()) {
            return f64::NAN;
        }
        let all = (0..self.n_numbers() as u32).filter_map(|id| self.placed(InstanceId(id)));
        all.map(|placed| {
            let [x, y, z, _] = placed.columns;
            let own = number(placed.index, placed.blas, mapped(&placed.inverse, point).map(|x| x as f32));
            if dot(x, cross(y, z)) < 0.0 { -own } else { own }
        })
        .sum()
    }

    /// Calls `visit` with each instance whose bounds have the point, and with the point in its object space, until it breaks.
    fn each_around(&self, point: [f64; 3], mut visit: impl FnMut(&Placed<'_, B>, [f32; 3]) -> ControlFlow<()>) {
        if !point.iter().all(|x| x.is_finite()) {
            return;
        }
        self.each_instance_in(&Aabb { min: point.map(down), max: point.map(up) }, |id| match self.placed(id) {
            Some(placed) if has_point(&placed.aabb, point) => {
                visit(&placed, mapped(&placed.inverse, point).map(|x| x as f32))
            }
            _ => ControlFlow::Continue(()),
        });
    }

    /// An instance that rays may see, where it is as the shutter opens.
    pub(crate) fn placed(&self, instance: InstanceId) -> Option<Placed<'_, B>> {
        let aabb = self.instance_bounds(instance)?;
        let mut made = None;
        let given = self.placements.of(instance.index(), &mut made);
        let columns = given.map.world_from_object().columns.map(to_f64);
        let blas = &self.blas[given.blas as usize];
        Some(Placed { instance, index: given.blas, blas, inverse: invert(&columns), columns, aabb })
    }
}

/// # Containment
/// A point is mapped to the object space of each instance around it in `f64`, and rounded to `f32` there.
impl<B: Intersect + Borrow<TriangleBvh>> Tlas<B> {
    /// Whether `point` is inside of any instance, or on one, by [`TriangleBvh::contains`].
    #[must_use]
    pub fn contains(&self, point: impl Into<[f64; 3]>) -> bool {
        self.contains_with(point, |_, blas, point| {
            let bvh: &TriangleBvh = blas.borrow();
            bvh.contains(point)
        })
    }

    /// Whether each point is inside; see [`Tlas::contains`].
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn contains_many(&self, points: &[[f64; 3]], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer for each point");
        points.iter().zip(inside).for_each(|(&point, inside)| *inside = self.contains(point));
    }

    /// [`Tlas::contains_many`] on all threads.
    pub fn par_contains_many(&self, points: &[[f64; 3]], inside: &mut [bool])
    where
        B: Sync,
    {
        assert_eq!(points.len(), inside.len(), "one answer for each point");
        self.find_bounds();
        par::for_chunks(inside, CHUNK, |first, inside| {
            self.contains_many(&points[first..first + inside.len()], inside)
        });
    }
}

/// An instance with its map.
pub(crate) struct Placed<'a, B> {
    pub(crate) instance: InstanceId,
    /// Of the bottom-level BVH.
    pub(crate) index: u32,
    pub(crate) blas: &'a B,
    pub(crate) columns: Columns,
    pub(crate) inverse: Rows,
    /// World space.
    pub(crate) aabb: Aabb,
}

pub(crate) fn mapped(rows: &Rows, p: [f64; 3]) -> [f64; 3] {
    rows.map(|[x, y, z, w]| x * p[0] + y * p[1] + z * p[2] + w)
}

fn has_point(aabb: &Aabb, point: [f64; 3]) -> bool {
    (0..3).all(|k| f64::from(aabb.min[k]) <= point[k] && point[k] <= f64::from(aabb.max[k]))
}
