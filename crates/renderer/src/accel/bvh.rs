use canted_bih::Bih;
use canted_bvh2::Bvh2;
use canted_kdtree::KdTree;
use canted_lbvh::Strategy;
use canted_obb::Obb;
use canted_tlas::Blas;
use canted_trace::{HIT_ERROR, Hit, InstanceId, Query, Ray};
use canted_wide::{LaneKernel, RefitError, TriangleBvh};

use crate::PrepareError;

/// A bottom-level structure.
pub enum Bvh<K: LaneKernel> {
    /// Eight-wide, with aligned and oriented nodes.
    Wide(TriangleBvh<K>),
    /// Binary, with volumes of one strategy.
    Binary(Bvh2<K>, Strategy),
    /// A bounding interval hierarchy.
    Bih(Bih<K>),
    /// A kd-tree.
    KdTree(KdTree<K>),
}

/// Evaluates an expression for the structure inside, whichever it is.
macro_rules! each {
    ($bvh:expr, $inner:ident => $result:expr) => {
        match $bvh {
            Bvh::Wide($inner) => $result,
            Bvh::Binary($inner, _) => $result,
            Bvh::Bih($inner) => $result,
            Bvh::KdTree($inner) => $result,
        }
    };
}

impl<K: LaneKernel> Bvh<K> {
    /// Memory of nodes and triangles.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        each!(self, bvh => bvh.n_bytes())
    }

    /// Updates the boxes to new vertices of the same triangles; returns the drift, or `None` where this kind of structure cannot be
    /// refitted.
    pub(crate) fn refit(
        &mut self,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Option<f32>, PrepareError> {
        match self {
            Self::Wide(wide) => match wide.refit(positions, triangles) {
                Ok(refit) => Ok(Some(refit.drift)),
                Err(RefitError::Geometry(error)) => Err(error.into()),
                // The caller then builds a BVH over the new number of triangles.
                Err(_) => Ok(None),
            },
            Self::Binary(..) | Self::Bih(_) | Self::KdTree(_) => Ok(None),
        }
    }

    /// Whether it has oriented nodes.
    pub(crate) fn has_oriented_nodes(&self) -> bool {
        match self {
            Self::Wide(wide) => {
                let [_, oriented] = wide.sizes().nodes;
                oriented > 0 || wide.frame() != Obb::IDENTITY_FRAME
            }
            Self::Binary(_, strategy) => *strategy != Strategy::Aabb,
            Self::Bih(_) | Self::KdTree(_) => false,
        }
    }
}

impl<K: LaneKernel> Blas for Bvh<K> {
    fn bounds(&self) -> Obb {
        each!(self, bvh => Blas::bounds(bvh))
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        each!(self, bvh => bvh.closest_hit_with(ray_object, instance, query))
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        each!(self, bvh => bvh.occluded_with(ray_object, instance, query))
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        each!(self, bvh => bvh.all_hits_with(ray_object, instance, query, hits));
    }
}
