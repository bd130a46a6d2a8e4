//! Touching pairs are those of exact integers.

use canted_collide::{Pose, overlaps, pairs, self_intersections};
use canted_obb::PrimId;
use canted_wide::{Preset, TriangleBvh};

use crate::common::poses;
use crate::common::{
    Triangle, bvh, config_of, configs, found, grid, lost_and_invented, mapped, needles, posed, share_a_point, soup,
    truth,
};

/// Compares all configurations with the truth; at least `least` pairs touch in all poses together.
fn check(name: &str, a: &[Triangle], b: &[Triangle], poses: &[[Pose; 2]], least: usize) {
    let mut n_touching = 0;
    for (i, &[a_pose, b_pose]) in poses.iter().enumerate() {
        let truth = truth(&posed(a, a_pose), &posed(b, b_pose));
        n_touching += truth.len();
        for (j, config) in configs().into_iter().enumerate() {
            let (a, b) = (bvh(a, config), bvh(b, config));
            let found = found(&a, a_pose, &b, b_pose);
            assert_eq!(lost_and_invented(&found, &truth), [0, 0], "{name}, pose {i}, configuration {j}");
            assert!(found.is_sorted(), "{name}");
            assert_eq!(found.len(), truth.len(), "{name}: no pair comes twice");
            assert_eq!(overlaps(&a, a_pose, &b, b_pose), !truth.is_empty(), "{name}, pose {i}");
        }
    }
    assert!(n_touching >= least, "{name}: only {n_touching} pairs touch");
}

fn second(poses: impl IntoIterator<Item = Pose>) -> Vec<[Pose; 2]> {
    poses.into_iter().map(|pose| [Pose::IDENTITY, pose]).collect()
}

#[test]
fn soups_under_all_poses() {
    check("soup", &soup(200, 0.15, 1), &soup(200, 0.15, 2), &second(poses()), 300);
    let both: Vec<[Pose; 2]> = poses().into_iter().zip(poses().into_iter().rev()).map(|(a, b)| [a, b]).collect();
    check("both are posed", &soup(150, 0.15, 3), &soup(150, 0.15, 4), &both, 200);
}

#[test]
fn needles_and_segments() {
    check("needles", &needles(120, 5), &needles(120, 6), &second(poses()), 10);
}

#[test]
fn coplanar_grids_touch_in_edges_and_vertices() {
    let shifts = [[0.0, 0.0, 0.0], [0.5, 0.25, 0.0], [8.0, 0.0, 0.0], [8.0, 8.0, 0.0]];
    for shift in shifts {
        check("grid", &grid(8, [0.0; 3]), &grid(8, shift), &second([Pose::IDENTITY]), 1);
    }
    // A unit in the last place apart, and in one plane under a pose.
    let above = Pose::translation([0.0, 0.0, f64::from(f32::from_bits(1))]);
    assert!(!overlaps(
        &bvh(&grid(8, [0.0; 3]), config_of(Preset::Fast)),
        Pose::IDENTITY,
        &bvh(&grid(8, [0.0, 0.0, f32::EPSILON]), config_of(Preset::Fast)),
        Pose::IDENTITY
    ));
    check("a hair above", &grid(4, [0.0; 3]), &grid(4, [0.0; 3]), &second([above]), 0);
    check(
        "a posed grid",
        &grid(6, [0.0; 3]),
        &grid(6, [0.5, 0.5, 0.0]),
        &[[poses()[2], poses()[2]], [poses()[3], poses()[3]]],
        20,
    );
}

#[test]
fn offsets_and_scales() {
    let (a, b) = (soup(150, 0.15, 7), soup(150, 0.15, 8));
    for scale in [1e-6_f32, 1e-3, 1e3, 1e6] {
        let [a, b] = [&a, &b].map(|triangles| mapped(triangles, |p| p.map(|x| x * scale)));
        let f = f64::from(scale);
        let shift = Pose::translation([0.1 * f, 0.0, -0.05 * f]);
        check("scaled", &a, &b, &second([Pose::IDENTITY, shift, poses()[2]]), 100);
    }
    let [a, b] = [&a, &b].map(|triangles| mapped(triangles, |p| p.map(|x| 200.0 * x + 1e7)));
    check("far", &a, &b, &second([Pose::IDENTITY, Pose::translation([3.0, -2.0, 1.0])]), 100);
    // Far bodies that a pose brings to others at the origin.
    let back = Pose::translation([-1e7; 3]);
    check("brought back", &mapped(&soup(150, 0.15, 9), |p| p.map(|x| 200.0 * x)), &b, &second([back]), 50);
    // One body is a million times smaller.
    let tiny = mapped(&soup(150, 0.15, 10), |p| p.map(|x| 1e-6 * x));
    let grown = Pose::from_rows([[1e6, 0.0, 0.0, 0.0], [0.0, 1e6, 0.0, 0.0], [0.0, 0.0, 1e6, 0.0]]);
    check("grown", &soup(150, 0.15, 11), &tiny, &second([grown]), 50);
}

/// Pairs of triangles that touch in all ways, with the answer from a drawing.
#[test]
fn touching_and_degenerate_triangles() {
    let base: Triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let cases: [(&str, Triangle, bool); 22] = [
        ("itself", base, true),
        ("reversed", [base[0], base[2], base[1]], true),
        ("a vertex on the face", [[1.0, 1.0, 0.0], [1.0, 1.0, 3.0], [2.0, 1.0, 3.0]], true),
        ("a vertex on an edge", [[2.0, 0.0, 0.0], [2.0, -1.0, 3.0], [3.0, -1.0, 3.0]], true),
        ("a vertex on a vertex", [[4.0, 0.0, 0.0], [5.0, 0.0, 1.0], [5.0, 1.0, 1.0]], true),
        ("an edge through the face", [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [9.0, 9.0, 0.0]], true),
        ("an edge through an edge", [[2.0, 0.0, -1.0], [2.0, 0.0, 1.0], [2.0, -3.0, 0.0]], true),
        ("edges along each other", [[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [2.0, -1.0, 1.0]], true),
        ("a vertex a bit above the face", [[1.0, 1.0, 1e-30], [1.0, 1.0, 3.0], [2.0, 1.0, 3.0]], false),
        ("beyond an edge", [[3.0, 3.0, -1.0], [3.0, 3.0, 1.0], [9.0, 9.0, 0.0]], false),
        ("in the plane, inside", [[0.5, 0.5, 0.0], [1.0, 0.5, 0.0], [0.5, 1.0, 0.0]], true),
        ("in the plane, around", [[-9.0, -9.0, 0.0], [30.0, -9.0, 0.0], [-9.0, 30.0, 0.0]], true),
        ("in the plane, apart", [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]], false),
        ("in the plane, at a vertex", [[4.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]], true),
        ("a segment through the face", [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.5]], true),
        ("a segment that ends on the face", [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]], true),
        ("a segment in the plane", [[-1.0, 1.0, 0.0], [9.0, 1.0, 0.0], [2.0, 1.0, 0.0]], true),
        ("a segment in the plane, apart", [[-1.0, 5.0, 0.0], [9.0, 5.0, 0.0], [2.0, 5.0, 0.0]], false),
        ("a segment that passes", [[3.0, 3.0, -1.0], [3.0, 3.0, 1.0], [3.0, 3.0, 0.0]], false),
        ("a point on the face", [[1.0, 1.0, 0.0]; 3], true),
        ("a point on an edge", [[2.0, 2.0, 0.0]; 3], true),
        ("a point above", [[1.0, 1.0, 0.5]; 3], false),
    ];
    let segment: Triangle = [[0.0, 0.0, 0.0], [2.0, 2.0, 2.0], [1.0, 1.0, 1.0]];
    let of_segments: [(&str, Triangle, bool); 6] = [
        ("crossing", [[0.0, 2.0, 1.0], [2.0, 0.0, 1.0], [1.0, 1.0, 1.0]], true),
        ("along, overlapping", [[1.5, 1.5, 1.5], [3.0, 3.0, 3.0], [2.0, 2.0, 2.0]], true),
        ("along, apart", [[3.0, 3.0, 3.0], [5.0, 5.0, 5.0], [4.0, 4.0, 4.0]], false),
        ("end to end", [[2.0, 2.0, 2.0], [5.0, 2.0, 2.0], [3.0, 2.0, 2.0]], true),
        ("a point on it", [[0.5, 0.5, 0.5]; 3], true),
        ("a point beside it", [[0.5, 0.5, 0.25]; 3], false),
    ];
    let point: Triangle = [[1.0, 2.0, 3.0]; 3];
    let of_points = [("the same point", point, true), ("another point", [[1.0, 2.0, 3.5]; 3], false)];
    let all = cases.iter().map(|case| (base, case)).chain(of_segments.iter().map(|case| (segment, case)));
    for (one, &(name, other, expected)) in all.chain(of_points.iter().map(|case| (point, case))) {
        for rotation in 0..3 {
            let rotated = std::array::from_fn(|i| other[(i + rotation) % 3]);
            let flipped = [rotated[0], rotated[2], rotated[1]];
            for other in [rotated, flipped] {
                assert_eq!(overlaps(&one, Pose::IDENTITY, &other, Pose::IDENTITY), expected, "{name}");
                assert_eq!(overlaps(&other, Pose::IDENTITY, &one, Pose::IDENTITY), expected, "{name}, the other way");
                let [one, other] = [one, other].map(|t| t.map(|p| p.map(f64::from)));
                assert_eq!(share_a_point(&one, &other), expected, "{name}, by integers");
            }
        }
    }
}

#[test]
fn small_bodies_have_answers() {
    let config = config_of(Preset::Balanced);
    let (empty, one) = (bvh(&[], config), bvh(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], config));
    for (a, b, expected) in [(&empty, &empty, 0), (&empty, &one, 0), (&one, &empty, 0), (&one, &one, 1)] {
        assert_eq!(found(a, Pose::IDENTITY, b, Pose::IDENTITY).len(), expected);
    }
    for x in [f64::NAN, f64::INFINITY, 1e300] {
        assert!(!overlaps(&one, Pose::IDENTITY, &one, Pose::translation([x, 0.0, 0.0])));
    }
    // All points in one: a pose of zeros.
    let collapsed = |at: [f64; 3]| Pose { columns: [[0.0; 3], [0.0; 3], [0.0; 3], at] };
    assert!(overlaps(&one, Pose::IDENTITY, &one, collapsed([0.25, 0.25, 0.0])));
    assert!(!overlaps(&one, Pose::IDENTITY, &one, collapsed([0.25, 0.25, 0.1])));
}

/// What the comparison must see.
#[test]
fn lost_and_invented_pairs_are_counted() {
    let (a, b) = (soup(150, 0.15, 12), soup(150, 0.15, 13));
    let truth = truth(&posed(&a, Pose::IDENTITY), &posed(&b, Pose::IDENTITY));
    assert_eq!(lost_and_invented(&truth[1..], &truth), [1, 0]);
    let mut more = truth.clone();
    more.push([PrimId(0), PrimId(1000)]);
    assert_eq!(lost_and_invented(&more, &truth), [0, 1]);
    // Boxes alone find more, and a body that is moved by little another set.
    let config = config_of(Preset::Fast);
    let moved = found(&bvh(&a, config), Pose::IDENTITY, &bvh(&b, config), Pose::translation([1e-3, 0.0, 0.0]));
    assert_ne!(lost_and_invented(&moved, &truth), [0, 0]);
}

fn intersections(bvh: &TriangleBvh) -> Vec<[u32; 2]> {
    let mut found = vec![];
    self_intersections(bvh, &mut found);
    found.into_iter().map(|[a, b]| [a.0, b.0]).collect()
}

#[test]
fn self_intersections_are_those_of_a_loop() {
    for (triangles, least) in [(soup(200, 0.15, 14), 40), (needles(150, 15), 2)] {
        let points = posed(&triangles, Pose::IDENTITY);
        let expected: Vec<[u32; 2]> =
            truth(&points, &points).into_iter().filter(|[a, b]| a < b).map(|[a, b]| [a.0, b.0]).collect();
        assert!(expected.len() >= least, "{}", expected.len());
        for config in configs() {
            assert_eq!(intersections(&bvh(&triangles, config)), expected);
        }
    }
}

#[test]
fn neighbors_do_not_intersect_and_copies_do() {
    let config = config_of(Preset::Balanced);
    assert_eq!(intersections(&bvh(&grid(8, [0.0; 3]), config)), Vec::<[u32; 2]>::new());
    // A fan that folds onto itself is adjacent all the same.
    let fan = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.0; 3], [1.0, 0.1, 0.0], [0.1, 1.0, 0.0]]];
    assert_eq!(intersections(&bvh(&fan, config)), Vec::<[u32; 2]>::new());
    let twice = [fan[0], [fan[0][1], fan[0][2], fan[0][0]]];
    assert_eq!(intersections(&bvh(&twice, config)), [[0, 1]]);
    // Zeros of both signs are equal.
    let minus = [fan[0], [[-0.0; 3], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0]]];
    assert_eq!(intersections(&bvh(&minus, config)), Vec::<[u32; 2]>::new());
    assert_eq!(intersections(&bvh(&[], config)), Vec::<[u32; 2]>::new());
    let mut found = vec![[PrimId(7); 2]];
    pairs(&bvh(&fan, config), Pose::IDENTITY, &bvh(&[], config), Pose::IDENTITY, &mut found);
    assert!(found.is_empty());
}
