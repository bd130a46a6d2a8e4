//! Polygons into triangles: the fan of the first corner where that is convex, ear clipping elsewhere.
//!
//! Source: Meisters 1975 (every simple polygon has two ears); the plane is Newell's (Sutherland, Sproull and
//! Schumacker 1974). Non-planar polygons are cut as their projection along the largest component of that normal.

/// Blocker tests per corner that a polygon may cost before the rest of it is cut anyhow, so that no file takes for ever.
const TESTS_PER_CORNER: usize = 2048;

/// How a polygon could be cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// The triangles cover the polygon once.
    Clean,
    /// The polygon crosses itself or is too intricate: as many triangles, but they may overlap.
    Tangled,
}

/// Appends the `n - 2` triangles of a polygon of `n >= 3` corners, as corner numbers, each turning as the polygon does.
///
/// The order depends on the corners' positions alone. A polygon with a corner that is not finite is cut as its fan, and
/// so is a quadrilateral whose projection crosses itself: in space it is folded, and either diagonal makes a surface.
/// Time is about linear in `n` where few corners are reflex, and bounded by a constant for each corner always.
pub(crate) fn triangulate(polygon: &[[f32; 3]], triangles: &mut Vec<[usize; 3]>) -> Cut {
    let points = if polygon.len() > 3 { project(polygon) } else { None };
    match points.as_deref() {
        Some(&[a, b, c, d]) if !fan_is_clean(&[a, b, c, d]) && turn(d, a, b) > 0.0 && turn(b, c, d) > 0.0 => {
            triangles.extend([[0, 1, 3], [1, 2, 3]]);
        }
        Some(points) if points.len() > 4 && !fan_is_clean(points) => return clip_ears(points, triangles),
        _ => triangles.extend((2..polygon.len()).map(|k| [0, k - 1, k])),
    }
    Cut::Clean
}

/// The polygon along the largest component of its normal, seen from the side where it turns left.
///
/// `None` where it has no normal: corners that are not finite, or no area.
fn project(polygon: &[[f32; 3]]) -> Option<Vec<[f64; 2]>> {
    // Relative to the first corner, a polygon far from the origin keeps its shape.
    let origin = polygon[0].map(f64::from);
    let relative = |corner: [f32; 3]| -> [f64; 3] { std::array::from_fn(|k| f64::from(corner[k]) - origin[k]) };
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
    // Sums of `f32` differences stay far from the ends of `f64`, so only corners that are not finite fail here.
    if normal[axis] == 0.0 || !normal.iter().all(|x| x.is_finite()) {
        return None;
    }
    let (mut i, mut j) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        (i, j) = (j, i);
    }
    Some(polygon.iter().map(|&corner| relative(corner)).map(|corner| [corner[i], corner[j]]).collect())
}

/// Twice the signed area of a triangle; positive where it turns left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether the polygon is convex and every triangle of its fan has area.
fn fan_is_clean(points: &[[f64; 2]]) -> bool {
    let n = points.len();
    (2..n).all(|k| turn(points[0], points[k - 1], points[k]) > 0.0)
        && (0..n).all(|k| turn(points[k], points[(k + 1) % n], points[(k + 2) % n]) >= 0.0)
}

/// What a corner must be to be cut off, from the first round over the remaining corners to the last.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Demand {
    /// Convex, and no other corner in its closed triangle; or folded.
    Clear,
    /// Convex, and no other corner in its open triangle; or folded.
    Touching,
    /// Straight: nothing but slivers are left.
    Straight,
    /// Anything: no ear is left.
    Nothing,
}

fn clip_ears(points: &[[f64; 2]], triangles: &mut Vec<[usize; 3]>) -> Cut {
    let n = points.len();
    let mut next: Vec<usize> = (1..n).chain([0]).collect();
    let mut prev: Vec<usize> = [n - 1].into_iter().chain(0..n - 1).collect();
    let mut blockers = Blockers::of(points);
    let mut cut = Cut::Clean;
    let (mut left, mut misses, mut corner) = (n, 0, 0);
    while left > 3 {
        let (before, after) = (prev[corner], next[corner]);
        let demand = match misses / left {
            _ if blockers.n_tests_left == 0 => Demand::Nothing,
            0 => Demand::Clear,
            1 => Demand::Touching,
            2 => Demand::Straight,
            _ => Demand::Nothing,
        };
        let area = turn(points[before], points[corner], points[after]);
        let is_ear = match demand {
            Demand::Clear | Demand::Touching => {
                let around @ [_, a, b, c, _] = [prev[before], before, corner, after, next[after]].map(|k| points[k]);
                // A corner said twice, or the end of an edge that is walked there and back, encloses nothing.
                let is_folded = a == b || b == c || c == a;
                is_folded || area > 0.0 && is_inside_cones(around) && blockers.leave([before, corner, after], demand)
            }
            Demand::Straight => area == 0.0,
            Demand::Nothing => true,
        };
        if !is_ear {
            misses += 1;
            corner = after;
            continue;
        }
        if demand == Demand::Nothing {
            cut = Cut::Tangled;
        }
        triangles.push([before, corner, after]);
        (next[before], prev[after]) = (after, before);
        blockers.is_cut_off[corner] = true;
        left -= 1;
        misses = 0;
        // Passing over one corner keeps the triangles of a round bay from becoming a fan of needles.
        corner = next[after];
    }
    triangles.push([prev[corner], corner, next[corner]]);
    cut
}

/// Whether the cut from corner 1 to corner 3 of five in a row starts and ends on the inner side of the polygon.
///
/// Other corners at the same place do not block an ear, so a polygon that touches itself needs this test.
fn is_inside_cones([p, a, b, c, q]: [[f64; 2]; 5]) -> bool {
    (turn(p, a, b) <= 0.0 || turn(p, a, c) >= 0.0) && (turn(b, c, q) <= 0.0 || turn(a, c, q) >= 0.0)
}

/// The corners that may lie in another corner's triangle: those that do not turn left, sorted by their first coordinate.
struct Blockers<'a> {
    points: &'a [[f64; 2]],
    sorted: Vec<usize>,
    is_cut_off: Vec<bool>,
    n_tests_left: usize,
}

impl<'a> Blockers<'a> {
    fn of(points: &'a [[f64; 2]]) -> Self {
        let n = points.len();
        let does_not_turn_left = |&k: &usize| turn(points[(k + n - 1) % n], points[k], points[(k + 1) % n]) <= 0.0;
        let mut sorted: Vec<usize> = (0..n).filter(does_not_turn_left).collect();
        sorted.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
        Self { points, sorted, is_cut_off: vec![false; n], n_tests_left: TESTS_PER_CORNER * n }
    }

    /// Whether all blockers stay out of a triangle that turns left. Those at its corners do not count.
    fn leave(&mut self, triangle: [usize; 3], demand: Demand) -> bool {
        let [a, b, c] = triangle.map(|corner| self.points[corner]);
        let (least, most) = (a[0].min(b[0]).min(c[0]), a[0].max(b[0]).max(c[0]));
        let first = self.sorted.partition_point(|&blocker| self.points[blocker][0] < least);
        for &blocker in &self.sorted[first..] {
            let p = self.points[blocker];
            if p[0] > most {
                break;
            }
            self.n_tests_left = self.n_tests_left.saturating_sub(1);
            let sides = [turn(a, b, p), turn(b, c, p), turn(c, a, p)];
            let is_inside = match demand {
                Demand::Clear => sides.iter().all(|&side| side >= 0.0),
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
mod tests;
