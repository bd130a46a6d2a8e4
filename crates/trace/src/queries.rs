/// The queries of a BVH or kd-tree over triangles that follow from three: `closest_hit_with`, `occluded_with` and `all_hits_with`, its
/// inherent methods. Queries of single rays and of slices, plain and with a filter.
///
/// `$per_item` is the module with the loops over slices, `per_item` of `canted-lbvh`.
#[doc(hidden)]
#[macro_export]
macro_rules! triangle_queries {
    ($type:ident, $per_item:path) => {
        /// Queries of single rays.
        ///
        /// A ray with a NaN component, an infinite origin or direction, a zero direction or an empty interval never hits.
        ///
        /// Forms with `_where` count only the hits that `accepts` accepts. `accepts` must decide by its arguments alone: the
        /// order of its calls depends on the structure, and it is not called for every hit. Forms with `_with` take a
        /// [`Query`]($crate::Query), which may also count tests, and write `instance` into the hits.
        impl<K: $crate::Kernel> $type<K> {
            /// The hit of least `t`; ties go to the lowest primitive.
            #[must_use]
            pub fn closest_hit(&self, ray: &$crate::Ray) -> Option<$crate::Hit> {
                self.closest_hit_with(ray, $crate::InstanceId(0), &mut ())
            }

            /// Whether the ray hits anything: agrees with [`Self::closest_hit`].
            #[must_use]
            pub fn occluded(&self, ray: &$crate::Ray) -> bool {
                self.occluded_with(ray, $crate::InstanceId(0), &mut ())
            }

            /// Every hit with `t_min <= t <= t_max`, once: least `t` first, then lowest primitive. Replaces the contents of `hits`.
            pub fn all_hits(&self, ray: &$crate::Ray, hits: &mut Vec<$crate::Hit>) {
                self.all_hits_with(ray, $crate::InstanceId(0), &mut (), hits);
            }

            /// The hit of least `t` that `accepts` accepts; ties go to the lowest primitive.
            #[must_use]
            pub fn closest_hit_where(
                &self,
                ray: &$crate::Ray,
                accepts: impl Fn(&$crate::Ray, &$crate::Hit) -> bool,
            ) -> Option<$crate::Hit> {
                let mut query = $crate::HitFilter(|hit: &$crate::Hit| accepts(ray, hit));
                self.closest_hit_with(ray, $crate::InstanceId(0), &mut query)
            }

            /// Whether `accepts` accepts any hit.
            #[must_use]
            pub fn occluded_where(
                &self,
                ray: &$crate::Ray,
                accepts: impl Fn(&$crate::Ray, &$crate::Hit) -> bool,
            ) -> bool {
                let mut query = $crate::HitFilter(|hit: &$crate::Hit| accepts(ray, hit));
                self.occluded_with(ray, $crate::InstanceId(0), &mut query)
            }

            /// Every hit that `accepts` accepts, in the order of [`Self::all_hits`]. Replaces the contents of `hits`.
            pub fn all_hits_where(
                &self,
                ray: &$crate::Ray,
                hits: &mut Vec<$crate::Hit>,
                accepts: impl Fn(&$crate::Ray, &$crate::Hit) -> bool,
            ) {
                let mut query = $crate::HitFilter(|hit: &$crate::Hit| accepts(ray, hit));
                self.all_hits_with(ray, $crate::InstanceId(0), &mut query, hits);
            }
        }

        /// Queries of slices: the results of single rays, in order.
        ///
        /// Forms with `par_` use all threads of the current rayon pool, and one thread without the feature `parallel`;
        /// results are the same. All panic if the slices differ in length.
        ///
        /// Forms with `_where` count only the hits that `accepts` accepts. It gets the index of the ray, the ray and the hit,
        /// and must decide by these alone: the order of its calls depends on the structure and the threads.
        impl<K: $crate::Kernel> $type<K> {
            $crate::triangle_queries!(@slice closest_hits, par_closest_hits, Option<$crate::Hit>, $per_item,
                "The closest hit of each ray", |bvh, ray, out| *out = bvh.closest_hit(ray));
            $crate::triangle_queries!(@slice occluded_many, par_occluded_many, bool, $per_item,
                "Whether each ray hits anything", |bvh, ray, out| *out = bvh.occluded(ray));
            $crate::triangle_queries!(@slice all_hits_many, par_all_hits_many, Vec<$crate::Hit>, $per_item,
                "Every hit of each ray, in the order of [`Self::all_hits`]", |bvh, ray, out| bvh.all_hits(ray, out));
            $crate::triangle_queries!(@where closest_hits_where, par_closest_hits_where, Option<$crate::Hit>, $per_item,
                "The closest hit of each ray among those that `accepts` accepts",
                |bvh, ray, out, accepts| *out = bvh.closest_hit_where(ray, accepts));
            $crate::triangle_queries!(@where occluded_many_where, par_occluded_many_where, bool, $per_item,
                "Whether `accepts` accepts any hit of each ray",
                |bvh, ray, out, accepts| *out = bvh.occluded_where(ray, accepts));
            $crate::triangle_queries!(@where all_hits_many_where, par_all_hits_many_where, Vec<$crate::Hit>, $per_item,
                "Every hit of each ray that `accepts` accepts, in the order of [`Self::all_hits`]",
                |bvh, ray, out, accepts| bvh.all_hits_where(ray, out, accepts));
        }
    };

    (@slice $serial:ident, $parallel:ident, $result:ty, $per_item:path, $doc:literal,
        |$bvh:ident, $ray:ident, $out:ident| $body:expr) => {
        #[doc = concat!($doc, ".")]
        pub fn $serial(&self, rays: &[$crate::Ray], results: &mut [$result]) {
            use $per_item as per_item;
            let $bvh = self;
            per_item::serial(rays, results, |_, $ray, $out| $body);
        }

        #[doc = concat!($doc, "; on all threads.")]
        pub fn $parallel(&self, rays: &[$crate::Ray], results: &mut [$result]) {
            use $per_item as per_item;
            let $bvh = self;
            per_item::parallel(rays, results, |_, $ray, $out| $body);
        }
    };

    (@where $serial:ident, $parallel:ident, $result:ty, $per_item:path, $doc:literal,
        |$bvh:ident, $ray:ident, $out:ident, $accepts:ident| $body:expr) => {
        #[doc = concat!($doc, ".")]
        pub fn $serial(
            &self,
            rays: &[$crate::Ray],
            results: &mut [$result],
            accepts: impl Fn(usize, &$crate::Ray, &$crate::Hit) -> bool + Sync,
        ) {
            use $per_item as per_item;
            let $bvh = self;
            per_item::serial(rays, results, |i, $ray, $out| {
                let $accepts = |ray: &$crate::Ray, hit: &$crate::Hit| accepts(i, ray, hit);
                $body
            });
        }

        #[doc = concat!($doc, "; on all threads.")]
        pub fn $parallel(
            &self,
            rays: &[$crate::Ray],
            results: &mut [$result],
            accepts: impl Fn(usize, &$crate::Ray, &$crate::Hit) -> bool + Sync,
        ) {
            use $per_item as per_item;
            let $bvh = self;
            per_item::parallel(rays, results, |i, $ray, $out| {
                let $accepts = |ray: &$crate::Ray, hit: &$crate::Hit| accepts(i, ray, hit);
                $body
            });
        }
    };
}
