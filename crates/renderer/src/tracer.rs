use canted_trace::{Hit, Query, Ray};

/// Traces rays in world space.
///
/// In every [`Hit`], including those passed to [`Query::accepts`], `instance` is an index into the scene's instances and
/// `primitive` a triangle index in the mesh of that instance.
pub trait Tracer: Sync {
    /// The closest accepted hit; among equal `t` the one with the lowest `(instance, primitive)`.
    fn closest_hit<Q: Query>(&self, ray: &Ray, query: &mut Q) -> Option<Hit>;

    /// Whether the ray has any accepted hit.
    fn occluded<Q: Query>(&self, ray: &Ray, query: &mut Q) -> bool;
}
