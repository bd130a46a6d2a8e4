use canted_bih::Bih;
use canted_bvh2::Bvh2;
use canted_kdtree::KdTree;
use canted_lbvh::Strategy;
use canted_obb::Obb;
use canted_tlas::Blas;
use canted_trace::{HIT_ERROR, Hit, InstanceId, Query, Ray, ScaledRay};
use canted_wide::{LaneKernel, MovingBvh, RefitError, Sizes, Stack, TriangleBvh};

use super::Triangles;
use crate::PrepareError;

/// A bottom-level structure.
pub enum Bvh<K: LaneKernel> {
    /// Eight-wide, with aligned and oriented nodes.
    Wide(TriangleBvh<K>),
    /// As `Wide`, over triangles whose vertices move while the shutter is open.
    Moving(MovingBvh<K>),
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
            Bvh::Moving($inner) => $result,
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
        Triangles { positions, close, triangles }: Triangles,
    ) -> Result<Option<f32>, PrepareError> {
        let refit = match (self, close) {
            (Self::Wide(wide), None) => wide.refit(positions, triangles),
            (Self::Moving(moving), Some(close)) => moving.refit(positions, close, triangles),
            _ => return Ok(None),
        };
        match refit {
            Ok(refit) => Ok(Some(refit.drift)),
            Err(RefitError::Geometry(error)) => Err(error.into()),
            // The caller then builds a BVH over the new number of triangles.
            Err(_) => Ok(None),
        }
    }

    /// Calls `visit` with the box of each node and leaf, object space: the box, its level, 0 for the root, and whether it is a leaf.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        match self {
            Self::Wide(bvh) => bvh.each_box(visit),
            Self::Moving(bvh) => bvh.each_box(visit),
            Self::Binary(bvh, _) => {
                bvh.pairs().each_box(|obb, level, is_leaf| visit(bvh.reference().given_box(obb), level, is_leaf));
            }
            Self::Bih(bih) => {
                bih.boxes().each_box(|obb, level, is_leaf| visit(bih.reference().given_box(obb), level, is_leaf));
            }
            Self::KdTree(tree) => {
                tree.nodes().each_box(|obb, level, is_leaf| visit(tree.reference().given_box(obb), level, is_leaf));
            }
        }
    }

    /// Whether it has oriented nodes.
    pub(crate) fn has_oriented_nodes(&self) -> bool {
        match self {
            Self::Wide(wide) => is_oriented(&wide.sizes(), wide.frame()),
            Self::Moving(moving) => is_oriented(&moving.sizes(), moving.frame()),
            Self::Binary(_, strategy) => *strategy != Strategy::Aabb,
            Self::Bih(_) | Self::KdTree(_) => false,
        }
    }
}

fn is_oriented(sizes: &Sizes, frame: [[f32; 3]; 3]) -> bool {
    let [_, oriented] = sizes.nodes;
    oriented > 0 || frame != Obb::IDENTITY_FRAME
}

impl<K: LaneKernel> Blas for Bvh<K> {
    fn bounds(&self) -> Obb {
        each!(self, bvh => Blas::bounds(bvh))
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn has_local_error(&self) -> bool {
        true
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

    #[inline]
    fn closest_hit_scaled<Q: Query>(
        &self,
        ray: &ScaledRay,
        instance: InstanceId,
        query: &mut Q,
        stack: &mut Stack,
    ) -> Option<Hit> {
        each!(self, bvh => Blas::closest_hit_scaled(bvh, ray, instance, query, stack))
    }

    #[inline]
    fn occluded_scaled<Q: Query>(
        &self,
        ray: &ScaledRay,
        instance: InstanceId,
        query: &mut Q,
        stack: &mut Stack,
    ) -> bool {
        each!(self, bvh => Blas::occluded_scaled(bvh, ray, instance, query, stack))
    }
}
