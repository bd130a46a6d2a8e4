use std::fmt;

use canted_lbvh::{self as lbvh, GeometryError, par};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{HIT_ERROR, Hit, Intersect, LeafTriangles, Query, ReferencePoint, ScaledRay, TriangleTest};

use crate::{KdNodes, KdTraversal, KdTreeConfig, KdTreeMemory};

/// A kd-tree over triangles.
///
/// Hits are those of the triangle test on every triangle; ties go to the lowest primitive. [`Intersect`] has the queries.
///
/// ```
/// use canted_kdtree::{KdTreeConfig, KdTree, KdTraversal};
/// use canted_trace::{Intersect, Ray};
///
/// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let config = KdTreeConfig { traversal: KdTraversal::Ropes, ..KdTreeConfig::default() };
/// let tree = KdTree::build(&positions, &[[0, 1, 2], [3, 4, 5]], &config)?;
/// let mut hits = vec![];
/// tree.all_hits(&Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]), &mut hits);
/// assert_eq!(hits.iter().map(|hit| (hit.t, hit.primitive.0)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 0)]);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[derive(Clone)]
pub struct KdTree {
    nodes: KdNodes,
    /// The triangles in the order in which leaves refer to them first.
    triangles: LeafTriangles,
    /// Their numbers in the caller's array.
    primitives: Vec<PrimId>,
    bounds: Aabb,
}

/// Triangles of one job.
const CHUNK: usize = 1 << 13;

impl KdTree {
    /// Builds over indexed triangles.
    ///
    /// # Errors
    /// The first triangle with a missing vertex or a vertex that is not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &KdTreeConfig) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let reference = ReferencePoint::near(corners.len(), |i| Aabb::from_points(corners[i]));
        let moved = |corners: &lbvh::Corners| corners.map(|vertex| reference.moved(vertex));
        let moved = (!reference.is_origin()).then(|| par::map(&corners, CHUNK, moved));
        let nodes = KdNodes::new(moved.as_deref().unwrap_or(&corners), config);
        let (nodes, primitives) = nodes.in_leaf_order(corners.len());
        let sorted = lbvh::in_leaf_order(&corners, &primitives);
        Ok(Self { nodes, triangles: LeafTriangles::new(config.test, sorted, reference), primitives, bounds })
    }

    /// As [`Self::build`], over triangles that have their vertices themselves: the same tree as over any indexed form of them. In errors, vertex `3i + k` is
    /// vertex `k` of triangle `i`.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn build_flat(triangles: &[lbvh::Corners], config: &KdTreeConfig) -> Result<Self, GeometryError> {
        Self::build(triangles.as_flattened(), &lbvh::flat_indices(triangles.len())?, config)
    }

    /// The same tree for another traversal.
    #[must_use]
    pub fn with_traversal(self, traversal: KdTraversal) -> Self {
        Self { nodes: self.nodes.with_traversal(traversal), ..self }
    }

    /// What the planes are relative to: a point near the triangles if these are far from the origin.
    #[must_use]
    pub fn reference(&self) -> ReferencePoint {
        self.triangles.reference()
    }

    /// The planes and leaves, relative to [`KdTree::reference`]. They refer to positions in [`Self::primitives`].
    #[must_use]
    pub fn nodes(&self) -> &KdNodes {
        &self.nodes
    }

    /// The numbers of the triangles in the caller's array, in the order in which leaves refer to them first.
    #[must_use]
    pub fn primitives(&self) -> &[PrimId] {
        &self.primitives
    }

    /// The triangle test.
    #[must_use]
    pub fn test(&self) -> TriangleTest {
        self.triangles.test()
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Memory of all parts together.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.memory().total()
    }

    /// Memory by part.
    #[must_use]
    pub fn memory(&self) -> KdTreeMemory {
        let triangles = self.triangles.n_bytes() + size_of_val(&self.primitives[..]);
        KdTreeMemory { triangles, ..self.nodes.memory() }
    }
}

impl Intersect for KdTree {
    /// The bounds of all triangles; a point at the origin if there are none.
    fn bounds(&self) -> Obb {
        Obb::from_aabb(&self.bounds)
    }

    fn is_empty(&self) -> bool {
        self.n_triangles() == 0
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> Option<Hit> {
        self.triangles.closest_hit(&self.nodes, &self.primitives, ray, query)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> bool {
        self.triangles.occluded(&self.nodes, &self.primitives, ray, query)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64], hits: &mut Vec<Hit>) {
        self.triangles.all_hits(&self.nodes, &self.primitives, ray, query, hits);
    }
}

/// Sizes and bounds, not every node.
impl fmt::Debug for KdTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("KdTree")
            .field("n_triangles", &self.n_triangles())
            .field("n_leaves", &self.nodes.n_leaves())
            .field("n_references", &self.nodes.n_references())
            .field("depth", &self.nodes.depth())
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}
