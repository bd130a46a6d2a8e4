use canted_obb::{Aabb, Obb};
use num_traits::Signed;

use super::exact::{self, Q, contains, q, q3};
use super::inputs::{Rng, SETTINGS, Setting, Triangle, obb_near, ray_at};
use crate::{BaldwinWeber, Kernel, MollerTrumbore, Ray, ScaledRay, SlabRay, Slabs, Watertight, ray_aabb, ray_obb};

/// The exact corners of a box.
fn exact_corners(obb: &Obb) -> impl Iterator<Item = exact::Q3> {
    (0..8).map(|i| {
        std::array::from_fn(|k| {
            (0..3).fold(q(obb.center[k]), |sum, a| {
                let side = q(obb.frame[a][k]) * q(obb.half[a]);
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
            let slabs = Slabs::of_obb(&obb);
            assert!(exact_corners(&obb).all(|corner| contains(&slabs, &corner)), "{obb:?}");
            let points = rng.triangle(setting.around, setting.size);
            let slabs = Slabs::of_points(slabs.rows, points);
            assert!(points.iter().all(|&p| contains(&slabs, &q3(p))), "{points:?}");
            // Not needlessly large: two units in the last place less, and a point is out.
            let inward = |x: f32| x.next_up().next_up();
            let shrunken = Slabs { lo: slabs.lo.map(inward), hi: slabs.hi.map(|x| -inward(-x)), ..slabs };
            assert!(!points.iter().all(|&p| contains(&shrunken, &q3(p))), "not tight: {points:?}");
        }
    }
}

#[test]
fn rows_are_unit_and_span_the_faces() {
    let mut rng = Rng(2);
    // One rounding a component.
    let greatest = (Q::from_integer(1.into()) + q(f32::EPSILON) * q(2.0)).pow(2);
    for _ in 0..300 {
        let obb = obb_near(&mut rng, &SETTINGS[0]);
        for (k, row) in Slabs::of_obb(&obb).rows.into_iter().enumerate() {
            assert!(exact::dot(&q3(row), &q3(row)) <= greatest);
            for side in [obb.frame[(k + 1) % 3], obb.frame[(k + 2) % 3]] {
                let slant = exact::dot(&q3(row), &q3(side));
                assert!(slant.abs() <= q(4.0 * f32::EPSILON), "row {k} of {obb:?}");
            }
        }
    }
}

#[test]
fn degenerate_frames_still_contain() {
    let mut rng = Rng(3);
    for frame in [[[0.0; 3]; 3], [[1.0, 2.0, 3.0]; 3], [[1.0, 0.0, 0.0], [1.0, 1e-7, 0.0], [0.0, 0.0, 1e-30]]] {
        let obb = Obb { center: rng.vector(3.0), frame, half: [1.0, 2.0, 0.5] };
        assert!(exact_corners(&obb).all(|corner| contains(&Slabs::of_obb(&obb), &corner)), "{obb:?}");
    }
    assert!(Slabs::of_points(Obb::IDENTITY_FRAME, []).is_empty());
}

/// Rays at the edges and corners of boxes, in their faces and past them; how many the test loses that exactly enter.
///
/// `pads` makes the thickened ray. Where it enters, it must do so no later than the exact ray.
fn lost(setting: &Setting, oriented: bool, rng: &mut Rng, pads: impl Fn(&ScaledRay, f32) -> SlabRay) -> (u32, u32) {
    let (mut entered, mut lost) = (0, 0);
    for _ in 0..400 {
        // The triangle's vertices are corners of its box, so rays at it graze the box.
        let triangle = rng.triangle(setting.around, setting.size);
        let aabb = Aabb::of_points(triangle);
        let slabs = if oriented { Slabs::of_points(rng.frame(), triangle) } else { Slabs::of_aabb(&aabb) };
        let ray = ray_at(rng, &triangle, setting.distance);
        let slab_ray = pads(&ray, aabb.reach());
        let clipped = if oriented {
            slab_ray.clip_slabs(&slabs, f32::INFINITY)
        } else {
            slab_ray.clip_aabb(&aabb, f32::INFINITY)
        };
        assert!(!clipped.0.is_nan() && !clipped.1.is_nan());
        if let Some((near, far)) = exact::clip(&slabs, &ray) {
            entered += 1;
            let covers =
                q(clipped.0) <= near && far.is_none_or(|far| clipped.1 == f32::INFINITY || far <= q(clipped.1));
            lost += u32::from(!(clipped.0 <= clipped.1 && covers));
        }
    }
    (entered, lost)
}

#[test]
fn rays_that_exactly_enter_are_never_lost() {
    let mut rng = Rng(4);
    for setting in SETTINGS {
        for oriented in [false, true] {
            let (entered, lost) = lost(&setting, oriented, &mut rng, SlabRay::new);
            assert!(entered > 50, "the case is void: {setting:?}");
            assert_eq!(lost, 0, "{setting:?}, oriented: {oriented}");
        }
    }
}

#[test]
fn without_pads_rays_are_lost() {
    let mut rng = Rng(5);
    for oriented in [false, true] {
        let (_, lost) = lost(&SETTINGS[0], oriented, &mut rng, |ray, _| SlabRay::with_pads(ray, 0.0, 0.0));
        assert!(lost > 5, "the oracle sees only {lost} flaws");
    }
}

/// Hits of `K` whose box is not entered, or entered after the hit.
fn hits_lost<K: Kernel>(setting: &Setting, rng: &mut Rng, pads: impl Fn(&ScaledRay, f32) -> SlabRay) -> (u32, u32) {
    let (mut hits, mut lost) = (0, 0);
    for _ in 0..4000 {
        let triangle = rng.triangle(setting.around, setting.size);
        let ray = ray_at(rng, &triangle, setting.distance);
        let Some(hit) = K::intersect(&K::prepare(&ray), &ray, &K::record(triangle), f32::INFINITY) else { continue };
        hits += 1;
        let aabb = Aabb::of_points(triangle);
        let slabs = Slabs::of_points(rng.frame(), triangle);
        let slab_ray = pads(&ray, aabb.reach());
        let entries = [slab_ray.enters_aabb(&aabb, hit.t), slab_ray.enters_slabs(&slabs, hit.t)];
        lost += u32::from(!entries.into_iter().all(|near| near.is_some_and(|near| near <= hit.t)));
    }
    (hits, lost)
}

#[test]
fn boxes_of_hit_triangles_are_entered_before_the_hit() {
    let mut rng = Rng(6);
    for setting in SETTINGS {
        let sums = [
            hits_lost::<Watertight>(&setting, &mut rng, SlabRay::new),
            hits_lost::<MollerTrumbore>(&setting, &mut rng, SlabRay::new),
            hits_lost::<BaldwinWeber>(&setting, &mut rng, SlabRay::new),
        ];
        assert_eq!(sums.map(|(_, lost)| lost), [0; 3], "{setting:?}");
        assert!(sums[0].0 > 200, "the case is void: {sums:?} in {setting:?}");
    }
    let (hits, lost) = hits_lost::<Watertight>(&SETTINGS[0], &mut rng, |ray, _| SlabRay::with_pads(ray, 0.0, 0.0));
    assert!(lost > 20, "without pads only {lost} of {hits} are lost");
}

#[test]
fn public_tests_agree_with_six_planes() {
    let cube = Aabb { min: [-1.0; 3], max: [1.0; 3] };
    let entry = |origin, direction| ray_aabb(&Ray::new(origin, direction), &cube);
    let near = |x: f32, y: f32| (x - y).abs() <= 1e-5;
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
    for _ in 0..300 {
        let setting = SETTINGS[rng.below(4)];
        let obb = obb_near(&mut rng, &setting);
        let corners = obb.aabb().corners();
        let aim: Triangle = [corners[0], corners[3], corners[6]];
        let scaled = ray_at(&mut rng, &aim, setting.distance);
        let ray = Ray::new(scaled.origin, scaled.direction);
        // `Slabs::of_obb` holds the box, so what enters exactly is what must be found.
        if let Some((near, _)) = exact::clip(&Slabs::of_obb(&obb), &scaled) {
            let (entry, exit) = ray_obb(&ray, &obb).unwrap();
            assert!(q(entry) <= near && entry <= exit, "{obb:?} {ray:?}");
        }
    }
}
