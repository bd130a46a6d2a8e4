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

use canted_lbvh::{self as lbvh, Corners, GeometryError};
use canted_obb::{Aabb, Moments, Obb};
use canted_trace::{
    BaldwinWeber, HIT_ERROR, Hit, Intersect, Kernel, MollerTrumbore, Query, ScaledRay, TriangleHit, TriangleTest,
    Watertight, position_at,
};

use super::boxes::Order;
use super::sink::{AllHits, AnyHit, BestHit, Visits};
use crate::build::PrimitiveError;
use crate::leaf::hit;
use crate::traverse::TracedRay;
use crate::{
    Config, Primitive, PrimitiveHit, Refit, RefitError, SimdPath, Sizes, WideBvh, bounds_of_points, extent_of_points,
};

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

    /// By the watertight test; [`MovingBvh`] prepares a ray for its own test once.
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let found = Watertight::intersect(&Watertight::prepare(ray), ray, &self.at(ray.time), t_max)?;
        Some(PrimitiveHit { t: found.t, u: found.u, v: found.v, side: found.side })
    }
}

/// A [`WideBvh`] over triangles whose vertices move in straight lines while the shutter is open.
///
/// At the time `s` of a ray the hits are, bit for bit, those of a [`TriangleBvh`](crate::TriangleBvh) over the vertices
/// [`position_at`]`(open, close, s)`, on every [`SimdPath`]. Its boxes hold for the whole shutter, so rays test more of them the farther
/// triangles move relative to their size.
///
/// ```
/// use canted_trace::{Intersect, Ray};
/// use canted_wide::MovingBvh;
///
/// // A triangle that moves from z = 0 to z = 4.
/// let at_height = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
/// let bvh = MovingBvh::build(&at_height(0.0), &at_height(4.0), &[[0, 1, 2]])?;
/// let ray = Ray::new([0.2, 0.2, 10.0], [0.0, 0.0, -1.0]);
/// let hits = [0.0, 0.25, 1.0].map(|time| bvh.closest_hit(&ray.at_time(time)).map(|hit| hit.t));
/// assert_eq!(hits, [Some(10.0), Some(9.0), Some(6.0)]);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[derive(Clone, Debug)]
pub struct MovingBvh {
    bvh: WideBvh<MovingTriangle>,
    test: TriangleTest,
}

impl MovingBvh {
    /// Builds a BVH over triangles with these vertices as the shutter opens and as it closes, with the default configuration. Vertices and
    /// indices may have the types that [`TriangleBvh::build`](crate::TriangleBvh::build) takes.
    ///
    /// # Errors
    /// More triangles than [`MAX_PRIMITIVES`](crate::MAX_PRIMITIVES); the first triangle with an index out of range of one of the
    /// lists, or with a vertex that is not finite in one.
    pub fn build<V, I>(open: &[V], close: &[V], triangles: &[[I; 3]]) -> Result<Self, GeometryError>
    where
        V: Into<[f32; 3]> + Copy + 'static,
        I: TryInto<u32> + Copy + 'static,
    {
        Self::build_with(open, close, triangles, Config::default())
    }

    /// As [`MovingBvh::build`], with a [`Preset`](crate::Preset) or a [`Config`].
    ///
    /// # Errors
    /// As [`MovingBvh::build`].
    pub fn build_with<V, I>(
        open: &[V],
        close: &[V],
        triangles: &[[I; 3]],
        config: impl Into<Config>,
    ) -> Result<Self, GeometryError>
    where
        V: Into<[f32; 3]> + Copy + 'static,
        I: TryInto<u32> + Copy + 'static,
    {
        let config = config.into();
        let bvh = WideBvh::over_with(moving(open, close, triangles)?, config).map_err(|error| match error {
            PrimitiveError::TooMany { n_primitives } => GeometryError::TooMany { n_triangles: n_primitives },
            // Vertices are finite: only the box around both ends may not be.
            PrimitiveError::Bounds { primitive: triangle } => {
                let [vertex, ..] = triangles[triangle.index()].map(|index| index.try_into().unwrap_or(u32::MAX));
                GeometryError::NotFinite { triangle, vertex, position: close[vertex as usize].into().into() }
            }
        })?;
        Ok(Self { bvh, test: config.test })
    }

    /// New boxes for another motion of the same triangles, as [`TriangleBvh::refit`](crate::TriangleBvh::refit).
    ///
    /// # Errors
    /// Another number of triangles, and those of [`MovingBvh::build`]. The BVH is then unchanged.
    pub fn refit<V, I>(&mut self, open: &[V], close: &[V], triangles: &[[I; 3]]) -> Result<Refit, RefitError>
    where
        V: Into<[f32; 3]> + Copy + 'static,
        I: TryInto<u32> + Copy + 'static,
    {
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
}

impl Intersect for MovingBvh {
    fn bounds(&self) -> Obb {
        self.bvh.bounds()
    }

    fn is_empty(&self) -> bool {
        self.bvh.n_primitives() == 0
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn stack_len(&self) -> usize {
        self.bvh.stack_len()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        let mut best = BestHit::<false>::new(query);
        best.visits = self.pass_hits(ray, Order::Nearest, stack, &mut |hit, t_max| best.take_hit(ray, hit, t_max));
        best.hit(ray)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        let mut any = AnyHit::<false>::new(query);
        any.visits = self.pass_hits(ray, Order::Any, stack, &mut |hit, t_max| any.take_hit(ray, hit, t_max));
        any.found()
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        let mut all = AllHits::new(query, hits);
        all.visits = self.pass_hits(ray, Order::Any, stack, &mut |hit, t_max| all.take_hit(ray, hit, t_max));
        all.finish(ray);
    }
}

impl MovingBvh {
    /// Calls `take` with every hit at the time of the ray, `t` scaled; the work.
    fn pass_hits(
        &self,
        ray: &ScaledRay,
        order: Order,
        stack: &mut [u64],
        take: &mut dyn FnMut(Hit, f32) -> f32,
    ) -> Visits {
        match self.test {
            TriangleTest::Watertight => self.pass_hits_of::<Watertight>(ray, order, stack, take),
            TriangleTest::MollerTrumbore => self.pass_hits_of::<MollerTrumbore>(ray, order, stack, take),
            TriangleTest::BaldwinWeber => self.pass_hits_of::<BaldwinWeber>(ray, order, stack, take),
        }
    }

    fn pass_hits_of<K: Kernel>(
        &self,
        ray: &ScaledRay,
        order: Order,
        stack: &mut [u64],
        take: &mut dyn FnMut(Hit, f32) -> f32,
    ) -> Visits {
        // The ray's part of the distance between hits and triangles, in units of the space.
        let moved = self.bvh.frame.reference.moved(ray.origin);
        let reach = moved.into_iter().fold(0.0, |reach: f32, x| reach.max(x.abs()));
        let traced = TracedRay::within(ray, &self.bvh.frame, f64::from(HIT_ERROR) * f64::from(reach));
        let prepared = K::prepare(ray);
        let mut n_tested = 0;
        let mut visits = self.bvh.visit(&traced, order, stack, &mut |triangle, id, t_max| {
            n_tested += 1;
            let record = K::record(triangle.at(ray.time));
            match K::intersect(&prepared, ray, &record, t_max) {
                Some(TriangleHit { t, u, v, side }) => take(hit(t, [u, v], side, id), t_max),
                None => t_max,
            }
        });
        visits.n_primitives = n_tested;
        visits
    }
}

/// The triangles with these vertices.
fn moving<V, I>(open: &[V], close: &[V], triangles: &[[I; 3]]) -> Result<Vec<MovingTriangle>, GeometryError>
where
    V: Into<[f32; 3]> + Copy + 'static,
    I: TryInto<u32> + Copy + 'static,
{
    let triangles = lbvh::as_triangles(triangles);
    let (opening, _) = lbvh::triangle_corners(&lbvh::as_positions(open), &triangles)?;
    let (closing, _) = lbvh::triangle_corners(&lbvh::as_positions(close), &triangles)?;
    Ok(opening.into_iter().zip(closing).map(|(open, close)| MovingTriangle { open, close }).collect())
}
