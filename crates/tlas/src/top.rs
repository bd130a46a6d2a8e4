use canted_bvh2::{PairBvh, PairOrder};
use canted_lbvh::{self as lbvh, Bits, Domain, VolumeConfig};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{InstanceId, Query, ScaledRay, SlabRay};
use canted_wide::{BoxTree, Config, MAX_PRIMITIVES, PrimitiveError, SimdPath};

use crate::InstanceError;

/// How the tree over instances is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TopConfig {
    /// Eight-wide nodes over the instances' boxes along the axes: the fastest to trace.
    Wide(Config),
    /// The radix tree over the instances' boxes, with these volumes.
    Binary(VolumeConfig),
}

impl Default for TopConfig {
    fn default() -> Self {
        Self::Wide(Config::default())
    }
}

/// The tree over instances.
pub(crate) enum Top {
    Wide(BoxTree),
    /// With the instance of each leaf.
    Binary(PairBvh, Vec<InstanceId>),
}

impl TopConfig {
    /// Most instances that the tree can name.
    pub(crate) fn most_instances(&self) -> usize {
        match self {
            Self::Wide(_) => MAX_PRIMITIVES,
            Self::Binary(_) => lbvh::MAX_PRIMITIVES,
        }
    }
}

impl Top {
    /// Builds over a box an instance, world space.
    pub(crate) fn new(instances: &[Obb], config: &TopConfig) -> Result<Self, InstanceError> {
        let boxes: Vec<Aabb> = instances.iter().map(Obb::aabb).collect();
        match config {
            TopConfig::Wide(config) => Ok(Self::Wide(BoxTree::build(&boxes, config)?)),
            TopConfig::Binary(volumes) => {
                let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
                let codes = lbvh::morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes);
                let tree = lbvh::radix(lbvh::sort_by_code(&codes, Bits::B63));
                let sorted: Vec<Obb> = tree.leaves.iter().map(|leaf| instances[leaf.index()]).collect();
                let volumes = lbvh::volumes(&tree, &sorted, volumes);
                let binary = PairBvh::new(&tree, &volumes, &sorted, &bounds, PairOrder::Numbered);
                Ok(Self::Binary(binary, tree.leaves.iter().map(|leaf| InstanceId(leaf.0)).collect()))
            }
        }
    }

    /// The same tree walked on another path, where it is wide.
    pub(crate) fn with_path(self, path: SimdPath) -> Self {
        match self {
            Self::Wide(tree) => Self::Wide(tree.with_path(path)),
            binary @ Self::Binary(..) => binary,
        }
    }

    /// Box around all instances; empty for none.
    pub(crate) fn aabb(&self) -> Aabb {
        match self {
            Self::Wide(tree) => tree.aabb(),
            Self::Binary(_, leaves) if leaves.is_empty() => Aabb::EMPTY,
            Self::Binary(binary, _) => binary.bounds().aabb(),
        }
    }

    /// Memory of nodes and numbers.
    pub(crate) fn n_bytes(&self) -> usize {
        match self {
            Self::Wide(tree) => tree.n_bytes(),
            Self::Binary(binary, leaves) => binary.n_bytes() + size_of_val(&leaves[..]),
        }
    }

    /// Calls `enter` with each instance whose box `ray` enters at or before `t_max`, nearer subtrees first.
    ///
    /// `enter` is given the scaled `t_max` and returns the new one. A box is entered no later than any hit that lies within
    /// `error` of it, world space, and while that is `<= t_max`: so ties are met, whatever the tree.
    #[inline]
    pub(crate) fn traverse_ordered<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        mut enter: impl FnMut(InstanceId, f32, &mut Q) -> f32,
    ) {
        match self {
            Self::Wide(tree) => tree.traverse_ordered(ray, error, query, by_number(enter)),
            Self::Binary(binary, leaves) => {
                let slab_ray = SlabRay::with_error(ray, binary.reach(), error);
                binary.traverse_ordered(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
                    enter(leaves[leaf as usize], t_max, query)
                });
            }
        }
    }

    /// As [`Top::traverse_ordered`], in any order, until `enter` returns a `t_max` below zero.
    #[inline]
    pub(crate) fn traverse_any<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        mut enter: impl FnMut(InstanceId, f32, &mut Q) -> f32,
    ) {
        match self {
            Self::Wide(tree) => tree.traverse_any(ray, error, query, by_number(enter)),
            Self::Binary(binary, leaves) => {
                let slab_ray = SlabRay::with_error(ray, binary.reach(), error);
                binary.traverse_any(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
                    enter(leaves[leaf as usize], t_max, query)
                });
            }
        }
    }
}

/// The boxes of a wide top level are numbered as the instances are.
fn by_number<Q>(mut enter: impl FnMut(InstanceId, f32, &mut Q) -> f32) -> impl FnMut(PrimId, f32, &mut Q) -> f32 {
    move |PrimId(number), t_max, query| enter(InstanceId(number), t_max, query)
}

impl From<PrimitiveError> for InstanceError {
    fn from(error: PrimitiveError) -> Self {
        match error {
            PrimitiveError::Bounds { primitive } => Self::OutOfRange { instance: primitive.index() },
            PrimitiveError::TooMany { n_primitives } => Self::TooMany { n_instances: n_primitives },
        }
    }
}
