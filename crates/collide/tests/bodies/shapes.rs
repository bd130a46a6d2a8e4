//! Spheres, capsules, segments, boxes and hulls as bodies.

use canted_collide::{Body, Capsule, Hull, Pose, Segment, distance, overlaps, pairs};
use canted_obb::{Aabb, Affine, Obb, PrimId};
use canted_trace::Sphere;
use canted_wide::{Preset, WideBvh};

use crate::common::{Random, Triangle, bvh, config_of, soup};

fn between<A: Body, B: Body>(a: &A, b: &B) -> f64 {
    let found = distance(a, Pose::IDENTITY, b, Pose::IDENTITY, f64::INFINITY).expect("neither is empty").distance;
    assert_eq!(found == 0.0, overlaps(a, Pose::IDENTITY, b, Pose::IDENTITY));
    let back = distance(b, Pose::IDENTITY, a, Pose::IDENTITY, f64::INFINITY).expect("neither is empty").distance;
    assert!((found - back).abs() < 1e-12, "{found} and {back}");
    found
}

/// Right values by hand.
#[test]
fn distances_of_shapes() {
    let ball = |x: f32, radius: f32| Sphere { center: [x, 0.0, 0.0], radius };
    let cube = Aabb { min: [3.0, -1.0, -1.0], max: [5.0, 1.0, 1.0] };
    let capsule = |y: f64| Capsule { ends: [[-2.0, y, 0.0], [2.0, y, 0.0]], radius: 0.5 };
    let segment = Segment { ends: [[0.0, 0.0, 2.0], [0.0, 0.0, 6.0]] };
    let octahedron = Hull {
        points: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .into_iter()
            .flat_map(|p: [f64; 3]| [p, p.map(|x| -x)])
            .collect(),
    };
    let turned = Obb { center: [0.0, 4.0, 0.0], ..Obb::from_aabb(&Aabb { min: [-1.0; 3], max: [1.0; 3] }) };
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
    near(between(&ball(0.0, 1.0), &ball(4.0, 1.0)), 2.0);
    assert_eq!(between(&ball(0.0, 1.0), &ball(1.5, 1.0)), 0.0);
    assert_eq!(between(&ball(0.0, 1.0), &ball(2.0, 1.0)), 0.0, "touching counts");
    assert_eq!(between(&ball(0.0, 4.0), &ball(0.5, 1.0)), 0.0, "one ball in another");
    near(between(&ball(0.0, 1.0), &cube), 2.0);
    assert_eq!(between(&ball(4.0, 0.25), &cube), 0.0, "a ball in a box");
    near(between(&capsule(3.0), &ball(0.0, 1.0)), 1.5);
    near(between(&capsule(3.0), &capsule(-3.0)), 5.0);
    near(between(&segment, &ball(0.0, 1.0)), 1.0);
    near(between(&segment, &octahedron), 1.0);
    near(between(&octahedron, &cube), 2.0);
    near(between(&octahedron, &turned), 2.0);
    near(between(&turned, &cube), 2.0_f64.hypot(2.0));
    // A face of the octahedron: the distance of a point from its plane.
    let corner = Segment { ends: [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]] };
    near(between(&octahedron, &corner), 2.0 / 3.0_f64.sqrt());
    assert_eq!(between(&octahedron, &Segment { ends: [[0.1, 0.1, 0.1]; 2] }), 0.0);
    let triangle: Triangle = [[3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, 0.0, 1.0]];
    near(between(&triangle, &ball(0.0, 1.0)), 2.0);
    assert_eq!(between(&triangle, &cube), 0.0);
    assert!(!overlaps(&Aabb::EMPTY, Pose::IDENTITY, &cube, Pose::IDENTITY), "an empty box touches nothing");
    assert!(!overlaps(&Hull { points: vec![] }, Pose::IDENTITY, &cube, Pose::IDENTITY));
}

#[test]
fn posed_shapes() {
    let cube = Aabb { min: [-1.0; 3], max: [1.0; 3] };
    let turn = Affine::rotation([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_4);
    let posed = |x: f32| Pose::from(turn.then(&Affine::translation([x, 0.0, 0.0])));
    let found = distance(&cube, Pose::IDENTITY, &cube, posed(4.0), f64::INFINITY).expect("two boxes");
    assert!((found.distance - (3.0 - 2.0_f64.sqrt())).abs() < 1e-6);
    assert!((found.points[1][0] - found.points[0][0] - found.distance).abs() < 1e-9);
    assert!(overlaps(&cube, Pose::IDENTITY, &cube, posed(2.4)) && !overlaps(&cube, Pose::IDENTITY, &cube, posed(2.42)));
    let grown = Pose::from(Affine::scale([2.0; 3]).then(&Affine::translation([5.0, 0.0, 0.0])));
    let ball = Sphere { center: [0.0; 3], radius: 1.0 };
    let found = distance(&ball, Pose::IDENTITY, &ball, grown, 9.0).expect("two balls");
    assert!((found.distance - 2.0).abs() < 1e-12);
    // Squeezed in y: what is compared is a ball within the ellipsoid.
    let squeezed = Pose::from_rows([[1.0, 0.0, 0.0, 0.0], [0.0, 0.25, 0.0, 3.0], [0.0, 0.0, 1.0, 0.0]]);
    let found = distance(&ball, Pose::IDENTITY, &ball, squeezed, 9.0).expect("two balls");
    assert!((found.distance - 1.75).abs() < 1e-12);
}

/// BVHs of spheres and boxes give the pairs of a loop over single shapes.
#[test]
fn bvhs_of_shapes_are_loops() {
    let mut random = Random(40);
    let spheres: Vec<Sphere> =
        (0..200).map(|_| Sphere { center: random.point(), radius: 0.15 * random.next() }).collect();
    let boxes: Vec<Aabb> = (0..200)
        .map(|_| {
            let min = random.point();
            Aabb { min, max: min.map(|x| x + 0.15 * random.next()) }
        })
        .collect();
    let triangles = soup(200, 0.15, 41);
    let (sphere_bvh, box_bvh) = (WideBvh::over(spheres.clone()).unwrap(), WideBvh::over(boxes.clone()).unwrap());
    let triangle_bvh = bvh(&triangles, config_of(Preset::Balanced));
    let pose = Pose::from(Affine::rotation([1.0, 1.0, 0.0], 0.3));
    fn check<A: Body, B: Body, S: Body, T: Body>(a: &A, singles: &[S], b: &B, others: &[T], pose: Pose) {
        let mut expected = vec![];
        for (i, one) in singles.iter().enumerate() {
            for (j, other) in others.iter().enumerate() {
                if overlaps(one, Pose::IDENTITY, other, pose) {
                    expected.push([PrimId(i as u32), PrimId(j as u32)]);
                }
            }
        }
        let mut found = vec![];
        pairs(a, Pose::IDENTITY, b, pose, &mut found);
        assert!(expected.len() > 10);
        assert_eq!(found, expected);
    }
    check(&sphere_bvh, &spheres, &box_bvh, &boxes, pose);
    check(&sphere_bvh, &spheres, &triangle_bvh, &triangles, pose);
    check(&triangle_bvh, &triangles, &box_bvh, &boxes, pose);
    check(&sphere_bvh, &spheres, &sphere_bvh, &spheres, pose);
}
