use std::fmt;

use canted_bvh2::leaf_triangles::LeafTriangles;
use canted_bvh2::triangle_queries;
use canted_lbvh::{self as lbvh, GeometryError, par};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Kernel, ReferencePoint};

use crate::{Config, KdNodes, Memory, Traversal};

/// A kd-tree over triangles.
///
/// `K` is the triangle test. Hits are those of `K` on every triangle; ties go to the lowest primitive.
///
/// ```
/// use canted_kdtree::{Config, KdTree, Traversal};
/// use canted_trace::{Ray, Watertight};
///
/// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let config = Config { traversal: Traversal::Ropes, ..Config::default() };
/// let tree = KdTree::<Watertight>::build(&positions, &[[0, 1, 2], [3, 4, 5]], &config)?;
/// let mut hits = vec![];
/// tree.all_hits(&Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]), &mut hits);
/// assert_eq!(hits.iter().map(|hit| (hit.t, hit.primitive.0)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 0)]);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
pub struct KdTree<K: Kernel> {
    nodes: KdNodes,
    /// The triangles in the order in which leaves refer to them first.
    records: Vec<K::Record>,
    /// Their numbers in the caller's array.
    primitives: Vec<PrimId>,
    bounds: Aabb,
    /// What the nodes are relative to; triangles are in object space.
    reference: ReferencePoint,
}

/// Triangles of one job.
const CHUNK: usize = 1 << 13;

impl<K: Kernel> KdTree<K> {
    /// Builds over indexed triangles.
    ///
    /// # Errors
    /// The first triangle with a missing vertex or a vertex that is not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &Config) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let reference = ReferencePoint::near(corners.len(), |i| Aabb::from_points(corners[i]));
        let moved = |corners: &lbvh::Corners| corners.map(|vertex| reference.moved(vertex));
        let moved = (!reference.is_origin()).then(|| par::map(&corners, CHUNK, moved));
        let nodes = KdNodes::new(moved.as_deref().unwrap_or(&corners), config);
        let (nodes, primitives) = nodes.in_leaf_order(corners.len());
        // If a record is just the vertices, this reuses the allocation.
        let records = lbvh::in_leaf_order(&corners, &primitives).into_iter().map(K::record).collect();
        Ok(Self { nodes, records, primitives, bounds, reference })
    }

    #[inline(always)]
    fn leaf_triangles(&self) -> LeafTriangles<'_, KdNodes, K> {
        let (nodes, records, primitives) = (&self.nodes, &self.records[..], &self.primitives[..]);
        LeafTriangles { nodes, records, primitives, reference: self.reference }
    }

    /// The same tree for another traversal.
    #[must_use]
    pub fn with_traversal(self, traversal: Traversal) -> Self {
        Self { nodes: self.nodes.with_traversal(traversal), ..self }
    }

    /// What the planes are relative to: a point near the triangles if these are far from the origin.
    #[must_use]
    pub fn reference(&self) -> ReferencePoint {
        self.reference
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

    /// The bounds of all triangles; a point at the origin if there are none.
    #[must_use]
    pub fn bounds(&self) -> Obb {
        if self.records.is_empty() {
            return Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] };
        }
        Obb::from_aabb(&self.bounds)
    }

    /// Number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.records.len()
    }

    /// Memory of all parts together.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.memory().total()
    }

    /// Memory by part.
    #[must_use]
    pub fn memory(&self) -> Memory {
        let triangles = size_of_val(&self.records[..]) + size_of_val(&self.primitives[..]);
        Memory { triangles, ..self.nodes.memory() }
    }
}

triangle_queries!(KdTree);

impl<K: Kernel> Clone for KdTree<K> {
    fn clone(&self) -> Self {
        Self {
            nodes: self.nodes.clone(),
            records: self.records.clone(),
            primitives: self.primitives.clone(),
            ..*self
        }
    }
}

/// Sizes and bounds, not every node.
impl<K: Kernel> fmt::Debug for KdTree<K> {
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
