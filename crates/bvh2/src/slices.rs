use canted_trace::{Hit, Kernel, Ray};

use crate::Bvh2;
use crate::per_ray::{parallel, serial};

/// Queries of slices: the results of single rays, in order.
///
/// Forms with `par_` use all threads of the current rayon pool, and one thread without the feature `parallel`; results
/// are the same. All panic if the slices differ in length.
///
/// Forms with `_where` count only the hits that `accepts` accepts. It gets the index of the ray, the ray and the hit, and
/// must decide by these alone: the order of its calls depends on the BVH and the threads.
impl<K: Kernel> Bvh2<K> {
    /// The closest hit of each ray.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        serial(rays, hits, |_, ray, hit| *hit = self.closest_hit(ray));
    }

    /// The closest hit of each ray, on all threads.
    pub fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        parallel(rays, hits, |_, ray, hit| *hit = self.closest_hit(ray));
    }

    /// Whether each ray hits anything.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        serial(rays, occluded, |_, ray, occluded| *occluded = self.occluded(ray));
    }

    /// Whether each ray hits anything, on all threads.
    pub fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        parallel(rays, occluded, |_, ray, occluded| *occluded = self.occluded(ray));
    }

    /// Every hit of each ray, in the order of [`Bvh2::all_hits`].
    pub fn all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        serial(rays, hits, |_, ray, hits| self.all_hits(ray, hits));
    }

    /// Every hit of each ray, on all threads.
    pub fn par_all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        parallel(rays, hits, |_, ray, hits| self.all_hits(ray, hits));
    }

    /// The closest hit of each ray among those that `accepts` accepts.
    ///
    /// ```
    /// use canted_bvh2::{BuildConfig, Bvh2};
    /// use canted_trace::{Ray, Watertight};
    ///
    /// let positions = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2], [3, 4, 5]], &BuildConfig::default())?;
    /// let rays = [Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]); 2];
    /// let mut hits = [None; 2];
    /// // The filter of the second ray rejects triangle 1.
    /// bvh.par_closest_hits_where(&rays, &mut hits, |index, _, hit| index == 0 || hit.primitive.0 != 1);
    /// assert_eq!(hits.map(|hit| hit.map(|hit| hit.primitive.0)), [Some(1), Some(0)]);
    /// # Ok::<(), canted_lbvh::GeometryError>(())
    /// ```
    pub fn closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        serial(rays, hits, |i, ray, hit| *hit = self.closest_hit_where(ray, |ray, hit| accepts(i, ray, hit)));
    }

    /// As [`Bvh2::closest_hits_where`], on all threads.
    pub fn par_closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        parallel(rays, hits, |i, ray, hit| *hit = self.closest_hit_where(ray, |ray, hit| accepts(i, ray, hit)));
    }

    /// Whether `accepts` accepts any hit of each ray.
    pub fn occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        serial(rays, occluded, |i, ray, out| *out = self.occluded_where(ray, |ray, hit| accepts(i, ray, hit)));
    }

    /// As [`Bvh2::occluded_many_where`], on all threads.
    pub fn par_occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        parallel(rays, occluded, |i, ray, out| *out = self.occluded_where(ray, |ray, hit| accepts(i, ray, hit)));
    }

    /// Every hit of each ray that `accepts` accepts, in the order of [`Bvh2::all_hits`].
    pub fn all_hits_many_where(
        &self,
        rays: &[Ray],
        hits: &mut [Vec<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        serial(rays, hits, |i, ray, hits| self.all_hits_where(ray, hits, |ray, hit| accepts(i, ray, hit)));
    }

    /// As [`Bvh2::all_hits_many_where`], on all threads.
    pub fn par_all_hits_many_where(
        &self,
        rays: &[Ray],
        hits: &mut [Vec<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        parallel(rays, hits, |i, ray, hits| self.all_hits_where(ray, hits, |ray, hit| accepts(i, ray, hit)));
    }
}
