//! The smallest box of a set of points: the reference for fits and merges.
//!
//! For every direction of an edge, the smallest rectangle around the projected points is exact. Directions lie on a
//! spiral over the half sphere, along the edges of the triangles and across every two of these, because two adjacent
//! sides of the box of least volume each contain an edge (O'Rourke 1985). Two different spirals are searched; the
//! difference of their results shows the error.

use std::cmp::Ordering;

use canted_fixtures::SplitMix64;
use canted_obb::{Frame, Obb, Quaternion, bound};
use canted_tests::clouds::random_rotation;
use canted_tests::vector::{Vector, cross, dot, length, sub};

use super::rectangle::{extent, turns};

/// Directions on half a sphere, each about 5.2 degrees from the next.
const N_DIRECTIONS: u32 = 750;

/// Number of refined candidates.
const N_IMPROVED: usize = 4;

/// Cosine of the minimum angle between two of them, 15 degrees: three neighbors on the spiral.
const MIN_SEPARATION_COS: f64 = 0.966;

/// First and last step of the refinement.
const STEPS_RAD: [f64; 2] = [0.05, 1e-7];
const SHRINK: f64 = 0.8;
const GAIN: f64 = 1e-9;

/// The smallest box by one measure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Least {
    pub(super) size: f64,
    /// Ratio of the two spirals' results, at least 1: an estimate of the search's error.
    pub(super) gap: f64,
}

/// Smallest area and smallest volume around `points`, three per triangle, including the `known` boxes.
pub(super) fn least(points: &[[f32; 3]], known: &[Obb], seed: u64) -> [Least; 2] {
    let mut exact: Vec<Vector> = points.iter().map(|p| p.map(f64::from)).collect();
    exact.sort_by(in_order);
    exact.dedup();
    let mut rng = SplitMix64::new(seed);
    let of_edges = of_edges(points);
    let spirals = [0; 2].map(|_: u8| searched(&exact, &of_edges, random_rotation(&mut rng).columns()));
    [(0, Obb::area as fn(&Obb) -> f64), (1, Obb::volume)].map(|(k, size)| {
        // Measured like all other boxes, including outward rounding.
        let [a, b] = spirals.map(|frames| size(&bound(frames[k], points.iter().copied())));
        Least { size: known.iter().map(size).fold(a.min(b), f64::min), gap: a.max(b) / a.min(b) }
    })
}

/// A box by the directions of two of its edges, and its size.
#[derive(Clone, Copy)]
struct Found {
    size: f64,
    edges: [Vector; 2],
}

impl Found {
    fn lesser(self, other: Self) -> Self {
        if other.size < self.size { other } else { self }
    }

    fn frame(&self) -> Frame {
        let [a, b] = self.edges;
        Quaternion::from_columns([a, b, cross(a, b)]).frame()
    }
}

/// Unit vectors along the triangles' edges, and across every two of them.
fn of_edges(points: &[[f32; 3]]) -> Vec<Vector> {
    let sides = |corners: &[[f32; 3]]| {
        let [a, b, c] = [0, 1, 2].map(|i| corners[i].map(f64::from));
        [sub(b, a), sub(c, b), sub(a, c)]
    };
    let mut edges: Vec<Vector> = points.chunks_exact(3).flat_map(sides).filter_map(unit).collect();
    // Neighbors share an edge, in opposite directions.
    for edge in &mut edges {
        *edge = edge.map(|x| x * edge.iter().copied().find(|&x| x != 0.0).unwrap_or(1.0).signum());
    }
    edges.sort_by(in_order);
    edges.dedup();
    let across = edges.iter().enumerate().flat_map(|(i, &a)| edges[..i].iter().filter_map(move |&b| unit(cross(a, b))));
    across.chain(edges.iter().copied()).collect()
}

fn in_order(a: &Vector, b: &Vector) -> Ordering {
    a.partial_cmp(b).unwrap_or(Ordering::Equal)
}

/// Frames of the boxes of least area and least volume, over a spiral rotated by `columns` and over `others`.
fn searched(points: &[Vector], others: &[Vector], columns: [Vector; 3]) -> [Frame; 2] {
    let spiral = (0..N_DIRECTIONS).map(|i| {
        // The golden angle, with equal areas between successive heights.
        let height = (f64::from(i) + 0.5) / f64::from(N_DIRECTIONS);
        let (sine, cosine) = (f64::from(i) * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        let on_spiral = [radius * cosine, radius * sine, height];
        std::array::from_fn(|k| (0..3).map(|a| columns[a][k] * on_spiral[a]).sum())
    });
    let tried: Vec<[Found; 2]> =
        spiral.chain(others.iter().copied()).map(|direction| along(direction, points)).collect();
    [0, 1].map(|k| {
        let mut tried: Vec<Found> = tried.iter().map(|found| found[k]).collect();
        tried.sort_by(|a, b| a.size.total_cmp(&b.size));
        let mut starts: Vec<Found> = vec![];
        for found in tried {
            let is_apart = |start: &Found| dot(start.edges[0], found.edges[0]).abs() < MIN_SEPARATION_COS;
            if starts.len() < N_IMPROVED && starts.iter().all(is_apart) {
                starts.push(found);
            }
        }
        let ends = starts.iter().map(|&start| improved(start, &|direction| along(direction, points)[k]));
        ends.fold(starts[0], Found::lesser).frame()
    })
}

/// The boxes of least area and least volume that have an edge along a unit vector.
fn along(direction: Vector, points: &[Vector]) -> [Found; 2] {
    let [u, v] = across(direction);
    let height = extent(points.iter().map(|&p| dot(p, direction)));
    let seen = points.iter().map(|&p| [dot(p, u), dot(p, v)]).collect();
    let mut least = [Found { size: f64::INFINITY, edges: [direction, u] }; 2];
    for ([c, s], [w, l]) in turns(seen) {
        let edges = [direction, std::array::from_fn(|k| c * u[k] + s * v[k])];
        let sizes = [2.0 * (w * l + height * (w + l)), w * l * height];
        least = std::array::from_fn(|k| least[k].lesser(Found { size: sizes[k], edges }));
    }
    least
}

/// The local minimum from `start`: tries every edge as the first direction, then nearby directions.
fn improved(start: Found, of: &impl Fn(Vector) -> Found) -> Found {
    let mut best = start;
    let [mut step, last] = STEPS_RAD;
    let mut phase = 0.0;
    while step > last {
        // Valleys are narrow: eight fixed directions would stop on their sides.
        phase += 1.0;
        let [a, b] = best.edges;
        let third = cross(a, b);
        let nearby = (0..8).map(|i| {
            let (sine, cosine) = (f64::from(i) * std::f64::consts::FRAC_PI_4 + phase).sin_cos();
            std::array::from_fn(|k| a[k] + step * (cosine * b[k] + sine * third[k]))
        });
        // Normalized each time, so that the search does not exploit a shrinking vector.
        let next = [b, third].into_iter().chain(nearby).filter_map(unit).map(of).fold(best, Found::lesser);
        if next.size < best.size * (1.0 - GAIN) {
            best = next;
        } else {
            step *= SHRINK;
        }
    }
    best
}

/// Two unit vectors across a third.
fn across(direction: Vector) -> [Vector; 2] {
    let least = (0..3).min_by(|&i, &k| direction[i].abs().total_cmp(&direction[k].abs())).unwrap_or(0);
    let other = std::array::from_fn(|k| if k == least { 1.0 } else { 0.0 });
    let u = unit(cross(direction, other)).unwrap_or(other);
    [u, cross(direction, u)]
}

/// `None` for a vector of zero length.
fn unit(v: Vector) -> Option<Vector> {
    let length = length(v);
    (length > 0.0).then(|| v.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use canted_tests::clouds::placed;

    use super::*;

    fn sign(i: usize, k: usize) -> f64 {
        if i >> k & 1 == 1 { 1.0 } else { -1.0 }
    }

    /// Corners are rounded to 2^-24 of at most 4, and boxes outwards by as much again.
    const BOUND: f64 = 1e-5;

    #[test]
    fn boxes_and_a_tetrahedron_are_found() {
        let mut rng = SplitMix64::new(8);
        for seed in 0..5 {
            let turn = random_rotation(&mut rng);
            let at = |half, x| placed(&turn, half, [0.0; 3], x);
            let corners: Vec<[f32; 3]> = (0..8).map(|i| at([3.0, 1.0, 0.5], [0, 1, 2].map(|k| sign(i, k)))).collect();
            let found = least(&corners, &[], seed);
            // 8·(3·1 + 3·0.5 + 1·0.5) and 8·3·1·0.5.
            for (least, exact) in found.iter().zip([40.0, 12.0]) {
                assert!((least.size / exact - 1.0).abs() < BOUND && least.gap < 1.0 + BOUND, "{found:?}");
            }
            // The box of a regular tetrahedron is a cube; the tetrahedron has every second corner of it.
            let faces = [[0, 3, 5], [0, 3, 6], [0, 5, 6], [3, 5, 6]].concat();
            let tetrahedron: Vec<[f32; 3]> =
                faces.into_iter().map(|i| at([1.0; 3], [0, 1, 2].map(|k| sign(i, k)))).collect();
            let found = least(&tetrahedron, &[], seed);
            for (least, exact) in found.iter().zip([24.0, 8.0]) {
                assert!((least.size / exact - 1.0).abs() < BOUND, "{found:?}");
            }
        }
    }

    #[test]
    fn no_random_frame_is_smaller() {
        let mut rng = SplitMix64::new(9);
        for seed in 0..3 {
            let points: Vec<[f32; 3]> =
                (0..20).map(|_| placed(&random_rotation(&mut rng), [1.0, 0.5, 0.1], [0.0; 3], [1.0; 3])).collect();
            let found = least(&points, &[], seed);
            for _ in 0..20_000 {
                let tried = bound(random_rotation(&mut rng).frame(), points.iter().copied());
                assert!(tried.area() > found[0].size * (1.0 - BOUND), "{} {found:?}", tried.area());
                assert!(tried.volume() > found[1].size * (1.0 - BOUND), "{} {found:?}", tried.volume());
            }
        }
    }

    #[test]
    fn a_smaller_known_box_wins_and_keeps_the_gap() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let found = least(&points, &[], 1)[0];
        let known = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.1; 3] };
        let nearby = least(&points, &[known], 1)[0];
        assert!(nearby.size == known.area() && nearby.gap == found.gap && nearby.gap >= 1.0, "{nearby:?}");
    }

    #[test]
    fn points_on_a_line_and_single_points_have_boxes() {
        let line: Vec<[f32; 3]> = (0..5_u8).map(|i| [f32::from(i), 2.0 * f32::from(i), 0.0]).collect();
        for points in [&line[..], &line[..1]] {
            let found = least(points, &[], 3);
            assert!(found.iter().all(|least| least.size >= 0.0 && least.size < BOUND), "{found:?}");
        }
    }
}
