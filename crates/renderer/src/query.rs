use canted_trace::{Hit, Query};

use crate::sampler::{mix, unit};

/// A query that can be asked for one ray of many, each by its number.
///
/// A ray that is asked about twice, as by a counting query and then another, must have one number.
pub(crate) trait RayKeyed: Query + Clone {
    /// The same query for a ray with this number, of those that `self` stands for.
    ///
    /// Numbers of numbers make a tree: the rays of a path, the shadow rays of one of its vertices.
    #[must_use]
    fn keyed(&self, number: u32) -> Self;
}

impl RayKeyed for () {
    fn keyed(&self, _: u32) -> Self {}
}

/// The key of the ray with this number among those that `key` stands for.
pub(crate) fn derived_key(key: u32, number: u32) -> u32 {
    mix(key ^ number)
}

/// A number in `[0, 1)` for a ray and the triangle that it meets, equally distributed over both.
pub(crate) fn alpha_threshold(key: u32, hit: &Hit) -> f32 {
    unit(mix(mix(key ^ hit.instance.0) ^ hit.primitive.0) >> 8)
}

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

    #[inline]
    fn boxes(&mut self, n: u32) {
        self.inner.boxes(n);
    }
    #[inline]
    fn triangles(&mut self, n: u32) {
        self.inner.triangles(n);
    }
    #[inline]
    fn time(&self) -> f32 {
        self.time
    }
    #[inline]
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.inner.accepts(hit)
    }
}
