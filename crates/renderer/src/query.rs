use canted_trace::{Hit, Query};

use crate::sampler::{mix, unit};

/// A query for one of many rays, identified by a number that seeds stochastic alpha.
///
/// If a ray is traced twice, both queries must use the same number.
pub(crate) trait RayKeyed: Query + Clone {
    /// The query for the ray with this number.
    ///
    /// Numbers nest: a path, its vertices, the shadow rays of each vertex.
    #[must_use]
    fn keyed(&self, number: u32) -> Self;
}

impl RayKeyed for () {
    fn keyed(&self, _: u32) -> Self {}
}

/// The key of the ray with this number, below the ray or path with `key`.
pub(crate) fn derived_key(key: u32, number: u32) -> u32 {
    mix(key ^ number)
}

/// A uniform number in `[0, 1)` for a ray and a triangle.
pub(crate) fn alpha_threshold(key: u32, hit: &Hit) -> f32 {
    unit(mix(mix(key ^ hit.instance.0) ^ hit.primitive.0) >> 8)
}

/// Forwards the counters of a [`Query`] to one field, and its mask to another.
macro_rules! forward {
    (counters: $counters:ident, mask: $inner:ident) => {
        #[inline]
        fn boxes(&mut self, n: u32) {
            self.$counters.boxes(n);
        }
        #[inline]
        fn triangles(&mut self, n: u32) {
            self.$counters.triangles(n);
        }
        #[inline]
        fn mask(&self) -> u32 {
            self.$inner.mask()
        }
    };
}
pub(crate) use forward;

/// A query with the time of its rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timed<Q> {
    pub(crate) inner: Q,
    pub(crate) time: f32,
}

impl<Q: RayKeyed> RayKeyed for Timed<Q> {
    fn keyed(&self, number: u32) -> Self {
        Self { inner: self.inner.keyed(number), ..*self }
    }
}

impl<Q: Query> Query for Timed<Q> {
    const MAY_REJECT: bool = Q::MAY_REJECT;

    forward!(counters: inner, mask: inner);
    #[inline]
    fn time(&self) -> f32 {
        self.time
    }
    #[inline]
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.inner.accepts(hit)
    }
}
