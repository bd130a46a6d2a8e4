use crate::Hit;

/// Callbacks of a traversal: a filter for hits, counters of its work, and the time of the ray.
///
/// `()` accepts every hit, counts nothing and costs nothing. [`Query::accepts`] must decide by the hit alone, not by the
/// order of calls, which depends on the BVH.
pub trait Query {
    /// Whether [`Query::accepts`] may reject a hit. If `false`, it must return `true`, and a traversal may skip the call.
    const MAY_REJECT: bool = true;

    /// Counts `n` ray-box tests.
    #[inline(always)]
    fn boxes(&mut self, n: u32) {
        let _ = n;
    }

    /// Counts `n` ray-triangle tests.
    #[inline(always)]
    fn triangles(&mut self, n: u32) {
        let _ = n;
    }

    /// Time of the ray for moving instances and vertices: 0 when the shutter opens, 1 when it closes; clamped to that interval.
    ///
    /// Called only where something moves. It must return the same value for the whole ray.
    #[inline(always)]
    fn time(&self) -> f32 {
        0.0
    }

    /// Which instances the ray tests: those whose own mask shares a bit with this one.
    ///
    /// Called once per ray, only by BVHs over instances. A query that wraps another one must forward it.
    #[inline(always)]
    fn mask(&self) -> u32 {
        u32::MAX
    }

    /// Whether to accept `hit`; on `false` the ray continues through the surface, as for alpha masks.
    #[inline(always)]
    fn accepts(&mut self, hit: &Hit) -> bool {
        let _ = hit;
        true
    }
}

impl Query for () {
    const MAY_REJECT: bool = false;
}

/// Numbers of tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Ray-box tests.
    pub boxes: u64,
    /// Ray-triangle tests.
    pub triangles: u64,
}

impl Query for Counts {
    const MAY_REJECT: bool = false;

    #[inline]
    fn boxes(&mut self, n: u32) {
        self.boxes += u64::from(n);
    }
    #[inline]
    fn triangles(&mut self, n: u32) {
        self.triangles += u64::from(n);
    }
}
