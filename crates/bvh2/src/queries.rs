//! The queries of single rays and of slices of rays, the same for every structure over triangles in leaves.

/// Implements all queries of a structure whose method `leaf_triangles` returns its
/// [`LeafTriangles`](crate::leaf_triangles::LeafTriangles). Not part of the stable interface.
#[doc(hidden)]
#[macro_export]
macro_rules! triangle_queries {
    ($bvh:ident) => {
        /// Queries of single rays.
        ///
        /// A ray with a NaN component, an infinite origin or direction, a zero direction or an empty interval never hits.
        ///
        /// Forms with `_where` count only the hits that `accepts` accepts. `accepts` must decide by its arguments alone: the
        /// order of its calls depends on the BVH, and it is not called for every hit. Forms with `_with` take a
        /// [`Query`](canted_trace::Query), which may also count tests, and write `instance` into the hits.
        impl<K: canted_trace::Kernel> $bvh<K> {
            /// The hit of least `t`; ties go to the lowest primitive.
            #[must_use]
            pub fn closest_hit(&self, ray: &canted_trace::Ray) -> Option<canted_trace::Hit> {
                self.closest_hit_with(ray, canted_trace::InstanceId(0), &mut ())
            }

            /// Whether the ray hits anything: agrees with [`Self::closest_hit`].
            #[must_use]
            pub fn occluded(&self, ray: &canted_trace::Ray) -> bool {
                self.occluded_with(ray, canted_trace::InstanceId(0), &mut ())
            }

            /// Every hit with `t_min <= t <= t_max`: least `t` first, then lowest primitive. Replaces the contents of
            /// `hits`.
            pub fn all_hits(&self, ray: &canted_trace::Ray, hits: &mut Vec<canted_trace::Hit>) {
                self.all_hits_with(ray, canted_trace::InstanceId(0), &mut (), hits);
            }

            /// The hit of least `t` that `accepts` accepts; ties go to the lowest primitive.
            #[must_use]
            pub fn closest_hit_where(
                &self,
                ray: &canted_trace::Ray,
                accepts: impl Fn(&canted_trace::Ray, &canted_trace::Hit) -> bool,
            ) -> Option<canted_trace::Hit> {
                let mut query = canted_trace::HitFilter(|hit: &canted_trace::Hit| accepts(ray, hit));
                self.closest_hit_with(ray, canted_trace::InstanceId(0), &mut query)
            }

            /// Whether `accepts` accepts any hit.
            #[must_use]
            pub fn occluded_where(
                &self,
                ray: &canted_trace::Ray,
                accepts: impl Fn(&canted_trace::Ray, &canted_trace::Hit) -> bool,
            ) -> bool {
                let mut query = canted_trace::HitFilter(|hit: &canted_trace::Hit| accepts(ray, hit));
                self.occluded_with(ray, canted_trace::InstanceId(0), &mut query)
            }

            /// Every hit that `accepts` accepts, in the order of [`Self::all_hits`]. Replaces the contents of `hits`.
            pub fn all_hits_where(
                &self,
                ray: &canted_trace::Ray,
                hits: &mut Vec<canted_trace::Hit>,
                accepts: impl Fn(&canted_trace::Ray, &canted_trace::Hit) -> bool,
            ) {
                let mut query = canted_trace::HitFilter(|hit: &canted_trace::Hit| accepts(ray, hit));
                self.all_hits_with(ray, canted_trace::InstanceId(0), &mut query, hits);
            }

            /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
            pub fn closest_hit_with<Q: canted_trace::Query>(
                &self,
                ray: &canted_trace::Ray,
                instance: canted_trace::InstanceId,
                query: &mut Q,
            ) -> Option<canted_trace::Hit> {
                self.leaf_triangles().closest_hit(ray, instance, query)
            }

            /// Whether the query accepts any hit.
            pub fn occluded_with<Q: canted_trace::Query>(
                &self,
                ray: &canted_trace::Ray,
                instance: canted_trace::InstanceId,
                query: &mut Q,
            ) -> bool {
                self.leaf_triangles().occluded(ray, instance, query)
            }

            /// Every hit that the query accepts, in the order of [`Self::all_hits`]. Replaces the contents of `hits`.
            pub fn all_hits_with<Q: canted_trace::Query>(
                &self,
                ray: &canted_trace::Ray,
                instance: canted_trace::InstanceId,
                query: &mut Q,
                hits: &mut Vec<canted_trace::Hit>,
            ) {
                self.leaf_triangles().all_hits(ray, instance, query, hits);
            }
        }

        $crate::triangle_slices!($bvh);
    };
}
