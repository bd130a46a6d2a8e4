use std::fmt;

use canted_lbvh::{self as lbvh, Bits, Corners, Domain, GeometryError, Tree, Volumes, par};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{HIT_ERROR, Hit, Intersect, LeafTriangles, Query, ReferencePoint, ScaledRay, TriangleTest};

use crate::{PairBvh, PairOrder};

/// Triangles of one job.
const CHUNK: usize = 1 << 13;

/// How [`Bvh2::build`] and [`Bvh2::over`] build.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Bvh2Config {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// Volumes of the nodes.
    pub volumes: lbvh::VolumeConfig,
    /// The triangle test.
    pub test: TriangleTest,
}

/// A binary BVH over triangles, with boxes of any volume strategy.
///
/// Hits are those of the triangle test on every triangle; ties go to the lowest primitive. [`Intersect`] has the queries.
///
/// ```
/// use canted_bvh2::{Bvh2, Bvh2Config};
/// use canted_trace::{Intersect, Ray};
///
/// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let bvh = Bvh2::build(&positions, &[[0, 1, 2], [3, 4, 5]], &Bvh2Config::default())?;
/// let rays = [Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]); 2];
/// let mut all = vec![];
/// bvh.all_hits(&rays[0], &mut all);
/// assert_eq!(all.iter().map(|hit| (hit.t, hit.primitive.0)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 0)]);
/// let mut hits = [None; 2];
/// // The filter of the second ray rejects triangle 1.
/// bvh.par_closest_hits_with(&rays, &mut hits, &|index, _, hit| index == 0 || hit.primitive.0 != 1);
/// assert_eq!(hits.map(|hit| hit.map(|hit| hit.primitive.0)), [Some(1), Some(0)]);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[derive(Clone)]
pub struct Bvh2 {
    pairs: PairBvh,
    triangles: LeafTriangles,
    /// The number of the triangle of each leaf.
    leaves: Vec<PrimId>,
    /// The box of the root, object space.
    bounds: Obb,
}

impl Bvh2 {
    /// Builds a radix tree over the triangles.
    ///
    /// # Errors
    /// The first triangle with a missing vertex or a vertex that is not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &Bvh2Config) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, config.bits), &corners);
        let tree = lbvh::radix(lbvh::sort_by_code(&codes, config.bits));
        Ok(Self::in_order(tree, &corners, &bounds, config, PairOrder::Numbered))
    }

    /// As [`Self::build`], over triangles that have their vertices themselves: the same tree as over any indexed form of them. In errors, vertex `3i + k` is
    /// vertex `k` of triangle `i`.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn build_flat(triangles: &[Corners], config: &Bvh2Config) -> Result<Self, GeometryError> {
        Self::build(triangles.as_flattened(), &lbvh::flat_indices(triangles.len())?, config)
    }

    /// Builds over the tree of another builder. `corners` are in the caller's order.
    #[must_use]
    pub fn over(tree: Tree, corners: &[Corners], bounds: &Aabb, config: &Bvh2Config) -> Self {
        Self::in_order(tree, corners, bounds, config, PairOrder::DepthFirst)
    }

    /// Computes the volumes, relative to a point near the triangles.
    fn in_order(tree: Tree, corners: &[Corners], bounds: &Aabb, config: &Bvh2Config, pair_order: PairOrder) -> Self {
        let sorted = lbvh::in_leaf_order(corners, &tree.leaves);
        let reference = ReferencePoint::near(corners.len(), |i| Aabb::from_points(corners[i]));
        if reference.is_origin() {
            let volumes = lbvh::volumes(&tree, &sorted, &config.volumes);
            return Self::new(tree, &volumes, sorted, bounds, pair_order, config.test);
        }
        let moved = par::map(&sorted, CHUNK, |corners| corners.map(|vertex| reference.moved(vertex)));
        let volumes = lbvh::volumes(&tree, &moved, &config.volumes);
        let pairs = PairBvh::new(&tree, &volumes, &moved, &reference.moved_box(bounds), pair_order);
        let triangles = LeafTriangles::new(config.test, sorted, reference);
        Self { pairs, triangles, leaves: tree.leaves, bounds: Obb::from_aabb(bounds) }
    }

    /// Combines the results of the build stages. `sorted` are the corners in leaf order.
    ///
    /// Boxes are relative to the origin. [`Bvh2::build`] and [`Bvh2::over`] take a point near the triangles instead, so that meshes far from
    /// the origin are traced as fast.
    #[must_use]
    pub fn new(
        tree: Tree,
        volumes: &Volumes,
        sorted: Vec<Corners>,
        bounds: &Aabb,
        pair_order: PairOrder,
        test: TriangleTest,
    ) -> Self {
        let pairs = PairBvh::new(&tree, volumes, &sorted, bounds, pair_order);
        let triangles = LeafTriangles::new(test, sorted, ReferencePoint::ORIGIN);
        let bounds = *pairs.bounds();
        Self { pairs, triangles, leaves: tree.leaves, bounds }
    }

    /// What the nodes are relative to: a point near the triangles if these are far from the origin.
    #[must_use]
    pub fn reference(&self) -> ReferencePoint {
        self.triangles.reference()
    }

    /// The nodes, relative to [`Bvh2::reference`].
    #[must_use]
    pub fn pairs(&self) -> &PairBvh {
        &self.pairs
    }

    /// The triangle test.
    #[must_use]
    pub fn test(&self) -> TriangleTest {
        self.triangles.test()
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.leaves.len()
    }

    /// Memory of nodes, triangles and their numbers.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.pairs.n_bytes() + self.triangles.n_bytes() + size_of_val(&self.leaves[..])
    }
}

impl Intersect for Bvh2 {
    fn bounds(&self) -> Obb {
        self.bounds
    }

    fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> Option<Hit> {
        self.triangles.closest_hit(&self.pairs, &self.leaves, ray, query)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> bool {
        self.triangles.occluded(&self.pairs, &self.leaves, ray, query)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64], hits: &mut Vec<Hit>) {
        self.triangles.all_hits(&self.pairs, &self.leaves, ray, query, hits);
    }
}

/// Sizes and bounds, not every node.
impl fmt::Debug for Bvh2 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bvh2")
            .field("n_triangles", &self.n_triangles())
            .field("n_pairs", &self.pairs.n_pairs())
            .field("depth", &self.pairs.depth())
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}
