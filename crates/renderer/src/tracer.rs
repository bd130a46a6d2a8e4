use canted_trace::{Hit, Query, Ray};

/// What answers rays in world space.
///
/// In every [`Hit`], also those shown to [`Query::accepts`], `instance` is an index into the scene's instances and
/// `primitive` a triangle of the mesh of that instance, numbered as in the mesh.
pub trait Tracer: Sync {
    /// The first accepted hit of a world-space ray; equal `t` goes to the lowest `(instance, primitive)`.
    fn closest_hit<Q: Query>(&self, ray: &Ray, query: &mut Q) -> Option<Hit>;

    /// Whether a world-space ray has any accepted hit.
    fn occluded<Q: Query>(&self, ray: &Ray, query: &mut Q) -> bool;
}
