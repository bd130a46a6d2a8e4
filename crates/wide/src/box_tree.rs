use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Query, ScaledRay};

use crate::collapse::{Areas, Plan};
use crate::emit::{Numbers, Records, Source, TooLarge, emit_as};
use crate::layout::{Limits, NodeKind};
use crate::simd::{Simd, Task};
use crate::traverse::{MeshFrame, Pads, RayLanes, Stack, Visit, walk};
use crate::{Config, Costs, PrimitiveError, SimdPath, binary, measure};

/// A tree of eight-wide nodes over boxes along the axes; what stands in a box, the caller knows.
///
/// An outer level, whose boxes are entered and not hit: instances, other trees, volumes.
///
/// ```
/// use canted_obb::Aabb;
/// use canted_trace::{Ray, ScaledRay};
/// use canted_wide::{BoxTree, Config};
///
/// let boxes: Vec<Aabb> = [9.0, 0.0, 6.0, 3.0].map(|x| Aabb { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] }).into();
/// let tree = BoxTree::build(&boxes, &Config::default())?;
/// let ray = ScaledRay::new(&Ray::new([2.0, 0.5, 0.5], [1.0, 0.0, 0.0])).expect("a ray");
/// let mut entered = vec![];
/// tree.traverse_ordered(&ray, 0.0, &mut (), |number, t_max, _| {
///     entered.push(number.0);
///     // Something at 4.5 in the second box hides the last.
///     if number.0 == 2 { 4.5 } else { t_max }
/// });
/// assert_eq!(entered, [3, 2]);
/// # Ok::<(), canted_wide::PrimitiveError>(())
/// ```
#[derive(Clone, Debug)]
pub struct BoxTree {
    pub(crate) records: Records,
    bounds: Aabb,
    /// What leaves hold.
    pub(crate) numbers: Vec<PrimId>,
    pub(crate) path: SimdPath,
}

impl BoxTree {
    /// Builds a tree with a box a leaf; `config` says which binary tree is collapsed and what visits cost, its leaning and
    /// turning do not matter.
    ///
    /// # Errors
    /// More than [`MAX_PRIMITIVES`](crate::MAX_PRIMITIVES) boxes, before any is looked at, or so many that their tree is too large; the
    /// first box that is empty or not finite.
    pub fn build(boxes: &[Aabb], config: &Config) -> Result<Self, PrimitiveError> {
        Self::build_within(&Limits::OF_WORDS, boxes, 1, config)
    }

    /// Builds a tree with at most `max_leaf` boxes a leaf, where words can name no more than this.
    pub(crate) fn build_within(
        limits: &Limits,
        boxes: &[Aabb],
        max_leaf: usize,
        config: &Config,
    ) -> Result<Self, PrimitiveError> {
        check_number(boxes.len(), limits)?;
        let too_many = PrimitiveError::TooMany { n_primitives: boxes.len() };
        if let Some((_, primitive)) = boxes.iter().zip((0..).map(PrimId)).find(|(aabb, _)| !is_sound(aabb)) {
            return Err(PrimitiveError::Bounds { primitive });
        }
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
        let config = Config { oriented: false, ..*config }.usable();
        let costs = Costs { max_leaf: config.costs.max_leaf.min(max_leaf), ..config.costs };
        let (records, numbers) =
            emit(boxes, &bounds, &Config { costs, ..config }, limits).map_err(|TooLarge| too_many)?;
        Ok(Self { records, bounds, numbers, path: SimdPath::detect() })
    }

    /// The same tree walked on another path; on the scalar one where this machine lacks it.
    #[must_use]
    pub fn with_path(mut self, path: SimdPath) -> Self {
        self.path = if path.is_available() { path } else { SimdPath::Scalar };
        self
    }

    /// Box around all boxes; empty for none.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.bounds
    }

    /// Memory of nodes and numbers.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(&self.records.lines[..]) + size_of_val(&self.numbers[..])
    }

    /// Greatest coordinate of any box.
    #[inline(always)]
    pub(crate) fn reach(&self) -> f32 {
        if self.numbers.is_empty() { 0.0 } else { self.bounds.reach() }
    }

    /// Calls `enter` with the number of each box that `ray` enters at or before `t_max`, nearer subtrees first.
    ///
    /// `enter` is given the scaled `t_max` and returns the new one; below zero ends the walk. A box is entered no later than any
    /// hit that lies within `error` of it in each coordinate, in units of the space, and while that is `<= t_max`: so ties
    /// are met, whatever the tree.
    pub fn traverse_ordered<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        enter: impl FnMut(PrimId, f32, &mut Q) -> f32,
    ) {
        self.path.run(Entering::<_, _, true> { tree: self, ray, error, query, enter });
    }

    /// As [`BoxTree::traverse_ordered`], in any order: for whoever ends the walk at the first hit.
    pub fn traverse_any<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        enter: impl FnMut(PrimId, f32, &mut Q) -> f32,
    ) {
        self.path.run(Entering::<_, _, false> { tree: self, ray, error, query, enter });
    }
}

/// More boxes than leaves can name are told before the work.
pub(crate) fn check_number(n_primitives: usize, limits: &Limits) -> Result<(), PrimitiveError> {
    if n_primitives > limits.n_parts { Err(PrimitiveError::TooMany { n_primitives }) } else { Ok(()) }
}

fn is_sound(aabb: &Aabb) -> bool {
    (0..3).all(|k| aabb.min[k] <= aabb.max[k]) && aabb.is_finite()
}

/// Box nodes over boxes, and the number of each place in leaf order.
fn emit(boxes: &[Aabb], bounds: &Aabb, config: &Config, limits: &Limits) -> Result<(Records, Vec<PrimId>), TooLarge> {
    let (tree, aligned) = binary::over_boxes(boxes, measure::unit_scale(bounds), config);
    let areas = |area: f32| Areas::new(area, f32::MAX);
    let inner: Vec<Areas> = aligned.inner_areas.iter().map(|&area| areas(area)).collect();
    let leaf = |place: u32| areas(aligned.leaf_areas[place as usize]);
    let plan = Plan::new(&tree, &inner, &leaf, &config.costs, false);
    let source = Source {
        tree: &tree,
        corners: &[],
        primitives: &tree.leaves,
        leaf_boxes: &aligned.leaf_boxes,
        inner_boxes: &aligned.inner_boxes,
        frames: &|_| Obb::IDENTITY_FRAME,
    };
    emit_as::<Numbers>(&source, &plan, limits)
}

/// One ray through one tree.
struct Entering<'a, Q, F, const ORDERED: bool> {
    tree: &'a BoxTree,
    ray: &'a ScaledRay,
    error: f64,
    query: &'a mut Q,
    enter: F,
}

impl<Q: Query, F: FnMut(PrimId, f32, &mut Q) -> f32, const ORDERED: bool> Task for Entering<'_, Q, F, ORDERED> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { tree, ray, error, query, enter } = self;
        let BoxTree { records, numbers, .. } = tree;
        let pads = Pads::within(error, ray, tree.reach());
        let lanes = RayLanes::new(simd, ray, &MeshFrame::IDENTITY, &pads);
        let stack = &mut Stack::new(records.depth);
        let visit = &mut Entered { numbers, query, enter };
        walk::<S, ORDERED>(simd, &records.lines, records.root, &lanes, ray.t_max, stack, visit);
    }
}

/// Hands boxes over.
struct Entered<'a, Q, F> {
    numbers: &'a [PrimId],
    query: &'a mut Q,
    enter: F,
}

impl<Q: Query, F: FnMut(PrimId, f32, &mut Q) -> f32> Visit for Entered<'_, Q, F> {
    #[inline(always)]
    fn leaf(&mut self, first: u32, n: u32, mut t_max: f32) -> f32 {
        for &number in &self.numbers[first as usize..(first + n) as usize] {
            t_max = (self.enter)(number, t_max, self.query);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {
        self.query.boxes(8);
    }
}
