//! Polygons into triangles: the fan of the first corner where that is convex, ear clipping elsewhere.
//!
//! Source: Meisters 1975 (every simple polygon has two ears); the plane is Newell's (Sutherland, Sproull and
//! Schumacker 1974). Non-planar polygons are cut as their projection along the largest component of that normal.

use std::collections::VecDeque;

/// Steps (corners tried, blockers tested) for each corner of a polygon, after which the rest of it is cut anyhow, so that
/// no file takes for ever. A bay where every ear spans all corners gets there from about 4000 corners on.
const STEPS_PER_CORNER: usize = 2048;

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

/// What a corner must be to be cut off. A round over all corners that cuts none makes the next one ask for less.
#[derive(Clone, Copy, PartialEq)]
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

impl Demand {
    fn relaxed(self) -> Self {
        match self {
            Self::Clear => Self::Touching,
            Self::Touching => Self::Straight,
            Self::Straight | Self::Nothing => Self::Nothing,
        }
    }
}

fn clip_ears(points: &[[f64; 2]], triangles: &mut Vec<[usize; 3]>) -> Cut {
    let n = points.len();
    let mut next: Vec<usize> = (1..n).chain([0]).collect();
    let mut prev: Vec<usize> = [n - 1].into_iter().chain(0..n - 1).collect();
    let mut blockers = Blockers::of(points);
    let mut queue = Queue { waiting: (0..n).collect(), n_entries: vec![1; n] };
    let (mut cut, mut demand, mut has_cut) = (Cut::Clean, Demand::Clear, false);
    let (mut left, mut remaining) = (n, 0);
    while left > 3 {
        let Some(corner) = queue.pop() else {
            demand = if has_cut { Demand::Clear } else { demand.relaxed() };
            has_cut = false;
            for _ in 0..left {
                queue.push(remaining);
                remaining = next[remaining];
            }
            continue;
        };
        if blockers.n_steps_left == 0 {
            demand = Demand::Nothing;
        }
        let (before, after) = (prev[corner], next[corner]);
        let around = [prev[before], before, corner, after, next[after]];
        if !is_ear(around, points, &mut blockers, demand) {
            continue;
        }
        triangles.push([before, corner, after]);
        (next[before], prev[after]) = (after, before);
        (left, remaining, has_cut) = (left - 1, after, true);
        blockers.is_cut_off[corner] = true;
        // The neighbours have changed. That they wait anew keeps a round bay from becoming a fan of needles.
        queue.push(before);
        queue.push(after);
        if demand == Demand::Nothing {
            (cut, demand) = (Cut::Tangled, Demand::Clear);
        }
    }
    triangles.push([prev[remaining], remaining, next[remaining]]);
    cut
}

/// Corners that wait to be tried, in order; of several entries for a corner the last counts.
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

/// Whether the middle one of five corners in a row may be cut off.
fn is_ear(around: [usize; 5], points: &[[f64; 2]], blockers: &mut Blockers, demand: Demand) -> bool {
    blockers.n_steps_left = blockers.n_steps_left.saturating_sub(1);
    let [_, before, corner, after, _] = around;
    let [a, b, c] = [before, corner, after].map(|k| points[k]);
    let area = turn(a, b, c);
    match demand {
        Demand::Clear | Demand::Touching => {
            // A corner said twice, or the end of an edge that is walked there and back, encloses nothing.
            let is_folded = a == b || b == c || c == a;
            let is_convex = area > 0.0 && is_inside_cones(around.map(|k| points[k]));
            is_folded || is_convex && blockers.leave([before, corner, after], demand)
        }
        Demand::Straight => area == 0.0,
        Demand::Nothing => true,
    }
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
    n_steps_left: usize,
}

impl<'a> Blockers<'a> {
    fn of(points: &'a [[f64; 2]]) -> Self {
        let n = points.len();
        let does_not_turn_left = |&k: &usize| turn(points[(k + n - 1) % n], points[k], points[(k + 1) % n]) <= 0.0;
        let mut sorted: Vec<usize> = (0..n).filter(does_not_turn_left).collect();
        sorted.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
        Self { points, sorted, is_cut_off: vec![false; n], n_steps_left: STEPS_PER_CORNER * n }
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
            self.n_steps_left = self.n_steps_left.saturating_sub(1);
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
