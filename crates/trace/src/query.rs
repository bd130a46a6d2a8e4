use crate::Hit;

/// What a traversal tells and asks its caller: its work is counted, its hits may be refused.
///
/// `()` counts nothing, accepts everything and costs nothing. The answer of [`Query::accepts`] must depend on the hit
/// alone, never on the order of calls: that order changes with the tree.
pub trait Query {
    /// Whether [`Query::accepts`] may refuse a hit. Where `false`, it must answer `true`, and need not be asked.
    const MAY_REJECT: bool = true;

    /// `n` ray-box tests were made.
    #[inline(always)]
    fn boxes(&mut self, n: u32) {
        let _ = n;
    }

    /// `n` ray-triangle tests were made.
    #[inline(always)]
    fn triangles(&mut self, n: u32) {
        let _ = n;
    }

    /// When the ray flies, for what moves: 0 where the shutter opens, 1 where it closes; what is beyond counts as the end.
    ///
    /// Asked only about instances that move, and the same for all of one ray.
    #[inline(always)]
    fn time(&self) -> f32 {
        0.0
    }

    /// Which instances the ray sees: those whose own mask shares a bit with this one.
    ///
    /// Asked once for each ray, by BVHs over instances alone. A query that wraps another one must pass this on.
    #[inline(always)]
    fn mask(&self) -> u32 {
        u32::MAX
    }

    /// Whether `hit` counts; `false` lets the ray pass through, as an alpha mask does.
    #[inline(always)]
    fn accepts(&mut self, hit: &Hit) -> bool {
        let _ = hit;
        true
    }
}

impl Query for () {
    const MAY_REJECT: bool = false;
}

/// Sums of tests.
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
