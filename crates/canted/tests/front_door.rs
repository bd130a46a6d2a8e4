//! What a user of `canted` alone relies on: names, vectors of other libraries, threads.

use canted::{Intersect, Ray, TriangleBvh, WideBvh};

#[test]
fn vectors_of_glam_pass_as_points_and_directions() {
    let positions = [glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y];
    let bvh = TriangleBvh::build(&positions, &[[0_u16, 1, 2]]).unwrap();
    let ray = Ray::new(glam::Vec3::new(0.25, 0.5, 1.0), -glam::Vec3::Z);
    let hit = bvh.closest_hit(&ray).unwrap();
    assert_eq!((hit.t, hit.u, hit.v), (1.0, 0.25, 0.5));
    assert_eq!(bvh.nearest_point(glam::Vec3A::new(0.0, 0.0, 2.0), f32::INFINITY).unwrap().distance, 2.0);
}

/// BVHs are sent to and shared by threads.
#[test]
fn structures_are_send_and_sync() {
    fn check<T: Send + Sync + Clone + std::fmt::Debug>() {}
    check::<TriangleBvh>();
    check::<WideBvh<canted::Sphere>>();
    check::<canted::Tlas<TriangleBvh>>();
    #[cfg(feature = "bvh2")]
    check::<canted::structure::Bvh2>();
}

/// Modules included; a name that few programs need belongs into a module.
#[test]
fn the_root_has_at_most_thirty_names() {
    let source = include_str!("../src/lib.rs");
    let root = source.split("{\n    pub use").map(|part| part.rsplit_once("\n}\n").map_or(part, |(_, rest)| rest));
    let root: String = root.collect();
    let uses = root.split("pub use ").skip(1).map(|item| item.split(';').next().unwrap_or_default());
    let n_names: usize = uses.map(|item| item.split('{').next_back().unwrap_or_default()).map(n_listed).sum();
    let n_modules = root.matches("pub mod ").count();
    assert!((20..=30).contains(&(n_names + n_modules)), "{n_names} names and {n_modules} modules");
}

fn n_listed(list: &str) -> usize {
    list.trim_end_matches('}').split(',').filter(|name| !name.trim().is_empty()).count()
}
