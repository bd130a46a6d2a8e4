//! How often rays visit what: what a tree's cost is made of, and what [`Costs`](crate::Costs) are measured by.

use canted_trace::{Hit, InstanceId, Ray, ScaledRay};

use crate::WideBvh;
use crate::layout::NodeKind;
use crate::simd::{Simd, Task};
use crate::traced::{Best, HitSink, Traced, trace};
use crate::traverse::{LaneKernel, Stack};

/// Visits of rays that look for their closest hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`].
    pub nodes: [u64; 2],
    /// Leaves.
    pub leaves: u64,
    /// Blocks of up to eight triangles.
    pub blocks: u64,
}

impl<K: LaneKernel> WideBvh<K> {
    /// What [`WideBvh::closest_hits`] visits for these rays, one after another.
    #[must_use]
    pub fn traversal_counts(&self, rays: &[Ray]) -> TraversalCounts {
        self.path.run(Counting { wide: self, rays })
    }
}

struct Counting<'a, K: LaneKernel> {
    wide: &'a WideBvh<K>,
    rays: &'a [Ray],
}

impl<K: LaneKernel> Task for Counting<'_, K> {
    type Output = TraversalCounts;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> TraversalCounts {
        let mut visits = TraversalCounts::default();
        let mut stack = Stack::new(self.wide.records().depth);
        for ray in self.rays {
            let Some(ray) = ScaledRay::new(ray) else { continue };
            let mut every = ();
            let best = Best::<_, true>::new(&mut every, InstanceId(0));
            trace(simd, self.wide, &ray, &mut stack, &mut Counted { best, visits: &mut visits });
        }
        visits
    }
}

/// The closest hit, and what was visited on the way.
struct Counted<'a, 'q> {
    best: Best<'q, (), true>,
    visits: &'a mut TraversalCounts,
}

impl<M: ?Sized> HitSink<M> for Counted<'_, '_> {
    const ORDERED: bool = true;

    #[inline(always)]
    fn take(&mut self, ray: &ScaledRay, hit: Hit, met: &M, t_max: f32) -> f32 {
        self.best.take(ray, hit, met, t_max)
    }

    #[inline(always)]
    fn primitives(&mut self, n: u32) {
        self.visits.leaves += 1;
        self.visits.blocks += u64::from(n.div_ceil(8));
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        self.visits.nodes[kind as usize] += 1;
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures as fixtures;
    use canted_trace::{Counts, Watertight};

    use super::*;
    use crate::{Config, Preset};

    /// Counts add up to the tests that a query counts, on every path.
    #[test]
    fn visits_are_the_tests_that_a_query_counts() {
        let mesh = fixtures::SCENES.iter().find(|scene| scene.name == "scaffold").map(|scene| (scene.generate)());
        let mesh = mesh.expect("the scene is known");
        let config = Config::preset(Preset::Fast);
        let tree = WideBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &config).expect("finite");
        let rays: Vec<Ray> = fixtures::object_views(&mesh)[0]
            .rays(24)
            .iter()
            .map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) })
            .collect();
        let mut counts = Counts::default();
        for ray in &rays {
            let _ = tree.closest_hit_with(ray, InstanceId(0), &mut counts);
        }
        let visits = tree.traversal_counts(&rays);
        assert_eq!(8 * visits.nodes.iter().sum::<u64>(), counts.boxes);
        assert!(visits.nodes.iter().all(|&n| n > 0), "{visits:?}");
        let most = counts.triangles.div_ceil(8) + visits.leaves;
        assert!(visits.leaves <= visits.blocks && visits.blocks <= most, "{visits:?} for {counts:?}");
        assert_eq!(tree.clone().with_path(crate::SimdPath::Scalar).traversal_counts(&rays), visits);
        assert_eq!(tree.traversal_counts(&[]), TraversalCounts::default());
    }
}
