//! Vectors of any library are accepted where a point or a direction is expected.

use canted_obb::{Aabb, Affine, Dop, Enclosure, Moments, Obb, PrimId, bound};
use canted_trace::{Hit, InstanceId, Ray, Side, SurfacePoint, segment_overlaps_aabb};

fn accepts<V: Copy + Into<[f32; 3]> + From<[f32; 3]>>() {
    let [a, b, c] = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 2.0, 3.0]].map(V::from);
    let arrays = [a, b, c].map(Into::into);

    let aabb = Aabb::from_points([a, b, c]);
    assert_eq!(aabb, Aabb::from_points(arrays));
    assert!(aabb.contains(b) && segment_overlaps_aabb(a, c, &aabb));
    let obb = bound(Obb::IDENTITY_FRAME, [a, b, c]);
    assert!(obb.contains(c));
    assert_eq!(obb, bound(Obb::IDENTITY_FRAME, arrays));
    let mut enclosure = Enclosure::new(Obb::IDENTITY_FRAME, a);
    enclosure.add_point(b);
    assert!(enclosure.finish().contains(b));
    assert_eq!(Moments::from_points([a, b, c]), Moments::from_points(arrays));
    assert_eq!(Dop::from_points([a, b, c]), Dop::from_points(arrays));
    assert_eq!(Affine::IDENTITY.point(b), b.into());

    assert_eq!(Ray::new(a, b), Ray::new(arrays[0], arrays[1]));
    let hit = Hit { t: 1.0, u: 0.25, v: 0.25, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front };
    let point = SurfacePoint::new(&hit, [a, b, c], aabb.reach());
    assert_eq!(point, SurfacePoint::new(&hit, arrays, aabb.reach()));
    assert_eq!(point.spawn_ray(c), point.spawn_ray(arrays[2]));
    assert_eq!(point.spawn_ray_to(c), point.spawn_ray_to(arrays[2]));
}

#[test]
fn vectors_of_other_libraries_are_accepted() {
    accepts::<[f32; 3]>();
    accepts::<(f32, f32, f32)>();
    accepts::<glam::Vec3>();
    accepts::<mint::Vector3<f32>>();
    accepts::<mint::Point3<f32>>();
}
