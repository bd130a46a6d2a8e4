//! The BVH over the triangles of one mesh, or of all instances: which one, and how it is built.

use std::any::Any;

use canted_bih::{Bih, BihConfig};
use canted_bvh2::{Bvh2, Bvh2Boxes, Bvh2Config, PairOrder};
use canted_kdtree::{KdTree, KdTreeConfig};
use canted_lbvh::{self as lbvh, Corners, Leaf, Strategy, VolumeConfig};
use canted_obb::{Aabb, Obb, PrimId};
use canted_sah::{Axes, SpatialConfig, Split, TopDownConfig};
use canted_scene::{CurveSegments, CurveShape, Curves, Mesh};
use canted_tlas::TopConfig;
use canted_trace::{
    AcceptAt, Answers, BezierPatch, HIT_ERROR, Hit, InstanceId, Intersect, PlacedRay, Query, Ray, RibbonCubic,
    RibbonSegment, RoundCubic, RoundSegment, ScaledRay, TriangleTest, pad_aabb,
};
use canted_wide::{
    Config, MAX_TRIANGLES, Moves, Moving, MovingBvh, Preset, Primitive, RefitError, Sizes, TriangleBvh, WideBvh,
};

use crate::PrepareError;

/// Kind of acceleration structure over triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BvhKind {
    /// Eight-wide nodes, aligned or oriented, whichever is predicted to be cheaper.
    #[default]
    Wide,
    /// Binary nodes with one kind of bounding volume.
    Bvh2,
    /// A bounding interval hierarchy, below wide nodes over instances.
    Bih,
    /// A SAH kd-tree, below wide nodes over instances.
    KdTree,
}

impl BvhKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Wide, Self::Bvh2, Self::Bih, Self::KdTree];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wide => "wide",
            Self::Bvh2 => "bvh2",
            Self::Bih => "bih",
            Self::KdTree => "kdtree",
        }
    }

    /// Whether a [`Builder`] can be chosen for it; the others have one of their own.
    #[must_use]
    pub fn has_builders(self) -> bool {
        match self {
            Self::Wide | Self::Bvh2 => true,
            Self::Bih | Self::KdTree => false,
        }
    }
}

/// Builder of binary trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Builder {
    /// Merges neighbors along the Morton curve by area, then reinserts subtrees.
    Ploc,
    /// The radix tree over Morton codes.
    Lbvh,
    /// [`Builder::Lbvh`] below a tree by the surface area heuristic.
    Hlbvh,
    /// Top down by the surface area heuristic.
    Sah,
    /// Top down, at the midpoint of the longest axis.
    Midpoint,
    /// Top down, at the median along the longest axis.
    Median,
    /// As [`Builder::Sah`], but triangles that cross a split may be in both children, each with the box of its part.
    Sbvh,
    /// The external crate `obvhs`, of which only the tree is used.
    #[cfg(feature = "baseline")]
    Obvhs,
}

impl Builder {
    /// All builders.
    pub const ALL: &[Self] = &[
        Self::Sah,
        Self::Sbvh,
        Self::Ploc,
        Self::Hlbvh,
        Self::Lbvh,
        Self::Midpoint,
        Self::Median,
        #[cfg(feature = "baseline")]
        Self::Obvhs,
    ];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Hlbvh => "hlbvh",
            Self::Sah => "sah",
            Self::Midpoint => "midpoint",
            Self::Median => "median",
            Self::Sbvh => "sbvh",
            Self::Ploc => "ploc",
            Self::Lbvh => "lbvh",
            #[cfg(feature = "baseline")]
            Self::Obvhs => "obvhs",
        }
    }

    /// Our own builder; `None` for an external one, and where leaves are parts of triangles.
    fn own(self) -> Option<canted_sah::Builder> {
        match self {
            Self::Lbvh => Some(canted_sah::Builder::Lbvh),
            Self::Hlbvh => Some(canted_sah::Builder::Hybrid),
            Self::Ploc => Some(canted_sah::Builder::BALANCED),
            Self::Sah => Some(canted_sah::Builder::TopDown(TopDownConfig::BINNED, None)),
            Self::Midpoint => Some(halved(Split::Midpoint)),
            Self::Median => Some(halved(Split::Median)),
            Self::Sbvh => None,
            #[cfg(feature = "baseline")]
            Self::Obvhs => None,
        }
    }

    /// The tree over triangles, one per leaf.
    fn tree(self, corners: &[Corners], bounds: &Aabb) -> Result<lbvh::Tree, PrepareError> {
        match self {
            #[cfg(feature = "baseline")]
            Self::Obvhs if corners.len() > 1 => Ok(obvhs_tree(corners, obvhs::BvhBuildParams::medium_build())?),
            // Over centroids, as `canted tree` writes it; `canted_sah` builds its radix tree over boxes.
            Self::Lbvh => {
                let bits = lbvh::Bits::B63;
                let codes = lbvh::morton_codes(&lbvh::Domain::new(bounds, 3, bits), corners);
                Ok(lbvh::radix(lbvh::sort_by_code(&codes, bits)))
            }
            _ => {
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                Ok(canted_sah::build(&boxes, bounds, &self.own().unwrap_or_default()))
            }
        }
    }
}

/// Top down, along the longest axis alone.
fn halved(split: Split) -> canted_sah::Builder {
    canted_sah::Builder::TopDown(TopDownConfig { split, axes: Axes::Longest, ..TopDownConfig::BINNED }, None)
}

/// The topology of a BVH that `obvhs` builds over at least two triangles, one per leaf; volumes are fitted by our own code.
///
/// # Errors
/// If the nodes do not form a tree over the triangles.
#[cfg(feature = "baseline")]
pub fn obvhs_tree(corners: &[Corners], params: obvhs::BvhBuildParams) -> Result<lbvh::Tree, lbvh::TopologyError> {
    use obvhs::{aabb, bvh2::builder::build_bvh2};

    let boxes = corners.iter().map(|c| aabb::Aabb::from_points(&c.map(glam::Vec3A::from_array)));
    let params = obvhs::BvhBuildParams { pre_split: false, max_prims_per_leaf: 1, ..params };
    let bvh = build_bvh2(&boxes.collect::<Vec<_>>(), params, &mut std::time::Duration::default());
    let mut children = Vec::with_capacity(bvh.primitive_indices.len());
    // The `obvhs` index of each inner node, in our numbering.
    let mut inner = vec![0usize];
    let mut next = 0;
    while let Some(&node) = inner.get(next) {
        next += 1;
        let first = bvh.nodes[node].first_index as usize;
        children.push([first, first + 1].map(|child| {
            let node = &bvh.nodes[child];
            if node.is_leaf() {
                lbvh::Child::leaf(bvh.primitive_indices[node.first_index as usize])
            } else {
                inner.push(child);
                lbvh::Child::inner(lbvh::NodeId(inner.len() as u32 - 1))
            }
        }));
    }
    lbvh::Tree::from_children(&children)
}

/// How many levels of BVHs a scene gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Levels {
    /// Two where one level would copy many triangles, exceeds what one BVH can index, or is predicted to cost rays much more; else one.
    #[default]
    Auto,
    /// One BVH over all triangles in world space; two levels all the same where an instance moves.
    One,
    /// A BVH per mesh, and one over the instances.
    Two,
}

impl Levels {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Auto, Self::One, Self::Two];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::One => "one",
            Self::Two => "two",
        }
    }
}

/// The acceleration structure to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneBvhConfig {
    /// Number of levels.
    pub levels: Levels,
    /// The structure over triangles.
    pub kind: BvhKind,
    /// Build effort of a wide BVH.
    pub preset: Preset,
    /// Builder of the binary tree of a wide or binary BVH; `None` for the preset's, or [`Builder::Ploc`].
    pub builder: Option<Builder>,
    /// Bounding volumes of a binary BVH.
    pub volumes: Strategy,
    /// Whether a wide BVH has axis-aligned nodes alone: neither oriented nodes nor a frame of the mesh.
    pub aligned: bool,
    /// The triangle test.
    pub triangles: TriangleTest,
    /// Whether a wide BVH has small leaves, which are faster on devices ([`Config::for_devices`]).
    pub on_device: bool,
}

impl Default for SceneBvhConfig {
    fn default() -> Self {
        Self {
            levels: Levels::default(),
            kind: BvhKind::default(),
            preset: Preset::default(),
            builder: None,
            volumes: Strategy::Aabb,
            aligned: false,
            triangles: TriangleTest::default(),
            on_device: false,
        }
    }
}

impl SceneBvhConfig {
    /// Triangles that one BVH can index.
    pub(crate) fn max_triangles(&self) -> usize {
        match self.kind {
            BvhKind::Wide => MAX_TRIANGLES,
            BvhKind::Bvh2 | BvhKind::Bih | BvhKind::KdTree => lbvh::MAX_PRIMITIVES,
        }
    }

    /// The BVH over instances.
    pub(crate) fn top(&self) -> TopConfig {
        match self.kind {
            BvhKind::Wide => TopConfig::Wide(Config::preset(self.preset)),
            BvhKind::Bvh2 => {
                TopConfig::other(Bvh2Boxes::builder(VolumeConfig { strategy: self.volumes, fallback: true }))
            }
            BvhKind::Bih | BvhKind::KdTree => TopConfig::Wide(Config::default()),
        }
    }

    fn wide(&self) -> Config {
        let preset = Config::preset(self.preset);
        let preset = if self.on_device { preset.for_devices() } else { preset };
        Config { test: self.triangles, ..if self.aligned { preset.axis_aligned() } else { preset } }
    }

    /// Builds the BVH of a mesh.
    pub(crate) fn build(&self, of: Triangles) -> Result<BottomLevel, PrepareError> {
        let Triangles { positions, close, triangles, curves } = of;
        if let Some((mesh, curves)) = curves {
            if self.kind != BvhKind::Wide || self.builder.is_some() {
                return Err(PrepareError::Curves);
            }
            return self.build_curves(mesh, curves);
        }
        if let Some(close) = close {
            if self.kind != BvhKind::Wide {
                return Err(PrepareError::MovingTriangles);
            }
            return Ok(BottomLevel::Moving(MovingBvh::build_with(positions, close, triangles, self.wide())?));
        }
        let test = self.triangles;
        match self.kind {
            BvhKind::Wide => self.build_wide(positions, triangles).map(BottomLevel::Wide),
            BvhKind::Bvh2 => Ok(BottomLevel::Bvh2(self.build_binary(positions, triangles)?, self.volumes)),
            BvhKind::Bih => {
                Ok(BottomLevel::Bih(Bih::build(positions, triangles, &BihConfig { test, ..BihConfig::default() })?))
            }
            BvhKind::KdTree => {
                let config = KdTreeConfig { test, ..KdTreeConfig::default() };
                Ok(BottomLevel::KdTree(KdTree::build(positions, triangles, &config)?))
            }
        }
    }

    /// The BVH over the segments of the curves of a mesh, or over its patches.
    fn build_curves(
        &self,
        mesh: &Mesh,
        Curves { radii, segments, shape }: &Curves,
    ) -> Result<BottomLevel, PrepareError> {
        let close = mesh
            .close
            .as_ref()
            .map(|close| Points { positions: &close.positions, radii: close.radii.as_deref().unwrap_or(radii) });
        let points = (Points { positions: &mesh.positions, radii }, close);
        let following = || mesh.following_indices().into_iter();
        match (segments, shape) {
            (CurveSegments::Linear(list), CurveShape::Tube) => {
                self.over(points, list.iter(), Points::segment, BottomLevel::Segments)
            }
            (CurveSegments::Cubic(list), CurveShape::Tube) => {
                self.over(points, list.iter(), Points::cubic, BottomLevel::Cubics)
            }
            (CurveSegments::Linear(list), CurveShape::Ribbon) => {
                self.over(points, list.iter().zip(following()), Points::ribbon, BottomLevel::Ribbons)
            }
            (CurveSegments::Cubic(list), CurveShape::Ribbon) => {
                self.over(points, list.iter().zip(following()), Points::cubic_ribbon, BottomLevel::CubicRibbons)
            }
            (CurveSegments::Patches(list), _) => self.over(points, list.iter(), Points::patch, BottomLevel::Patches),
        }
    }

    /// The BVH over what `make` makes of each item and the points at shutter open; of those at shutter close too, if they move.
    fn over<'a, I: Copy, P: Moves + 'static>(
        &self,
        (open, close): (Points<'a>, Option<Points<'a>>),
        items: impl Iterator<Item = I>,
        make: fn(&Points<'a>, I) -> P,
        still: fn(WideBvh<P>) -> BottomLevel,
    ) -> Result<BottomLevel, PrepareError> {
        let Some(close) = close else {
            let all = items.map(|item| make(&open, item)).collect();
            return Ok(still(WideBvh::over_with(all, self.wide())?));
        };
        let all = items.map(|item| Moving { open: make(&open, item), close: make(&close, item) }).collect();
        Ok(BottomLevel::MovingCurves(Box::new(WideBvh::over_with(all, self.wide())?)))
    }

    fn build_binary(&self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Bvh2, PrepareError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let volumes = VolumeConfig { strategy: self.volumes, fallback: true };
        let builder = self.builder.unwrap_or(Builder::Ploc);
        if builder != Builder::Sbvh {
            let config = Bvh2Config { volumes, test: self.triangles, ..Bvh2Config::default() };
            return Ok(Bvh2::over(builder.tree(&corners, &bounds)?, &corners, &bounds, &config));
        }
        let (tree, parts) = parts(&corners);
        // Padded by the reach of the whole triangle, to which the errors of its hits are relative.
        let padded = |(part, leaf): (&Aabb, &PrimId)| pad_aabb(part, corners[leaf.index()].aabb().reach());
        let leaves: Vec<Obb> = parts.iter().zip(&tree.leaves).map(|of| Obb::from_aabb(&padded(of))).collect();
        let volumes = lbvh::volumes(&tree, &leaves, &volumes);
        let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
        Ok(Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst, self.triangles))
    }

    fn build_wide(&self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<TriangleBvh, PrepareError> {
        let preset = self.wide();
        let config = match self.builder.map(|builder| (builder, builder.own())) {
            None => preset,
            Some((_, Some(own))) => Config { builder: own, alternative_builder: None, groups: None, ..preset },
            Some((Builder::Sbvh, _)) => {
                let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
                let (tree, parts) = parts(&corners);
                return Ok(TriangleBvh::from_tree_of_parts(&tree, parts, &corners, &bounds, preset)?);
            }
            Some((external, None)) if triangles.len() > 1 => {
                let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
                let tree = external.tree(&corners, &bounds)?;
                return Ok(TriangleBvh::from_tree(&tree, &corners, &bounds, preset)?);
            }
            Some(_) => preset,
        };
        Ok(TriangleBvh::build_with(positions, triangles, config)?)
    }
}

/// Points and radii of curves at one end of the shutter.
#[derive(Clone, Copy)]
struct Points<'a> {
    positions: &'a [[f32; 3]],
    radii: &'a [f32],
}

impl Points<'_> {
    fn position(&self, i: u32) -> [f32; 3] {
        self.positions[i as usize]
    }

    fn radius(&self, i: u32) -> f32 {
        self.radii[i as usize]
    }

    fn segment(&self, ends: &[u32; 2]) -> RoundSegment {
        RoundSegment { ends: ends.map(|i| self.position(i)), radii: ends.map(|i| self.radius(i)) }
    }

    fn cubic(&self, points: &[u32; 4]) -> RoundCubic {
        RoundCubic { points: points.map(|i| self.position(i)), radii: points.map(|i| self.radius(i)) }
    }

    fn ribbon(&self, (ends, next): (&[u32; 2], u32)) -> RibbonSegment {
        let RoundSegment { ends, radii } = self.segment(ends);
        RibbonSegment { ends, radii, next: self.position(next) }
    }

    fn cubic_ribbon(&self, (points, next): (&[u32; 4], u32)) -> RibbonCubic {
        let RoundCubic { points, radii } = self.cubic(points);
        RibbonCubic { points, radii, next: self.position(next) }
    }

    fn patch(&self, points: &[u32; 16]) -> BezierPatch {
        BezierPatch { points: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| self.position(points[4 * i + j]))) }
    }
}

/// A wide BVH over curves or patches that move, of any kind.
pub trait CurveBvh: Intersect + Sync + Send {
    /// Memory of nodes and primitives.
    fn n_bytes(&self) -> usize;

    /// As [`WideBvh::each_box`].
    fn each_box(&self, visit: &mut dyn FnMut(Obb, u32, bool));

    /// The BVH itself, a [`WideBvh`] over `Moving` primitives.
    fn as_any(&self) -> &dyn Any;

    /// Number of nodes of each kind, and the rows of the frame of aligned nodes.
    fn sizes_and_frame(&self) -> (Sizes, [[f32; 3]; 3]);
}

impl<P: Primitive + 'static> CurveBvh for WideBvh<P> {
    fn n_bytes(&self) -> usize {
        Self::n_bytes(self)
    }

    fn each_box(&self, visit: &mut dyn FnMut(Obb, u32, bool)) {
        Self::each_box(self, visit);
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn sizes_and_frame(&self) -> (Sizes, [[f32; 3]; 3]) {
        (self.sizes(), self.frame())
    }
}

/// A tree with spatial splits whose leaves name triangles, and the boxes of their parts in leaf order.
fn parts(corners: &[Corners]) -> (lbvh::Tree, Vec<Aabb>) {
    let (mut tree, references) = canted_sah::spatial(corners, &SpatialConfig::default());
    let parts = tree.leaves.iter().map(|part| references.boxes[part.index()]).collect();
    tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
    (tree, parts)
}

/// The triangles of a mesh, or of all instances.
#[derive(Clone, Copy)]
pub(crate) struct Triangles<'a> {
    pub(crate) positions: &'a [[f32; 3]],
    /// Positions at shutter close, if the vertices move.
    pub(crate) close: Option<&'a [[f32; 3]]>,
    pub(crate) triangles: &'a [[u32; 3]],
    /// In place of triangles, with the mesh of which they are.
    pub(crate) curves: Option<(&'a Mesh, &'a Curves)>,
}

impl<'a> Triangles<'a> {
    /// Triangles over the vertices of a mesh.
    pub(crate) fn of(mesh: &'a Mesh, triangles: &'a [[u32; 3]]) -> Self {
        let close = mesh.close.as_ref().map(|close| &close.positions[..]);
        let curves = mesh.curves.as_ref().map(|curves| (mesh, curves));
        Self { positions: &mesh.positions, close, triangles, curves }
    }
}

/// The acceleration structure over the triangles of one mesh, or of all instances.
pub enum BottomLevel {
    /// Eight-wide, with aligned and oriented nodes.
    Wide(TriangleBvh),
    /// As `Wide`, over triangles whose vertices move while the shutter is open.
    Moving(MovingBvh),
    /// Binary, with volumes of one strategy.
    Bvh2(Bvh2, Strategy),
    /// A bounding interval hierarchy.
    Bih(Bih),
    /// A kd-tree.
    KdTree(KdTree),
    /// Eight-wide, over round segments.
    Segments(WideBvh<RoundSegment>),
    /// Eight-wide, over round cubic curves.
    Cubics(WideBvh<RoundCubic>),
    /// Eight-wide, over straight ribbons.
    Ribbons(WideBvh<RibbonSegment>),
    /// Eight-wide, over cubic ribbons.
    CubicRibbons(WideBvh<RibbonCubic>),
    /// Eight-wide, over bicubic patches.
    Patches(WideBvh<BezierPatch>),
    /// Eight-wide, over curves or patches whose points move while the shutter is open.
    MovingCurves(Box<dyn CurveBvh>),
}

impl BottomLevel {
    fn inner(&self) -> &dyn Intersect {
        match self {
            Self::Wide(bvh) => bvh,
            Self::Moving(bvh) => bvh,
            Self::Bvh2(bvh, _) => bvh,
            Self::Bih(bih) => bih,
            Self::KdTree(tree) => tree,
            Self::Segments(bvh) => bvh,
            Self::Cubics(bvh) => bvh,
            Self::Ribbons(bvh) => bvh,
            Self::CubicRibbons(bvh) => bvh,
            Self::Patches(bvh) => bvh,
            Self::MovingCurves(bvh) => &**bvh,
        }
    }

    /// Memory of nodes and triangles.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        match self {
            Self::Wide(bvh) => bvh.n_bytes(),
            Self::Moving(bvh) => bvh.n_bytes(),
            Self::Bvh2(bvh, _) => bvh.n_bytes(),
            Self::Bih(bih) => bih.n_bytes(),
            Self::KdTree(tree) => tree.n_bytes(),
            Self::Segments(bvh) => bvh.n_bytes(),
            Self::Cubics(bvh) => bvh.n_bytes(),
            Self::Ribbons(bvh) => bvh.n_bytes(),
            Self::CubicRibbons(bvh) => bvh.n_bytes(),
            Self::Patches(bvh) => bvh.n_bytes(),
            Self::MovingCurves(bvh) => bvh.n_bytes(),
        }
    }

    /// Updates the boxes to new vertices of the same triangles; returns the drift, or `None` where this kind of structure cannot be
    /// refitted.
    pub(crate) fn refit(
        &mut self,
        Triangles { positions, close, triangles, curves: _ }: Triangles,
    ) -> Result<Option<f32>, PrepareError> {
        let refit = match (self, close) {
            (Self::Wide(wide), None) => wide.refit(positions, triangles),
            (Self::Moving(moving), Some(close)) => moving.refit(positions, close, triangles),
            // Curves are built again.
            (
                Self::Segments(_)
                | Self::Cubics(_)
                | Self::Ribbons(_)
                | Self::CubicRibbons(_)
                | Self::Patches(_)
                | Self::MovingCurves(_),
                _,
            ) => return Ok(None),
            (Self::Wide(_) | Self::Moving(_) | Self::Bvh2(..) | Self::Bih(_) | Self::KdTree(_), _) => return Ok(None),
        };
        match refit {
            Ok(refit) => Ok(Some(refit.drift)),
            Err(RefitError::Geometry(error)) => Err(error.into()),
            // The caller then builds a BVH over the new number of triangles.
            Err(_) => Ok(None),
        }
    }

    /// Calls `visit` with the box of each node and leaf, object space: the box, its level, 0 for the root, and whether it is a leaf.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        match self {
            Self::Wide(bvh) => bvh.each_box(visit),
            Self::Moving(bvh) => bvh.each_box(visit),
            Self::Segments(bvh) => bvh.each_box(visit),
            Self::Cubics(bvh) => bvh.each_box(visit),
            Self::Ribbons(bvh) => bvh.each_box(visit),
            Self::CubicRibbons(bvh) => bvh.each_box(visit),
            Self::Patches(bvh) => bvh.each_box(visit),
            Self::MovingCurves(bvh) => bvh.each_box(&mut visit),
            Self::Bvh2(bvh, _) => {
                bvh.pairs().each_box(|obb, level, is_leaf| visit(bvh.reference().given_box(obb), level, is_leaf));
            }
            Self::Bih(bih) => {
                bih.boxes().each_box(|obb, level, is_leaf| visit(bih.reference().given_box(obb), level, is_leaf));
            }
            Self::KdTree(tree) => {
                tree.nodes().each_box(|obb, level, is_leaf| visit(tree.reference().given_box(obb), level, is_leaf));
            }
        }
    }

    /// Whether it has oriented nodes.
    pub(crate) fn has_oriented_nodes(&self) -> bool {
        let of_wide = |Sizes { nodes: [_, oriented], .. }, frame| oriented > 0 || frame != Obb::IDENTITY_FRAME;
        match self {
            Self::Wide(wide) => of_wide(wide.sizes(), wide.frame()),
            Self::Moving(moving) => of_wide(moving.sizes(), moving.frame()),
            Self::Segments(bvh) => of_wide(bvh.sizes(), bvh.frame()),
            Self::Cubics(bvh) => of_wide(bvh.sizes(), bvh.frame()),
            Self::Ribbons(bvh) => of_wide(bvh.sizes(), bvh.frame()),
            Self::CubicRibbons(bvh) => of_wide(bvh.sizes(), bvh.frame()),
            Self::Patches(bvh) => of_wide(bvh.sizes(), bvh.frame()),
            Self::MovingCurves(bvh) => {
                let (sizes, frame) = bvh.sizes_and_frame();
                of_wide(sizes, frame)
            }
            Self::Bvh2(_, strategy) => *strategy != Strategy::Aabb,
            Self::Bih(_) | Self::KdTree(_) => false,
        }
    }
}

impl Intersect for BottomLevel {
    fn bounds(&self) -> Obb {
        self.inner().bounds()
    }

    fn hit_error(&self) -> f32 {
        // One bound for all triangle tests, so that the boxes of instances are the same.
        self.inner().hit_error().max(HIT_ERROR)
    }

    fn has_local_error(&self) -> bool {
        self.inner().has_local_error()
    }

    fn is_empty(&self) -> bool {
        self.inner().is_empty()
    }

    fn support(&self, direction: [f64; 3]) -> Option<f64> {
        self.inner().support(direction)
    }

    fn closest_hit_placed(
        &self,
        ray: &PlacedRay<'_>,
        instance: InstanceId,
        query: &mut dyn Query,
        stack: &mut [u64],
    ) -> Option<(f64, Hit)> {
        self.inner().closest_hit_placed(ray, instance, query, stack)
    }

    fn occluded_placed(
        &self,
        ray: &PlacedRay<'_>,
        instance: InstanceId,
        query: &mut dyn Query,
        stack: &mut [u64],
    ) -> bool {
        self.inner().occluded_placed(ray, instance, query, stack)
    }

    fn stack_len(&self) -> usize {
        self.inner().stack_len()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        self.inner().closest_hit_scaled(ray, query, stack)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        self.inner().occluded_scaled(ray, query, stack)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        self.inner().all_hits_scaled(ray, query, stack, hits);
    }

    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, answers: Answers) {
        self.inner().answer(rays, first, accept, answers);
    }
}
