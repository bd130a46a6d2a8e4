use std::fmt;

use canted_lbvh::{self as lbvh, Bits, Corners, Domain, GeometryError, Tree, Volumes, par};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Kernel, ReferencePoint};

use crate::leaf_triangles::LeafTriangles;
use crate::{PairBvh, PairOrder, triangle_queries};

/// Triangles of one job.
const CHUNK: usize = 1 << 13;

/// How [`Bvh2::build`] and [`Bvh2::over`] build.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct BuildConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// Volumes of the nodes.
    pub volumes: lbvh::VolumeConfig,
}

/// A binary BVH over triangles, with boxes of any volume strategy.
///
/// `K` is the triangle test. Hits are those of `K` on every triangle; ties go to the lowest primitive.
///
/// ```
/// use canted_bvh2::{BuildConfig, Bvh2};
/// use canted_trace::{Ray, Watertight};
///
/// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2], [3, 4, 5]], &BuildConfig::default())?;
/// let rays = [Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]); 2];
/// let mut all = vec![];
/// bvh.all_hits(&rays[0], &mut all);
/// assert_eq!(all.iter().map(|hit| (hit.t, hit.primitive.0)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 0)]);
/// let mut hits = [None; 2];
/// // The filter of the second ray rejects triangle 1.
/// bvh.par_closest_hits_where(&rays, &mut hits, |index, _, hit| index == 0 || hit.primitive.0 != 1);
/// assert_eq!(hits.map(|hit| hit.map(|hit| hit.primitive.0)), [Some(1), Some(0)]);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
pub struct Bvh2<K: Kernel> {
    pairs: PairBvh,
    /// The triangles in leaf order.
    records: Vec<K::Record>,
    /// The number of the triangle of each leaf.
    leaves: Vec<PrimId>,
    /// What the nodes are relative to; triangles are in object space.
    reference: ReferencePoint,
    /// The box of the root, object space.
    bounds: Obb,
}

impl<K: Kernel> Bvh2<K> {
    /// Builds a radix tree over the triangles.
    ///
    /// # Errors
    /// The first triangle with a missing vertex or a vertex that is not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &BuildConfig) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, config.bits), &corners);
        let tree = lbvh::radix(lbvh::sort_by_code(&codes, config.bits));
        Ok(Self::in_order(tree, &corners, &bounds, config, PairOrder::Numbered))
    }

    /// Builds over the tree of another builder. `corners` are in the caller's order.
    #[must_use]
    pub fn over(tree: Tree, corners: &[Corners], bounds: &Aabb, config: &BuildConfig) -> Self {
        Self::in_order(tree, corners, bounds, config, PairOrder::DepthFirst)
    }

    /// Computes the volumes, relative to a point near the triangles.
    fn in_order(tree: Tree, corners: &[Corners], bounds: &Aabb, config: &BuildConfig, pair_order: PairOrder) -> Self {
        let sorted = lbvh::in_leaf_order(corners, &tree.leaves);
        let reference = ReferencePoint::near(corners.len(), |i| Aabb::from_points(corners[i]));
        if reference.is_origin() {
            let volumes = lbvh::volumes(&tree, &sorted, &config.volumes);
            return Self::new(tree, &volumes, sorted, bounds, pair_order);
        }
        let moved = par::map(&sorted, CHUNK, |corners| corners.map(|vertex| reference.moved(vertex)));
        let volumes = lbvh::volumes(&tree, &moved, &config.volumes);
        let pairs = PairBvh::new(&tree, &volumes, &moved, &reference.moved_box(bounds), pair_order);
        let records = sorted.into_iter().map(K::record).collect();
        Self { pairs, records, leaves: tree.leaves, reference, bounds: Obb::from_aabb(bounds) }
    }

    /// Combines the results of the build stages. `sorted` are the corners in leaf order.
    ///
    /// Boxes are relative to the origin. [`Bvh2::build`] and [`Bvh2::over`] take a point near the triangles instead, so that meshes far from
    /// the origin are traced as fast.
    #[must_use]
    pub fn new(tree: Tree, volumes: &Volumes, sorted: Vec<Corners>, bounds: &Aabb, pair_order: PairOrder) -> Self {
        let pairs = PairBvh::new(&tree, volumes, &sorted, bounds, pair_order);
        // If a record is just the vertices, this reuses the allocation.
        let records = sorted.into_iter().map(K::record).collect();
        let (reference, bounds) = (ReferencePoint::ORIGIN, *pairs.bounds());
        Self { pairs, records, leaves: tree.leaves, reference, bounds }
    }

    #[inline(always)]
    fn leaf_triangles(&self) -> LeafTriangles<'_, PairBvh, K> {
        LeafTriangles { nodes: &self.pairs, records: &self.records, primitives: &self.leaves, reference: self.reference }
    }

    /// What the nodes are relative to: a point near the triangles if these are far from the origin.
    #[must_use]
    pub fn reference(&self) -> ReferencePoint {
        self.reference
    }

    /// The nodes, relative to [`Bvh2::reference`].
    #[must_use]
    pub fn pairs(&self) -> &PairBvh {
        &self.pairs
    }

    /// The box of the root.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        self.bounds
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.leaves.len()
    }

    /// Memory of nodes, triangles and their numbers.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.pairs.n_bytes() + size_of_val(&self.records[..]) + size_of_val(&self.leaves[..])
    }
}

triangle_queries!(Bvh2);

impl<K: Kernel> Clone for Bvh2<K> {
    fn clone(&self) -> Self {
        let Self { reference, bounds, .. } = *self;
        let (pairs, records, leaves) = (self.pairs.clone(), self.records.clone(), self.leaves.clone());
        Self { pairs, records, leaves, reference, bounds }
    }
}

/// Sizes and bounds, not every node.
impl<K: Kernel> fmt::Debug for Bvh2<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bvh2")
            .field("n_triangles", &self.n_triangles())
            .field("n_pairs", &self.pairs.n_pairs())
            .field("depth", &self.pairs.depth())
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}
