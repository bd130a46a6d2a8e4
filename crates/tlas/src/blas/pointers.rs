use std::sync::Arc;

use canted_obb::Obb;
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay};
use canted_wide::Stack;

use super::{Blas, CrossingBlas};

/// Passes every call on to the BVH behind a pointer.
macro_rules! forward {
    ($pointer:ty) => {
        impl<B: Blas> Blas for $pointer {
            fn bounds(&self) -> Obb {
                B::bounds(self)
            }

            fn hit_error(&self) -> f32 {
                B::hit_error(self)
            }

            fn has_local_error(&self) -> bool {
                B::has_local_error(self)
            }

            fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
                B::closest_hit_with(self, ray_object, instance, query)
            }

            fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
                B::occluded_with(self, ray_object, instance, query)
            }

            fn all_hits_with<Q: Query>(
                &self,
                ray_object: &Ray,
                instance: InstanceId,
                query: &mut Q,
                hits: &mut Vec<Hit>,
            ) {
                B::all_hits_with(self, ray_object, instance, query, hits);
            }

            #[inline]
            fn closest_hit_scaled<Q: Query>(&self, ray: &ScaledRay, instance: InstanceId, query: &mut Q, stack: &mut Stack) -> Option<Hit> {
                B::closest_hit_scaled(self, ray, instance, query, stack)
            }

            #[inline]
            fn occluded_scaled<Q: Query>(&self, ray: &ScaledRay, instance: InstanceId, query: &mut Q, stack: &mut Stack) -> bool {
                B::occluded_scaled(self, ray, instance, query, stack)
            }
        }

        impl<B: CrossingBlas> CrossingBlas for $pointer {
            fn crossings(&self, ray_object: &Ray, instance: InstanceId, crossings: &mut Vec<Hit>) {
                B::crossings(self, ray_object, instance, crossings);
            }
        }
    };
}

forward!(&B);
forward!(Box<B>);
forward!(Arc<B>);
