use canted_lbvh::{self as lbvh, Bits, Corners, Domain, GeometryError, Tree, Volumes};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Hit, InstanceId, Kernel, Query, Ray, ScaledRay, SlabRay};

use canted_wide::{LaneKernel, Wide};

use crate::{Binary, PairOrder};

/// What an instance places: anything that answers rays in its object space.
///
/// Implemented by [`Wide`] and [`MeshBlas`]; a scene mixes kinds through an enum of the caller's. `instance` is written into hits
/// and shown to the query. Among hits of equal `t` the lowest primitive must win.
pub trait Blas: Send + Sync {
    /// A box around everything, object space.
    fn bounds(&self) -> Obb;

    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    fn closest_hit<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit>;

    /// Whether any hit is accepted: agrees with [`Blas::closest_hit`].
    fn occluded<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool;
}

/// How a bottom level is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct BuildConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// Volumes of the nodes.
    pub volumes: lbvh::VolumeConfig,
}

/// A bottom level over triangles: a traced binary tree and the triangles in its leaf order.
///
/// `K` is the triangle test.
pub struct MeshBlas<K: Kernel> {
    binary: Binary,
    records: Vec<K::Record>,
    leaves: Vec<PrimId>,
}

impl<K: Kernel> MeshBlas<K> {
    /// Builds a radix tree over the triangles.
    ///
    /// # Errors
    /// The first triangle with a vertex that is missing or not finite.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], config: &BuildConfig) -> Result<Self, GeometryError> {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, config.bits), &corners);
        let tree = lbvh::radix(lbvh::sort_by_code(&codes, config.bits));
        let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
        let volumes = lbvh::volumes(&tree, &sorted, &config.volumes);
        Ok(Self::new(tree, &volumes, sorted, &bounds, PairOrder::Numbered))
    }

    /// Traces through a tree of another builder.
    #[must_use]
    pub fn over(tree: Tree, corners: &[Corners], bounds: &Aabb, config: &BuildConfig) -> Self {
        let sorted = lbvh::in_leaf_order(corners, &tree.leaves);
        let volumes = lbvh::volumes(&tree, &sorted, &config.volumes);
        Self::new(tree, &volumes, sorted, bounds, PairOrder::DepthFirst)
    }

    /// Joins the results of the stations: `sorted` are the corners in leaf order.
    #[must_use]
    pub fn new(tree: Tree, volumes: &Volumes, sorted: Vec<Corners>, bounds: &Aabb, pair_order: PairOrder) -> Self {
        let binary = Binary::new(&tree, volumes, &sorted, bounds, pair_order);
        // Where a record is the vertices themselves this takes the array over as it is.
        let records = sorted.into_iter().map(K::record).collect();
        Self { binary, records, leaves: tree.leaves }
    }

    /// The traced tree.
    #[must_use]
    pub fn binary(&self) -> &Binary {
        &self.binary
    }

    /// Memory of nodes, triangles and their numbers.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.binary.n_bytes() + size_of_val(&self.records[..]) + size_of_val(&self.leaves[..])
    }

    /// The hit at a leaf, `t` scaled, before the query was asked.
    #[inline(always)]
    fn hit(&self, prepared: &K::Prepared, ray: &ScaledRay, leaf: u32, t_max: f32, instance: InstanceId) -> Option<Hit> {
        let hit = K::intersect(prepared, ray, &self.records[leaf as usize], t_max)?;
        let primitive = self.leaves[leaf as usize];
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side })
    }
}

impl<K: Kernel> Blas for MeshBlas<K> {
    fn bounds(&self) -> Obb {
        *self.binary.bounds()
    }

    fn closest_hit<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray_object)?;
        let prepared = K::prepare(&ray);
        let mut best: Option<Hit> = None;
        let slab_ray = SlabRay::new(&ray, self.binary.reach());
        self.binary.closest(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, leaf, t_max, instance) {
                Some(hit) if best.is_none_or(|best| hit.before(&best)) && accepted(&hit, &ray, query) => {
                    best = Some(hit);
                    hit.t
                }
                _ => t_max,
            }
        });
        best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
    }

    fn occluded<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        let Some(ray) = ScaledRay::new(ray_object) else { return false };
        let prepared = K::prepare(&ray);
        let mut found = false;
        let slab_ray = SlabRay::new(&ray, self.binary.reach());
        self.binary.any(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            query.triangles(1);
            match self.hit(&prepared, &ray, leaf, t_max, instance) {
                Some(hit) if accepted(&hit, &ray, query) => {
                    found = true;
                    -1.0
                }
                _ => t_max,
            }
        });
        found
    }
}

impl<K: LaneKernel> Blas for Wide<K> {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn closest_hit<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        self.closest_hit_with(ray_object, instance, query)
    }

    fn occluded<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        self.occluded_with(ray_object, instance, query)
    }
}

/// Asks the query about a hit in the caller's units.
#[inline(always)]
fn accepted<Q: Query>(hit: &Hit, ray: &ScaledRay, query: &mut Q) -> bool {
    query.accepts(&Hit { t: ray.caller_t(hit.t), ..*hit })
}
