//! Distances, each proven by a plane between the nearest points.

use canted_collide::{Distance, Pose, closest_pairs, distance, overlaps, pairs_within};
use canted_obb::PrimId;
use canted_wide::Preset;

use crate::common::{Triangle, bvh, config_of, configs, mapped, needles, posed, poses, soup};

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// By how much a distance of two triangles may exceed the least, and its points lie off their triangles: by how far both reach to the wrong side of planes
/// across the line between the points.
fn error_of(near: &Distance, a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> f64 {
    let [p, q] = near.points;
    let across = sub(q, p);
    assert!(
        (dot(across, across).sqrt() - near.distance).abs() <= 1e-12 * (near.distance + 1.0),
        "the points are that far apart"
    );
    let beyond = |points: &[[f64; 3]; 3], from: [f64; 3], sign: f64| {
        points.iter().map(|&x| sign * dot(sub(x, from), across) / near.distance).fold(f64::NEG_INFINITY, f64::max)
    };
    beyond(a, p, 1.0).abs().max(beyond(b, q, -1.0).abs())
}

/// All pairs, by single triangles: each is proven.
fn all(a: &[Triangle], a_pose: Pose, b: &[Triangle], b_pose: Pose, error: f64) -> Vec<Distance> {
    let (a_posed, b_posed) = (posed(a, a_pose), posed(b, b_pose));
    let mut all = vec![];
    for (i, one) in a.iter().enumerate() {
        for (j, other) in b.iter().enumerate() {
            let near = distance(one, a_pose, other, b_pose, f64::INFINITY).expect("two triangles");
            let touch = overlaps(one, a_pose, other, b_pose);
            assert_eq!(near.distance == 0.0, touch);
            if !touch {
                let found = error_of(&near, &a_posed[i], &b_posed[j]);
                assert!(found <= error, "{i} and {j}: off by {found:e}");
            }
            all.push(Distance { primitives: [PrimId(i as u32), PrimId(j as u32)], ..near });
        }
    }
    all.sort_by(|x, y| x.distance.total_cmp(&y.distance).then(x.primitives.cmp(&y.primitives)));
    all
}

fn check(name: &str, a: &[Triangle], b: &[Triangle], b_pose: Pose, error: f64) {
    let all = all(a, Pose::IDENTITY, b, b_pose, error);
    for config in configs() {
        let (a, b) = (bvh(a, config), bvh(b, config));
        let mut nearest = vec![];
        closest_pairs(&a, Pose::IDENTITY, &b, b_pose, 20, f64::INFINITY, &mut nearest);
        assert_eq!(nearest, all[..20], "{name}");
        assert_eq!(distance(&a, Pose::IDENTITY, &b, b_pose, f64::INFINITY), Some(all[0]), "{name}");
        let least = all[0].distance;
        assert_eq!(
            distance(&a, Pose::IDENTITY, &b, b_pose, least),
            Some(all[0]),
            "{name}: the greatest distance counts"
        );
        if least > 0.0 {
            assert_eq!(distance(&a, Pose::IDENTITY, &b, b_pose, least.next_down()), None, "{name}");
        }
        let (limit, mut within) = (all[50].distance, vec![]);
        pairs_within(&a, Pose::IDENTITY, &b, b_pose, limit, &mut within);
        let mut expected: Vec<_> = all.iter().filter(|x| x.distance <= limit).map(|x| x.primitives).collect();
        expected.sort_unstable();
        assert_eq!(within, expected, "{name}");
    }
}

#[test]
fn distances_are_those_of_a_loop() {
    let (a, b) = (soup(60, 0.1, 20), soup(60, 0.1, 21));
    for (pose, shift) in poses().into_iter().zip([1.5, 0.0, 2.0, 0.9, 0.0]) {
        let mut pose = pose;
        pose.columns[3][0] += shift;
        check("soup", &a, &b, pose, 1e-13);
    }
    check("apart", &a, &mapped(&b, |[x, y, z]| [x + 1.25, y, z]), Pose::IDENTITY, 1e-13);
    // Thinner than 2^-13 of their length.
    check("needles", &needles(60, 22), &mapped(&needles(60, 23), |[x, y, z]| [x, y, z + 1.5]), Pose::IDENTITY, 1e-9);
}

#[test]
fn scales_and_offsets() {
    let (a, b) = (soup(40, 0.1, 24), mapped(&soup(40, 0.1, 25), |[x, y, z]| [x + 1.5, y, z]));
    for scale in [1e-6_f32, 1e6] {
        let [a, b] = [&a, &b].map(|triangles| mapped(triangles, |p| p.map(|x| x * scale)));
        check("scaled", &a, &b, Pose::IDENTITY, 1e-13 * f64::from(scale.max(1.0)));
    }
    let [a, b] = [&a, &b].map(|triangles| mapped(triangles, |p| p.map(|x| 1000.0 * x + 1e7)));
    check("far", &a, &b, Pose::IDENTITY, 1e-8);
}

#[test]
fn empty_bodies_and_limits() {
    let config = config_of(Preset::Balanced);
    let (empty, one) = (bvh(&[], config), bvh(&soup(1, 0.1, 26), config));
    for (a, b) in [(&empty, &empty), (&empty, &one), (&one, &empty)] {
        assert_eq!(distance(a, Pose::IDENTITY, b, Pose::IDENTITY, f64::INFINITY), None);
    }
    let touching = distance(&one, Pose::IDENTITY, &one, Pose::IDENTITY, 0.0).expect("a body touches itself");
    assert_eq!((touching.distance, touching.primitives), (0.0, [PrimId(0); 2]));
    assert_eq!(touching.points[0], touching.points[1]);
    for limit in [-1.0, f64::NAN] {
        assert_eq!(distance(&one, Pose::IDENTITY, &one, Pose::IDENTITY, limit), None);
    }
    // In the middle of both: an edge through a face.
    let face: Triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let through: Triangle = [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [9.0, 9.0, 9.0]];
    let near = distance(&face, Pose::IDENTITY, &through, Pose::IDENTITY, f64::INFINITY).expect("they touch");
    assert_eq!((near.distance, near.points), (0.0, [[1.0, 1.0, 0.0]; 2]));
}

/// Triangles that touch in real numbers, and with the roundings of the pose do not: the distance, which is all roundings, is not 0.
#[test]
fn only_what_touches_has_the_distance_zero() {
    let cases: [(Triangle, Triangle, [[f64; 3]; 3]); 3] = [
        (
            [[1.0, -1.0, 1.0], [-2.0, 2.0, 1.0], [-1.0, 0.0, 2.0]],
            [[-2.0, -2.0, -2.0], [0.0, -2.0, 2.0], [-2.0, 0.0, -2.0]],
            [[0.8, 0.1, -0.1], [0.1, -0.5, -0.5], [0.5, -0.4, 0.3]],
        ),
        (
            [[-2.0, -2.0, 2.0], [-2.0, 1.0, -1.0], [-2.0, -2.0, 2.0]],
            [[0.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [0.0, -1.0, -2.0]],
            [[0.0, 0.2, 0.9], [0.6, 0.3, -0.5], [0.2, -0.9, 0.8]],
        ),
        (
            [[1.0, -1.0, 2.0], [-2.0, -1.0, -2.0], [1.0, 0.0, 1.0]],
            [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, -1.0]],
            [[-0.9, -0.1, -0.5], [0.4, -0.6, 0.7], [-0.2, 0.1, 0.0]],
        ),
    ];
    for (a, b, [x, y, z]) in cases {
        let row = |[x, y, z]: [f64; 3]| [x, y, z, 0.0];
        let pose = Pose::from_rows([row(x), row(y), row(z)]);
        assert!(!overlaps(&a, Pose::IDENTITY, &b, pose));
        let near = distance(&a, Pose::IDENTITY, &b, pose, f64::INFINITY).expect("two triangles");
        assert!(near.distance > 0.0 && near.distance < 1e-15, "{near:?}");
        assert_eq!(distance(&a, Pose::IDENTITY, &b, pose, 0.0), None);
        let mut found = vec![];
        pairs_within(&a, Pose::IDENTITY, &b, pose, 0.0, &mut found);
        assert!(found.is_empty());
    }
}
