use crate::Hit;

/// A filter of hits, and counters of the work of a traversal.
///
/// `()` accepts every hit and counts nothing, [`Accept`] filters by a function, [`Counts`] counts. A query decides by the hit alone, not
/// by the order of calls, which depends on the BVH.
pub trait Query {
    /// Whether [`Query::accepts`] may return `false`. Where not, a traversal may skip the call.
    fn may_reject(&self) -> bool {
        true
    }

    /// Whether the query counts. Where it neither counts nor rejects, a traversal makes no call at all.
    fn counts(&self) -> bool {
        true
    }

    /// Whether the query neither rejects nor counts.
    #[doc(hidden)]
    fn is_plain(&self) -> bool {
        !self.may_reject() && !self.counts()
    }

    /// Counts `n` ray-box tests.
    fn boxes(&mut self, n: u32) {
        let _ = n;
    }

    /// Counts `n` ray-primitive tests.
    fn triangles(&mut self, n: u32) {
        let _ = n;
    }

    /// Whether to accept `hit`; on `false` the ray continues through the surface, as for alpha masks.
    fn accepts(&mut self, hit: &Hit) -> bool {
        let _ = hit;
        true
    }
}

impl Query for () {
    #[inline(always)]
    fn may_reject(&self) -> bool {
        false
    }
    #[inline(always)]
    fn counts(&self) -> bool {
        false
    }
    #[inline(always)]
    fn boxes(&mut self, _: u32) {}
    #[inline(always)]
    fn triangles(&mut self, _: u32) {}
    #[inline(always)]
    fn accepts(&mut self, _: &Hit) -> bool {
        true
    }
}

/// Passes hits on to a query as a function maps them: those of a structure inside of another, which has other numbers.
#[doc(hidden)]
pub struct Mapped<'a, F> {
    /// The query of the outer structure.
    pub query: &'a mut dyn Query,
    /// The hit of the outer structure.
    pub map: F,
}

impl<F: Fn(&Hit) -> Hit> Query for Mapped<'_, F> {
    fn may_reject(&self) -> bool {
        self.query.may_reject()
    }

    fn counts(&self) -> bool {
        self.query.counts()
    }

    fn boxes(&mut self, n: u32) {
        self.query.boxes(n);
    }

    fn triangles(&mut self, n: u32) {
        self.query.triangles(n);
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.query.accepts(&(self.map)(hit))
    }
}

/// A query that accepts the hits for which a function returns `true`.
///
/// The function must decide by the hit alone: it is called for some of the hits only, in an order that depends on the BVH.
#[derive(Clone, Copy, Debug)]
pub struct Accept<F>(pub F);

impl<F: FnMut(&Hit) -> bool> Query for Accept<F> {
    fn counts(&self) -> bool {
        false
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        (self.0)(hit)
    }
}

/// Numbers of tests; as a [`Query`], accepts every hit and counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Ray-box tests.
    pub boxes: u64,
    /// Ray-primitive tests.
    pub triangles: u64,
}

impl Query for Counts {
    fn may_reject(&self) -> bool {
        false
    }

    fn boxes(&mut self, n: u32) {
        self.boxes += u64::from(n);
    }

    fn triangles(&mut self, n: u32) {
        self.triangles += u64::from(n);
    }
}
