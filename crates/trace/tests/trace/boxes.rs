use canted_obb::{Aabb, Obb};
use canted_trace::{
    BaldwinWeber, Kernel, MollerTrumbore, Projected, Ray, ScaledRay, SlabRay, Slabs, Watertight, lanes::UNIT_ROUNDOFF,
    ray_aabb, ray_obb,
};
use num_traits::Signed;

use crate::inputs::{self, Q, Rng, SETTINGS, Triangle, any_bits, contains, obb_near, q, q3, ray_at};

/// The exact corners of a box.
fn exact_corners(obb: &Obb) -> impl Iterator<Item = inputs::Q3> {
    (0..8).map(|i| {
        std::array::from_fn(|k| {
            (0..3).fold(q(obb.center[k]), |sum, a| {
                let side = q(obb.frame[a][k]) * q(obb.half_extents[a]);
                if i >> a & 1 == 1 { sum + side } else { sum - side }
            })
        })
    })
}

#[test]
fn slabs_contain_their_boxes_and_points() {
    let mut rng = Rng(1);
    for setting in SETTINGS {
        for _ in 0..150 {
            let obb = obb_near(&mut rng, &setting);
            let slabs = Slabs::from_obb(&obb);
            assert!(exact_corners(&obb).all(|corner| contains(&slabs, &corner)), "{obb:?}");
            for k in 0..3 {
                // Tight: the outward rounding to f32 and the error of f64.
                let row = q3(slabs.rows[k]);
                let least = exact_corners(&obb).map(|corner| inputs::dot(&row, &corner)).min().expect("eight");
                let magnitude = exact_corners(&obb).map(|corner| inputs::reach(&corner)).max().expect("eight");
                let slack = q(f32::EPSILON) * q(slabs.lo[k].abs()) + q(32.0 * f64::EPSILON) * magnitude;
                assert!(least - q(slabs.lo[k]) <= slack + q(f32::from_bits(1)), "row {k} of {obb:?}");
            }
            let points = rng.triangle(setting.around, setting.size);
            let slabs = Slabs::from_points(slabs.rows, points);
            assert!(points.iter().all(|&p| contains(&slabs, &q3(p))), "{points:?}");
            // Tight: two units in the last place less exclude a point.
            let inward = |x: f32| x.next_up().next_up();
            let shrunken = Slabs { lo: slabs.lo.map(inward), hi: slabs.hi.map(|x| -inward(-x)), ..slabs };
            assert!(!points.iter().all(|&p| contains(&shrunken, &q3(p))), "not tight: {points:?}");
        }
    }
}

#[test]
fn rows_are_unit_and_span_the_faces() {
    let mut rng = Rng(2);
    // One rounding per component.
    let greatest = (Q::from_integer(1.into()) + q(f32::EPSILON) * q(2.0)).pow(2);
    for _ in 0..300 {
        let obb = obb_near(&mut rng, &SETTINGS[0]);
        for (k, row) in Slabs::from_obb(&obb).rows.into_iter().enumerate() {
            assert!(inputs::dot(&q3(row), &q3(row)) <= greatest);
            for side in [obb.frame[(k + 1) % 3], obb.frame[(k + 2) % 3]] {
                let slant = inputs::dot(&q3(row), &q3(side));
                assert!(slant.abs() <= q(4.0 * f32::EPSILON), "row {k} of {obb:?}");
            }
        }
    }
}

#[test]
fn degenerate_frames_still_contain() {
    let mut rng = Rng(3);
    for frame in [[[0.0; 3]; 3], [[1.0, 2.0, 3.0]; 3], [[1.0, 0.0, 0.0], [1.0, 1e-7, 0.0], [0.0, 0.0, 1e-30]]] {
        let obb = Obb { center: rng.vector(3.0), frame, half_extents: [1.0, 2.0, 0.5] };
        assert!(exact_corners(&obb).all(|corner| contains(&Slabs::from_obb(&obb), &corner)), "{obb:?}");
    }
    assert!(Slabs::from_points(Obb::IDENTITY_FRAME, []).is_empty());
}

/// Triangles and rays towards them.
type Case = (Triangle, ScaledRay);

/// The ray with its padding.
fn padded(ray: &ScaledRay, aabb: &Aabb) -> SlabRay {
    SlabRay::new(ray, aabb.reach())
}

/// The ray without padding.
fn bare(ray: &ScaledRay, _: &Aabb) -> SlabRay {
    SlabRay::with_pads(ray, 0.0, 0.0)
}

/// Rays that hit the box of a triangle exactly, and how many of them the test misses or reports with too small an interval.
fn rays_missed(
    rng: &mut Rng,
    oriented: bool,
    case: impl Fn(&mut Rng) -> Case,
    thicken: impl Fn(&ScaledRay, &Aabb) -> SlabRay,
) -> (u32, u32) {
    let (mut entered, mut lost) = (0, 0);
    for _ in 0..500 {
        // The triangle's vertices are on faces of its box, so rays towards them graze it.
        let (triangle, ray) = case(rng);
        let aabb = Aabb::from_points(triangle);
        let slabs = if oriented { Slabs::from_points(rng.frame(), triangle) } else { Slabs::from_aabb(&aabb) };
        let slab_ray = thicken(&ray, &aabb);
        let (near, far) = if oriented {
            slab_ray.clip_slabs(&slabs, f32::INFINITY)
        } else {
            slab_ray.clip_aabb(&aabb, f32::INFINITY)
        };
        assert!(!near.is_nan() && !far.is_nan());
        if let Some((exact_near, exact_far)) = inputs::clip(&slabs, &ray) {
            entered += 1;
            let covers = q(near) <= exact_near && (far == f32::INFINITY || exact_far.is_some_and(|x| x <= q(far)));
            lost += u32::from(!(near <= far && covers));
        }
    }
    (entered, lost)
}

#[test]
fn no_ray_that_hits_a_box_exactly_is_missed() {
    let mut rng = Rng(4);
    for oriented in [false, true] {
        for setting in SETTINGS {
            let (entered, lost) = rays_missed(&mut rng, oriented, |rng| inputs::case(rng, &setting), padded);
            assert!(entered > 50, "the case is void: {setting:?}");
            assert_eq!(lost, 0, "{setting:?}, oriented: {oriented}");
        }
        let (entered, lost) = rays_missed(&mut rng, oriented, any_bits, padded);
        assert!(entered > 50 && lost == 0, "{lost} of {entered} lost, oriented: {oriented}");
        let (_, lost) = rays_missed(&mut rng, oriented, |rng| inputs::case(rng, &SETTINGS[0]), bare);
        assert!(lost > 5, "without pads only {lost} are lost, oriented: {oriented}");
    }
}

/// Hits of `K`, and how many have a box that is missed, or entered after the hit.
fn hits_missed<K: Kernel>(
    rng: &mut Rng,
    case: impl Fn(&mut Rng) -> Case,
    thicken: impl Fn(&ScaledRay, &Aabb) -> SlabRay,
) -> (u32, u32) {
    let (mut hits, mut lost) = (0, 0);
    for _ in 0..4000 {
        let (triangle, ray) = case(rng);
        let Some(hit) = K::intersect(&K::prepare(&ray), &ray, &K::record(triangle), f32::INFINITY) else { continue };
        hits += 1;
        let aabb = Aabb::from_points(triangle);
        let slabs = Slabs::from_points(rng.frame(), triangle);
        let slab_ray = thicken(&ray, &aabb);
        let entries = [slab_ray.intersect_aabb(&aabb, hit.t), slab_ray.intersect_slabs(&slabs, hit.t)];
        lost += u32::from(!entries.into_iter().all(|near| near.is_some_and(|near| near <= hit.t)));
    }
    (hits, lost)
}

fn boxes_are_entered_before_hits<K: Kernel>(name: &str) {
    let mut rng = Rng(6);
    for setting in SETTINGS {
        let (hits, lost) = hits_missed::<K>(&mut rng, |rng| inputs::case(rng, &setting), padded);
        assert!(hits > 200, "the case is void: {hits} hits of {name} in {setting:?}");
        assert_eq!(lost, 0, "{name} in {setting:?}");
    }
    let (hits, lost) = hits_missed::<K>(&mut rng, any_bits, padded);
    assert!(hits > 200 && lost == 0, "{name}: {lost} of {hits} lost");
    let (hits, lost) = hits_missed::<K>(&mut rng, |rng| inputs::case(rng, &SETTINGS[0]), bare);
    assert!(lost > 20, "{name}: without pads only {lost} of {hits} are lost");
}

#[test]
fn boxes_of_hit_triangles_are_entered_before_the_hit() {
    boxes_are_entered_before_hits::<Watertight>("watertight");
    boxes_are_entered_before_hits::<MollerTrumbore>("moller-trumbore");
    boxes_are_entered_before_hits::<BaldwinWeber>("baldwin-weber");
    boxes_are_entered_before_hits::<Projected>("projected");
}

#[test]
fn a_given_error_adds_to_the_padding() {
    let mut rng = Rng(8);
    let mut lost_without = 0;
    for setting in SETTINGS {
        let error = 0.25 * setting.size;
        let mut entered = 0;
        for _ in 0..400 {
            let (triangle, ray) = inputs::case(&mut rng, &setting);
            let outer = Aabb::from_points(triangle);
            // Points of the outer box are within the error of this box.
            let inner =
                Aabb { min: outer.min.map(|x| (x + error).next_down()), max: outer.max.map(|x| (x - error).next_up()) };
            if inner.is_empty() {
                continue;
            }
            let Some((near, _)) = inputs::clip(&Slabs::from_aabb(&outer), &ray) else { continue };
            entered += 1;
            let slab_ray = SlabRay::with_error(&ray, inner.reach(), f64::from(error));
            let slabs = Slabs::from_points(rng.frame(), inner.corners());
            for entry in
                [slab_ray.intersect_aabb(&inner, f32::INFINITY), slab_ray.intersect_slabs(&slabs, f32::INFINITY)]
            {
                assert!(entry.is_some_and(|entry| q(entry) <= near), "{setting:?} {ray:?} {inner:?}");
            }
            lost_without += u32::from(padded(&ray, &inner).intersect_aabb(&inner, f32::INFINITY).is_none());
        }
        assert!(entered > 50, "the case is void: {entered} in {setting:?}");
    }
    assert!(lost_without > 100, "without the error only {lost_without} are lost");
}

#[test]
fn public_tests_agree_with_six_planes() {
    let cube = Aabb { min: [-1.0; 3], max: [1.0; 3] };
    let entry = |origin, direction| ray_aabb(&Ray::new(origin, direction), &cube);
    // The documented bound of `ray_aabb` for a box of one and origins five away, along directions of one or longer.
    let near = |x: f32, y: f32| (x - y).abs() <= 25.0 * UNIT_ROUNDOFF * (1.0 + 5.0);
    for direction in [[2.0, 0.0, 0.0], [2.0, -0.0, -0.0]] {
        let (a, b) = entry([-5.0, 0.0, 0.0], direction).unwrap();
        assert!(near(a, 2.0) && near(b, 3.0) && a <= 2.0 && b >= 3.0);
        // In the plane of a face, and along an edge.
        assert!(entry([-5.0, 1.0, 0.0], direction).is_some() && entry([-5.0, 1.0, -1.0], direction).is_some());
        assert!(entry([-5.0, 1.001, 0.0], direction).is_none());
    }
    let (a, b) = entry([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    assert!(a == 0.0 && near(b, 1.0));
    assert_eq!(entry([5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), None);
    assert_eq!(entry([0.0; 3], [0.0; 3]), None);
    assert_eq!(ray_aabb(&Ray::new([0.0; 3], [1.0, 0.0, 0.0]), &Aabb::EMPTY), None);

    let mut rng = Rng(7);
    let mut n_entered = 0;
    for _ in 0..300 {
        let setting = SETTINGS[rng.below(4)];
        let obb = obb_near(&mut rng, &setting);
        let corners = obb.aabb().corners();
        let aim: Triangle = [corners[0], corners[3], corners[6]];
        let scaled = ray_at(&mut rng, &aim, setting.distance);
        let ray = Ray::new(scaled.origin, scaled.direction);
        // `Slabs::from_obb` holds the box, so every exact hit must be reported.
        if let Some((near, far)) = inputs::clip(&Slabs::from_obb(&obb), &scaled) {
            n_entered += 1;
            let (entry, exit) = ray_obb(&ray, &obb).unwrap();
            assert!(q(entry) <= near && far.unwrap() <= q(exit), "{obb:?} {ray:?}");
        }
    }
    assert!(n_entered > 100, "the case is void: {n_entered}");
}
