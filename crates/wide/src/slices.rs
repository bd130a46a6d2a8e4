use canted_trace::{Hit, Ray};

use crate::WideBvh;
use crate::answers::{Any, Closest, Every, Occluded, Where, parallel, serial};
use crate::traverse::LaneKernel;

/// Queries of slices: the answers of single rays, in order, for less than one by one.
///
/// Forms with `par_` share the rays out among the threads of the current rayon pool, without the feature `parallel`
/// among one; answers are the same. All panic where the slices differ in length.
///
/// Forms with `_where` ask a function about hits, with the place of the ray in its slice. It must answer by its
/// arguments alone: it is asked in an order that changes with the tree and the threads, and not about all hits.
impl<K: LaneKernel> WideBvh<K> {
    /// The closest hit of each ray.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        serial(self.path, self, &Closest(Any), rays, hits);
    }

    /// The closest hit of each ray, on all threads.
    pub fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        parallel(self.path, self, &Closest(Any), rays, hits);
    }

    /// Whether each ray hits anything.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        serial(self.path, self, &Occluded(Any), rays, occluded);
    }

    /// Whether each ray hits anything, on all threads.
    pub fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        parallel(self.path, self, &Occluded(Any), rays, occluded);
    }

    /// Every hit of each ray, as [`WideBvh::all_hits`] gives them.
    pub fn all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        serial(self.path, self, &Every(Any), rays, hits);
    }

    /// Every hit of each ray, on all threads.
    pub fn par_all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        parallel(self.path, self, &Every(Any), rays, hits);
    }

    /// The closest hit of each ray among those that `accepts` accepts.
    pub fn closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        serial(self.path, self, &Closest(Where(accepts)), rays, hits);
    }

    /// The same on all threads.
    pub fn par_closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        parallel(self.path, self, &Closest(Where(accepts)), rays, hits);
    }

    /// Whether `accepts` accepts any hit of each ray.
    pub fn occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        serial(self.path, self, &Occluded(Where(accepts)), rays, occluded);
    }

    /// The same on all threads.
    pub fn par_occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        parallel(self.path, self, &Occluded(Where(accepts)), rays, occluded);
    }
}
