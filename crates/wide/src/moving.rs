//! Triangles that move while the shutter is open.
//!
//! ```text
//! vertices at both ends of the shutter -> bounds of each triangle for all times -> WideBvh
//! ray and its time -> leaves of the WideBvh -> vertices at that time -> triangle test
//! ```
//!
//! Reads: vertices as the shutter opens and as it closes. Writes: a BVH, hits at the time of each ray. Holds: hits at a time are
//! those of a static BVH over [`position_at`] of all vertices at that time, bit for bit.
//! Source: Glassner 1988 for boxes that hold at all times; the vertices' straight lines are those of Embree's motion blur.
//!
//! # No lost hit
//! At each time a vertex lies within `(2^-24 + 2^-50)·r` in each coordinate, with r the reach of the triangle, of the segment between
//! its ends ([`position_at`]), so within 2^-23·r of it in any direction, as √3·(2^-24 + 2^-50) < 2^-23. [`MovingTriangle`] reports
//! the extents of all points this close to its six ends; they contain the convex hull, and so the triangle at every time. Its
//! bounds hold the six ends alone, because no coordinate leaves the interval between them. A hit at a time lies within
//! `HIT_ERROR·(|o|∞ + ρ∞)` of the triangle at that time, ρ∞ the reach of the six ends, both relative to any point: this is the contract of
//! a local [`Primitive`], whose proof is in `traverse`. The boxes are padded for their part of it, and the ray carries `HIT_ERROR·|o|∞`,
//! relative to the reference point of the BVH.

use std::marker::PhantomData;

use canted_lbvh::{self as lbvh, Corners, GeometryError};
use canted_obb::{Aabb, Moments, Obb, PrimId};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Kernel, Query, Ray, ScaledRay, TriangleHit, Watertight, position_at};

use crate::build::PrimitiveError;
use crate::sink::by_t;
use crate::{Config, LaneKernel, Primitive, PrimitiveHit, Refit, RefitError, SimdPath, Sizes, WideBvh};
use crate::{bounds_of_points, extent_of_points, leaf::hit};

/// A triangle whose vertices move in straight lines.
#[derive(Clone, Copy, Debug)]
struct MovingTriangle {
    open: Corners,
    close: Corners,
}

impl MovingTriangle {
    /// The vertices at both ends.
    fn ends(&self) -> [[f32; 3]; 6] {
        let ([a, b, c], [d, e, f]) = (self.open, self.close);
        [a, b, c, d, e, f]
    }

    /// The vertices at a time.
    #[inline]
    fn at(&self, time: f32) -> Corners {
        [0, 1, 2].map(|i| position_at(&self.open[i], &self.close[i], time))
    }
}

impl Primitive for MovingTriangle {
    const IS_LOCAL: bool = true;
    const MAX_LEAF: usize = 4;

    fn bounds(&self) -> Aabb {
        bounds_of_points(self.ends(), 0.0)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        // Exact: a power of two times a number.
        let rounding = f32::EPSILON * self.bounds().reach() + f32::MIN_POSITIVE;
        extent_of_points(self.ends(), rounding, direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.ends())
    }

    /// As the shutter opens; [`MovingBvh`] tests at the time of its ray.
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let found = Watertight::intersect(&Watertight::prepare(ray), ray, &self.open, t_max)?;
        Some(PrimitiveHit { t: found.t, u: found.u, v: found.v, side: found.side })
    }
}

/// A [`WideBvh`] over triangles whose vertices move in straight lines while the shutter is open.
///
/// The time of a ray is that of its [`Query`]. At time `s` the hits are, bit for bit, those of a
/// [`TriangleBvh`](crate::TriangleBvh) over the vertices [`position_at`]`(open, close, s)`, on every [`SimdPath`]. Its boxes hold for
/// the whole shutter, so rays test more of them the farther triangles move relative to their size.
///
/// ```
/// use canted_trace::{InstanceId, Query, Ray};
/// use canted_wide::{Config, MovingBvh};
///
/// /// A ray at a time.
/// struct At(f32);
///
/// impl Query for At {
///     const MAY_REJECT: bool = false;
///
///     fn time(&self) -> f32 {
///         self.0
///     }
/// }
///
/// // A triangle that moves from z = 0 to z = 4.
/// let at_height = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
/// let bvh: MovingBvh = MovingBvh::build(&at_height(0.0), &at_height(4.0), &[[0, 1, 2]], &Config::default())?;
/// let ray = Ray::new([0.2, 0.2, 10.0], [0.0, 0.0, -1.0]);
/// let hits = [0.0, 0.25, 1.0].map(|time| bvh.closest_hit_with(&ray, InstanceId(0), &mut At(time)).map(|hit| hit.t));
/// assert_eq!(hits, [Some(10.0), Some(9.0), Some(6.0)]);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[derive(Clone, Debug)]
pub struct MovingBvh<K: LaneKernel = Watertight> {
    bvh: WideBvh<MovingTriangle>,
    kernel: PhantomData<K>,
}

impl<K: LaneKernel> MovingBvh<K> {
    /// Builds a BVH over triangles with these vertices as the shutter opens and as it closes.
    ///
    /// # Errors
    /// More triangles than [`MAX_PRIMITIVES`](crate::MAX_PRIMITIVES); the first triangle with an index out of range of one of the
    /// lists, or with a vertex that is not finite in one.
    pub fn build(
        open: &[[f32; 3]],
        close: &[[f32; 3]],
        triangles: &[[u32; 3]],
        config: &Config,
    ) -> Result<Self, GeometryError> {
        let bvh =
            WideBvh::<MovingTriangle>::build(moving(open, close, triangles)?, config).map_err(|error| match error {
                PrimitiveError::TooMany { n_primitives } => GeometryError::TooMany { n_triangles: n_primitives },
                PrimitiveError::Bounds { primitive } => GeometryError::NotFinite { triangle: primitive },
            })?;
        Ok(Self { bvh, kernel: PhantomData })
    }

    /// New boxes for another motion of the same triangles, as [`WideBvh::refit`].
    ///
    /// # Errors
    /// Another number of triangles, and those of [`MovingBvh::build`]. The BVH is then unchanged.
    pub fn refit(
        &mut self,
        open: &[[f32; 3]],
        close: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Refit, RefitError> {
        self.bvh.refit(moving(open, close, triangles).map_err(RefitError::Geometry)?)
    }

    /// The same BVH traced with other instructions; see [`WideBvh::with_path`].
    #[must_use]
    pub fn with_path(self, path: SimdPath) -> Self {
        Self { bvh: self.bvh.with_path(path), ..self }
    }

    /// A box around all triangles at all times, object space.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        self.bvh.bounds()
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_primitives(&self) -> usize {
        self.bvh.n_primitives()
    }

    /// Memory of nodes and triangles.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.bvh.n_bytes()
    }

    /// Number of nodes of each kind, and memory.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        self.bvh.sizes()
    }

    /// Rows of the frame that the boxes of aligned nodes are aligned with.
    #[must_use]
    pub fn frame(&self) -> [[f32; 3]; 3] {
        self.bvh.frame()
    }

    /// Calls `visit` with the box of each node and leaf, as [`WideBvh::each_box`]; a box contains its triangles at all times.
    pub fn each_box(&self, visit: impl FnMut(Obb, u32, bool)) {
        self.bvh.each_box(visit);
    }

    /// The hit of least `t` that the query accepts at its time, as a hit on `instance`; ties go to the lowest triangle.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let test = Test::<K>::new(&self.bvh, ray, query)?;
        let mut best: Option<Hit> = None;
        self.bvh.traverse_ordered(&test.ray, test.error, query, |id, t_max, query: &mut Q| {
            query.triangles(1);
            let Some(found) = test.hit(id, t_max) else { return t_max };
            let is_first = best.is_none_or(|best| found.before(&best));
            if is_first && query.accepts(&test.reported(found, instance)) {
                best = Some(found);
                return found.t;
            }
            t_max
        });
        best.map(|best| test.reported(best, instance))
    }

    /// Whether the query accepts any hit at its time.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        let Some(test) = Test::<K>::new(&self.bvh, ray, query) else { return false };
        let mut found = false;
        self.bvh.traverse_any(&test.ray, test.error, query, |id, t_max, query: &mut Q| {
            query.triangles(1);
            let Some(hit) = test.hit(id, t_max) else { return t_max };
            found = query.accepts(&test.reported(hit, instance));
            if found { -1.0 } else { t_max }
        });
        found
    }

    /// Every hit that the query accepts at its time, as hits on `instance`: least `t` first, then lowest triangle. Replaces the
    /// content of `hits`.
    pub fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        hits.clear();
        let Some(test) = Test::<K>::new(&self.bvh, ray, query) else { return };
        self.bvh.traverse_any(&test.ray, test.error, query, |id, t_max, query: &mut Q| {
            query.triangles(1);
            if let Some(found) = test.hit(id, t_max)
                && query.accepts(&test.reported(found, instance))
            {
                hits.push(found);
            }
            t_max
        });
        hits.sort_unstable_by(by_t);
        hits.iter_mut().for_each(|found| *found = test.reported(*found, instance));
    }
}

/// The triangles with these vertices.
fn moving(open: &[[f32; 3]], close: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Vec<MovingTriangle>, GeometryError> {
    let (opening, _) = lbvh::triangle_corners(open, triangles)?;
    let (closing, _) = lbvh::triangle_corners(close, triangles)?;
    Ok(opening.into_iter().zip(closing).map(|(open, close)| MovingTriangle { open, close }).collect())
}

/// A ray at its time.
struct Test<'a, K: Kernel> {
    triangles: &'a [MovingTriangle],
    ray: ScaledRay,
    prepared: K::Prepared,
    time: f32,
    /// The ray's part of the distance between hits and triangles, in units of the space.
    error: f64,
}

impl<'a, K: Kernel> Test<'a, K> {
    /// `None` for a ray that cannot hit.
    fn new(bvh: &'a WideBvh<MovingTriangle>, ray: &Ray, query: &impl Query) -> Option<Self> {
        let ray = ScaledRay::new(ray)?;
        let moved = bvh.frame.reference.moved(ray.origin);
        let reach = moved.into_iter().fold(0.0, |reach: f32, x| reach.max(x.abs()));
        let error = f64::from(HIT_ERROR) * f64::from(reach);
        Some(Self { triangles: bvh.primitives(), prepared: K::prepare(&ray), ray, time: query.time(), error })
    }

    /// The hit on a triangle, `t` scaled.
    #[inline]
    fn hit(&self, id: PrimId, t_max: f32) -> Option<Hit> {
        let record = K::record(self.triangles[id.index()].at(self.time));
        let TriangleHit { t, u, v, side } = K::intersect(&self.prepared, &self.ray, &record, t_max)?;
        Some(hit(t, [u, v], side, id))
    }

    /// The hit as the caller sees it.
    #[inline]
    fn reported(&self, hit: Hit, instance: InstanceId) -> Hit {
        Hit { t: self.ray.caller_t(hit.t), instance, ..hit }
    }
}
