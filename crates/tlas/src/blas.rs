use canted_bvh2::Bvh2;
use canted_obb::Obb;
use canted_trace::{Hit, InstanceId, Kernel, Query, Ray};
use canted_wide::{LaneKernel, TriangleBvh};

/// What an instance places: anything that answers rays in its object space.
///
/// Implemented by [`TriangleBvh`] and [`Bvh2`]; a scene mixes kinds through an enum of the caller's. `instance` is written into hits
/// and shown to the query. Among hits of equal `t` the lowest primitive must win.
pub trait Blas: Send + Sync {
    /// A box around everything, object space.
    fn bounds(&self) -> Obb;

    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit>;

    /// Whether any hit is accepted: agrees with [`Blas::closest_hit_with`].
    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool;
}

impl<K: Kernel> Blas for Bvh2<K> {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        Self::closest_hit_with(self, ray_object, instance, query)
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        Self::occluded_with(self, ray_object, instance, query)
    }
}

impl<K: LaneKernel> Blas for TriangleBvh<K> {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        Self::closest_hit_with(self, ray_object, instance, query)
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        Self::occluded_with(self, ray_object, instance, query)
    }
}
