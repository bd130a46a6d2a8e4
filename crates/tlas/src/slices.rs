use canted_bvh2::per_ray::{parallel, parallel_with, serial};
use canted_trace::{Hit, HitFilter, Query, Ray};

use crate::queries::Stacks;
use crate::{Blas, Tlas};

/// Queries of slices: the results of single rays, in order.
///
/// Forms with `par_` use all threads of the current rayon pool, and one thread without the feature `parallel`; results
/// are the same. All panic if the slices differ in length.
///
/// Forms with `_where` count only the hits that `accepts` accepts. It gets the index of the ray, the ray and the hit, and
/// must decide by these alone. Forms with `_with` make a [`Query`] for each ray, by its index and itself:
///
/// ```
/// # use canted_bvh2::{BuildConfig, Bvh2};
/// # use canted_obb::Affine;
/// # use canted_tlas::{Instance, RayOptions, Tlas, TopConfig};
/// # use canted_trace::{Ray, Watertight};
/// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// # let bvh = Bvh2::<Watertight>::build(&positions, &[[0, 1, 2]], &BuildConfig::default())?;
/// // Two instances in the same position, with masks 1 and 2.
/// let instances = [1, 2].map(|mask| Instance::new(0, Affine::IDENTITY).with_mask(mask));
/// let tlas = Tlas::new(vec![bvh], &instances, TopConfig::default())?;
/// let rays = [Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0]); 3];
/// let mut hits = [None; 3];
/// tlas.par_closest_hits(&rays, &mut hits);
/// assert_eq!(hits.map(|hit| hit.map(|hit| hit.instance.0)), [Some(0); 3]);
///
/// let masks = [1, 2, 4];
/// tlas.par_closest_hits_with(&rays, &mut hits, |index, _ray| RayOptions::mask(masks[index]));
/// assert_eq!(hits.map(|hit| hit.map(|hit| hit.instance.0)), [Some(0), Some(1), None]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<B: Blas> Tlas<B> {
    /// The closest hit of each ray.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_hits_with(rays, hits, |_, _| ());
    }

    /// The closest hit of each ray, on all threads.
    pub fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.par_closest_hits_with(rays, hits, |_, _| ());
    }

    /// Whether each ray hits anything.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_many_with(rays, occluded, |_, _| ());
    }

    /// Whether each ray hits anything, on all threads.
    pub fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.par_occluded_many_with(rays, occluded, |_, _| ());
    }

    /// Every hit of each ray, in the order of [`Tlas::all_hits`].
    pub fn all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        self.all_hits_many_with(rays, hits, |_, _| ());
    }

    /// Every hit of each ray, on all threads.
    pub fn par_all_hits_many(&self, rays: &[Ray], hits: &mut [Vec<Hit>]) {
        self.par_all_hits_many_with(rays, hits, |_, _| ());
    }

    /// The closest hit of each ray among those that `accepts` accepts.
    pub fn closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        let accepts = &accepts;
        self.closest_hits_with(rays, hits, |i, ray| HitFilter(move |hit: &Hit| accepts(i, ray, hit)));
    }

    /// As [`Tlas::closest_hits_where`], on all threads.
    pub fn par_closest_hits_where(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        let accepts = &accepts;
        self.par_closest_hits_with(rays, hits, |i, ray| HitFilter(move |hit: &Hit| accepts(i, ray, hit)));
    }

    /// Whether `accepts` accepts any hit of each ray.
    pub fn occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        let accepts = &accepts;
        self.occluded_many_with(rays, occluded, |i, ray| HitFilter(move |hit: &Hit| accepts(i, ray, hit)));
    }

    /// As [`Tlas::occluded_many_where`], on all threads.
    pub fn par_occluded_many_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        let accepts = &accepts;
        self.par_occluded_many_with(rays, occluded, |i, ray| HitFilter(move |hit: &Hit| accepts(i, ray, hit)));
    }

    /// Every hit of each ray that `accepts` accepts, in the order of [`Tlas::all_hits`].
    pub fn all_hits_many_where(
        &self,
        rays: &[Ray],
        hits: &mut [Vec<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        let accepts = &accepts;
        self.all_hits_many_with(rays, hits, |i, ray| HitFilter(move |hit: &Hit| accepts(i, ray, hit)));
    }

    /// As [`Tlas::all_hits_many_where`], on all threads.
    pub fn par_all_hits_many_where(
        &self,
        rays: &[Ray],
        hits: &mut [Vec<Hit>],
        accepts: impl Fn(usize, &Ray, &Hit) -> bool + Sync,
    ) {
        let accepts = &accepts;
        self.par_all_hits_many_with(rays, hits, |i, ray| HitFilter(move |hit: &Hit| accepts(i, ray, hit)));
    }

    /// The closest hit of each ray that its query accepts.
    pub fn closest_hits_with<'r, Q: Query>(
        &self,
        rays: &'r [Ray],
        hits: &mut [Option<Hit>],
        query: impl Fn(usize, &'r Ray) -> Q,
    ) {
        let mut stacks = Stacks::default();
        serial(rays, hits, |i, ray, hit| *hit = self.closest_hit_on(&mut stacks, ray, &mut query(i, ray)));
    }

    /// As [`Tlas::closest_hits_with`], on all threads.
    pub fn par_closest_hits_with<'r, Q: Query>(
        &self,
        rays: &'r [Ray],
        hits: &mut [Option<Hit>],
        query: impl Fn(usize, &'r Ray) -> Q + Sync,
    ) {
        parallel_with(rays, hits, Stacks::default, |stacks, i, ray, hit| {
            *hit = self.closest_hit_on(stacks, ray, &mut query(i, ray));
        });
    }

    /// Whether each ray hits anything that its query accepts.
    pub fn occluded_many_with<'r, Q: Query>(
        &self,
        rays: &'r [Ray],
        occluded: &mut [bool],
        query: impl Fn(usize, &'r Ray) -> Q,
    ) {
        let mut stacks = Stacks::default();
        serial(rays, occluded, |i, ray, out| *out = self.occluded_on(&mut stacks, ray, &mut query(i, ray)));
    }

    /// As [`Tlas::occluded_many_with`], on all threads.
    pub fn par_occluded_many_with<'r, Q: Query>(
        &self,
        rays: &'r [Ray],
        occluded: &mut [bool],
        query: impl Fn(usize, &'r Ray) -> Q + Sync,
    ) {
        parallel_with(rays, occluded, Stacks::default, |stacks, i, ray, out| {
            *out = self.occluded_on(stacks, ray, &mut query(i, ray));
        });
    }

    /// Every hit of each ray that its query accepts, in the order of [`Tlas::all_hits`].
    pub fn all_hits_many_with<'r, Q: Query>(
        &self,
        rays: &'r [Ray],
        hits: &mut [Vec<Hit>],
        query: impl Fn(usize, &'r Ray) -> Q,
    ) {
        serial(rays, hits, |i, ray, hits| self.all_hits_with(ray, &mut query(i, ray), hits));
    }

    /// As [`Tlas::all_hits_many_with`], on all threads.
    pub fn par_all_hits_many_with<'r, Q: Query>(
        &self,
        rays: &'r [Ray],
        hits: &mut [Vec<Hit>],
        query: impl Fn(usize, &'r Ray) -> Q + Sync,
    ) {
        parallel(rays, hits, |i, ray, hits| self.all_hits_with(ray, &mut query(i, ray), hits));
    }
}
