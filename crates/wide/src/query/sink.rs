//! What queries do with hits: keep the closest, any, or all.

use std::cmp::Ordering;

use canted_trace::{Hit, Query, ScaledRay};

use crate::node::NodeKind;

/// Decides what becomes of hits on triangles.
pub(crate) trait HitSink {
    /// Whether nearer subtrees must be visited first.
    const ORDERED: bool;

    /// Whether every hit is accepted and the first one ends the traversal.
    const ANY: bool = false;

    /// Whether no hit shortens the ray.
    const ALL: bool = false;

    /// Whether hits that are certainly inside of their triangle go to [`HitSink::take_inside`].
    const SPLITS: bool = false;

    /// Takes a hit that is on no edge of its triangle, where [`HitSink::SPLITS`]. Returns the new `t_max`.
    #[inline(always)]
    fn take_inside(&mut self, _: Hit, _: f32) -> f32 {
        unreachable!("the sink takes all hits alike")
    }

    /// Whether hits that are certain need not be computed: they go to [`HitSink::take_any`].
    #[inline(always)]
    fn takes_any(&self) -> bool {
        Self::ANY
    }

    /// Takes a hit that is certain but not computed, where [`HitSink::takes_any`]. Returns a negative number.
    #[inline(always)]
    fn take_any(&mut self) -> f32 {
        unreachable!("the sink needs hits")
    }

    /// Takes a hit with `t_min <= t <= t_max`, all scaled. Returns the new `t_max`; a negative one ends the traversal.
    fn take(&mut self, ray: &ScaledRay, hit: Hit, vertices: &[[f32; 3]; 3], t_max: f32) -> f32;

    /// Where the work is counted, if it is.
    #[inline(always)]
    fn visits(&mut self) -> Option<&mut Visits> {
        None
    }
}

/// Visits by rays that search for their closest hit; [`Costs`](crate::Costs) are fitted to them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`](crate::NodeKind::ALL).
    pub nodes: [u64; 2],
    /// Leaves.
    pub leaves: u64,
    /// Blocks of up to eight primitives.
    pub blocks: u64,
    /// Triangles that the filter of their block does not reject: each is decided alone, in `f64`.
    pub exact: u64,
}

impl TraversalCounts {
    /// Adds the visits of other rays.
    pub(crate) fn add(&mut self, other: &Self) {
        self.nodes.iter_mut().zip(other.nodes).for_each(|(sum, n)| *sum += n);
        self.leaves += other.leaves;
        self.blocks += other.blocks;
        self.exact += other.exact;
    }
}

/// The work of one ray.
#[derive(Clone, Copy, Default)]
pub(crate) struct Visits {
    pub(crate) counts: TraversalCounts,
    pub(crate) n_primitives: u32,
}

impl Visits {
    #[inline(always)]
    pub(crate) fn leaf(&mut self, n: u32) {
        self.counts.leaves += 1;
        self.counts.blocks += u64::from(n.div_ceil(8));
        self.n_primitives += n;
    }

    #[inline(always)]
    pub(crate) fn exact(&mut self, n: u32) {
        self.counts.exact += u64::from(n);
    }

    #[inline(always)]
    pub(crate) fn node(&mut self, kind: NodeKind) {
        self.counts.nodes[kind as usize] += 1;
    }

    /// Ray-box tests: eight for each node.
    #[inline]
    pub(crate) fn n_boxes(&self) -> u32 {
        8 * self.counts.nodes.iter().sum::<u64>() as u32
    }

    /// Adds the work to a query that counts.
    pub(crate) fn report(&self, query: &mut dyn Query) {
        if query.counts() {
            query.boxes(self.n_boxes());
            query.triangles(self.n_primitives);
        }
    }
}

/// Keeps the first of the hits that a query accepts; where `PLAIN`, the query accepts all and counts nothing.
pub(crate) struct BestHit<'a, const PLAIN: bool> {
    query: &'a mut dyn Query,
    /// `t` scaled.
    pub(crate) best: Option<Hit>,
    pub(crate) visits: Visits,
}

impl<'a, const PLAIN: bool> BestHit<'a, PLAIN> {
    #[inline(always)]
    pub(crate) fn new(query: &'a mut dyn Query) -> Self {
        Self { query, best: None, visits: Visits::default() }
    }

    /// Takes a hit on any primitive.
    #[inline(always)]
    pub(crate) fn take_hit(&mut self, ray: &ScaledRay, hit: Hit, t_max: f32) -> f32 {
        let is_first = self.best.is_none_or(|best| hit.before(&best));
        if is_first && (PLAIN || self.query.accepts(&Hit { t: ray.caller_t(hit.t), ..hit })) {
            self.best = Some(hit);
            return hit.t;
        }
        t_max
    }

    /// The hit, with `t` in units of the caller's direction; reports the work.
    #[inline(always)]
    pub(crate) fn hit(self, ray: &ScaledRay) -> Option<Hit> {
        if !PLAIN {
            self.visits.report(self.query);
        }
        self.best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
    }
}

impl<const PLAIN: bool> HitSink for BestHit<'_, PLAIN> {
    const ORDERED: bool = true;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &[[f32; 3]; 3], t_max: f32) -> f32 {
        self.take_hit(ray, hit, t_max)
    }

    #[inline(always)]
    fn visits(&mut self) -> Option<&mut Visits> {
        if PLAIN { None } else { Some(&mut self.visits) }
    }
}

/// Whether a query accepts any hit; where `PLAIN`, it accepts all and counts nothing.
pub(crate) struct AnyHit<'a, const PLAIN: bool> {
    query: &'a mut dyn Query,
    /// Whether the query may reject a hit.
    may_reject: bool,
    found: bool,
    pub(crate) visits: Visits,
}

impl<'a, const PLAIN: bool> AnyHit<'a, PLAIN> {
    #[inline(always)]
    pub(crate) fn new(query: &'a mut dyn Query) -> Self {
        let may_reject = !PLAIN && query.may_reject();
        Self { query, may_reject, found: false, visits: Visits::default() }
    }

    /// Takes a hit on any primitive.
    #[inline(always)]
    pub(crate) fn take_hit(&mut self, ray: &ScaledRay, hit: Hit, t_max: f32) -> f32 {
        self.found = PLAIN || self.query.accepts(&Hit { t: ray.caller_t(hit.t), ..hit });
        if self.found { -1.0 } else { t_max }
    }

    /// Whether a hit was found; reports the work.
    #[inline(always)]
    pub(crate) fn found(self) -> bool {
        if !PLAIN {
            self.visits.report(self.query);
        }
        self.found
    }
}

impl<const PLAIN: bool> HitSink for AnyHit<'_, PLAIN> {
    const ORDERED: bool = false;
    const ANY: bool = PLAIN;

    #[inline(always)]
    fn takes_any(&self) -> bool {
        !self.may_reject
    }

    #[inline(always)]
    fn take_any(&mut self) -> f32 {
        self.found = true;
        -1.0
    }

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &[[f32; 3]; 3], t_max: f32) -> f32 {
        self.take_hit(ray, hit, t_max)
    }

    #[inline(always)]
    fn visits(&mut self) -> Option<&mut Visits> {
        if PLAIN { None } else { Some(&mut self.visits) }
    }
}

/// Appends all hits that a query accepts, in traversal order, `t` scaled.
pub(crate) struct AllHits<'a> {
    query: &'a mut dyn Query,
    /// Whether the query may reject a hit.
    pub(crate) may_reject: bool,
    hits: &'a mut Vec<Hit>,
    /// Where those of this ray start.
    first: usize,
    pub(crate) visits: Visits,
}

impl<'a> AllHits<'a> {
    #[inline(always)]
    pub(crate) fn new(query: &'a mut dyn Query, hits: &'a mut Vec<Hit>) -> Self {
        let (first, may_reject) = (hits.len(), query.may_reject());
        Self { query, may_reject, hits, first, visits: Visits::default() }
    }

    /// Takes a hit on any primitive.
    #[inline(always)]
    pub(crate) fn take_hit(&mut self, ray: &ScaledRay, hit: Hit, t_max: f32) -> f32 {
        if !self.may_reject || self.query.accepts(&Hit { t: ray.caller_t(hit.t), ..hit }) {
            self.hits.push(hit);
        }
        t_max
    }

    /// Puts the hits in order; reports the work.
    #[inline(always)]
    pub(crate) fn finish(self, ray: &ScaledRay) {
        self.visits.report(self.query);
        sort_from(self.hits, self.first);
        to_caller(ray, &mut self.hits[self.first..]);
    }
}

impl HitSink for AllHits<'_> {
    const ORDERED: bool = false;
    const ALL: bool = true;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, _: &[[f32; 3]; 3], t_max: f32) -> f32 {
        self.take_hit(ray, hit, t_max)
    }

    #[inline(always)]
    fn visits(&mut self) -> Option<&mut Visits> {
        Some(&mut self.visits)
    }
}

/// Sorts the hits from `first` on, which are those of one ray, and removes duplicates.
#[inline(always)]
pub(crate) fn sort_from(hits: &mut Vec<Hit>, first: usize) {
    let own = &mut hits[first..];
    if own.len() < 2 {
        return;
    }
    own.sort_unstable_by_key(key);
    // Where a primitive has two references, both give the same bits.
    let mut kept = 1;
    for i in 1..own.len() {
        if key(&own[i]) != key(&own[kept - 1]) {
            own[kept] = own[i];
            kept += 1;
        }
    }
    hits.truncate(first + kept);
}

/// Converts `t` of hits to units of the caller's direction.
#[inline(always)]
pub(crate) fn to_caller(ray: &ScaledRay, hits: &mut [Hit]) {
    hits.iter_mut().for_each(|hit| hit.t = ray.caller_t(hit.t));
}

/// Order of hits along a ray as an integer: `t`, then primitive. No `t` is negative, and adding zero makes -0.0 positive.
#[inline(always)]
fn key(hit: &Hit) -> u64 {
    u64::from((hit.t + 0.0).to_bits()) << 32 | u64::from(hit.primitive.0)
}

/// Order of hits along a ray: `t`, then primitive.
pub(crate) fn by_t(a: &Hit, b: &Hit) -> Ordering {
    key(a).cmp(&key(b))
}
