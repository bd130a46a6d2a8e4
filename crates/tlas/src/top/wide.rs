use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Query, ScaledRay};
use canted_wide::{Config, PrimitiveError, SimdPath, Stack, WideBvh};

/// A wide top level: eight-wide aligned nodes over the instances' axis-aligned boxes.
#[derive(Clone, Debug)]
pub(crate) struct WideTop {
    bvh: WideBvh<Aabb>,
    /// Growth of the predicted traversal cost since the build.
    drift: f32,
}

impl WideTop {
    /// Builds over a box for each instance, world space.
    pub(crate) fn build(boxes: Vec<Aabb>, config: Config, path: SimdPath) -> Result<Self, PrimitiveError> {
        let bvh = WideBvh::<Aabb>::build(boxes, &config.axis_aligned())?;
        Ok(Self { bvh: bvh.with_path(path), drift: 1.0 })
    }

    pub(crate) fn with_path(self, path: SimdPath) -> Self {
        Self { bvh: self.bvh.with_path(path), ..self }
    }

    /// New boxes for the same instances, in the same topology.
    pub(crate) fn refit(&mut self, boxes: Vec<Aabb>) {
        self.drift = self.bvh.refit(boxes).expect("a finite box for each instance").drift;
    }

    pub(crate) fn drift(&self) -> f32 {
        self.drift
    }

    pub(crate) fn n_bytes(&self) -> usize {
        self.bvh.n_bytes()
    }

    pub(crate) fn each_box(&self, visit: impl FnMut(Obb, u32, bool)) {
        self.bvh.each_box(visit);
    }

    #[inline]
    pub(crate) fn traverse<Q: Query, const ORDERED: bool>(
        &self,
        ray: &ScaledRay,
        error: f64,
        query: &mut Q,
        stack: &mut Stack,
        mut enter: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        // The boxes have the numbers of the class.
        let visit = |PrimId(number): PrimId, t_max: f32, query: &mut Q| enter(number, t_max, query);
        self.bvh.traverse_with::<Q, ORDERED>(ray, error, query, stack, visit);
    }
}
