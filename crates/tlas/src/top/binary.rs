use canted_bvh2::{PairBvh, PairOrder};
use canted_lbvh::{self as lbvh, Costs, Tree, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_sah::Builder;
use canted_trace::{Query, ScaledRay, SlabRay};

/// A binary top level: the radix tree over the instances' boxes ([`Builder::Lbvh`]), with volumes of any strategy.
#[derive(Clone, Debug)]
pub(crate) struct BinaryTop {
    bvh: PairBvh,
    tree: Tree,
    config: VolumeConfig,
    /// Predicted costs after the build.
    built: Prediction,
    /// Predicted costs now.
    now: Prediction,
}

/// Predicted traversal costs.
#[derive(Clone, Copy, Debug)]
struct Prediction {
    /// For a ray that enters the root.
    per_ray: f64,
    /// For as many such rays as enter one instance's box on average.
    per_instance: f64,
}

impl BinaryTop {
    /// Builds over `instances`, one box for each, world space.
    pub(crate) fn build(instances: &[Obb], config: VolumeConfig) -> Self {
        let boxes = &aabbs(instances);
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let tree = canted_sah::build(boxes, &bounds, &Builder::Lbvh);
        let (bvh, built) = lay_out(&tree, instances, &bounds, &config);
        Self { bvh, tree, config, built, now: built }
    }

    /// New boxes for the same instances, in the same tree.
    pub(crate) fn refit(&mut self, instances: &[Obb]) {
        let bounds = aabbs(instances).iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        (self.bvh, self.now) = lay_out(&self.tree, instances, &bounds, &self.config);
    }

    /// How many times the predicted cost has grown since the build: the greater growth of both predictions.
    #[expect(clippy::cast_possible_truncation, reason = "a prediction")]
    pub(crate) fn drift(&self) -> f32 {
        let growth = |now: f64, built: f64| if built > 0.0 { now / built } else { 1.0 };
        let (now, built) = (self.now, self.built);
        growth(now.per_ray, built.per_ray).max(growth(now.per_instance, built.per_instance)) as f32
    }

    pub(crate) fn n_bytes(&self) -> usize {
        let Tree { nodes, leaves, bottom_up, tasks, .. } = &self.tree;
        let tree = size_of_val(&nodes[..]) + size_of_val(&leaves[..]) + size_of_val(&bottom_up[..]);
        self.bvh.n_bytes() + tree + size_of_val(&tasks[..])
    }

    pub(crate) fn each_box(&self, visit: impl FnMut(Obb, u32, bool)) {
        self.bvh.each_box(visit);
    }

    #[inline]
    pub(crate) fn traverse_ordered<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        mut enter: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        let slab_ray = SlabRay::with_error(ray, 0.0, error);
        self.bvh.traverse_ordered(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            enter(self.tree.leaves[leaf as usize].0, t_max, query)
        });
    }

    #[inline]
    pub(crate) fn traverse_any<Q: Query>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        mut enter: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        let slab_ray = SlabRay::with_error(ray, 0.0, error);
        self.bvh.traverse_any(&slab_ray, ray.t_max, query, |leaf, t_max, query| {
            enter(self.tree.leaves[leaf as usize].0, t_max, query)
        });
    }
}

fn aabbs(instances: &[Obb]) -> Vec<Aabb> {
    instances.iter().map(Obb::aabb).collect()
}

/// Computes the volumes of `tree` and lays them out for tracing.
fn lay_out(tree: &Tree, instances: &[Obb], bounds: &Aabb, config: &VolumeConfig) -> (PairBvh, Prediction) {
    let sorted: Vec<Obb> = tree.leaves.iter().map(|leaf| instances[leaf.index()]).collect();
    let volumes = lbvh::volumes(tree, &sorted, config);
    let bvh = PairBvh::new(tree, &volumes, &sorted, bounds, PairOrder::Numbered);
    let per_ray = lbvh::tree_cost(tree, &volumes, &sorted, &Costs::default(), 1.0).sah;
    let of_instances: f64 = sorted.iter().map(Obb::area).sum();
    let per_instance = if of_instances > 0.0 { per_ray * bvh.bounds().area() / of_instances } else { 0.0 };
    (bvh, Prediction { per_ray, per_instance })
}
