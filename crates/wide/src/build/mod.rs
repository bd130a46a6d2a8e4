//! From primitives to records: a binary tree, frames, a collapse, positions, records.

pub(crate) mod binary;
mod collapse;
mod emit;
pub(crate) mod frames;
pub(crate) mod item;
pub(crate) mod layout;
pub(crate) mod subtrees;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tree_tests;

use std::fmt;
use std::ops::DerefMut;

use canted_lbvh::{self as lbvh, Child, ChildKind, Corners, GeometryError, Tree, stages::stage};
use canted_obb::{Aabb, Obb, PrimId};
use canted_sah::GroupConfig;
use canted_trace::ReferencePoint;

use crate::build::binary::{Chosen, Oriented};
use crate::build::collapse::{ALIGNED, Plan, PlanCosts, Table};
use crate::build::emit::{Leaves, emit, write_ids, write_triangles};
use crate::build::item::{Item, Items};
use crate::build::layout::{Source, TooLarge, layout};
use crate::build::subtrees::SubtreeReaches;
use crate::bvh::{PredictedCost, TriangleBvh, WideBvh};
use crate::config::{Baseline, Config, Costs};
use crate::leaf::{Blocks, LeafPrimitive, Placed, Primitive, Primitives, Shapes, is_filtered};
use crate::node::{HalfBlock, LeafLayout, Limits, NodeKind, Nodes, Records};
use crate::par;
use crate::simd::AvailablePath;
use crate::traverse::{BoxPads, MeshFrame, Pads};

/// Primitives of one job.
const CHUNK: usize = 1 << 12;

/// How much of the cost of a leaf of triangles one of balls has: their filter takes fewer branches. From 1/3 on fewer nodes save no more.
const BALLS_LEAF: f32 = 1.0 / 3.0;

/// Why no BVH can be built over primitives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrimitiveError {
    /// Bounds are empty or not finite.
    Bounds {
        /// The primitive.
        primitive: PrimId,
    },
    /// More primitives than a BVH can name.
    TooMany {
        /// Number of primitives.
        n_primitives: usize,
    },
}

impl fmt::Display for PrimitiveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bounds { primitive } => write!(f, "primitive {primitive} has bounds that are empty or not finite"),
            Self::TooMany { n_primitives } => write!(f, "{n_primitives} primitives are more than a BVH can hold"),
        }
    }
}

impl std::error::Error for PrimitiveError {}

impl TriangleBvh {
    /// Builds a BVH over triangles, with the default configuration.
    ///
    /// Vertices may have any type that converts into `[f32; 3]`, indices any integer type. They are not copied where they are `[f32; 3]`
    /// and `u32`. A flat list of indices is a list of triangles by `as_chunks::<3>().0`.
    ///
    /// ```
    /// use canted_wide::TriangleBvh;
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bvh = TriangleBvh::build(&positions, &[[0, 1, 2]])?;
    /// assert_eq!(bvh.n_primitives(), 1);
    ///
    /// let (vertices, indices) = (positions.map(glam::Vec3::from_array), vec![0_u16, 1, 2, 2, 1, 0]);
    /// assert_eq!(TriangleBvh::build(&vertices, indices.as_chunks::<3>().0)?.n_primitives(), 2);
    /// # Ok::<(), canted_lbvh::GeometryError>(())
    /// ```
    ///
    /// # Errors
    /// More than [`MAX_TRIANGLES`](crate::MAX_TRIANGLES), before any is read, or so many that the BVH is too large; the first
    /// triangle with an index out of range or a vertex that is not finite.
    pub fn build<V, I>(positions: &[V], triangles: &[[I; 3]]) -> Result<Self, GeometryError>
    where
        V: Into<[f32; 3]> + Copy + 'static,
        I: TryInto<u32> + Copy + 'static,
    {
        Self::build_with(positions, triangles, Config::default())
    }

    /// As [`TriangleBvh::build`], with a [`Preset`](crate::Preset) or a [`Config`].
    ///
    /// # Errors
    /// As [`TriangleBvh::build`].
    pub fn build_with<V, I>(
        positions: &[V],
        triangles: &[[I; 3]],
        config: impl Into<Config>,
    ) -> Result<Self, GeometryError>
    where
        V: Into<[f32; 3]> + Copy + 'static,
        I: TryInto<u32> + Copy + 'static,
    {
        let (positions, triangles) = (lbvh::as_positions(positions), lbvh::as_triangles(triangles));
        Ok(over_indexed(&Limits::OF_WORDS, &positions, &triangles, &config.into())?.into())
    }

    /// As [`TriangleBvh::build`], over triangles that have their vertices themselves: the same BVH as over any indexed form of them. In errors,
    /// vertex `3i + k` is vertex `k` of triangle `i`.
    ///
    /// # Errors
    /// As [`TriangleBvh::build`].
    pub fn build_flat(triangles: &[[[f32; 3]; 3]]) -> Result<Self, GeometryError> {
        Self::build(triangles.as_flattened(), &lbvh::flat_indices(triangles.len())?)
    }

    /// Collapses a binary tree of any builder; `corners` in input order and finite, `bounds` around them.
    ///
    /// # Errors
    /// Too many triangles, as for [`TriangleBvh::build`].
    pub fn from_tree(
        tree: &Tree,
        corners: &[Corners],
        bounds: &Aabb,
        config: impl Into<Config>,
    ) -> Result<Self, GeometryError> {
        Ok(over_tree(tree, None, corners, bounds, &config.into())?.into())
    }

    /// Collapses a binary tree whose leaves are parts of triangles, as [`canted_sah::spatial()`] makes it; a leaf names its triangle, of
    /// which it may hold a part only. `parts` are the boxes of the leaves, in leaf order; the boxes of a triangle together
    /// contain all of its points. [`TriangleBvh::refit`] replaces the parts by whole triangles; only then a file of the BVH can be loaded.
    ///
    /// ```
    /// use canted_lbvh::triangle_corners;
    /// use canted_sah::{SpatialConfig, spatial};
    /// use canted_wide::{Preset, TriangleBvh};
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let (corners, bounds) = triangle_corners(&positions, &[[0, 1, 2], [1, 2, 3]])?;
    /// let (mut tree, references) = spatial(&corners, &SpatialConfig::default());
    /// let parts: Vec<_> = tree.leaves.iter().map(|part| references.boxes[part.index()]).collect();
    /// tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
    /// let bvh = TriangleBvh::from_tree_of_parts(&tree, parts, &corners, &bounds, Preset::Balanced)?;
    /// assert_eq!(bvh.n_primitives(), 2);
    /// # Ok::<(), canted_lbvh::GeometryError>(())
    /// ```
    ///
    /// # Errors
    /// Too many triangles, as for [`TriangleBvh::build`].
    ///
    /// # Panics
    /// If `parts` and the leaves of the tree differ in number.
    pub fn from_tree_of_parts(
        tree: &Tree,
        parts: Vec<Aabb>,
        corners: &[Corners],
        bounds: &Aabb,
        config: impl Into<Config>,
    ) -> Result<Self, GeometryError> {
        assert_eq!(parts.len(), tree.leaves.len(), "each leaf has a box");
        Ok(over_tree(tree, Some(parts), corners, bounds, &config.into())?.into())
    }
}

impl<P: Primitive> WideBvh<P> {
    /// Builds a BVH over primitives of your own, with the default configuration.
    ///
    /// ```
    /// use canted_trace::Sphere;
    /// use canted_wide::WideBvh;
    ///
    /// let spheres = vec![Sphere { center: [0.0; 3], radius: 1.0 }, Sphere { center: [4.0, 0.0, 0.0], radius: 2.0 }];
    /// let bvh = WideBvh::over(spheres)?;
    /// assert_eq!(bvh.primitives()[1].radius, 2.0);
    /// # Ok::<(), canted_wide::PrimitiveError>(())
    /// ```
    ///
    /// # Errors
    /// More than [`MAX_PRIMITIVES`](crate::MAX_PRIMITIVES), before any is read, or so many that the BVH is too large; the first
    /// primitive whose bounds are empty or not finite.
    pub fn over(primitives: Vec<P>) -> Result<Self, PrimitiveError> {
        Self::over_with(primitives, Config::default())
    }

    /// As [`WideBvh::over`], with a [`Preset`](crate::Preset) or a [`Config`].
    ///
    /// # Errors
    /// As [`WideBvh::over`].
    pub fn over_with(primitives: Vec<P>, config: impl Into<Config>) -> Result<Self, PrimitiveError> {
        Self::over_within(&Limits::OF_WORDS, primitives, &config.into())
    }

    /// As [`WideBvh::over_with`], with smaller limits.
    pub(crate) fn over_within(limits: &Limits, primitives: Vec<P>, config: &Config) -> Result<Self, PrimitiveError> {
        if primitives.len() > limits.n_parts {
            return Err(PrimitiveError::TooMany { n_primitives: primitives.len() });
        }
        let boxes = boxes_of(&primitives)?;
        let Costs { max_leaf, leaf, block, .. } = config.costs;
        let leaf = if P::BALL.is_some() { BALLS_LEAF * leaf } else { leaf };
        let costs = Costs { max_leaf: max_leaf.min(P::MAX_LEAF), leaf, block: block * P::COST, ..config.costs };
        // Eight are filtered at once, so rays are as fast where groups are larger, which take half the time to build.
        let larger = |groups: GroupConfig| {
            let [max_group, max_run] = [groups.max_group, groups.max_run].map(|n| n.max(8));
            GroupConfig { max_group, max_run, ..groups }
        };
        let groups = if is_filtered::<P>() { config.groups.map(larger) } else { config.groups };
        let config = Config { costs, groups, ..*config }.usable();
        let reference = reference_of(&primitives);
        let built = over_primitives(&primitives, &boxes, reference, P::ERROR, &config, limits)?;
        Ok(built
            .with(|order| {
                let mut leaves = Shapes::new(order, primitives);
                leaves.sort();
                leaves
            })
            .into())
    }

    /// The primitives in input order. Their memory has the order of the leaves, until a single one is changed.
    #[must_use]
    pub fn primitives(&self) -> Vec<&P> {
        self.leaves.in_input_order()
    }
}

/// A BVH before it has what only traversal needs.
pub(crate) struct Built<L> {
    nodes: Nodes,
    leaves: L,
    frame: MeshFrame,
    bounds: Aabb,
    n_primitives: usize,
    predicted: PredictedCost,
    costs: Costs,
}

impl<L> Built<L> {
    /// The same with other leaves.
    fn with<M>(self, change: impl FnOnce(L) -> M) -> Built<M> {
        let Self { nodes, leaves, frame, bounds, n_primitives, predicted, costs } = self;
        Built { nodes, leaves: change(leaves), frame, bounds, n_primitives, predicted, costs }
    }
}

impl<P: LeafPrimitive> From<Built<P::Leaves>> for WideBvh<P> {
    fn from(built: Built<P::Leaves>) -> Self {
        let Built { nodes, leaves, frame, bounds, n_primitives, predicted, costs } = built;
        let (baseline, path) = (Baseline::new(costs), AvailablePath::detect());
        Self { nodes, leaves, frame, bounds, n_primitives, predicted, baseline, path }
    }
}

/// The bounds of each primitive.
///
/// # Errors
/// The first whose bounds are empty or not finite.
fn boxes_of(primitives: &dyn Primitives) -> Result<Vec<Aabb>, PrimitiveError> {
    let boxes = par::from_fn(primitives.n(), CHUNK, |i| primitives.at(i).bounds());
    match (0..).map(PrimId).zip(&boxes).find(|(_, aabb)| !is_valid(aabb)) {
        Some((primitive, _)) => Err(PrimitiveError::Bounds { primitive }),
        None => Ok(boxes),
    }
}

/// The box around all primitives.
///
/// # Errors
/// As [`boxes_of`].
pub(crate) fn bounds_of(primitives: &dyn Primitives) -> Result<Aabb, PrimitiveError> {
    Ok(around(&boxes_of(primitives)?))
}

fn around(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
}

/// Whether a primitive may have these bounds.
pub(crate) fn is_valid(bounds: &Aabb) -> bool {
    // Negated comparisons would accept NaN.
    (0..3).all(|k| bounds.min[k] <= bounds.max[k]) && bounds.is_finite()
}

/// The point that boxes of these primitives are relative to; the origin of their space where their hits have errors relative to it.
pub(crate) fn reference_of<P: Primitive>(primitives: &[P]) -> ReferencePoint {
    if P::IS_LOCAL {
        ReferencePoint::near(primitives.len(), |i| primitives[i].bounds())
    } else {
        ReferencePoint::ORIGIN
    }
}

/// The same of triangles.
pub(crate) fn reference_of_triangles(n: usize, corners: impl Fn(usize) -> Corners) -> ReferencePoint {
    ReferencePoint::near(n, |i| Aabb::from_points(corners(i)))
}

/// Builds over primitives of any type with these bounds; leaves are their numbers. `error` is that of hits.
fn over_primitives(
    primitives: &dyn Primitives,
    boxes: &[Aabb],
    reference: ReferencePoint,
    error: f32,
    config: &Config,
    limits: &Limits,
) -> Result<Built<Vec<PrimId>>, PrimitiveError> {
    let (n_primitives, bounds) = (primitives.n(), around(boxes));
    let place = |i: usize| Placed { primitive: primitives.at(i), bounds: boxes[i], reference };
    let items = Items::Made(n_primitives, &place);
    let mut chosen = binary::choose(items, &reference.moved_box(&bounds), config);
    let tables = std::mem::take(&mut chosen.aligned_tables);
    let ids = chosen.primitives();
    let write = |at: &[u32], _: usize, out: &mut [PrimId]| write_ids(at.iter().map(|&i| ids[i as usize]), out);
    let leaves = Leaves { layout: &LeafLayout::IDS, units: &|n| vec![PrimId(0); n], write: &write };
    let costs = config.costs;
    let (nodes, leaves, predicted) = collapse(&chosen, tables, &costs, error, limits, &leaves)
        .map_err(|TooLarge| PrimitiveError::TooMany { n_primitives })?;
    let frame = MeshFrame::new(chosen.rows, reference);
    Ok(Built { nodes, leaves, frame, bounds, n_primitives, predicted, costs })
}

/// Builds over indexed triangles.
fn over_indexed(
    limits: &Limits,
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    config: &Config,
) -> Result<Built<Blocks>, GeometryError> {
    check_number(triangles.len(), limits)?;
    let bounds = stage("bounds", || lbvh::triangle_bounds(positions, triangles))?;
    let config = config.usable();
    let n = triangles.len();
    let given = |i: usize| lbvh::corners_of(positions, &triangles[i]);
    let reference = stage("reference point", || reference_of_triangles(n, given));
    let moved = |i: usize| given(i).moved(reference);
    let (given, moved) = (Items::Made(n, &given), Items::Made(n, &moved));
    let items = if reference.is_origin() { given } else { moved };
    let mut chosen = binary::choose(items, &reference.moved_box(&bounds), &config);
    over_chosen(&mut chosen, given, (reference, &bounds), &config, limits)
}

/// Builds over a binary tree of any builder.
fn over_tree(
    tree: &Tree,
    parts: Option<Vec<Aabb>>,
    corners: &[Corners],
    bounds: &Aabb,
    config: &Config,
) -> Result<Built<Blocks>, GeometryError> {
    check_number(corners.len(), &Limits::OF_WORDS)?;
    let config = config.usable();
    let reference = reference_of_triangles(corners.len(), |i| corners[i]);
    let moved = item::moved(corners, reference);
    let parts = parts.map(|parts| parts.iter().map(|part| reference.moved_box(part)).collect());
    let items = Items::Array(moved.as_deref().unwrap_or(corners));
    let mut chosen = binary::over_tree(tree.clone(), parts, items, &reference.moved_box(bounds), &config);
    over_chosen(&mut chosen, Items::Array(corners), (reference, bounds), &config, &Limits::OF_WORDS)
}

/// Rejects more triangles than leaves can name.
fn check_number(n_triangles: usize, limits: &Limits) -> Result<(), GeometryError> {
    if n_triangles > limits.n_triangles() { Err(GeometryError::TooMany { n_triangles }) } else { Ok(()) }
}

/// Writes the records of a tree over triangles, which are relative to the reference point there; `given` are as they were given, and
/// so are `bounds`.
pub(crate) fn over_chosen(
    chosen: &mut Chosen<Corners>,
    given: Items<Corners>,
    (reference, bounds): (ReferencePoint, &Aabb),
    config: &Config,
    limits: &Limits,
) -> Result<Built<Blocks>, GeometryError> {
    let tables = std::mem::take(&mut chosen.aligned_tables);
    let (n_primitives, ids) = (given.n(), chosen.primitives());
    let write = |at: &[u32], part: usize, out: &mut [HalfBlock]| {
        let ids = at.iter().map(|&i| ids[i as usize]);
        write_triangles(ids.map(|id| (given.get(id.index()), id)), part, out);
    };
    let leaves = Leaves { layout: &LeafLayout::BLOCKS, units: &Records::zeroed, write: &write };
    let (nodes, halves, predicted) = collapse(chosen, tables, &config.costs, config.test.hit_error(), limits, &leaves)
        .map_err(|TooLarge| GeometryError::TooMany { n_triangles: n_primitives })?;
    let leaves = Blocks::new(halves, config.test);
    let frame = MeshFrame::new(chosen.rows, reference);
    Ok(Built { nodes, leaves, frame, bounds: *bounds, n_primitives, predicted, costs: config.costs })
}

/// Writes the records of the cheapest plan; `error` is that of hits.
fn collapse<I: Item, U: Send, B: DerefMut<Target = [U]>>(
    chosen: &Chosen<I>,
    aligned_tables: Vec<Table<ALIGNED>>,
    costs: &Costs,
    error: f32,
    limits: &Limits,
    leaves: &Leaves<'_, U, B>,
) -> Result<(Nodes, B, PredictedCost), TooLarge> {
    let Chosen { items, tree, rows, aligned, oriented, .. } = chosen;
    let members = chosen.members();
    let frame_of = |child: Child| match (oriented, child.kind()) {
        (None, _) => *rows,
        (Some(Oriented { fits, .. }), ChildKind::Leaf(i)) => fits.leaf[i as usize].rows,
        (Some(Oriented { fits, .. }), ChildKind::Inner(id)) => fits.inner[id.index()].rows,
    };
    // The box of a part may reach less far than the triangle, to whose reach the errors of hits are relative.
    let own_boxes = (*rows == Obb::IDENTITY_FRAME && !chosen.is_shared).then_some(aligned);
    let reaches = || SubtreeReaches::of_tree(tree, members, chosen.primitives(), *items, own_boxes);
    let reaches = stage("reaches", reaches);
    let source = Source {
        tree,
        members,
        primitives: chosen.primitives(),
        is_shared: chosen.is_shared,
        leaf_boxes: &aligned.leaf_boxes,
        inner_boxes: &aligned.inner_boxes,
        frames: &frame_of,
        slabs: &|range, rows| {
            let sorted = oriented.as_ref().expect("only oriented nodes have boxes of their own");
            I::slabs(&sorted.sorted[range], rows)
        },
        reach: &|child| reaches.of_child(child),
        pads: BoxPads::new(Pads::of(error), *rows == Obb::IDENTITY_FRAME),
    };
    let (aligned_areas, both_areas) = (|i: usize| chosen.aligned_leaf(i), |i: usize| chosen.both_leaf(i));
    let of_rays = PlanCosts::of_rays(costs);
    let plan = Plan { tree, members, costs: of_rays, tables: &aligned_tables, leaf_areas: &aligned_areas };
    let costs_of_aligned = tree.root().map(|root| (plan.area(root, NodeKind::Aligned), plan.cost(root)));
    let predicted = |chosen: Option<f32>| {
        costs_of_aligned.map_or_else(PredictedCost::default, |(area, aligned)| PredictedCost {
            aligned: aligned / area,
            chosen: chosen.unwrap_or(aligned) / area,
        })
    };
    let (Some(Oriented { tables, line_cost, .. }), Some(root)) = (oriented, tree.root()) else {
        let layout = stage("layout", || layout(&source, &plan, limits, leaves.layout))?;
        // They take half the memory of a BVH, and records are only now allocated.
        drop(aligned_tables);
        let (nodes, units) = stage("records", || emit(&source, &layout, leaves));
        return Ok((nodes, units, predicted(None)));
    };
    drop(aligned_tables);
    let costs = PlanCosts { line: *line_cost, ..of_rays };
    let plan = Plan { tree, members, costs, tables, leaf_areas: &both_areas };
    let layout = stage("layout", || layout(&source, &plan, limits, leaves.layout))?;
    let (nodes, units) = stage("records", || emit(&source, &layout, leaves));
    // The cost of memory is none of rays.
    let cost = plan.cost(root) - line_cost * nodes.lines.len() as f32;
    Ok((nodes, units, predicted(Some(cost))))
}
