//! The top level: instances in classes of similar error, a BVH over the boxes of each class.
//!
//! # Where the error of hits is
//! A hit lies within `per_origin·|o - r|∞ + fixed(r)` of its instance's bounds, for every point `r`. Boxes are relative to a reference
//! point `r` near the instances, and so are the origins of rays: a cluster of instances far from the origin is traced as one near it.
//! `fixed` is part of the instance's box. `per_origin` is that of
//! the transform's condition; it is multiplied by the ray's origin, so rays carry it, and all boxes of a BVH get the greatest
//! of its instances. So instances whose `per_origin` differ much are in different BVHs, which a ray traverses one after
//! another: one ill-conditioned instance does not loosen the boxes of the others. Transforms that scale and rotate have
//! similar conditions, and almost all scenes one class.

mod binary;
mod class;
mod wide;

use canted_lbvh::{self as lbvh, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_trace::{InstanceId, Query, ReferencePoint, ScaledRay};
use canted_wide::{Config, MAX_PRIMITIVES, SimdPath, Stack};

use crate::InstanceError;
use crate::placement::Bounds;
use class::{Class, classify};

/// How the top-level BVH is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TopConfig {
    /// Eight-wide aligned nodes over the instances' axis-aligned boxes: the fastest to trace. `oriented` and `rotate_mesh` of
    /// the configuration are ignored.
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

/// The top-level BVHs.
#[derive(Clone, Debug)]
pub(crate) struct Top {
    classes: Vec<Class>,
    /// World space.
    aabb: Aabb,
    /// What the boxes of the classes are relative to.
    reference: ReferencePoint,
}

/// The spread of `per_origin` in a class when it is built; in a refit four times as much is allowed.
///
/// Boxes are then padded by at most 16 times what the best-conditioned instance needs: less than 400 u of the ray's origin,
/// u = 2^-24, for instances of which one is a rotation.
const SPREAD: f64 = 16.0;
const SPREAD_OF_REFIT: f64 = 64.0;

impl Top {
    /// Builds over the bounds of instances.
    pub(crate) fn build(bounds: &[Bounds], config: &TopConfig, path: SimdPath) -> Result<Self, InstanceError> {
        let classes = classify(bounds, SPREAD).into_iter();
        let reference = reference_of(bounds);
        let of_class = |ids| Class::build((bounds, reference), ids, config, path);
        Ok(Self { classes: classes.map(of_class).collect::<Result<_, _>>()?, aabb: aabb_of(bounds), reference })
    }

    /// The same BVHs traced on another path, if they are wide.
    pub(crate) fn with_path(self, path: SimdPath) -> Self {
        Self { classes: self.classes.into_iter().map(|class| class.with_path(path)).collect(), ..self }
    }

    /// Box around all instances; empty for none.
    pub(crate) fn aabb(&self) -> Aabb {
        self.aabb
    }

    pub(crate) fn n_bytes(&self) -> usize {
        self.classes.iter().map(Class::n_bytes).sum()
    }

    /// Calls `visit` with the box of each node and leaf.
    pub(crate) fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut in_world = |obb, level, is_leaf| visit(self.reference.given_box(obb), level, is_leaf);
        self.classes.iter().for_each(|class| class.each_box(&mut in_world));
    }

    /// New bounds for the same instances, in the same topology; built again where the errors of a class have spread too far.
    pub(crate) fn refit(&mut self, bounds: &[Bounds], config: &TopConfig, path: SimdPath) {
        if self.classes.iter().any(|class| class.spread(bounds) > SPREAD_OF_REFIT)
            && let Ok(top) = Self::build(bounds, config, path)
        {
            *self = top;
            return;
        }
        self.reference = reference_of(bounds);
        self.classes.iter_mut().for_each(|class| class.refit(bounds, self.reference));
        self.aabb = aabb_of(bounds);
    }

    /// How many times the predicted traversal cost has grown since the build: the greatest growth of a class.
    pub(crate) fn drift(&self) -> f32 {
        self.classes.iter().map(Class::drift).fold(1.0, f32::max)
    }

    /// Calls `enter` with each instance whose box `ray` enters at or before `t_max`, nearer subtrees of a class first where
    /// `ORDERED`.
    ///
    /// `enter` gets the scaled `t_max` and returns the new one; a negative value ends the traversal. The entry `t` of a box
    /// is at most that of any hit on its instance, and boxes with an entry `<= t_max` are visited, so `enter` receives all
    /// hits of equal `t`.
    #[inline]
    pub(crate) fn traverse<Q: Query, const ORDERED: bool>(
        &self,
        ray: &ScaledRay,
        query: &mut Q,
        stack: &mut Stack,
        mut enter: impl FnMut(InstanceId, f32, &mut Q) -> f32,
    ) {
        let mut ray = self.reference.moved_ray(ray);
        // Almost all scenes have one class.
        if let [class] = &self.classes[..] {
            return class.traverse::<Q, ORDERED>(&ray, query, stack, enter);
        }
        for class in &self.classes {
            let mut t_max = ray.t_max;
            class.traverse::<Q, ORDERED>(&ray, query, stack, |instance, limit, query| {
                t_max = enter(instance, limit, query);
                t_max
            });
            if t_max < 0.0 {
                return;
            }
            ray.t_max = t_max;
        }
    }
}

/// A point near the instances.
fn reference_of(bounds: &[Bounds]) -> ReferencePoint {
    ReferencePoint::near(bounds.len(), |i| bounds[i].aabb)
}

fn aabb_of(bounds: &[Bounds]) -> Aabb {
    bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds.aabb))
}
