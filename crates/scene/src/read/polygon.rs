//! Triangulates polygons: a fan for convex polygons, ear clipping for others.
//!
//! Source: Meisters 1975 (every simple polygon has two ears); the normal is Newell's (Sutherland, Sproull and Schumacker
//! 1974). Non-planar polygons are projected along the largest component of that normal.

use std::collections::VecDeque;

use canted_obb::vector::{sub, to_f64};

/// Work limit per corner, in ear tests and point tests. Beyond it the remaining polygon is clipped without tests, so that
/// the time stays linear. Polygons in which every ear spans all corners reach the limit at about 4000 corners.
const STEPS_PER_CORNER: usize = 2048;

/// Quality of a triangulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// The triangles cover the polygon once.
    Clean,
    /// The polygon intersects itself or exceeds the work limit; triangles may overlap.
    Overlapping,
}

/// Appends the `n - 2` triangles of a polygon with `n >= 3` corners, as corner numbers with the polygon's orientation.
///
/// The result depends only on the corner positions. Polygons with a non-finite corner become fans, and so do quadrilaterals
/// whose projection intersects itself: they are folded in space, where either diagonal is valid. Time is about linear in `n`
/// for few reflex corners, and always bounded by a constant per corner.
pub(crate) fn triangulate(polygon: &[[f32; 3]], triangles: &mut Vec<[usize; 3]>) -> Cut {
    let points = if polygon.len() > 3 { project(polygon) } else { None };
    match points.as_deref() {
        Some(&[a, b, c, d]) if !fan_is_clean(&[a, b, c, d]) && orient2d(d, a, b) > 0.0 && orient2d(b, c, d) > 0.0 => {
            triangles.extend([[0, 1, 3], [1, 2, 3]]);
        }
        Some(points) if points.len() > 4 && !fan_is_clean(points) => return clip_ears(points, triangles),
        _ => triangles.extend((2..polygon.len()).map(|k| [0, k - 1, k])),
    }
    Cut::Clean
}

/// Projects the polygon along the largest component of its normal, counter-clockwise.
///
/// `None` if it has no normal: a corner is not finite, or the area is zero.
fn project(polygon: &[[f32; 3]]) -> Option<Vec<[f64; 2]>> {
    // Relative to the first corner, for precision far from the origin.
    let origin = to_f64(polygon[0]);
    let relative = |corner: [f32; 3]| sub(to_f64(corner), origin);
    let mut normal = [0.0_f64; 3];
    let mut before = relative(polygon[polygon.len() - 1]);
    for &corner in polygon {
        let corner = relative(corner);
        for (k, component) in normal.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            *component += (before[i] - corner[i]) * (before[j] + corner[j]);
        }
        before = corner;
    }
    let axis = (0..3).reduce(|a, b| if normal[b].abs() > normal[a].abs() { b } else { a })?;
    // Sums of `f32` differences do not overflow `f64`, so only non-finite corners fail here.
    if normal[axis] == 0.0 || !normal.iter().all(|x| x.is_finite()) {
        return None;
    }
    let (mut i, mut j) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        (i, j) = (j, i);
    }
    Some(polygon.iter().map(|&corner| relative(corner)).map(|corner| [corner[i], corner[j]]).collect())
}

/// Twice the signed area of a triangle; positive if counter-clockwise.
fn orient2d(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether the polygon is convex and every triangle of its fan has positive area.
fn fan_is_clean(points: &[[f64; 2]]) -> bool {
    let n = points.len();
    (2..n).all(|k| orient2d(points[0], points[k - 1], points[k]) > 0.0)
        && (0..n).all(|k| orient2d(points[k], points[(k + 1) % n], points[(k + 2) % n]) >= 0.0)
}

/// Condition for clipping an ear. It is relaxed after a pass over all corners that clips none.
#[derive(Clone, Copy, PartialEq)]
enum EarTest {
    /// Convex with no other corner in the closed triangle, or folded.
    Strict,
    /// Convex with no other corner in the open triangle, or folded.
    Interior,
    /// Collinear: only slivers are left.
    Collinear,
    /// Always: no ear is left.
    Any,
}

impl EarTest {
    fn relaxed(self) -> Self {
        match self {
            Self::Strict => Self::Interior,
            Self::Interior => Self::Collinear,
            Self::Collinear | Self::Any => Self::Any,
        }
    }
}

fn clip_ears(points: &[[f64; 2]], triangles: &mut Vec<[usize; 3]>) -> Cut {
    let n = points.len();
    let mut next: Vec<usize> = (1..n).chain([0]).collect();
    let mut prev: Vec<usize> = [n - 1].into_iter().chain(0..n - 1).collect();
    let mut reflex = ReflexCorners::of(points);
    let mut queue = Queue { waiting: (0..n).collect(), n_entries: vec![1; n] };
    let (mut cut, mut test, mut has_clipped) = (Cut::Clean, EarTest::Strict, false);
    let (mut left, mut remaining) = (n, 0);
    while left > 3 {
        let Some(corner) = queue.pop() else {
            test = if has_clipped { EarTest::Strict } else { test.relaxed() };
            has_clipped = false;
            for _ in 0..left {
                queue.push(remaining);
                remaining = next[remaining];
            }
            continue;
        };
        if reflex.n_steps_left == 0 {
            test = EarTest::Any;
        }
        let (before, after) = (prev[corner], next[corner]);
        let around = [prev[before], before, corner, after, next[after]];
        if !is_ear(around, points, &mut reflex, test) {
            continue;
        }
        triangles.push([before, corner, after]);
        (next[before], prev[after]) = (after, before);
        (left, remaining, has_clipped) = (left - 1, after, true);
        reflex.is_cut_off[corner] = true;
        // The neighbors have changed. Moving them to the back avoids fans of needles in round concave regions.
        queue.push(before);
        queue.push(after);
        if test == EarTest::Any {
            (cut, test) = (Cut::Overlapping, EarTest::Strict);
        }
    }
    triangles.push([prev[remaining], remaining, next[remaining]]);
    cut
}

/// Corners to test in order; only the last entry of a corner is used.
struct Queue {
    waiting: VecDeque<usize>,
    n_entries: Vec<usize>,
}

impl Queue {
    fn push(&mut self, corner: usize) {
        self.waiting.push_back(corner);
        self.n_entries[corner] += 1;
    }

    fn pop(&mut self) -> Option<usize> {
        loop {
            let corner = self.waiting.pop_front()?;
            self.n_entries[corner] -= 1;
            if self.n_entries[corner] == 0 {
                return Some(corner);
            }
        }
    }
}

/// Whether the third of five consecutive corners may be clipped.
fn is_ear(around: [usize; 5], points: &[[f64; 2]], reflex: &mut ReflexCorners, test: EarTest) -> bool {
    reflex.n_steps_left = reflex.n_steps_left.saturating_sub(1);
    let [_, before, corner, after, _] = around;
    let [a, b, c] = [before, corner, after].map(|k| points[k]);
    let area = orient2d(a, b, c);
    match test {
        EarTest::Strict | EarTest::Interior => {
            // A repeated corner, or the end of an edge traversed in both directions, encloses no area.
            let is_folded = a == b || b == c || c == a;
            let is_convex = area > 0.0 && is_locally_inside(around.map(|k| points[k]));
            is_folded || is_convex && reflex.are_outside([before, corner, after], test)
        }
        EarTest::Collinear => area == 0.0,
        EarTest::Any => true,
    }
}

/// Whether the diagonal from the second to the fourth of five consecutive corners starts and ends inside the polygon.
///
/// Corners at equal positions do not block an ear, so polygons that touch themselves need this test.
fn is_locally_inside([p, a, b, c, q]: [[f64; 2]; 5]) -> bool {
    (orient2d(p, a, b) <= 0.0 || orient2d(p, a, c) >= 0.0) && (orient2d(b, c, q) <= 0.0 || orient2d(a, c, q) >= 0.0)
}

/// Corners that may lie inside an ear: those that are not strictly convex, sorted by x.
struct ReflexCorners<'a> {
    points: &'a [[f64; 2]],
    sorted: Vec<usize>,
    is_cut_off: Vec<bool>,
    n_steps_left: usize,
}

impl<'a> ReflexCorners<'a> {
    fn of(points: &'a [[f64; 2]]) -> Self {
        let n = points.len();
        let does_not_turn_left = |&k: &usize| orient2d(points[(k + n - 1) % n], points[k], points[(k + 1) % n]) <= 0.0;
        let mut sorted: Vec<usize> = (0..n).filter(does_not_turn_left).collect();
        sorted.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
        Self { points, sorted, is_cut_off: vec![false; n], n_steps_left: STEPS_PER_CORNER * n }
    }

    /// Whether no reflex corner lies inside a counter-clockwise triangle. Points at its corners do not count.
    fn are_outside(&mut self, triangle: [usize; 3], test: EarTest) -> bool {
        let [a, b, c] = triangle.map(|corner| self.points[corner]);
        let (min_x, max_x) = (a[0].min(b[0]).min(c[0]), a[0].max(b[0]).max(c[0]));
        let first = self.sorted.partition_point(|&blocker| self.points[blocker][0] < min_x);
        for &blocker in &self.sorted[first..] {
            let p = self.points[blocker];
            if p[0] > max_x {
                break;
            }
            self.n_steps_left = self.n_steps_left.saturating_sub(1);
            let sides = [orient2d(a, b, p), orient2d(b, c, p), orient2d(c, a, p)];
            let is_inside = match test {
                EarTest::Strict => sides.iter().all(|&side| side >= 0.0),
                _ => sides.iter().all(|&side| side > 0.0),
            };
            if is_inside && !self.is_cut_off[blocker] && p != a && p != b && p != c {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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
        assert_eq!(
            triangulate(&[[0.0; 3], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]], &mut triangles),
            Cut::Clean
        );
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
            &[[-n, 2 * n * n], [-n, -2 * n * n], [n, -2 * n * n], [n, 2 * n * n]]
                .into_iter()
                .chain(bay)
                .collect::<Grid>(),
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
        prop::collection::vec([-40_i64..=40, -40_i64..=40], 4..60).prop_filter_map(
            "around the origin",
            |mut corners| {
                corners.retain(|&corner| corner != [0, 0]);
                let half = |[x, y]: [i64; 2]| y < 0 || (y == 0 && x < 0);
                let cross = |a: [i64; 2], b: [i64; 2]| a[0] * b[1] - a[1] * b[0];
                corners.sort_by(|&a, &b| half(a).cmp(&half(b)).then(0.cmp(&cross(a, b))));
                corners.dedup_by(|b, a| half(*a) == half(*b) && cross(*a, *b) == 0);
                let around = (0..corners.len()).all(|k| cross(corners[k], corners[(k + 1) % corners.len()]) > 0);
                (corners.len() >= 4 && around).then_some(corners)
            },
        )
    }

    proptest! {
        #[test]
        fn simple_polygons_are_triangulated(polygon in star(), first in 0_usize..60) {
            let mut polygon = polygon;
            let n = polygon.len();
            polygon.rotate_left(first % n);
            is_clean(&polygon);
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
            is_clean(&ring);
        }

        #[test]
        fn repeated_corners_are_supported(polygon in star(), repeated in prop::collection::vec(0_usize..60, 1..5)) {
            let mut polygon = polygon;
            for k in repeated {
                let k = k % polygon.len();
                polygon.insert(k, polygon[k]);
            }
            is_clean(&polygon);
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
}
