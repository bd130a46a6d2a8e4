//! Triangles in the leaves of a BVH, tested one after another.

use alloc::vec::Vec;

use canted_obb::PrimId;

use crate::{
    Answer, BaldwinWeber, Hit, InstanceId, Kernel, MollerTrumbore, Query, ReferencePoint, ScaledRay, SlabRay,
    TriangleTest, Watertight,
};

/// Nodes that report the leaves that a ray may hit.
///
/// [`LeafTriangles`] adds the triangles.
pub trait Leaves {
    /// Calls `leaf` with the position of each leaf that `ray` may hit at or before `t_max`, nearer subtrees first where
    /// `ORDERED`. `ray` is prepared with a reach of 0. `t_max` is scaled, and `leaf` returns the new one; without `ORDERED`, a
    /// negative one ends the traversal.
    ///
    /// Holds: `leaf` receives every leaf with a hit at or before the least `t_max` returned, ties included.
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    );
}

/// The triangles at the leaf positions of a BVH, in the form that its [`TriangleTest`] requires: answers the queries of
/// [`Intersect`](crate::Intersect) over any [`Leaves`].
///
/// `primitives` of a query are the numbers of the triangles in the caller's array: two leaf positions may have the same.
///
/// ```
/// use canted_obb::PrimId;
/// use canted_trace::{Hit, LeafTriangles, Leaves, Query, Ray, ReferencePoint, ScaledRay, SlabRay, TriangleTest};
///
/// /// Every leaf, whatever the ray.
/// struct All(u32);
///
/// impl Leaves for All {
///     fn traverse<const ORDERED: bool, Q: Query>(
///         &self,
///         _: &SlabRay,
///         mut t_max: f32,
///         query: &mut Q,
///         mut leaf: impl FnMut(u32, f32, &mut Q) -> f32,
///     ) {
///         for position in 0..self.0 {
///             t_max = leaf(position, t_max, query);
///             if t_max < 0.0 {
///                 break;
///             }
///         }
///     }
/// }
///
/// let at = |z: f32| [[0.0, 0.0, z], [4.0, 0.0, z], [0.0, 4.0, z]];
/// let triangles = LeafTriangles::new(TriangleTest::Watertight, vec![at(2.0), at(1.0)], ReferencePoint::ORIGIN);
/// let ray = ScaledRay::new(&Ray::new([1.0, 1.0, 0.0], [0.0, 0.0, 1.0])).unwrap();
/// let hit = triangles.closest_hit(&All(2), &[PrimId(7), PrimId(9)], &ray, &mut ()).unwrap();
/// assert_eq!((hit.t, hit.primitive), (1.0, PrimId(9)));
/// ```
#[derive(Clone, Debug)]
pub struct LeafTriangles {
    records: Records,
    reference: ReferencePoint,
}

/// The records of one kernel, in leaf order.
#[derive(Clone, Debug)]
enum Records {
    Watertight(Vec<<Watertight as Kernel>::Record>),
    MollerTrumbore(Vec<<MollerTrumbore as Kernel>::Record>),
    BaldwinWeber(Vec<<BaldwinWeber as Kernel>::Record>),
}

impl LeafTriangles {
    /// Triangles by their vertices, in leaf order.
    ///
    /// `reference` is what the nodes are relative to; triangles are in object space.
    #[must_use]
    pub fn new(test: TriangleTest, corners: Vec<[[f32; 3]; 3]>, reference: ReferencePoint) -> Self {
        // Where a record is just the vertices, this reuses the allocation.
        let corners = corners.into_iter();
        let records = match test {
            TriangleTest::Watertight => Records::Watertight(corners.map(Watertight::record).collect()),
            TriangleTest::MollerTrumbore => Records::MollerTrumbore(corners.map(MollerTrumbore::record).collect()),
            TriangleTest::BaldwinWeber => Records::BaldwinWeber(corners.map(BaldwinWeber::record).collect()),
        };
        Self { records, reference }
    }

    /// The triangle test.
    #[must_use]
    pub fn test(&self) -> TriangleTest {
        match self.records {
            Records::Watertight(_) => TriangleTest::Watertight,
            Records::MollerTrumbore(_) => TriangleTest::MollerTrumbore,
            Records::BaldwinWeber(_) => TriangleTest::BaldwinWeber,
        }
    }

    /// Number of leaf positions.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.records {
            Records::Watertight(records) => records.len(),
            Records::MollerTrumbore(records) => records.len(),
            Records::BaldwinWeber(records) => records.len(),
        }
    }

    /// Whether there are no triangles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What the nodes are relative to.
    #[must_use]
    pub fn reference(&self) -> ReferencePoint {
        self.reference
    }

    /// Memory in bytes.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        match &self.records {
            Records::Watertight(records) => size_of_val(&records[..]),
            Records::MollerTrumbore(records) => size_of_val(&records[..]),
            Records::BaldwinWeber(records) => size_of_val(&records[..]),
        }
    }

    /// See [`Intersect::closest_hit_scaled`](crate::Intersect::closest_hit_scaled).
    pub fn closest_hit<N: Leaves>(
        &self,
        nodes: &N,
        primitives: &[PrimId],
        ray: &ScaledRay,
        query: &mut dyn Query,
    ) -> Option<Hit> {
        let mut best = None;
        self.answer(nodes, primitives, ray, query, Answer::Closest(&mut best));
        best
    }

    /// See [`Intersect::occluded_scaled`](crate::Intersect::occluded_scaled).
    pub fn occluded<N: Leaves>(
        &self,
        nodes: &N,
        primitives: &[PrimId],
        ray: &ScaledRay,
        query: &mut dyn Query,
    ) -> bool {
        let mut found = false;
        self.answer(nodes, primitives, ray, query, Answer::Occluded(&mut found));
        found
    }

    /// See [`Intersect::all_hits_scaled`](crate::Intersect::all_hits_scaled).
    pub fn all_hits<N: Leaves>(
        &self,
        nodes: &N,
        primitives: &[PrimId],
        ray: &ScaledRay,
        query: &mut dyn Query,
        hits: &mut Vec<Hit>,
    ) {
        self.answer(nodes, primitives, ray, query, Answer::All(hits));
    }

    #[inline(always)]
    fn answer<N: Leaves>(
        &self,
        nodes: &N,
        primitives: &[PrimId],
        ray: &ScaledRay,
        query: &mut dyn Query,
        answer: Answer,
    ) {
        let slab_ray = SlabRay::new(&self.reference.moved_ray(ray), 0.0);
        let leaves = EnteredLeaves { nodes, primitives, ray, slab_ray };
        match &self.records {
            Records::Watertight(records) => leaves.tested::<Watertight>(records).answer(query, answer),
            Records::MollerTrumbore(records) => leaves.tested::<MollerTrumbore>(records).answer(query, answer),
            Records::BaldwinWeber(records) => leaves.tested::<BaldwinWeber>(records).answer(query, answer),
        }
    }
}

/// The leaves that a ray enters.
struct EnteredLeaves<'a, N> {
    nodes: &'a N,
    primitives: &'a [PrimId],
    ray: &'a ScaledRay,
    slab_ray: SlabRay,
}

impl<'a, N: Leaves> EnteredLeaves<'a, N> {
    #[inline(always)]
    fn tested<K: Kernel>(self, records: &'a [K::Record]) -> Tested<'a, N, K> {
        let Self { nodes, primitives, ray, slab_ray } = self;
        Tested { nodes, primitives, ray, slab_ray, records, prepared: K::prepare(ray) }
    }
}

/// Triangles with the kernel `K`, and a ray.
struct Tested<'a, N, K: Kernel> {
    nodes: &'a N,
    records: &'a [K::Record],
    primitives: &'a [PrimId],
    ray: &'a ScaledRay,
    prepared: K::Prepared,
    slab_ray: SlabRay,
}

impl<N: Leaves, K: Kernel> Tested<'_, N, K> {
    #[inline(always)]
    fn answer(&self, query: &mut dyn Query, answer: Answer) {
        let is_plain = query.is_plain();
        let mut tally = Tally { counts: query.counts(), may_reject: query.may_reject(), boxes: 0, triangles: 0, query };
        match answer {
            Answer::Closest(best) if is_plain => *best = self.closest_hit(&mut ()),
            Answer::Closest(best) => *best = self.closest_hit(&mut tally),
            Answer::Occluded(found) if is_plain => *found = self.occluded(&mut ()),
            Answer::Occluded(found) => *found = self.occluded(&mut tally),
            Answer::All(hits) => self.all_hits(&mut tally, hits),
        }
        tally.report();
    }

    #[inline(always)]
    fn closest_hit<Q: Query>(&self, query: &mut Q) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.nodes.traverse::<true, Q>(&self.slab_ray, self.ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(leaf, t_max) {
                Some(hit) if best.is_none_or(|best| hit.before(&best)) && self.accepts(query, &hit) => {
                    best = Some(hit);
                    hit.t
                }
                _ => t_max,
            }
        });
        best.map(|hit| self.of_caller(hit))
    }

    #[inline(always)]
    fn occluded<Q: Query>(&self, query: &mut Q) -> bool {
        let mut found = false;
        self.nodes.traverse::<false, Q>(&self.slab_ray, self.ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(leaf, t_max) {
                Some(hit) if self.accepts(query, &hit) => {
                    found = true;
                    -1.0
                }
                _ => t_max,
            }
        });
        found
    }

    #[inline(always)]
    fn all_hits<Q: Query>(&self, query: &mut Q, hits: &mut Vec<Hit>) {
        let start = hits.len();
        self.nodes.traverse::<false, Q>(&self.slab_ray, self.ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            hits.extend(self.hit(leaf, t_max).filter(|hit| self.accepts(query, hit)));
            t_max
        });
        once_each(hits, start);
        for hit in &mut hits[start..] {
            *hit = self.of_caller(*hit);
        }
    }

    /// The hit at a leaf position, `t` scaled, whether or not the query accepts it.
    #[inline(always)]
    fn hit(&self, leaf: u32, t_max: f32) -> Option<Hit> {
        let hit = K::intersect(&self.prepared, self.ray, &self.records[leaf as usize], t_max)?;
        let (primitive, instance) = (self.primitives[leaf as usize], InstanceId(0));
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side })
    }

    #[inline(always)]
    fn accepts<Q: Query>(&self, query: &mut Q, hit: &Hit) -> bool {
        !query.may_reject() || query.accepts(&self.of_caller(*hit))
    }

    #[inline(always)]
    fn of_caller(&self, hit: Hit) -> Hit {
        Hit { t: self.ray.caller_t(hit.t), ..hit }
    }
}

/// Sorts the hits from `start` on, least `t` first, then lowest primitive, and keeps one of those that are equal in both: a BVH may
/// refer to a triangle more than once.
fn once_each(hits: &mut Vec<Hit>, start: usize) {
    // Adding zero makes -0.0 positive: the two zeros are one `t`.
    hits[start..].sort_unstable_by(|a, b| (a.t + 0.0).total_cmp(&(b.t + 0.0)).then(a.primitive.cmp(&b.primitive)));
    let key = |hit: &Hit| (hit.t.to_bits(), hit.primitive);
    let mut end = start;
    for i in start..hits.len() {
        if end == start || key(&hits[end - 1]) != key(&hits[i]) {
            hits[end] = hits[i];
            end += 1;
        }
    }
    hits.truncate(end);
}

/// A query whose counts are reported once for each ray.
struct Tally<'a> {
    query: &'a mut dyn Query,
    counts: bool,
    may_reject: bool,
    boxes: u32,
    triangles: u32,
}

impl Tally<'_> {
    #[inline(always)]
    fn report(self) {
        if self.counts {
            self.query.boxes(self.boxes);
            self.query.triangles(self.triangles);
        }
    }
}

impl Query for Tally<'_> {
    #[inline(always)]
    fn may_reject(&self) -> bool {
        self.may_reject
    }

    #[inline(always)]
    fn boxes(&mut self, n: u32) {
        self.boxes += n;
    }

    #[inline(always)]
    fn triangles(&mut self, n: u32) {
        self.triangles += n;
    }

    #[inline(always)]
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.query.accepts(hit)
    }
}
