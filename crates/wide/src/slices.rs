use canted_trace::{Hit, Ray};

use crate::batch::{Closest, Every, Everything, Occluded, run};
use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;

/// Queries of slices: the results of single rays, in order, at a lower cost per ray.
///
/// `par_` methods distribute the rays over the threads of the current rayon pool (one thread without the feature
/// `parallel`); results are the same. All methods panic if the slices differ in length.
///
/// `_where` methods call a function with the index of the ray in its slice, the ray and a hit, to accept or reject the hit. Its
/// result must depend on its arguments alone: it is called for some of the hits only, in an order that depends on the BVH
/// and on the threads.
impl<P: LeafPrimitive> WideBvh<P> {
    /// The closest hit of each ray.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        run::<_, _, false>(self, &Closest(Everything), rays, hits);
    }

    /// The closest hit of each ray, on all threads.
    pub fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        run::<_, _, true>(self, &Closest(Everything), rays, hits);
    }

    /// Whether each ray hits anything.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        run::<_, _, false>(self, &Occluded(Everything), rays, occluded);
    }

    /// Whether each ray hits anything, on all threads.
    pub fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        run::<_, _, true>(self, &Occluded(Everything), rays, occluded);
    }

    /// Every hit of each ray, as [`WideBvh::all_hits`] returns them.
    pub fn all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        run::<_, _, false>(self, &Every(Everything), rays, hits);
    }

    /// Every hit of each ray, on all threads.
    pub fn par_all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        run::<_, _, true>(self, &Every(Everything), rays, hits);
    }

    /// The closest hit of each ray among those that `accepts` accepts.
    pub fn closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        run::<_, _, false>(self, &Closest(accepts), rays, hits);
    }

    /// The same on all threads.
    pub fn par_closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        run::<_, _, true>(self, &Closest(accepts), rays, hits);
    }

    /// Whether `accepts` accepts any hit of each ray.
    pub fn occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        run::<_, _, false>(self, &Occluded(accepts), rays, occluded);
    }

    /// The same on all threads.
    pub fn par_occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        run::<_, _, true>(self, &Occluded(accepts), rays, occluded);
    }

    /// Every hit of each ray that `accepts` accepts.
    pub fn all_hits_many_where(
        &self,
        rays: &[Ray],
        hits: &mut [Vec<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        run::<_, _, false>(self, &Every(accepts), rays, hits);
    }

    /// The same on all threads.
    pub fn par_all_hits_many_where(
        &self,
        rays: &[Ray],
        hits: &mut [Vec<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        run::<_, _, true>(self, &Every(accepts), rays, hits);
    }
}
