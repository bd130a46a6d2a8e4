use std::fmt;

use canted_bvh2::leaf_triangles::LeafTriangles;
use canted_bvh2::triangle_queries;
use canted_lbvh::{self as lbvh, GeometryError};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::Kernel;

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
}

impl<K: Kernel> KdTree<K> {
    /// Builds over indexed triangles.
    ///
    /// # Errors
    /// The first triangle with a missing vertex or a vertex that is not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &Config) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let (nodes, primitives) = KdNodes::new(&corners, config).in_leaf_order(corners.len());
        // If a record is just the vertices, this reuses the allocation.
        let records = lbvh::in_leaf_order(&corners, &primitives).into_iter().map(K::record).collect();
        Ok(Self { nodes, records, primitives, bounds })
    }

    #[inline(always)]
    fn leaf_triangles(&self) -> LeafTriangles<'_, KdNodes, K> {
        LeafTriangles { nodes: &self.nodes, records: &self.records, primitives: &self.primitives }
    }

    /// The same tree for another traversal.
    #[must_use]
    pub fn with_traversal(self, traversal: Traversal) -> Self {
        Self { nodes: self.nodes.with_traversal(traversal), ..self }
    }

    /// The planes and leaves. They refer to positions in [`Self::primitives`].
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
            bounds: self.bounds,
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
