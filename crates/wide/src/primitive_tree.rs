use std::fmt;

use canted_obb::{Aabb, PrimId};
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};

use crate::answers::{AllOfOne, Any, Closest, Every, Occluded, One, parallel, serial};
use crate::box_tree::check_number;
use crate::emit::Records;
use crate::layout::Limits;
use crate::simd::Simd;
use crate::traced::{HitSink, Leaf, Traced, hit};
use crate::traverse::{MeshFrame, Pads};
use crate::{BoxTree, Config, Primitive, SimdPath, par};

/// Most primitives of a leaf: their own tests run one by one, eight boxes at once.
const MAX_LEAF: usize = 2;

/// Primitives of one job.
const CHUNK: usize = 1 << 12;

/// A tree of eight-wide nodes over primitives of the caller's.
///
/// Boxes stand along the axes. Hits are those of trying every primitive; ties go to the lowest.
///
/// ```
/// use canted_trace::{Ray, Sphere};
/// use canted_wide::{Config, PrimitiveTree};
///
/// let spheres = (0..100u8).map(|i| Sphere { center: [3.0 * f32::from(i), 0.0, 0.0], radius: 1.0 }).collect();
/// let tree = PrimitiveTree::build(spheres, &Config::default())?;
/// let hit = tree.closest_hit(&Ray::new([30.0, 5.0, 0.0], [0.0, -1.0, 0.0])).expect("it points at a sphere");
/// assert_eq!((hit.t, hit.primitive.0), (4.0, 10));
/// # Ok::<(), canted_wide::PrimitiveError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PrimitiveTree<P> {
    boxes: BoxTree,
    primitives: Vec<P>,
}

/// Why primitives make no tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrimitiveError {
    /// Bounds are empty or not finite.
    Bounds {
        /// The primitive.
        primitive: PrimId,
    },
    /// More primitives than a tree can name.
    TooMany {
        /// Number of primitives.
        n_primitives: usize,
    },
}

impl fmt::Display for PrimitiveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bounds { primitive } => write!(f, "primitive {primitive} has bounds that are empty or not finite"),
            Self::TooMany { n_primitives } => write!(f, "{n_primitives} primitives are more than a tree can hold"),
        }
    }
}

impl std::error::Error for PrimitiveError {}

impl<P: Primitive> PrimitiveTree<P> {
    /// Builds a tree; `config` says which binary tree is collapsed and what visits cost, its leaning and turning do not
    /// matter.
    ///
    /// # Errors
    /// More than [`MAX_PRIMITIVES`](crate::MAX_PRIMITIVES), before any is asked for its bounds, or so many that their tree is too
    /// large; the first primitive whose bounds are empty or not finite.
    pub fn build(primitives: Vec<P>, config: &Config) -> Result<Self, PrimitiveError> {
        let limits = &Limits::OF_WORDS;
        check_number(primitives.len(), limits)?;
        let boxes = par::map(&primitives, CHUNK, Aabb::EMPTY, P::bounds);
        Ok(Self { boxes: BoxTree::build_within(limits, &boxes, MAX_LEAF, config)?, primitives })
    }

    /// The same tree traced on another path; on the scalar one where this machine lacks it.
    #[must_use]
    pub fn with_path(mut self, path: SimdPath) -> Self {
        self.boxes = self.boxes.with_path(path);
        self
    }

    /// Box around all primitives, object space; empty for none.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.boxes.aabb()
    }

    /// The primitives, in the order in which they were given.
    #[must_use]
    pub fn primitives(&self) -> &[P] {
        &self.primitives
    }

    /// The hit of least `t`; ties go to the lowest primitive.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit_with(ray, InstanceId(0), &mut ())
    }

    /// Whether anything is hit: agrees with [`PrimitiveTree::closest_hit`].
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_with(ray, InstanceId(0), &mut ())
    }

    /// Every hit with `t_min <= t <= t_max`: least `t`, then lowest primitive. Replaces what `hits` held.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        self.boxes.path.run(AllOfOne { tree: self, ray, instance: InstanceId(0), query: &mut (), hits });
    }

    /// The hit of least `t` that the query accepts, as a hit on `instance`; ties go to the lowest primitive.
    pub fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.boxes.path.run(One::<_, _, true> { tree: self, ray, instance, query })
    }

    /// Whether the query accepts any hit.
    pub fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.boxes.path.run(One::<_, _, false> { tree: self, ray, instance, query }).is_some()
    }

    /// The closest hit of each ray. Panics, like all of the following, where the slices differ in length.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        serial(self.boxes.path, self, &Closest(Any), rays, hits);
    }

    /// The closest hit of each ray, on all threads.
    pub fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        parallel(self.boxes.path, self, &Closest(Any), rays, hits);
    }

    /// Whether each ray hits anything.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        serial(self.boxes.path, self, &Occluded(Any), rays, occluded);
    }

    /// Whether each ray hits anything, on all threads.
    pub fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        parallel(self.boxes.path, self, &Occluded(Any), rays, occluded);
    }

    /// Every hit of each ray.
    pub fn all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        serial(self.boxes.path, self, &Every(Any), rays, hits);
    }

    /// Every hit of each ray, on all threads.
    pub fn par_all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        parallel(self.boxes.path, self, &Every(Any), rays, hits);
    }
}

/// Leaves hold places among the primitives.
impl<P: Primitive> Traced for PrimitiveTree<P> {
    type Prepared<S: Simd> = ();
    type Met = P;

    #[inline(always)]
    fn records(&self) -> &Records {
        &self.boxes.records
    }

    #[inline(always)]
    fn frame(&self) -> &MeshFrame {
        &MeshFrame::IDENTITY
    }

    #[inline(always)]
    fn reach(&self) -> f32 {
        self.boxes.reach()
    }

    #[inline(always)]
    fn pads(&self) -> Pads {
        const {
            assert!(P::ERROR >= 0.0 && P::ERROR <= 0.125, "the proof of the pads holds for small errors");
            Pads::of(P::ERROR)
        }
    }

    #[inline(always)]
    fn prepare<S: Simd>(_: S, _: &ScaledRay) {}

    #[inline(always)]
    fn leaf<S: Simd, T: HitSink<P>>(&self, _: S, (): &(), ray: &ScaledRay, leaf: Leaf, take: &mut T) -> f32 {
        let Leaf { first, n, mut t_max } = leaf;
        let range = first as usize..(first + n) as usize;
        for &number in &self.boxes.numbers[range] {
            t_max = meet(&self.primitives[number.index()], number, *ray, t_max, take);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }
}

/// Hands over the hits on one primitive, one after another: the first may be refused.
#[inline(always)]
fn meet<P: Primitive, T: HitSink<P>>(
    primitive: &P,
    number: PrimId,
    mut ray: ScaledRay,
    mut t_max: f32,
    take: &mut T,
) -> f32 {
    while let Some(found) = primitive.intersect(&ray, t_max) {
        // A primitive that breaks its contract must not keep the walk from ending.
        if !(ray.t_min <= found.t && found.t <= t_max && found.t.is_finite()) {
            break;
        }
        t_max = take.take(&ray, hit(found.t, [found.u, found.v], found.side, number), primitive, t_max);
        ray.t_min = found.t.next_up();
        if ray.t_min > t_max {
            break;
        }
    }
    t_max
}
