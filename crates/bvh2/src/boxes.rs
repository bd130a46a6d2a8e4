use std::sync::Arc;

use canted_lbvh::{self as lbvh, Costs, Tree, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_sah::Builder;
use canted_trace::{BoxBvh, Query, ScaledRay, SlabRay};

use crate::{PairBvh, PairOrder};

/// A binary BVH over oriented boxes: a radix tree ([`Builder::Lbvh`]), with volumes of any strategy.
///
/// The top level of a TLAS of `canted-tlas` may be one: `TopConfig::other(Bvh2Boxes::builder(volumes))`.
#[derive(Clone, Debug)]
pub struct Bvh2Boxes {
    bvh: PairBvh,
    tree: Arc<Tree>,
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
    /// For as many such rays as enter one box on average.
    per_box: f64,
}

impl Bvh2Boxes {
    /// Builds over boxes, which have their indices as numbers.
    #[must_use]
    pub fn build(boxes: &[Obb], config: VolumeConfig) -> Self {
        let aabbs: Vec<Aabb> = boxes.iter().map(Obb::aabb).collect();
        let bounds = aabbs.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let tree = canted_sah::build(&aabbs, &bounds, &Builder::Lbvh);
        let (bvh, built) = lay_out(&tree, boxes, &config);
        Self { bvh, tree: Arc::new(tree), config, built, now: built }
    }

    /// A function that builds with these volumes.
    pub fn builder(config: VolumeConfig) -> impl Fn(&[Obb]) -> Arc<dyn BoxBvh> + Send + Sync {
        move |boxes| Arc::new(Self::build(boxes, config))
    }
}

impl BoxBvh for Bvh2Boxes {
    fn traverse(&self, ray: &ScaledRay, error: f64, is_ordered: bool, enter: &mut dyn FnMut(u32, f32) -> f32) -> u32 {
        let slab_ray = SlabRay::with_error(ray, 0.0, error);
        let mut counted = BoxTests(0);
        let leaf = |leaf, t_max, _: &mut BoxTests| enter(self.tree.leaves[leaf as usize].0, t_max);
        if is_ordered {
            self.bvh.traverse_ordered(&slab_ray, ray.t_max, &mut counted, leaf);
        } else {
            self.bvh.traverse_any(&slab_ray, ray.t_max, &mut counted, leaf);
        }
        counted.0
    }

    fn refitted(&self, boxes: &[Obb]) -> Arc<dyn BoxBvh> {
        let (bvh, now) = lay_out(&self.tree, boxes, &self.config);
        Arc::new(Self { bvh, now, tree: Arc::clone(&self.tree), ..*self })
    }

    /// The greater growth of both predictions.
    fn drift(&self) -> f32 {
        let growth = |now: f64, built: f64| if built > 0.0 { now / built } else { 1.0 };
        let (now, built) = (self.now, self.built);
        growth(now.per_ray, built.per_ray).max(growth(now.per_box, built.per_box)) as f32
    }

    fn each_box(&self, visit: &mut dyn FnMut(Obb, u32, bool)) {
        self.bvh.each_box(visit);
    }

    fn n_bytes(&self) -> usize {
        let Tree { nodes, leaves, bottom_up, tasks, .. } = &*self.tree;
        let tree = size_of_val(&nodes[..]) + size_of_val(&leaves[..]) + size_of_val(&bottom_up[..]);
        self.bvh.n_bytes() + tree + size_of_val(&tasks[..])
    }
}

/// Computes the volumes of `tree` and lays them out for tracing.
fn lay_out(tree: &Tree, boxes: &[Obb], config: &VolumeConfig) -> (PairBvh, Prediction) {
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b.aabb()));
    let sorted: Vec<Obb> = tree.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    let volumes = lbvh::volumes(tree, &sorted, config);
    let bvh = PairBvh::new(tree, &volumes, &sorted, &bounds, PairOrder::Numbered);
    let per_ray = lbvh::tree_cost(tree, &volumes, &sorted, &Costs::default(), 1.0).sah;
    let of_boxes: f64 = sorted.iter().map(Obb::area).sum();
    let per_box = if of_boxes > 0.0 { per_ray * bvh.bounds().area() / of_boxes } else { 0.0 };
    (bvh, Prediction { per_ray, per_box })
}

struct BoxTests(u32);

impl Query for BoxTests {
    #[inline(always)]
    fn boxes(&mut self, n: u32) {
        self.0 += n;
    }
}
