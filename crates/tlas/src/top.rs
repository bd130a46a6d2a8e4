mod binary;
mod wide;

use canted_lbvh::{self as lbvh, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_trace::{InstanceId, Query, ScaledRay};
use canted_wide::{Config, MAX_PRIMITIVES, SimdPath};

use crate::InstanceError;
use binary::BinaryTop;
use wide::WideTop;

/// How the top-level BVH is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TopConfig {
    /// Eight-wide aligned nodes over the instances' axis-aligned boxes: the fastest to trace.
    Wide(Config),
    /// A binary radix tree over the instances' oriented boxes, with volumes of this strategy.
    Binary(VolumeConfig),
}

impl Default for TopConfig {
    fn default() -> Self {
        Self::Wide(Config::default())
    }
}

impl TopConfig {
    /// The greatest number of instances that the BVH can index.
    pub(crate) fn max_instances(&self) -> usize {
        match self {
            Self::Wide(_) => MAX_PRIMITIVES,
            Self::Binary(_) => lbvh::MAX_PRIMITIVES,
        }
    }
}

/// The top-level BVH.
#[derive(Clone, Debug)]
pub(crate) enum Top {
    Wide(WideTop),
    Binary(BinaryTop),
}

impl Top {
    /// Builds over `instances`, one box for each, world space.
    pub(crate) fn build(instances: &[Obb], config: &TopConfig, path: SimdPath) -> Result<Self, InstanceError> {
        let boxes = aabbs(instances);
        Ok(match config {
            TopConfig::Wide(config) => Self::Wide(WideTop::build(boxes, *config, path)?),
            TopConfig::Binary(config) => Self::Binary(BinaryTop::build(instances, &boxes, *config)),
        })
    }

    /// The same BVH traced on another path, if it is wide.
    pub(crate) fn with_path(self, path: SimdPath) -> Self {
        match self {
            Self::Wide(top) => Self::Wide(top.with_path(path)),
            binary @ Self::Binary(_) => binary,
        }
    }

    /// Box around all instances; empty for none.
    pub(crate) fn aabb(&self) -> Aabb {
        match self {
            Self::Wide(top) => top.aabb(),
            Self::Binary(top) => top.aabb(),
        }
    }

    pub(crate) fn n_bytes(&self) -> usize {
        match self {
            Self::Wide(top) => top.n_bytes(),
            Self::Binary(top) => top.n_bytes(),
        }
    }

    /// New boxes for the same instances, in the same topology.
    pub(crate) fn refit(&mut self, instances: &[Obb]) {
        let boxes = aabbs(instances);
        match self {
            Self::Wide(top) => top.refit(boxes),
            Self::Binary(top) => top.refit(instances, &boxes),
        }
    }

    /// How many times the predicted traversal cost has grown since the build.
    pub(crate) fn drift(&self) -> f32 {
        match self {
            Self::Wide(top) => top.drift(),
            Self::Binary(top) => top.drift(),
        }
    }

    /// Calls `enter` with each instance whose box `ray` enters at or before `t_max`, nearer subtrees first.
    ///
    /// `enter` gets the scaled `t_max` and returns the new one. The entry `t` of a box is at most that of any hit within
    /// `error` of it, world space, and boxes with an entry `<= t_max` are visited, so `enter` sees all hits of equal `t`.
    #[inline]
    pub(crate) fn traverse_ordered<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        enter: impl FnMut(InstanceId, f32, &mut Q) -> f32,
    ) {
        match self {
            Self::Wide(top) => top.traverse_ordered(ray, error, query, enter),
            Self::Binary(top) => top.traverse_ordered(ray, error, query, enter),
        }
    }

    /// As [`Top::traverse_ordered`], in any order, until `enter` returns a `t_max` below zero.
    #[inline]
    pub(crate) fn traverse_any<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        enter: impl FnMut(InstanceId, f32, &mut Q) -> f32,
    ) {
        match self {
            Self::Wide(top) => top.traverse_any(ray, error, query, enter),
            Self::Binary(top) => top.traverse_any(ray, error, query, enter),
        }
    }
}

fn aabbs(instances: &[Obb]) -> Vec<Aabb> {
    instances.iter().map(Obb::aabb).collect()
}
