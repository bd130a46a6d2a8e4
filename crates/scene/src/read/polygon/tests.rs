//! Oracle: on an integer grid areas are exact. A triangulation is correct if no triangle is clockwise and the areas sum to the
//! polygon's area. For self-intersecting polygons only the number of triangles is checked.

use super::*;
use proptest::prelude::*;

type Grid = Vec<[i64; 2]>;

fn twice_area([a, b, c]: [[i64; 2]; 3]) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn twice_polygon_area(polygon: &[[i64; 2]]) -> i64 {
    (0..polygon.len()).map(|k| twice_area([[0, 0], polygon[k], polygon[(k + 1) % polygon.len()]])).sum()
}

/// The first error of a triangulation of a counter-clockwise polygon.
fn flaw(polygon: &[[i64; 2]], triangles: &[[usize; 3]]) -> Option<String> {
    if triangles.len() != polygon.len() - 2 {
        return Some(format!("{} triangles for {} corners", triangles.len(), polygon.len()));
    }
    let areas: Vec<i64> = triangles.iter().map(|triangle| twice_area(triangle.map(|k| polygon[k]))).collect();
    if let Some(wrong) = areas.iter().position(|&area| area < 0) {
        return Some(format!("triangle {wrong} is clockwise"));
    }
    let (sum, expected) = (areas.iter().sum::<i64>(), twice_polygon_area(polygon));
    (sum != expected).then(|| format!("area {sum} instead of {expected}"))
}

/// Triangulates the polygon embedded in space by `embed`.
#[expect(clippy::cast_precision_loss, reason = "coordinates are whole numbers below 2^24")]
fn cut(polygon: &[[i64; 2]], embed: impl Fn([f32; 2]) -> [f32; 3]) -> (Vec<[usize; 3]>, Cut) {
    let placed: Vec<[f32; 3]> = polygon.iter().map(|corner| embed(corner.map(|x| x as f32))).collect();
    let mut triangles = Vec::new();
    let cut = triangulate(&placed, &mut triangles);
    (triangles, cut)
}

#[track_caller]
fn is_clean(polygon: &[[i64; 2]]) {
    let (triangles, cut) = cut(polygon, |[x, y]| [x, y, 0.0]);
    assert_eq!(flaw(polygon, &triangles), None);
    assert_eq!(cut, Cut::Clean);
}

const ARROW: [[i64; 2]; 4] = [[0, 0], [2, 1], [4, 0], [2, 6]];

#[test]
fn convex_polygons_become_fans() {
    let (triangles, _) = cut(&[[0, 0], [4, 0], [6, 2], [4, 4], [0, 4]], |[x, y]| [x, y, 0.0]);
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
}

#[test]
fn concave_polygons_are_triangulated() {
    is_clean(&ARROW);
    is_clean(&[[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]);
    // A comb.
    is_clean(&[[0, 0], [9, 0], [9, 5], [8, 1], [7, 5], [6, 1], [5, 5], [4, 1], [3, 5], [2, 1], [1, 5]]);
    // A ring with a bridge edge that is traversed twice.
    is_clean(&[[0, 0], [6, 0], [6, 6], [0, 6], [0, 0], [2, 2], [2, 4], [4, 4], [4, 2], [2, 2]]);
    // Two squares that touch at a corner.
    is_clean(&[[0, 0], [2, 0], [2, 2], [4, 2], [4, 4], [2, 4], [2, 2], [0, 2]]);
}

#[test]
fn collinear_corners_give_no_slivers() {
    let square = [[0, 0], [1, 0], [2, 0], [2, 2], [0, 2]];
    let (triangles, _) = cut(&square, |[x, y]| [x, y, 0.0]);
    assert!(triangles.iter().all(|triangle| twice_area(triangle.map(|k| square[k])) > 0), "{triangles:?}");
}

#[test]
fn oracle_detects_invalid_triangulations() {
    assert_eq!(flaw(&ARROW, &[[0, 1, 2], [0, 2, 3]]).as_deref(), Some("triangle 0 is clockwise"));
    assert_eq!(flaw(&ARROW, &[[0, 1, 3]]).as_deref(), Some("1 triangles for 4 corners"));
    assert_eq!(flaw(&ARROW, &[[0, 1, 3], [0, 2, 3]]).as_deref(), Some("area 34 instead of 20"));
}

#[test]
fn quadrilaterals_use_the_inner_diagonal() {
    for (polygon, want) in [
        ([[0, 0], [4, 0], [4, 4], [0, 4]], [[0, 1, 2], [0, 2, 3]]),
        (ARROW, [[0, 1, 3], [1, 2, 3]]),
        ([[2, 1], [4, 0], [2, 6], [0, 0]], [[0, 1, 2], [0, 2, 3]]),
        ([[0, 0], [2, 0], [4, 0], [2, 6]], [[0, 1, 3], [1, 2, 3]]),
        // Self-intersecting.
        ([[0, 0], [4, 0], [0, 3], [4, 4]], [[0, 1, 2], [0, 2, 3]]),
    ] {
        assert_eq!(cut(&polygon, |[x, y]| [x, y, 0.0]), (want.to_vec(), Cut::Clean), "{polygon:?}");
    }
}

#[test]
fn twisted_and_degenerate_polygons_become_fans() {
    let mut triangles = Vec::new();
    assert_eq!(triangulate(&[[0.0; 3], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]], &mut triangles), Cut::Clean);
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    triangles.clear();
    triangulate(&[[1.0; 3]; 7], &mut triangles);
    assert_eq!(triangles.len(), 5);
}

#[test]
fn long_polygons_stay_within_the_work_limit() {
    // A comb of needles, a polygon with only reflex corners along one side, a spiral.
    let n = 2_000_i64;
    let comb = (0..n).map(|k| [2 * (n - k), if k % 2 == 0 { 1 } else { 1000 }]);
    is_clean(&[[0, 0], [2 * n, 0]].into_iter().chain(comb).collect::<Grid>());
    let bay = (-n / 2..=n / 2).rev().map(|x| [x, x * x - n * n]);
    is_clean(
        &[[-n, 2 * n * n], [-n, -2 * n * n], [n, -2 * n * n], [n, 2 * n * n]].into_iter().chain(bay).collect::<Grid>(),
    );
    let arm = |k: i64, radius: i64| match k % 4 {
        0 => [radius, 0],
        1 => [0, radius],
        2 => [-radius, 0],
        _ => [0, -radius],
    };
    let outwards = (8..n).rev().map(|k| arm(k, 4 * k));
    let inwards = (8..n).map(|k| arm(k, 4 * k + 8));
    let spiral: Grid = inwards.chain(outwards).collect();
    is_clean(&spiral);
}

#[test]
fn complex_polygons_take_linear_time() {
    // Interleaved needles from both sides: every ear spans all corners.
    let n = 40_000_i64;
    let left = (0..n).map(|k| [if k % 2 == 0 { 0 } else { n }, 2 * k]);
    let right = (0..n).rev().map(|k| [if k % 2 == 0 { 1 } else { n + 1 }, 2 * k]);
    let zigzag: Grid = left.chain(right).collect();
    let (triangles, _) = cut(&zigzag, |[x, y]| [x, y, 0.0]);
    assert_eq!(triangles.len(), zigzag.len() - 2);
}

/// A simple polygon with corners sorted by angle around the origin; usually concave.
fn star() -> impl Strategy<Value = Grid> {
    prop::collection::vec([-40_i64..=40, -40_i64..=40], 4..60).prop_filter_map("around the origin", |mut corners| {
        corners.retain(|&corner| corner != [0, 0]);
        let half = |[x, y]: [i64; 2]| y < 0 || (y == 0 && x < 0);
        let cross = |a: [i64; 2], b: [i64; 2]| a[0] * b[1] - a[1] * b[0];
        corners.sort_by(|&a, &b| half(a).cmp(&half(b)).then(0.cmp(&cross(a, b))));
        corners.dedup_by(|b, a| half(*a) == half(*b) && cross(*a, *b) == 0);
        let around = (0..corners.len()).all(|k| cross(corners[k], corners[(k + 1) % corners.len()]) > 0);
        (corners.len() >= 4 && around).then_some(corners)
    })
}

proptest! {
    #[test]
    fn simple_polygons_are_triangulated(polygon in star(), first in 0_usize..60) {
        let mut polygon = polygon;
        let n = polygon.len();
        polygon.rotate_left(first % n);
        let (triangles, cut) = cut(&polygon, |[x, y]| [x, y, 0.0]);
        prop_assert_eq!(flaw(&polygon, &triangles), None);
        prop_assert_eq!(cut, Cut::Clean);
    }

    #[test]
    fn rings_with_a_bridge_are_triangulated(hole in star(), first in 0_usize..70) {
        // The bridge starts at the hole's corner farthest along the diagonal, so it intersects nothing.
        let mut hole = hole;
        let bridge = (0..hole.len()).max_by_key(|&k| hole[k][0] + hole[k][1]).unwrap();
        hole.rotate_left(bridge);
        let mut ring = vec![[50, 50], [-50, 50], [-50, -50], [50, -50], [50, 50], hole[0]];
        ring.extend(hole.iter().rev());
        let n = ring.len();
        ring.rotate_left(first % n);
        let (triangles, cut) = cut(&ring, |[x, y]| [x, y, 0.0]);
        prop_assert_eq!(flaw(&ring, &triangles), None);
        prop_assert_eq!(cut, Cut::Clean);
    }

    #[test]
    fn repeated_corners_are_supported(polygon in star(), repeated in prop::collection::vec(0_usize..60, 1..5)) {
        let mut polygon = polygon;
        for k in repeated {
            let k = k % polygon.len();
            polygon.insert(k, polygon[k]);
        }
        let (triangles, cut) = cut(&polygon, |[x, y]| [x, y, 0.0]);
        prop_assert_eq!(flaw(&polygon, &triangles), None);
        prop_assert_eq!(cut, Cut::Clean);
    }

    #[test]
    fn result_is_invariant_under_translation_and_scaling(polygon in star()) {
        let (flat, _) = cut(&polygon, |[x, y]| [x, y, 0.0]);
        // Exact in `f32`: integers below 2^24, powers of two.
        prop_assert_eq!(&cut(&polygon, |[x, y]| [x + 1e7, y - 1e7, x - y]).0, &flat);
        prop_assert_eq!(&cut(&polygon, |[x, y]| [x, y, 0.0].map(|v| v * 2_f32.powi(100))).0, &flat);
        prop_assert_eq!(&cut(&polygon, |[x, y]| [x, y, 0.0].map(|v| v * 2_f32.powi(-140))).0, &flat);
    }

    #[test]
    fn any_input_gives_n_minus_2_triangles(polygon in prop::collection::vec(prop::array::uniform3(any::<u32>()), 3..40)) {
        let corners: Vec<[f32; 3]> = polygon.iter().map(|corner| corner.map(f32::from_bits)).collect();
        let mut triangles = Vec::new();
        triangulate(&corners, &mut triangles);
        prop_assert_eq!(triangles.len(), corners.len() - 2);
        prop_assert!(triangles.iter().flatten().all(|&k| k < corners.len()));
    }
}
