mod pointers;

use canted_bih::Bih;
use canted_bvh2::Bvh2;
use canted_kdtree::KdTree;
use canted_obb::Obb;
use canted_trace::{HIT_ERROR, Hit, InstanceId, Kernel, Query, Ray, ScaledRay, Watertight};
use canted_wide::{LaneKernel, LeafPrimitive, MovingBvh, Stack, TriangleBvh, WideBvh};

/// A bottom-level BVH: anything that answers ray queries in its object space.
///
/// Implemented by every BVH of `canted-wide`, `canted-bvh2` and `canted-bih`, by the kd-tree of `canted-kdtree`, and by `&B`, `Box<B>`
/// and `Arc<B>`: several [`Tlas`](crate::Tlas) can share one BVH through an `Arc`. `instance` is written into hits and passed to
/// the query.
///
/// Rays come with directions whose greatest component lies in `[1, 2)`, and `t` is in units of these: the caller's direction, mapped
/// and scaled by a power of two. The [`Tlas`](crate::Tlas) converts `t` of hits, and those that the query sees.
///
/// # Several kinds in one TLAS
/// An enum whose methods match on the kind:
///
/// ```
/// use canted_bvh2::{BuildConfig, Bvh2};
/// use canted_obb::{Affine, Obb};
/// use canted_tlas::{Blas, Instance, Tlas, TopConfig};
/// use canted_trace::{HIT_ERROR, Hit, InstanceId, MollerTrumbore, Query, Ray, Watertight};
///
/// enum Shape {
///     Closed(Bvh2<Watertight>),
///     Open(Bvh2<MollerTrumbore>),
/// }
///
/// impl Blas for Shape {
///     fn bounds(&self) -> Obb {
///         match self {
///             Self::Closed(bvh) => bvh.bounds(),
///             Self::Open(bvh) => bvh.bounds(),
///         }
///     }
///     fn hit_error(&self) -> f32 {
///         // Both kinds are triangles.
///         HIT_ERROR
///     }
///     fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
///         match self {
///             Self::Closed(bvh) => bvh.closest_hit_with(ray, instance, query),
///             Self::Open(bvh) => bvh.closest_hit_with(ray, instance, query),
///         }
///     }
///     fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
///         match self {
///             Self::Closed(bvh) => bvh.occluded_with(ray, instance, query),
///             Self::Open(bvh) => bvh.occluded_with(ray, instance, query),
///         }
///     }
///     fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
///         match self {
///             Self::Closed(bvh) => bvh.all_hits_with(ray, instance, query, hits),
///             Self::Open(bvh) => bvh.all_hits_with(ray, instance, query, hits),
///         }
///     }
/// }
///
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let (triangles, config) = ([[0, 1, 2]], BuildConfig::default());
/// let shapes = vec![
///     Shape::Closed(Bvh2::build(&positions, &triangles, &config)?),
///     Shape::Open(Bvh2::build(&positions, &triangles, &config)?),
/// ];
/// let instances = [Instance::new(0, Affine::IDENTITY), Instance::new(1, Affine::IDENTITY)];
/// let tlas = Tlas::new(shapes, &instances, TopConfig::default())?;
/// let mut hits = vec![];
/// tlas.all_hits(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]), &mut hits);
/// assert_eq!(hits.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Blas: Send + Sync {
    /// A box around everything, object space.
    fn bounds(&self) -> Obb;

    /// How far a hit may lie outside of the bounds: each coordinate of `o + t·d`, in real arithmetic, by at most
    /// `hit_error·(|o|∞ + ρ∞)`, with `|o|∞` the greatest coordinate of the ray's origin and `ρ∞` that of the bounds. At
    /// most 1/8.
    ///
    /// [`HIT_ERROR`] for triangles, `ERROR` for a `Primitive` of `canted-wide`, and the greatest of its kinds for an
    /// enum. The top level pads its boxes by it: if it is too small, hits are lost.
    fn hit_error(&self) -> f32;

    /// Whether that holds relative to every point of object space, and not to its origin alone: with distances from the point instead of
    /// coordinates. The top level then has smaller boxes for content that is far from the origin.
    fn has_local_error(&self) -> bool {
        false
    }

    /// The hit of least `t` that the query accepts; ties go to the lowest primitive.
    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit>;

    /// Whether the query accepts any hit: agrees with [`Blas::closest_hit_with`].
    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool;

    /// Every hit that the query accepts, each once: least `t` first, then lowest primitive. Replaces the contents of
    /// `hits`.
    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>);

    /// As [`Blas::closest_hit_with`], without checking and scaling the ray again, with memory for nodes that wait.
    #[doc(hidden)]
    #[inline]
    fn closest_hit_scaled<Q: Query>(&self, ray: &ScaledRay, instance: InstanceId, query: &mut Q, _stack: &mut Stack) -> Option<Hit> {
        self.closest_hit_with(&ray.to_ray(), instance, query)
    }

    /// As [`Blas::occluded_with`], without checking and scaling the ray again, with memory for nodes that wait.
    #[doc(hidden)]
    #[inline]
    fn occluded_scaled<Q: Query>(&self, ray: &ScaledRay, instance: InstanceId, query: &mut Q, _stack: &mut Stack) -> bool {
        self.occluded_with(&ray.to_ray(), instance, query)
    }
}

/// A bottom-level BVH that counts how often a ray crosses its surfaces.
pub trait CrossingBlas: Blas {
    /// Every crossing of a surface, once: least `t` first, then lowest primitive. Replaces the contents of `crossings`.
    ///
    /// A ray through an edge or a vertex hits all triangles around it, but crosses the surface there once or not at all.
    fn crossings(&self, ray_object: &Ray, instance: InstanceId, crossings: &mut Vec<Hit>);
}

/// Structures over triangles, whose own methods have the names and contracts of [`Blas`].
macro_rules! blas_of_triangles {
    ($bvh:ident) => {
        impl<K: Kernel> Blas for $bvh<K> {
            fn bounds(&self) -> Obb {
                Self::bounds(self)
            }

            fn hit_error(&self) -> f32 {
                HIT_ERROR
            }

            fn has_local_error(&self) -> bool {
                true
            }

            fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
                Self::closest_hit_with(self, ray_object, instance, query)
            }

            fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
                Self::occluded_with(self, ray_object, instance, query)
            }

            fn all_hits_with<Q: Query>(
                &self,
                ray_object: &Ray,
                instance: InstanceId,
                query: &mut Q,
                hits: &mut Vec<Hit>,
            ) {
                Self::all_hits_with(self, ray_object, instance, query, hits);
            }
        }
    };
}

blas_of_triangles!(Bvh2);
blas_of_triangles!(Bih);
blas_of_triangles!(KdTree);

impl<P: LeafPrimitive> Blas for WideBvh<P> {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn hit_error(&self) -> f32 {
        P::ERROR
    }

    fn has_local_error(&self) -> bool {
        P::IS_LOCAL
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        Self::closest_hit_with(self, ray_object, instance, query)
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        Self::occluded_with(self, ray_object, instance, query)
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        Self::all_hits_with(self, ray_object, instance, query, hits);
    }

    #[inline]
    fn closest_hit_scaled<Q: Query>(&self, ray: &ScaledRay, instance: InstanceId, query: &mut Q, stack: &mut Stack) -> Option<Hit> {
        Self::closest_hit_scaled(self, ray, instance, query, stack)
    }

    #[inline]
    fn occluded_scaled<Q: Query>(&self, ray: &ScaledRay, instance: InstanceId, query: &mut Q, stack: &mut Stack) -> bool {
        Self::occluded_scaled(self, ray, instance, query, stack)
    }
}

impl<K: LaneKernel> Blas for MovingBvh<K> {
    fn bounds(&self) -> Obb {
        Self::bounds(self)
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        Self::closest_hit_with(self, ray_object, instance, query)
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        Self::occluded_with(self, ray_object, instance, query)
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        Self::all_hits_with(self, ray_object, instance, query, hits);
    }
}

impl CrossingBlas for TriangleBvh<Watertight> {
    fn crossings(&self, ray_object: &Ray, instance: InstanceId, crossings: &mut Vec<Hit>) {
        Self::crossings(self, ray_object, crossings);
        for crossing in crossings {
            crossing.instance = instance;
        }
    }
}
