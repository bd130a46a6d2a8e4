//! What a user of `canted` alone relies on: every example runs, and vectors of other libraries pass.

use canted::{Config, Preset, Ray, Triangle, TriangleBvh, WideBvh};

#[test]
fn vectors_of_glam_pass_as_points_and_directions() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bvh = WideBvh::<Triangle>::build(&positions, &[[0, 1, 2]], &Config::preset(Preset::Balanced)).unwrap();
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
    check::<canted::Bvh2<canted::Watertight>>();
    check::<canted::Tlas<TriangleBvh>>();
}
