use std::marker::PhantomData;

use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::emit::Records;
use crate::layout::{Half, NodeKind};
use crate::simd::{Simd, SimdPath, Task};
use crate::traverse::{Block, LaneKernel, MeshFrame, RayLanes, RayTriangles, Stack, Visit, walk};

/// A tree of eight-wide nodes over triangles, ready for rays.
///
/// `K` is the triangle test. Hits are those of `K` tried on every triangle: same `t`, `u`, `v`, same primitive, ties to
/// the lowest, on every [`SimdPath`].
#[derive(Clone, Debug)]
pub struct Wide<K: LaneKernel> {
    pub(crate) records: Records,
    pub(crate) frame: MeshFrame,
    pub(crate) bounds: Aabb,
    pub(crate) n_triangles: usize,
    pub(crate) predicted: Predicted,
    pub(crate) path: SimdPath,
    pub(crate) kernel: PhantomData<K>,
}

/// Predicted costs of a ray that enters the root's box, in visits of box nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Predicted {
    /// With box nodes only.
    pub aligned: f32,
    /// Of the tree as it was built.
    pub chosen: f32,
}

/// Sizes of a built tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`].
    pub nodes: [usize; 3],
    /// Bytes of all nodes.
    pub node_bytes: usize,
    /// Bytes of all triangle blocks.
    pub block_bytes: usize,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: u32,
}

impl<K: LaneKernel> Wide<K> {
    /// The same tree traced on another path; on the scalar one where this machine lacks it.
    #[must_use]
    pub fn with_path(mut self, path: SimdPath) -> Self {
        self.path = if path.is_available() { path } else { SimdPath::Scalar };
        self
    }

    /// The path that rays are traced on.
    #[must_use]
    pub fn path(&self) -> SimdPath {
        self.path
    }

    /// Box around all triangles, object space.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.bounds
    }

    /// Box around all triangles, in the frame of the mesh.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        if self.n_triangles == 0 {
            return Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half: [0.0; 3] };
        }
        Obb::from_aabb(&self.bounds)
    }

    /// Rows of the frame that its box nodes stand in.
    #[must_use]
    pub fn frame(&self) -> [[f32; 3]; 3] {
        self.frame.rows
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// Memory of nodes and blocks.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(&self.records.lines[..]) + size_of_val(&self.records.halves[..])
    }

    /// What the build predicted a ray to cost.
    #[must_use]
    pub fn predicted(&self) -> Predicted {
        self.predicted
    }

    /// How many nodes of each kind there are, and what they take.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        self.records.sizes()
    }

    /// The hit of least `t`; ties go to the lowest primitive.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit_with(ray, InstanceId(0), &mut ())
    }

    /// Whether anything is hit: agrees with [`Wide::closest_hit`].
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_with(ray, InstanceId(0), &mut ())
    }

    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.path.run(Closest { wide: self, ray, instance, query })
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.path.run(Occluded { wide: self, ray, instance, query })
    }

    /// The closest hits of `rays`, in order.
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "a hit for each ray");
        self.path.run(ClosestMany { wide: self, rays, hits });
    }

    /// Whether each of `rays` hits anything, in order.
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "an answer for each ray");
        self.path.run(OccludedMany { wide: self, rays, occluded });
    }

    #[inline(always)]
    fn trace<S: Simd, Q: Query, const ORDERED: bool>(
        &self,
        simd: S,
        ray: &Ray,
        instance: InstanceId,
        query: &mut Q,
        stack: &mut Stack,
    ) -> Option<Hit> {
        let ray = ScaledRay::new(ray)?;
        let lanes = RayLanes::new(simd, &ray, &self.frame, self.bounds_reach());
        let mut visit = Triangles::<S, K, Q, ORDERED> {
            simd,
            halves: &self.records.halves,
            triangles: RayTriangles::new(simd, &ray),
            prepared: K::prepare(&ray),
            ray: &ray,
            instance,
            query,
            best: None,
        };
        walk::<S, ORDERED>(simd, &self.records.lines, self.records.root, &lanes, ray.t_max, stack, &mut visit);
        visit.best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
    }

    #[inline(always)]
    fn bounds_reach(&self) -> f32 {
        self.bounds.reach()
    }
}

/// Leaves of triangles, met by one ray.
struct Triangles<'a, S: Simd, K: LaneKernel, Q, const ORDERED: bool> {
    simd: S,
    halves: &'a [Half],
    triangles: RayTriangles<S>,
    prepared: K::Prepared,
    ray: &'a ScaledRay,
    instance: InstanceId,
    query: &'a mut Q,
    /// The best hit so far, `t` scaled.
    best: Option<Hit>,
}

impl<S: Simd, K: LaneKernel, Q: Query, const ORDERED: bool> Visit for Triangles<'_, S, K, Q, ORDERED> {
    #[inline(always)]
    fn leaf(&mut self, first: u32, n: u32, mut t_max: f32) -> f32 {
        self.query.triangles(n);
        let (mut first, mut n) = (first as usize, n);
        loop {
            let block = Block::at(self.halves, first, n);
            let filled = if n < 8 { (1 << n) - 1 } else { 0xff };
            let mut mask = block.candidates::<S, K>(self.simd, &self.triangles, t_max) & filled;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let Some(hit) = K::finish(&self.prepared, self.ray, &block.vertices(lane), t_max) else { continue };
                let primitive: PrimId = block.primitive(lane);
                let hit = Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: self.instance, side: hit.side };
                if self.best.is_none_or(|best| hit.before(&best))
                    && self.query.accepts(&Hit { t: self.ray.caller_t(hit.t), ..hit })
                {
                    t_max = hit.t;
                    self.best = Some(hit);
                    if !ORDERED {
                        return -1.0;
                    }
                }
            }
            if n <= 8 {
                return t_max;
            }
            n -= 8;
            first += 2;
        }
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {
        self.query.boxes(8);
    }
}

struct Closest<'a, K: LaneKernel, Q> {
    wide: &'a Wide<K>,
    ray: &'a Ray,
    instance: InstanceId,
    query: &'a mut Q,
}

impl<K: LaneKernel, Q: Query> Task for Closest<'_, K, Q> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Option<Hit> {
        let mut stack = Stack::new(self.wide.records.depth);
        self.wide.trace::<S, Q, true>(simd, self.ray, self.instance, self.query, &mut stack)
    }
}

struct Occluded<'a, K: LaneKernel, Q> {
    wide: &'a Wide<K>,
    ray: &'a Ray,
    instance: InstanceId,
    query: &'a mut Q,
}

impl<K: LaneKernel, Q: Query> Task for Occluded<'_, K, Q> {
    type Output = bool;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> bool {
        let mut stack = Stack::new(self.wide.records.depth);
        self.wide.trace::<S, Q, false>(simd, self.ray, self.instance, self.query, &mut stack).is_some()
    }
}

struct ClosestMany<'a, K: LaneKernel> {
    wide: &'a Wide<K>,
    rays: &'a [Ray],
    hits: &'a mut [Option<Hit>],
}

impl<K: LaneKernel> Task for ClosestMany<'_, K> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let mut stack = Stack::new(self.wide.records.depth);
        for (ray, hit) in self.rays.iter().zip(self.hits) {
            *hit = self.wide.trace::<S, (), true>(simd, ray, InstanceId(0), &mut (), &mut stack);
        }
    }
}

struct OccludedMany<'a, K: LaneKernel> {
    wide: &'a Wide<K>,
    rays: &'a [Ray],
    occluded: &'a mut [bool],
}

impl<K: LaneKernel> Task for OccludedMany<'_, K> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let mut stack = Stack::new(self.wide.records.depth);
        for (ray, occluded) in self.rays.iter().zip(self.occluded) {
            *occluded = self.wide.trace::<S, (), false>(simd, ray, InstanceId(0), &mut (), &mut stack).is_some();
        }
    }
}
