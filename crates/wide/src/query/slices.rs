//! Slices of rays through triangles: prepared eight at a time, and walked together where that is less work.
//!
//! Rays with directions of equal signs can walk in groups ([`RayGroup`]). Whether that is less work is counted, not timed: now and then the rays of
//! a group walk one by one, and what they visit is the most that the next groups may visit. Hits are the same either way.

use canted_trace::{Accept, AcceptAt, Answers, Hit, Query, Ray, ScaledRay};

use super::pass::{PADS, TriangleLeaves, pass_prepared};
use super::sink::{AllHits, AnyHit, BestHit, HitSink, Visits};
use crate::bvh::TriangleBvh;
use crate::leaf::hit;
use crate::node::HalfBlock;
use crate::simd::{Simd, Task};
use crate::traverse::{
    BLOCK, Blocks, Bundle, ENTRY, EightRays, GROUP, GroupLeaves, LeafRange, OVERHEAD, OneOfEight, RayGroup,
    RayTriangles, TracedRay, Visitor,
};

/// What a ray of a slice gets.
pub(super) trait SliceAnswer: Sized {
    /// Of a ray that cannot hit.
    const NONE: Self;

    type Sink<'a, const PLAIN: bool>: HitSink;

    fn sink<const PLAIN: bool>(query: &mut dyn Query) -> Self::Sink<'_, PLAIN>;

    /// The answer of a ray whose hits the sink has got.
    fn of<const PLAIN: bool>(sink: Self::Sink<'_, PLAIN>, ray: &ScaledRay) -> Self;

    /// The answer of a ray, and the work.
    fn counted(bvh: &TriangleBvh, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> (Self, Visits);
}

impl SliceAnswer for Option<Hit> {
    const NONE: Self = None;

    type Sink<'a, const PLAIN: bool> = BestHit<'a, PLAIN>;

    #[inline(always)]
    fn sink<const PLAIN: bool>(query: &mut dyn Query) -> BestHit<'_, PLAIN> {
        BestHit::new(query)
    }

    #[inline(always)]
    fn of<const PLAIN: bool>(sink: BestHit<'_, PLAIN>, ray: &ScaledRay) -> Self {
        sink.hit(ray)
    }

    fn counted(bvh: &TriangleBvh, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> (Self, Visits) {
        bvh.closest(ray, query, stack)
    }
}

impl SliceAnswer for bool {
    const NONE: Self = false;

    type Sink<'a, const PLAIN: bool> = AnyHit<'a, PLAIN>;

    #[inline(always)]
    fn sink<const PLAIN: bool>(query: &mut dyn Query) -> AnyHit<'_, PLAIN> {
        AnyHit::new(query)
    }

    #[inline(always)]
    fn of<const PLAIN: bool>(sink: AnyHit<'_, PLAIN>, _: &ScaledRay) -> Self {
        sink.found()
    }

    fn counted(bvh: &TriangleBvh, ray: &TracedRay, query: &mut dyn Query, stack: &mut [u64]) -> (Self, Visits) {
        bvh.any(ray, query, stack)
    }
}

/// Whether groups of a slice are tried.
fn may_group(bvh: &TriangleBvh, n_rays: usize) -> bool {
    n_rays >= FEWEST && !bvh.nodes.has_oriented
}

/// Entries of memory that a slice of this many rays needs.
pub(super) fn stack_len_of_slice(bvh: &TriangleBvh, n_rays: usize) -> usize {
    if may_group(bvh, n_rays) { ENTRY * bvh.nodes.stack_len() } else { bvh.nodes.stack_len() }
}

/// The answers for a slice of rays, of which the first has the index `first`, with the default triangle test; without `accept`, where
/// `PLAIN`.
pub(super) struct Slice<'a, const PLAIN: bool, A> {
    pub(super) bvh: &'a TriangleBvh,
    pub(super) rays: &'a [Ray],
    pub(super) first: usize,
    pub(super) accept: Option<&'a AcceptAt<'a>>,
    pub(super) answers: &'a mut [A],
    pub(super) stack: &'a mut [u64],
}

impl<const PLAIN: bool, A: SliceAnswer> Task for Slice<'_, PLAIN, A> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, rays, mut first, accept, answers, stack } = self;
        let mut eights = [EightRays::new(), EightRays::new()];
        let mut plan = Plan::new(may_group(bvh, rays.len()));
        let mut prepared = [None; GROUP];
        for (rays, answers) in rays.chunks(GROUP).zip(answers.chunks_mut(GROUP)) {
            let (low, high) = rays.split_at(rays.len().min(8));
            eights[0].prepare(simd, low, &bvh.frame, PADS);
            eights[1].prepare(simd, high, &bvh.frame, PADS);
            let mut way = if rays.len() == GROUP { plan.next() } else { Way::Alone };
            // Not in a closure, which might not be inlined where the instructions are enabled: four times slower.
            if let Way::Together(_) | Way::Missed = way {
                if let Some(group) = RayGroup::new(simd, &eights, &bvh.frame, PADS) {
                    if group.misses(simd, &bvh.nodes) {
                        for answer in answers {
                            *answer = A::NONE;
                        }
                        first += GROUP;
                        continue;
                    }
                    if let Way::Together(limit) = way {
                        let of = Group { bvh, eights: &eights, rays, first, accept, limit };
                        if let Some(work) = of.walk::<S, PLAIN, A>(simd, &group, &mut prepared, answers, stack) {
                            plan.has_walked(work);
                            first += GROUP;
                            continue;
                        }
                    }
                }
                way = Way::Counted;
            }
            if let Way::Counted = way {
                plan.has_counted(counted(bvh, &eights, rays, first, accept, answers, stack));
                first += GROUP;
                continue;
            }
            for ((eight, rays), answers) in eights.iter().zip(rays.chunks(8)).zip(answers.chunks_mut(8)) {
                for (i, (given, answer)) in rays.iter().zip(answers).enumerate() {
                    if !eight.can_hit(i) {
                        *answer = A::NONE;
                        continue;
                    }
                    let scaled = eight.scaled(i, given);
                    let mut filter = Accept(|hit: &Hit| accept.is_none_or(|accept| accept(first + i, given, hit)));
                    let mut sink = A::sink::<PLAIN>(&mut filter);
                    let ray = OneOfEight { rays: eight, i };
                    pass_prepared::<S, _, _, _, true>(simd, bvh, &scaled, (ray, ray), stack, &mut sink);
                    *answer = A::of(sink, &scaled);
                }
                first += rays.len();
            }
        }
    }
}

/// Answers the rays of a group one by one. Returns their work.
fn counted<A: SliceAnswer>(
    bvh: &TriangleBvh,
    eights: &[EightRays; 2],
    rays: &[Ray],
    first: usize,
    accept: Option<&AcceptAt<'_>>,
    answers: &mut [A],
    stack: &mut [u64],
) -> u32 {
    let mut work = 0;
    for (i, (given, answer)) in rays.iter().zip(answers).enumerate() {
        let Some(ray) = eights[i / 8].ray(i % 8, given) else {
            *answer = A::NONE;
            continue;
        };
        let mut filter = Accept(|hit: &Hit| accept.is_none_or(|accept| accept(first + i, given, hit)));
        let visits;
        (*answer, visits) = A::counted(bvh, &ray, &mut filter, stack);
        work += work_of(&visits);
    }
    work
}

/// How the next rays of a slice walk.
#[derive(Clone, Copy)]
enum Way {
    Alone,
    /// One by one, and their work is counted.
    Counted,
    /// As a group that gives up beyond this much work.
    Together(u32),
    /// Those before missed everything: counted, unless these do, too.
    Missed,
}

/// The work of a ray in tests of nodes.
fn work_of(visits: &Visits) -> u32 {
    visits.counts.nodes.iter().sum::<u64>() as u32 + BLOCK * visits.counts.blocks as u32
}

/// Fewest rays of a slice in which groups are tried: the first group is counted, and one that fails is a sixteenth of the work.
const FEWEST: usize = 16 * GROUP;

/// Groups between two that are counted, at first and where groups go on to save a quarter of the work.
const COUNTED: u32 = 32;
const COUNTED_RARELY: u32 = 256;

/// Groups that walk alone after the first failure, and at most: those that fail are about a sixteenth of the work of a short slice, and a 64th of that
/// of a long one.
const FIRST_PAUSE: u32 = 15;
const LONGEST_PAUSE: u32 = 63;

/// Groups that walk alone after rays that miss everything, before the next are counted.
const IDLE: u32 = 3;

/// Which rays of a slice walk together.
struct Plan {
    is_possible: bool,
    /// The work of a group whose rays walk one by one, as last counted.
    work_alone: u32,
    /// Groups since then.
    age: u32,
    /// The age at which the next one is counted.
    period: u32,
    /// The work of groups since then, and how many walked.
    together: [u64; 2],
    /// Groups that walk alone before one is tried again.
    waits: u32,
    /// How many after the next failure.
    pause: u32,
    /// Work that groups have saved, less that of groups that were given up.
    saved: i32,
}

impl Plan {
    fn new(is_possible: bool) -> Self {
        let [age, period] = [COUNTED; 2];
        Self { is_possible, work_alone: 0, age, period, together: [0; 2], waits: 0, pause: FIRST_PAUSE, saved: 0 }
    }

    #[inline(always)]
    fn next(&mut self) -> Way {
        if !self.is_possible {
            return Way::Alone;
        }
        self.age += 1;
        if self.waits > 0 {
            self.waits -= 1;
            return Way::Alone;
        }
        if self.age <= self.period && !self.is_idle() {
            return Way::Together(self.work_alone);
        }
        self.age = 0;
        if self.is_idle() { Way::Missed } else { Way::Counted }
    }

    /// A group has walked together, with this much work.
    #[inline(always)]
    fn has_walked(&mut self, work: u32) {
        let [sum, n] = self.together;
        self.together = [sum + u64::from(work), n + 1];
        // The last leaf may have exceeded the limit.
        self.saved = (self.saved + self.work_alone as i32 - work as i32).min(4 * self.work_alone as i32);
        if self.saved >= self.work_alone as i32 {
            self.pause = 1;
        }
        self.wait_after_losses();
    }

    /// The rays of a group have walked alone, with this much work; if it was tried before, it would have been more together unless it is more
    /// than the limit.
    #[inline(always)]
    fn has_counted(&mut self, work: u32) {
        let [sum, n] = self.together;
        let saves = sum * 4 <= u64::from(work) * n * 3;
        self.period = if n > 0 && saves { (2 * self.period).min(COUNTED_RARELY) } else { COUNTED };
        if self.age > 0 {
            self.period = COUNTED;
            self.saved -= 2 * self.work_alone.min(work) as i32;
            self.wait_after_losses();
        }
        (self.work_alone, self.age, self.together) = (work, 0, [0; 2]);
        if self.is_idle() {
            self.waits = self.waits.max(IDLE);
        }
    }

    /// Whether rays miss everything, which takes less than any group.
    #[inline(always)]
    fn is_idle(&self) -> bool {
        self.work_alone <= OVERHEAD
    }

    #[inline(always)]
    fn wait_after_losses(&mut self) {
        if self.saved < 0 {
            self.saved = 0;
            self.waits = self.pause;
            self.pause = (2 * self.pause + 1).min(LONGEST_PAUSE);
        }
    }
}

/// Rays that walk together.
struct Group<'a> {
    bvh: &'a TriangleBvh,
    eights: &'a [EightRays; 2],
    rays: &'a [Ray],
    first: usize,
    accept: Option<&'a AcceptAt<'a>>,
    /// The work beyond which it is given up.
    limit: u32,
}

impl Group<'_> {
    /// The work; `None`, and no answers, where the group was given up.
    #[inline(always)]
    fn walk<S: Simd, const PLAIN: bool, A: SliceAnswer>(
        &self,
        simd: S,
        group: &RayGroup<'_, S>,
        prepared: &mut [Option<RayTriangles<S>>; GROUP],
        answers: &mut [A],
        stack: &mut [u64],
    ) -> Option<u32> {
        let &Self { bvh, eights, rays, first, accept, limit } = self;
        let mut filters: [_; GROUP] = std::array::from_fn(|i| {
            Accept(move |hit: &Hit| accept.is_none_or(|accept| accept(first + i, &rays[i], hit)))
        });
        let sinks = filters.each_mut().map(|filter| A::sink::<PLAIN>(filter));
        let scaled: [ScaledRay; GROUP] = std::array::from_fn(|i| eights[i / 8].scaled(i, &rays[i]));
        let mut t_max = [eights[0].t_max(), eights[1].t_max()];
        let halves = &bvh.leaves.halves;
        let bundle = Bundle::new(simd, eights);
        prepared.fill(None);
        let mut leaves = LeavesOfGroup { simd, halves, eights, scaled: &scaled, bundle, prepared, sinks };
        let work = if A::Sink::<'_, PLAIN>::ORDERED {
            group.walk::<true>(simd, &bvh.nodes, &mut t_max, stack, &mut leaves, limit)
        } else {
            group.walk::<false>(simd, &bvh.nodes, &mut t_max, stack, &mut leaves, limit)
        };
        let work = work?;
        for ((answer, sink), ray) in answers.iter_mut().zip(leaves.sinks).zip(&scaled) {
            *answer = A::of(sink, ray);
        }
        Some(work)
    }
}

/// Tests the triangles of each leaf that a ray of a group enters.
struct LeavesOfGroup<'a, S: Simd, T> {
    simd: S,
    halves: &'a [HalfBlock],
    eights: &'a [EightRays; 2],
    scaled: &'a [ScaledRay; GROUP],
    bundle: Option<Bundle<S>>,
    /// Those that have entered a leaf without most of the others.
    prepared: &'a mut [Option<RayTriangles<S>>; GROUP],
    sinks: [T; GROUP],
}

impl<S: Simd, T: HitSink> GroupLeaves for LeavesOfGroup<'_, S, T> {
    #[inline(always)]
    fn leaf(&mut self, i: usize, leaf: LeafRange) -> f32 {
        let &mut Self { simd, halves, eights, scaled, ref mut prepared, ref mut sinks, .. } = self;
        let ray = OneOfEight { rays: &eights[i / 8], i: i % 8 };
        let (scaled, prepared, sink) = (&scaled[i], &mut prepared[i], &mut sinks[i]);
        TriangleLeaves::<S, _, _, true> { simd, halves, scaled, ray, prepared, sink }.leaf(leaf)
    }

    #[inline(always)]
    fn can_test_together(&self) -> bool {
        self.bundle.is_some()
    }

    #[inline(always)]
    fn leaf_together(&mut self, mut rays: u32, (first, n): (u32, u32), t_max: &mut [[f32; 8]; 2]) -> (u32, bool) {
        let Self { simd, halves, scaled, sinks, .. } = self;
        let simd = *simd;
        let (mut work, mut has_hit) = (0, false);
        let Some(bundle) = &self.bundle else { return (work, has_hit) };
        for (block, filled) in Blocks::new(halves, first, n) {
            work += BLOCK;
            let mut triangles = bundle.may_hit(simd, &block) & filled;
            while triangles != 0 {
                let triangle = triangles.trailing_zeros() as usize;
                triangles &= triangles - 1;
                let vertices = block.vertices(triangle);
                for half in 0..2 {
                    let entered = rays >> (8 * half) & 0xff;
                    if entered == 0 {
                        continue;
                    }
                    work += BLOCK;
                    let t_max = &mut t_max[half];
                    let found = if T::ANY {
                        bundle.candidates::<true>(simd, half, &vertices, t_max)
                    } else {
                        bundle.candidates::<false>(simd, half, &vertices, t_max)
                    };
                    let mut mask = found.mask & entered;
                    has_hit |= mask != 0;
                    while mask != 0 {
                        let lane = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        let i = 8 * half + lane;
                        let (ray, sink) = (&scaled[i], &mut sinks[i]);
                        if T::ANY && found.sure >> lane & 1 == 1 {
                            t_max[lane] = sink.take_any();
                        } else if let Some(of) = bundle.hit(simd, &found, (lane, ray), t_max[lane]) {
                            let of = hit(of.t, [of.u, of.v], of.side, block.primitive(triangle));
                            t_max[lane] = sink.take(ray, of, &vertices, t_max[lane]);
                        }
                        if t_max[lane] < 0.0 {
                            rays &= !(1 << i);
                        }
                    }
                }
            }
        }
        (work, has_hit)
    }
}

/// All hits of each ray of a slice, with the default triangle test.
pub(super) struct AllOfSlice<'a> {
    pub(super) bvh: &'a TriangleBvh,
    pub(super) rays: &'a [Ray],
    pub(super) first: usize,
    pub(super) accept: Option<&'a AcceptAt<'a>>,
    pub(super) answers: Answers<'a>,
    pub(super) stack: &'a mut [u64],
}

impl Task for AllOfSlice<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, rays, first, accept, mut answers, stack } = self;
        let mut eight = EightRays::new();
        for (i, given) in rays.iter().enumerate() {
            let lane = i % 8;
            if lane == 0 {
                eight.prepare(simd, &rays[i..rays.len().min(i + 8)], &bvh.frame, PADS);
            }
            let mut filter = Accept(|hit: &Hit| accept.is_none_or(|accept| accept(first + i, given, hit)));
            // Not in a function that `Answers::fill` calls: it might not be inlined where the instructions are enabled.
            let hits = match &mut answers {
                Answers::All(hits) => {
                    hits[i].clear();
                    &mut hits[i]
                }
                Answers::Lists(lists) => lists.next_ray(),
                Answers::Closest(_) | Answers::Occluded(_) => unreachable!("they have slices of their own"),
            };
            if eight.can_hit(lane) {
                let scaled = eight.scaled(lane, given);
                let mut all = AllHits::new(&mut filter, hits);
                all.may_reject = accept.is_some();
                let ray = OneOfEight { rays: &eight, i: lane };
                pass_prepared::<S, _, _, _, true>(simd, bvh, &scaled, (ray, ray), stack, &mut all);
                all.finish(&scaled);
            }
            if let Answers::Lists(lists) = &mut answers {
                lists.end_ray();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{Mesh, SplitMix64, displaced_icosphere, grid};
    use canted_trace::Intersect;

    use super::*;
    use crate::traverse::Pads;
    use crate::{Config, Preset, SimdPath};

    /// What walks of groups without a limit answer, and alone; `None` for rays that are no group.
    struct Both<'a> {
        bvh: &'a TriangleBvh,
        rays: &'a [Ray],
        accept: Option<&'a AcceptAt<'a>>,
        pads: Pads,
    }

    impl Both<'_> {
        /// Where the answers of groups differ from those of rays, the number of groups, and of those that miss the root.
        fn differences(&self) -> [usize; 3] {
            let accepts = |i: usize, hit: &Hit| self.accept.is_none_or(|accept| accept(i, &self.rays[i], hit));
            let alone = |i: usize| self.bvh.closest_hit_with(&self.rays[i], &mut Accept(|hit: &Hit| accepts(i, hit)));
            let occluded = |i: usize| self.bvh.occluded_with(&self.rays[i], &mut Accept(|hit: &Hit| accepts(i, hit)));
            let mut n = [0; 3];
            let (closest, any, n_missed) = self.bvh.path.run(self);
            n[2] = n_missed;
            for (i, hits) in closest.iter().enumerate().filter_map(|(i, hits)| Some((i, hits.as_ref()?))) {
                n[1] += 1;
                for (k, hit) in hits.iter().enumerate() {
                    n[0] += usize::from(bits(hit) != bits(&alone(GROUP * i + k)));
                }
            }
            for (i, found) in any.iter().enumerate().filter_map(|(i, found)| Some((i, found.as_ref()?))) {
                for (k, found) in found.iter().enumerate() {
                    n[0] += usize::from(*found != occluded(GROUP * i + k));
                }
            }
            n
        }
    }

    type Answered<A> = Vec<Option<[A; GROUP]>>;

    impl Task for &Both<'_> {
        type Output = (Answered<Option<Hit>>, Answered<bool>, usize);

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> Self::Output {
            let &Both { bvh, rays, accept, pads } = self;
            let mut eights = [EightRays::new(), EightRays::new()];
            let mut stack = vec![0; ENTRY * bvh.nodes.stack_len()];
            let mut prepared = [None; GROUP];
            let (mut closest, mut any, mut n_missed) = (vec![], vec![], 0);
            for (i, rays) in rays.chunks_exact(GROUP).enumerate() {
                eights[0].prepare(simd, &rays[..8], &bvh.frame, PADS);
                eights[1].prepare(simd, &rays[8..], &bvh.frame, PADS);
                let of = Group { bvh, eights: &eights, rays, first: GROUP * i, accept, limit: u32::MAX };
                let (mut hits, mut found) = ([None; GROUP], [false; GROUP]);
                let group = RayGroup::new(simd, &eights, &bvh.frame, pads);
                closest.push(group.as_ref().map(|group| {
                    of.walk::<S, false, _>(simd, group, &mut prepared, &mut hits, &mut stack)
                        .expect("there is no limit");
                    hits
                }));
                any.push(group.as_ref().map(|group| {
                    let work = match accept {
                        None => of.walk::<S, true, _>(simd, group, &mut prepared, &mut found, &mut stack),
                        Some(_) => of.walk::<S, false, _>(simd, group, &mut prepared, &mut found, &mut stack),
                    };
                    work.expect("there is no limit");
                    found
                }));
                if group.is_some_and(|group| group.misses(simd, &bvh.nodes)) {
                    n_missed += 1;
                    assert_eq!(any[i], Some([false; GROUP]));
                }
            }
            (closest, any, n_missed)
        }
    }

    fn bits(hit: &Option<Hit>) -> Option<[u32; 4]> {
        hit.map(|hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive.0])
    }

    /// Groups of rays that start near a point and go about one way: `spread` apart at both ends, some along axes, some with an interval.
    fn bundles(mesh: &Mesh, rng: &mut SplitMix64, n_groups: usize) -> Vec<Ray> {
        let (center, size) = (mesh.center(), mesh.diagonal());
        let mut rays = vec![];
        for group in 0..n_groups {
            let spread = size * [0.0, 1e-6, 1e-3, 0.3][group % 4];
            let far = [0.7, 3.0, 100.0, 1e5][group / 4 % 4];
            let (from, to) = (rng.on_sphere(), rng.signed3());
            let axis = rng.below(9);
            for _ in 0..GROUP {
                let (a, b) = (rng.signed3(), rng.signed3());
                let start: [f64; 3] = [0, 1, 2].map(|k| center[k] + far * size * from[k] + spread * a[k]);
                let end: [f64; 3] = [0, 1, 2].map(|k| center[k] + 0.4 * size * to[k] + spread * b[k]);
                let mut direction = [0, 1, 2].map(|k| (end[k] - start[k]) as f32);
                if axis < 3 {
                    direction[axis] = -0.0;
                }
                let origin = start.map(|x| x as f32);
                let t_max = if rng.below(4) == 0 { rng.unit() as f32 } else { f32::INFINITY };
                let t_min = if rng.below(3) == 0 { 0.9 * t_max.min(1.0) * rng.unit() as f32 } else { 0.0 };
                rays.push(Ray::new(origin, direction).between(t_min, t_max));
            }
        }
        rays
    }

    fn meshes() -> Vec<Mesh> {
        let sphere = displaced_icosphere(3, 4);
        let far = sphere.placed(|[x, y, z]| [x + 1e7, y - 2e6, z]);
        let mirrored = sphere.placed(|[x, y, z]| [-1e-3 * x, 1e-3 * z, 2e-3 * y]);
        let twice = sphere.joined(&sphere);
        let rooms = tiles().off_axis();
        let far_rooms = rooms.placed(|[x, y, z]| [x + 1e6, y - 2e5, z]);
        vec![grid(5, [40, 40]), sphere.off_axis(), sphere, far, mirrored, twice, rooms, far_rooms]
    }

    /// Squares in the planes of the axes, which are aligned with a frame of the mesh when they are turned.
    fn tiles() -> Mesh {
        let mut mesh = Mesh { positions: vec![], triangles: vec![] };
        for i in 0..600_u32 {
            let [a, b, c] = [i % 10, i / 10 % 10, i / 100].map(|x| x as f32);
            let first = mesh.positions.len() as u32;
            let k = i as usize % 3;
            for [u, v] in [[0.0, 0.0], [0.9, 0.0], [0.9, 0.9], [0.0, 0.9_f32]] {
                let mut p = [a, b, c];
                p[(k + 1) % 3] += u;
                p[(k + 2) % 3] += v;
                mesh.positions.push(p);
            }
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        mesh
    }

    fn built(mesh: &Mesh) -> TriangleBvh {
        let config = Config { oriented: false, ..Config::from(Preset::Balanced) };
        TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap()
    }

    #[test]
    fn groups_have_the_hits_of_their_rays() {
        let mut rng = SplitMix64::new(16);
        let (mut n_groups, mut n_rotated, mut n_all_missed) = (0, 0, 0);
        for (m, mesh) in meshes().iter().enumerate() {
            let bvh = built(mesh);
            n_rotated += usize::from(!bvh.frame.is_identity);
            let rays = bundles(mesh, &mut rng, 160);
            let odd = |i: usize, _: &Ray, hit: &Hit| !(i + hit.primitive.index()).is_multiple_of(3);
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let bvh = bvh.clone().with_path(path);
                for accept in [None, Some(&odd as &AcceptAt)] {
                    let both = Both { bvh: &bvh, rays: &rays, accept, pads: PADS };
                    let [n_wrong, n, n_missed] = both.differences();
                    assert_eq!(n_wrong, 0, "mesh {m}, {}", path.name());
                    n_groups += n;
                    n_all_missed += n_missed;
                }
            }
        }
        assert!(n_groups > 1000 && n_rotated > 1, "{n_groups} groups, {n_rotated} rotated frames");
        assert!(n_all_missed > 20 && n_all_missed < n_groups / 2, "{n_all_missed} groups that miss everything");
    }

    /// Slices in which groups walk together, are given up and are none, with answers of others in the memory for theirs.
    #[test]
    fn slices_have_the_hits_of_their_rays() {
        let mut rng = SplitMix64::new(18);
        for (m, mesh) in meshes().iter().enumerate() {
            let bvh = built(mesh);
            let mut rays = bundles(mesh, &mut rng, 600);
            for i in (0..rays.len() - 2).step_by(331) {
                rays[i].mask = 0;
                rays[i + 1].direction = [f32::NAN; 3];
                rays[i + 2].direction = rays[i + 2].direction.map(|x| 1e-37 * x);
            }
            let wrong = bvh.closest_hit(&rays[7]);
            let accept = |i: usize, _: &Ray, hit: &Hit| !(i + hit.primitive.index()).is_multiple_of(3);
            let (mut plain, mut filtered) = (vec![wrong; rays.len()], vec![wrong; rays.len()]);
            let (mut any, mut any_filtered) = (vec![true; rays.len()], vec![true; rays.len()]);
            bvh.closest_hits(&rays, &mut plain);
            bvh.closest_hits_with(&rays, &mut filtered, &accept);
            bvh.occluded_many(&rays, &mut any);
            bvh.occluded_many_with(&rays, &mut any_filtered, &accept);
            for (i, ray) in rays.iter().enumerate() {
                let mut by = Accept(|hit: &Hit| accept(i, ray, hit));
                let filtered_alone = bvh.closest_hit_with(ray, &mut by);
                assert_eq!(bits(&plain[i]), bits(&bvh.closest_hit(ray)), "mesh {m}, ray {i}");
                assert_eq!(bits(&filtered[i]), bits(&filtered_alone), "mesh {m}, ray {i}");
                assert_eq!(any[i], plain[i].is_some(), "mesh {m}, ray {i}");
                assert_eq!(any_filtered[i], filtered_alone.is_some(), "mesh {m}, ray {i}");
            }
        }
    }

    /// The rays of a group that starts far away reach boxes with roundings of their origins, which the group must allow for.
    #[test]
    fn groups_without_pads_lose_hits() {
        let mut rng = SplitMix64::new(17);
        let none = Pads { aligned: 0.0, rotated: 0.0, oriented: 0.0 };
        for mesh in [grid(5, [40, 40]), tiles().off_axis()] {
            let bvh = built(&mesh);
            let rays = bundles(&mesh, &mut rng, 6000);
            let lost = |pads| Both { bvh: &bvh, rays: &rays, accept: None, pads }.differences()[0];
            assert_eq!(lost(PADS), 0);
            assert!(lost(none) > 0, "{}", bvh.frame.is_identity);
        }
    }

    /// Of groups whose rays take this much work alone and, together, that much: how many walk together, and the work that is added.
    fn planned(groups: impl Iterator<Item = [u32; 2]>) -> [u32; 2] {
        let mut plan = Plan::new(true);
        let [mut n, mut lost] = [0, 0];
        for [alone, together] in groups {
            match plan.next() {
                Way::Alone => {}
                Way::Missed if alone <= OVERHEAD => {}
                Way::Missed => plan.has_counted(alone),
                Way::Counted => plan.has_counted(alone),
                Way::Together(limit) if together <= limit => {
                    n += 1;
                    lost += together.saturating_sub(alone);
                    plan.has_walked(together);
                }
                Way::Together(limit) => {
                    lost += limit;
                    plan.has_counted(alone);
                }
            }
        }
        [n, lost]
    }

    #[test]
    fn groups_are_tried_where_they_save_work() {
        let n = 10_000;
        let (good, bad) = ([100, 50], [100, 400]);
        assert!(planned((0..n).map(|_| good))[0] > n * 99 / 100);
        // Rows of pixels that miss the object, of which no group is less work, and across it.
        let rows = (0..n).map(|i| if i / 64 % 2 == 0 { [16, 25] } else { [300, 60] });
        assert!(planned(rows)[0] > n * 9 / 20);
        let mixed = (0..n).map(|i| if i % 3 == 0 { good } else { bad });
        assert!(planned(mixed)[1] < 100 * n / 16);
        let worse = (0..n).map(|i| if i < n / 2 { [300, 60] } else { [30, 60] });
        assert!(planned(worse)[1] <= 30 * (n / 2) / 12);
        for n in [16, 64, 10_000] {
            let [n_together, lost] = planned((0..n).map(|_| bad));
            assert!(n_together == 0 && lost <= 100 * n / 12, "{lost} of {n}");
        }
        // All in one leaf, which no limit stops.
        assert!(planned((0..n).map(|_| [48, 47]))[1] == 0);
        let mut plan = Plan::new(true);
        plan.has_counted(48);
        plan.age = 1;
        (0..10).for_each(|_| plan.has_walked(58));
        assert!(plan.waits > 0 && plan.saved >= 0);
    }
}
