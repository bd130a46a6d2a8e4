use canted_obb::{Aabb, Affine, Dop, Enclosure, Moments, Obb, PrimId, bound};
use canted_trace::{
    BaldwinWeber, Hit, InstanceId, Kernel, MollerTrumbore, Projected, Ray, ScaledRay, Side, SlabRay, Slabs,
    SurfacePoint, Watertight, segment_overlaps_aabb,
};

use crate::{
    inputs::{Rng, SETTINGS, TWO_POW_60, Triangle, ray_at},
    kernels::{bits, hit},
};

/// The hit and the entries into the boxes, as bits.
fn answer<K: Kernel>(ray: &Ray, triangle: &Triangle, frame: [[f32; 3]; 3]) -> [Option<Vec<u32>>; 3] {
    let scaled = ScaledRay::new(ray).unwrap();
    let aabb = Aabb::from_points(*triangle);
    let slab_ray = SlabRay::new(&scaled, aabb.reach());
    [
        hit::<K>(&scaled, triangle).map(|h| bits(h).0.to_vec()),
        slab_ray.intersect_aabb(&aabb, f32::INFINITY).map(|t| vec![t.to_bits()]),
        slab_ray.intersect_slabs(&Slabs::from_points(frame, *triangle), f32::INFINITY).map(|t| vec![t.to_bits()]),
    ]
}

fn ray_and_triangle(rng: &mut Rng) -> (Ray, Triangle, [[f32; 3]; 3]) {
    let setting = SETTINGS[rng.below(2)];
    let triangle = rng.triangle(setting.around, setting.size);
    let scaled = ray_at(rng, &triangle, setting.distance);
    (Ray::new(scaled.origin, scaled.direction), triangle, rng.frame())
}

fn direction_length<K: Kernel>() {
    let mut rng = Rng(20);
    let mut n_hits = 0;
    for _ in 0..3000 {
        let (ray, triangle, frame) = ray_and_triangle(&mut rng);
        let base = answer::<K>(&ray, &triangle, frame);
        n_hits += u32::from(base[0].is_some());
        for factor in [0.5, 4.0, TWO_POW_60, 1.0 / TWO_POW_60] {
            let direction = ray.direction.map(|d| d * factor);
            // A component that became subnormal changes the direction.
            if ray.direction.iter().zip(direction).all(|(a, b)| b / factor == *a) {
                assert_eq!(answer::<K>(&Ray { direction, ..ray }, &triangle, frame), base);
            }
        }
    }
    assert!(n_hits > 500, "{n_hits}");
}

#[test]
fn a_power_of_two_in_the_direction_changes_no_bit() {
    direction_length::<Watertight>();
    direction_length::<MollerTrumbore>();
    direction_length::<BaldwinWeber>();
    direction_length::<Projected>();
}

fn negative_zeros<K: Kernel>() {
    let mut rng = Rng(21);
    let negate_zeros = |a: [f32; 3]| a.map(|x| if x == 0.0 { -0.0 } else { x });
    let add_zeros = |a: [f32; 3]| a.map(|x| x + 0.0);
    let mut n_zeros = 0;
    for _ in 0..3000 {
        let (ray, triangle, frame) = ray_and_triangle(&mut rng);
        let plus = Ray { origin: add_zeros(ray.origin), direction: add_zeros(ray.direction), ..ray };
        let minus = Ray { origin: negate_zeros(ray.origin), direction: negate_zeros(ray.direction), ..ray };
        n_zeros += u32::from(plus.direction.contains(&0.0));
        let expected = answer::<K>(&plus, &triangle.map(add_zeros), frame);
        assert_eq!(answer::<K>(&minus, &triangle.map(negate_zeros), frame.map(negate_zeros)), expected);
    }
    assert!(n_zeros > 500, "{n_zeros}");
}

#[test]
fn the_sign_of_zero_changes_no_bit() {
    negative_zeros::<Watertight>();
    negative_zeros::<MollerTrumbore>();
    negative_zeros::<BaldwinWeber>();
    negative_zeros::<Projected>();
}

#[test]
fn a_power_of_two_in_the_scene_changes_no_bit_of_weights() {
    let mut rng = Rng(22);
    let mut n_hits = 0;
    for _ in 0..5000 {
        let (ray, triangle, _) = ray_and_triangle(&mut rng);
        // Skip rays whose origin underflows: underflow depends on scale.
        if ray.origin.into_iter().chain(ray.direction).any(f32::is_subnormal) {
            continue;
        }
        let base = hit::<Watertight>(&ScaledRay::new(&ray).unwrap(), &triangle);
        for scale in [8.0, TWO_POW_60, 1.0 / TWO_POW_60] {
            let grown = |p: [f32; 3]| p.map(|x| x * scale);
            let scaled = ScaledRay::new(&Ray { origin: grown(ray.origin), ..ray }).unwrap();
            let found = hit::<Watertight>(&scaled, &triangle.map(grown));
            assert_eq!(found.map(|h| (h.t / scale, h.u, h.v, h.side)), base.map(|h| (h.t, h.u, h.v, h.side)));
        }
        n_hits += u32::from(base.is_some());
    }
    assert!(n_hits > 1000, "{n_hits}");
}

#[test]
fn invalid_rays_are_rejected() {
    let ray = Ray::new([1.0, 2.0, 3.0], [0.0, -3e-5, 1e-5]);
    let refused = |ray: Ray| ScaledRay::new(&ray).is_none();
    assert!(!refused(ray) && !refused(Ray { direction: [f32::MAX; 3], ..ray }));
    assert!(!refused(Ray { direction: [0.0, f32::from_bits(1), -0.0], ..ray }));
    assert!(refused(Ray { direction: [0.0, -0.0, 0.0], ..ray }));
    for bad in [f32::NAN, f32::INFINITY] {
        assert!(refused(Ray { direction: [1.0, bad, 0.0], ..ray }) && refused(Ray { origin: [bad; 3], ..ray }));
    }
    for (t_min, t_max) in [(1.0, 0.5), (-1.0, 1.0), (f32::NAN, 1.0), (0.0, f32::NAN)] {
        assert!(refused(Ray { t_min, t_max, ..ray }));
    }
    assert!(!refused(Ray { t_min: 1.0, t_max: 1.0, ..ray }));
}

#[test]
fn scaling_is_exact_and_reversible() {
    let ray = Ray { t_min: 0.25, ..Ray::new([0.0; 3], [0.0, -3e-5, 1e-5]) };
    let scaled = ScaledRay::new(&ray).unwrap();
    // 3e-5 is 2^-16 times 1.97.
    assert_eq!(scaled.direction, ray.direction.map(|d| d * 65536.0));
    assert_eq!(
        (scaled.t_min, scaled.scaled_t(2.0), scaled.caller_t(scaled.t_min)),
        (0.25 / 65536.0, 2.0 / 65536.0, 0.25)
    );
    // An infinite interval ends at the greatest finite `t`.
    assert_eq!((scaled.t_max, scaled.caller_t(scaled.t_max)), (f32::MAX / 65536.0, f32::MAX));
}

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
