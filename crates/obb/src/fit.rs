//! Boxes of points and triangles. Each method proposes a frame; the box along it is then exact.

use crate::{
    Aabb, Dop, Moments, Obb, bound,
    eigen::FULL_PRECISION,
    frame::{Frame, IDENTITY, orthonormal},
    vector::{self, Vector, cross, dot, sub},
};

/// How [`fit`] chooses the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Fit {
    /// Axis-aligned.
    Aabb,
    /// Principal axes of the points, equally weighted (Gottschalk 2000, as in Sabino 2020, 3.1.3).
    ///
    /// Depends on the tessellation; needs no triangles.
    Pca,
    /// Principal axes of the surface (Gottschalk et al. 1996, with the authors' errata): the same box for
    /// any tessellation. Without triangles, or where their total area is zero, as [`Fit::Pca`].
    #[default]
    AreaPca,
    /// DiTO-14: edges of a large ditetrahedron of extremal points (Larsson and Källberg 2011); needs no triangles.
    Dito,
    /// The best of sixteen fixed frames, by extents along twenty-five directions; needs no triangles.
    Dop,
}

/// Why [`fit`] failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitError {
    /// There are no points.
    Empty,
    /// A point has a coordinate that is not a finite number.
    NotFinite {
        /// Index of the first such point.
        index: usize,
    },
    /// A triangle index is out of range.
    IndexOutOfRange {
        /// Index of the first such triangle.
        triangle: usize,
        /// The index.
        index: u32,
        /// Number of points.
        n_points: usize,
    },
}

impl core::fmt::Display for FitError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => write!(f, "no points to fit a box to"),
            Self::NotFinite { index } => write!(f, "point {index} is not finite"),
            Self::IndexOutOfRange { triangle, index, n_points } => {
                write!(f, "triangle {triangle} has index {index}, but there are {n_points} points")
            }
        }
    }
}

impl core::error::Error for FitError {}

/// Fits a box to `points`, with axes chosen by `method`.
///
/// The box contains *every* point exactly, also points that no triangle uses. `triangles` may be empty; only
/// [`Fit::AreaPca`] uses them. The axis-aligned box is returned where it has no more area. Scaling the points by a power
/// of two scales the box bit for bit, unless it leaves the range of `f32`.
///
/// # Errors
/// [`FitError::Empty`], [`FitError::NotFinite`] for the first bad point, [`FitError::IndexOutOfRange`] for the first
/// bad triangle.
pub fn fit(points: &[[f32; 3]], triangles: &[[u32; 3]], method: Fit) -> Result<Obb, FitError> {
    check(points, triangles)?;
    let aabb = Aabb::from_points(each(points));
    let frame: Frame = match method {
        Fit::Aabb => return Ok(Obb::from_aabb(&aabb)),
        Fit::Pca => principal_axes(points),
        Fit::AreaPca => surface_axes(points, triangles),
        Fit::Dito => ditetrahedron_frame(points),
        Fit::Dop => fixed_frame(points),
    };
    Ok(bound(frame, each(points)).or_aabb(&aabb))
}

/// Every point, once. All passes of [`fit`] over the points are made with it, so that a test can count them.
fn each(points: &[[f32; 3]]) -> impl Iterator<Item = [f32; 3]> + Clone + '_ {
    points.iter().inspect(|_| count_visit()).copied()
}

#[cfg(not(test))]
#[inline(always)]
fn count_visit() {}

#[cfg(test)]
use tests::count_visit;

/// Principal axes of the points, longest first.
fn principal_axes(points: &[[f32; 3]]) -> Frame {
    Moments::from_points(each(points)).axes(FULL_PRECISION)
}

/// Principal axes of the surface, longest first; of the points where it has no area.
fn surface_axes(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Frame {
    let surface = triangles.iter().fold(Moments::EMPTY, |moments, corners| {
        moments.merged(&Moments::from_triangle(corners.map(|index| points[index as usize])))
    });
    if surface.weight > 0.0 { surface.axes(FULL_PRECISION) } else { principal_axes(points) }
}

/// The best of the fixed frames, by extents relative to the first point, for precision far from the origin.
fn fixed_frame(points: &[[f32; 3]]) -> Frame {
    let [x, y, z] = points[0];
    Dop::from_points(each(points).map(|p| [p[0] - x, p[1] - y, p[2] - z])).best().0
}

fn check(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<(), FitError> {
    if points.is_empty() {
        return Err(FitError::Empty);
    }
    if let Some(index) = each(points).position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(FitError::NotFinite { index });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&index| index as usize >= points.len()) {
            return Err(FitError::IndexOutOfRange { triangle, index, n_points: points.len() });
        }
    }
    Ok(())
}

/// The coordinate axes and the body diagonals: seven directions, fourteen extremal points.
const DIRECTIONS: [Vector; 7] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];

/// A point closer to a line or plane than this fraction of the base edge counts as on it: rounding a flat set to `f32`
/// moves points by up to two units in the last place on each of three coordinates.
const FLAT: f64 = 6.0 * f32::EPSILON as f64;

/// A frame along an edge and a normal of a large ditetrahedron (Larsson and Källberg 2011, DiTO-14).
///
/// The base edge is the longest span between opposite extremal points. The extremal point farthest from it completes the
/// base triangle, and the points farthest from that on both sides complete two tetrahedra. Each edge of their seven
/// triangles, with the triangle's normal, is a candidate frame; the least area of the box of the extremal points wins. A
/// point set without extent in some dimension skips the steps that need it, as in the paper. Unlike in the paper, the
/// apexes count as extremal points.
fn ditetrahedron_frame(points: &[[f32; 3]]) -> Frame {
    // Relative to the first point, for precision far from the origin.
    let origin = vector::to_f64(points[0]);
    let points = || each(points).map(|p| sub(vector::to_f64(p), origin));
    let spans = DIRECTIONS.map(|direction| extremes(points(), direction));
    let [p, q] = spans.into_iter().fold(spans[0], |longest, span| {
        if square(sub(span[1], span[0])) > square(sub(longest[1], longest[0])) { span } else { longest }
    });
    let base = sub(q, p);
    let length = vector::length(base);
    if length == 0.0 {
        return IDENTITY;
    }
    let from_line = |r: Vector| vector::length(cross(base, sub(r, p))) / length;
    let corners = spans.as_flattened();
    let r = corners.iter().fold(p, |far, &corner| if from_line(corner) > from_line(far) { corner } else { far });
    if from_line(r) <= FLAT * length {
        return orthonormal(base, [0.0; 3]);
    }
    let normal = cross(base, sub(r, p));
    let apexes = extremes(points(), normal);
    let measured = core::array::from_fn(|i| if i < corners.len() { corners[i] } else { apexes[i - corners.len()] });
    let mut search = Search { measured, best: (f64::INFINITY, IDENTITY) };
    search.add_triangle(p, q, r);
    for apex in apexes {
        if dot(sub(apex, p), normal).abs() > FLAT * length * vector::length(normal) {
            search.add_triangle(p, q, apex);
            search.add_triangle(q, r, apex);
            search.add_triangle(r, p, apex);
        }
    }
    search.best.1
}

/// The candidate of least area so far.
struct Search {
    measured: [Vector; 2 * DIRECTIONS.len() + 2],
    best: (f64, Frame),
}

impl Search {
    /// Tries the frames of each edge with the normal.
    fn add_triangle(&mut self, a: Vector, b: Vector, c: Vector) {
        let normal = cross(sub(b, a), sub(c, a));
        for edge in [sub(b, a), sub(c, b), sub(a, c)] {
            let frame = orthonormal(edge, normal);
            let [x, y, z] = frame.map(|axis| {
                let axis = vector::to_f64(axis);
                let [low, high] = extremes(self.measured.into_iter(), axis);
                dot(sub(high, low), axis)
            });
            let area = x * y + y * z + z * x;
            if area < self.best.0 {
                self.best = (area, frame);
            }
        }
    }
}

/// The points lowest and highest along a direction, the first of equals.
fn extremes(points: impl Iterator<Item = Vector>, direction: Vector) -> [Vector; 2] {
    let mut low = (f64::INFINITY, [0.0; 3]);
    let mut high = (f64::NEG_INFINITY, [0.0; 3]);
    for point in points {
        let height = dot(point, direction);
        if height < low.0 {
            low = (height, point);
        }
        if height > high.0 {
            high = (height, point);
        }
    }
    [low.1, high.1]
}

fn square(v: Vector) -> f64 {
    dot(v, v)
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    std::thread_local! {
        static N_VISITS: Cell<usize> = const { Cell::new(0) };
    }

    pub(super) fn count_visit() {
        N_VISITS.set(N_VISITS.get() + 1);
    }

    /// Visits of points while a box is fitted to `n` points of a flattened, rotated cloud.
    fn visits(n: usize, method: Fit) -> usize {
        let point = |i: usize| {
            // Additive recurrence with the plastic number: no two points are equal.
            let [a, b, c] = [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|step: f64| (step * i as f64).fract() - 0.5);
            [(a + 0.5 * b) as f32, (0.3 * b - 0.2 * a) as f32, (0.1 * c + 0.4 * a) as f32]
        };
        let points: std::vec::Vec<[f32; 3]> = (0..n).map(point).collect();
        N_VISITS.set(0);
        fit(&points, &[], method).expect("the points are finite");
        N_VISITS.get()
    }

    /// Each method looks at every point the same number of times, however many there are: the time is linear.
    #[test]
    fn the_number_of_passes_does_not_depend_on_the_number_of_points() {
        for method in [Fit::Aabb, Fit::Pca, Fit::AreaPca, Fit::Dito, Fit::Dop] {
            let passes = visits(1_000, method) / 1_000;
            assert!((1..=16).contains(&passes), "{method:?}: {passes}");
            for n in [1_000, 10_000, 100_000, 1_000_000] {
                assert_eq!(visits(n, method), passes * n, "{method:?} of {n}");
            }
        }
    }
}
