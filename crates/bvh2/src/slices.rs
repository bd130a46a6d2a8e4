/// Implements the queries of slices by those of single rays. Not part of the stable interface.
#[doc(hidden)]
#[macro_export]
macro_rules! triangle_slices {
    ($bvh:ident) => {
        /// Queries of slices: the results of single rays, in order.
        ///
        /// Forms with `par_` use all threads of the current rayon pool, and one thread without the feature `parallel`; results
        /// are the same. All panic if the slices differ in length.
        ///
        /// Forms with `_where` count only the hits that `accepts` accepts. It gets the index of the ray, the ray and the hit, and
        /// must decide by these alone: the order of its calls depends on the BVH and the threads.
        impl<K: canted_trace::Kernel> $bvh<K> {
            /// The closest hit of each ray.
            pub fn closest_hits(&self, rays: &[canted_trace::Ray], hits: &mut [Option<canted_trace::Hit>]) {
                $crate::per_ray::serial(rays, hits, |_, ray, hit| *hit = self.closest_hit(ray));
            }

            /// The closest hit of each ray, on all threads.
            pub fn par_closest_hits(&self, rays: &[canted_trace::Ray], hits: &mut [Option<canted_trace::Hit>]) {
                $crate::per_ray::parallel(rays, hits, |_, ray, hit| *hit = self.closest_hit(ray));
            }

            /// Whether each ray hits anything.
            pub fn occluded_many(&self, rays: &[canted_trace::Ray], occluded: &mut [bool]) {
                $crate::per_ray::serial(rays, occluded, |_, ray, occluded| *occluded = self.occluded(ray));
            }

            /// Whether each ray hits anything, on all threads.
            pub fn par_occluded_many(&self, rays: &[canted_trace::Ray], occluded: &mut [bool]) {
                $crate::per_ray::parallel(rays, occluded, |_, ray, occluded| *occluded = self.occluded(ray));
            }

            /// Every hit of each ray, in the order of [`Self::all_hits`].
            pub fn all_hits_many(&self, rays: &[canted_trace::Ray], hits: &mut [Vec<canted_trace::Hit>]) {
                $crate::per_ray::serial(rays, hits, |_, ray, hits| self.all_hits(ray, hits));
            }

            /// Every hit of each ray, on all threads.
            pub fn par_all_hits_many(&self, rays: &[canted_trace::Ray], hits: &mut [Vec<canted_trace::Hit>]) {
                $crate::per_ray::parallel(rays, hits, |_, ray, hits| self.all_hits(ray, hits));
            }

            /// The closest hit of each ray among those that `accepts` accepts.
            pub fn closest_hits_where(
                &self,
                rays: &[canted_trace::Ray],
                hits: &mut [Option<canted_trace::Hit>],
                accepts: impl Fn(usize, &canted_trace::Ray, &canted_trace::Hit) -> bool + Sync,
            ) {
                $crate::per_ray::serial(rays, hits, |i, ray, hit| {
                    *hit = self.closest_hit_where(ray, |ray, hit| accepts(i, ray, hit))
                });
            }

            /// As [`Self::closest_hits_where`], on all threads.
            pub fn par_closest_hits_where(
                &self,
                rays: &[canted_trace::Ray],
                hits: &mut [Option<canted_trace::Hit>],
                accepts: impl Fn(usize, &canted_trace::Ray, &canted_trace::Hit) -> bool + Sync,
            ) {
                $crate::per_ray::parallel(rays, hits, |i, ray, hit| {
                    *hit = self.closest_hit_where(ray, |ray, hit| accepts(i, ray, hit))
                });
            }

            /// Whether `accepts` accepts any hit of each ray.
            pub fn occluded_many_where(
                &self,
                rays: &[canted_trace::Ray],
                occluded: &mut [bool],
                accepts: impl Fn(usize, &canted_trace::Ray, &canted_trace::Hit) -> bool + Sync,
            ) {
                $crate::per_ray::serial(rays, occluded, |i, ray, out| {
                    *out = self.occluded_where(ray, |ray, hit| accepts(i, ray, hit))
                });
            }

            /// As [`Self::occluded_many_where`], on all threads.
            pub fn par_occluded_many_where(
                &self,
                rays: &[canted_trace::Ray],
                occluded: &mut [bool],
                accepts: impl Fn(usize, &canted_trace::Ray, &canted_trace::Hit) -> bool + Sync,
            ) {
                $crate::per_ray::parallel(rays, occluded, |i, ray, out| {
                    *out = self.occluded_where(ray, |ray, hit| accepts(i, ray, hit))
                });
            }

            /// Every hit of each ray that `accepts` accepts, in the order of [`Self::all_hits`].
            pub fn all_hits_many_where(
                &self,
                rays: &[canted_trace::Ray],
                hits: &mut [Vec<canted_trace::Hit>],
                accepts: impl Fn(usize, &canted_trace::Ray, &canted_trace::Hit) -> bool + Sync,
            ) {
                $crate::per_ray::serial(rays, hits, |i, ray, hits| {
                    self.all_hits_where(ray, hits, |ray, hit| accepts(i, ray, hit))
                });
            }

            /// As [`Self::all_hits_many_where`], on all threads.
            pub fn par_all_hits_many_where(
                &self,
                rays: &[canted_trace::Ray],
                hits: &mut [Vec<canted_trace::Hit>],
                accepts: impl Fn(usize, &canted_trace::Ray, &canted_trace::Hit) -> bool + Sync,
            ) {
                $crate::per_ray::parallel(rays, hits, |i, ray, hits| {
                    self.all_hits_where(ray, hits, |ray, hit| accepts(i, ray, hit))
                });
            }
        }
    };
}
