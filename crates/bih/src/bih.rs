use std::fmt;

use canted_lbvh::{Corners, GeometryError, MAX_PRIMITIVES, flat_indices, par, triangle_corners};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{HIT_ERROR, Hit, Intersect, LeafTriangles, Query, ReferencePoint, ScaledRay, TriangleTest};

use crate::partition::{Content, Item};
use crate::{BihConfig, BihMemory, BoxBih};

/// Triangles per job.
const CHUNK: usize = 1 << 13;

/// A bounding interval hierarchy over triangles.
///
/// Hits are those of the triangle test on every triangle; ties go to the lowest primitive. [`Intersect`] has the queries.
///
/// ```
/// use canted_bih::{Bih, BihConfig, LeafSize};
/// use canted_trace::{Intersect, Ray};
///
/// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let config = BihConfig { leaf_size: LeafSize::AtMost(1), ..BihConfig::default() };
/// let bih = Bih::build(&positions, &[[0, 1, 2], [3, 4, 5]], &config)?;
/// let mut hits = vec![];
/// bih.all_hits(&Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]), &mut hits);
/// assert_eq!(hits.iter().map(|hit| (hit.t, hit.primitive.0)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 0)]);
/// assert_eq!(bih.memory().nodes, 3 * 16);
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[derive(Clone)]
pub struct Bih {
    boxes: BoxBih,
    triangles: LeafTriangles,
    /// Of all triangles, object space.
    bounds: Aabb,
}

impl Bih {
    /// Builds a BIH over the triangles.
    ///
    /// # Errors
    /// The first triangle with a missing vertex or a vertex that is not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &BihConfig) -> Result<Self, GeometryError> {
        if triangles.len() > MAX_PRIMITIVES {
            return Err(GeometryError::TooMany { n_triangles: triangles.len() });
        }
        let vertex = |i: u32| positions.get(i as usize).copied().unwrap_or([f32::NAN; 3]);
        let corners = |&[a, b, c]: &[u32; 3]| [vertex(a), vertex(b), vertex(c)];
        let reference = ReferencePoint::near(triangles.len(), |i| Aabb::from_points(corners(&triangles[i])));
        let moved = |triangle: &[u32; 3]| corners(triangle).map(|vertex| reference.moved(vertex));
        let items = par::from_fn(triangles.len(), CHUNK, |i| Item::of_triangle(i as u32, moved(&triangles[i])));
        let contents = par::map_chunks(&items, CHUNK, |_, chunk| Content::of(chunk));
        let content = contents.into_iter().reduce(Content::union).unwrap_or(Content::EMPTY);
        if !content.reach.is_finite() {
            // The error is found here, off the fast path.
            triangle_corners(positions, triangles)?;
        }
        let bounds = match reference.is_origin() {
            true => content.bounds,
            false => Aabb::from_points(triangles.iter().flat_map(corners)),
        };
        let boxes = BoxBih::of_items(items, content, config);
        // The order of the triangles stays the caller's: only references are sorted, and records copied in their order.
        // Every index is valid by now.
        let sorted = par::map(&boxes.primitives, CHUNK, |primitive: &PrimId| {
            let [a, b, c] = triangles[primitive.index()];
            [positions[a as usize], positions[b as usize], positions[c as usize]]
        });
        Ok(Self { boxes, triangles: LeafTriangles::new(config.test, sorted, reference), bounds })
    }

    /// As [`Self::build`], over triangles that have their vertices themselves: the same tree as over any indexed form of them. In errors, vertex `3i + k` is
    /// vertex `k` of triangle `i`.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn build_flat(triangles: &[Corners], config: &BihConfig) -> Result<Self, GeometryError> {
        Self::build(triangles.as_flattened(), &flat_indices(triangles.len())?, config)
    }

    /// What the nodes are relative to: a point near the triangles if these are far from the origin.
    #[must_use]
    pub fn reference(&self) -> ReferencePoint {
        self.triangles.reference()
    }

    /// The nodes, relative to [`Bih::reference`].
    #[must_use]
    pub fn boxes(&self) -> &BoxBih {
        &self.boxes
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

    /// Memory of nodes, references and triangles.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.memory().total()
    }

    /// Memory of each array.
    #[must_use]
    pub fn memory(&self) -> BihMemory {
        BihMemory { triangles: self.triangles.n_bytes(), ..self.boxes.memory() }
    }
}

impl Intersect for Bih {
    /// The box around all triangles; a point at the origin if there are none.
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
        self.triangles.closest_hit(&self.boxes, &self.boxes.primitives, ray, query)
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> bool {
        self.triangles.occluded(&self.boxes, &self.boxes.primitives, ray, query)
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64], hits: &mut Vec<Hit>) {
        self.triangles.all_hits(&self.boxes, &self.boxes.primitives, ray, query, hits);
    }
}

/// Sizes and bounds, not every node.
impl fmt::Debug for Bih {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bih")
            .field("n_triangles", &self.n_triangles())
            .field("n_nodes", &self.boxes.n_nodes())
            .field("depth", &self.boxes.depth())
            .field("bounds", &self.bounds())
            .finish_non_exhaustive()
    }
}
