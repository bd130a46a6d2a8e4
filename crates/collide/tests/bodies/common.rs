//! Inputs, and exact answers.

use canted_collide::{Pose, PrimitivePair, pairs};
use canted_obb::{Affine, PrimId};
use canted_wide::{Config, Preset, TriangleBvh};
use num_bigint::BigInt;

pub(crate) type Triangle = [[f32; 3]; 3];

/// Uniform numbers from 0 to 1 (Steele, Lea and Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    pub(crate) fn point(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| self.next())
    }

    /// A point within `size` of `center` in each coordinate.
    pub(crate) fn near(&mut self, center: [f32; 3], size: f32) -> [f32; 3] {
        center.map(|x| x + size * (2.0 * self.next() - 1.0))
    }
}

/// Small triangles in a unit cube.
pub(crate) fn soup(n: usize, size: f32, seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed);
    let triangle = |random: &mut Random| {
        let center = random.point();
        std::array::from_fn(|_| random.near(center, size))
    };
    (0..n).map(|_| triangle(&mut random)).collect()
}

/// Long diagonal triangles, a five-hundredth as wide as long, and every tenth of no width.
pub(crate) fn needles(n: usize, seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed);
    let needle = |random: &mut Random, i: usize| {
        let [start, end] = [random.point(), random.point()];
        let third = if i.is_multiple_of(10) { start } else { random.near(start, 2e-3) };
        [start, end, third]
    };
    (0..n).map(|i| needle(&mut random, i)).collect()
}

/// A square grid in the plane z = 0 with corners at integers: neighbors share edges and vertices.
pub(crate) fn grid(n: u16, shift: [f32; 3]) -> Vec<Triangle> {
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| [f32::from(x), f32::from(y)]));
    let corner = |[x, y]: [f32; 2], dx: f32, dy: f32| [x + dx + shift[0], y + dy + shift[1], shift[2]];
    cells
        .flat_map(|at| {
            let [a, b, c, d] = [corner(at, 0.0, 0.0), corner(at, 1.0, 0.0), corner(at, 1.0, 1.0), corner(at, 0.0, 1.0)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

pub(crate) fn mapped(triangles: &[Triangle], map: impl Fn([f32; 3]) -> [f32; 3]) -> Vec<Triangle> {
    triangles.iter().map(|triangle| triangle.map(&map)).collect()
}

pub(crate) fn config_of(preset: Preset) -> Config {
    Config::preset(preset)
}

pub(crate) fn bvh(triangles: &[Triangle], config: Config) -> TriangleBvh {
    let positions: Vec<[f32; 3]> = triangles.iter().flatten().copied().collect();
    let indices: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleBvh::build_with(&positions, &indices, config).expect("all vertices are finite")
}

/// Configurations with aligned nodes, a mesh frame, and oriented nodes only.
pub(crate) fn configs() -> [Config; 3] {
    let mut oriented = config_of(Preset::Quality);
    oriented.costs.aligned_node = f32::INFINITY;
    oriented.costs.max_leaf = 2;
    [config_of(Preset::Dynamic), config_of(Preset::Balanced), oriented]
}

/// Poses that move, rotate, mirror, shear and flatten.
pub(crate) fn poses() -> [Pose; 5] {
    let rotation = Affine::rotation([1.0, 2.0, -0.5], 0.7);
    [
        Pose::IDENTITY,
        Pose::translation([0.1, -0.2, 0.3]),
        Pose::from(Affine::scale([-1.0, 1.0, 1.0]).then(&rotation).then(&Affine::translation([0.4, 0.2, 0.1]))),
        Pose::from_rows([[1.0, 0.7, -0.4, 0.1], [0.0, 1.3, 0.9, -0.2], [0.2, 0.0, 0.6, 0.05]]),
        Pose::from_rows([[1.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.25, 0.0], [0.0, 0.0, 0.0, 0.5]]),
    ]
}

/// The pairs that a query finds.
pub(crate) fn found(a: &TriangleBvh, a_pose: Pose, b: &TriangleBvh, b_pose: Pose) -> Vec<PrimitivePair> {
    let mut found = vec![];
    pairs(a, a_pose, b, b_pose, &mut found);
    found
}

pub(crate) fn posed(triangles: &[Triangle], pose: Pose) -> Vec<[[f64; 3]; 3]> {
    triangles.iter().map(|triangle| triangle.map(|vertex| pose.point(vertex.map(f64::from)))).collect()
}

/// All pairs that share a point, by integers.
pub(crate) fn truth(a: &[[[f64; 3]; 3]], b: &[[[f64; 3]; 3]]) -> Vec<PrimitivePair> {
    let range = |t: &[[f64; 3]; 3], k: usize| {
        t.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], p| [lo.min(p[k]), hi.max(p[k])])
    };
    let mut all = vec![];
    for (i, one) in a.iter().enumerate() {
        for (j, other) in b.iter().enumerate() {
            let meet = (0..3).all(|k| {
                let ([a, b], [c, d]) = (range(one, k), range(other, k));
                a <= d && c <= b
            });
            if meet && share_a_point(one, other) {
                all.push([PrimId(i as u32), PrimId(j as u32)]);
            }
        }
    }
    all
}

type Point = [BigInt; 3];

/// A number in units of 2^-340: all that are not below 2^-288.
fn integer(x: f64) -> BigInt {
    const UNIT: i32 = 340;
    if x == 0.0 {
        return BigInt::ZERO;
    }
    let exponent = (x.to_bits() >> 52 & 0x7ff) as i32;
    assert!(exponent > 0, "normal numbers only");
    let mantissa = BigInt::from(x.to_bits() & ((1 << 52) - 1) | 1 << 52);
    let shift = exponent - 1075 + UNIT;
    assert!(shift >= 0, "{x:e} is not a multiple of the unit");
    let magnitude = mantissa << shift;
    if x < 0.0 { -magnitude } else { magnitude }
}

fn sub(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn cross(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| &a[(k + 1) % 3] * &b[(k + 2) % 3] - &a[(k + 2) % 3] * &b[(k + 1) % 3])
}

fn dot(a: &Point, b: &Point) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// Whether two triangles share a point: no axis separates them of those that join their nearest points, which are vertices, or points of
/// edges or faces. So it holds for segments and points, too.
pub(crate) fn share_a_point(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> bool {
    let [a, b] = [a, b].map(|triangle| triangle.map(|p| p.map(integer)));
    let edges = |t: &[Point; 3]| [sub(&t[1], &t[0]), sub(&t[2], &t[1]), sub(&t[0], &t[2])];
    let (a_edges, b_edges) = (edges(&a), edges(&b));
    let between: Vec<Point> = a.iter().flat_map(|p| b.iter().map(move |q| sub(p, q))).collect();
    let mut axes = vec![cross(&a_edges[0], &a_edges[1]), cross(&b_edges[0], &b_edges[1])];
    axes.extend(a_edges.iter().flat_map(|e| b_edges.iter().map(move |f| cross(e, f))));
    for edge in a_edges.iter().chain(&b_edges) {
        axes.extend(between.iter().map(|offset| cross(edge, &cross(offset, edge))));
    }
    axes.extend(between);
    !axes.iter().any(|axis| {
        let range = |t: &[Point; 3]| {
            let mut along = [dot(&t[0], axis), dot(&t[1], axis), dot(&t[2], axis)];
            along.sort();
            let [lo, _, hi] = along;
            (lo, hi)
        };
        let ((a_lo, a_hi), (b_lo, b_hi)) = (range(&a), range(&b));
        a_hi < b_lo || b_hi < a_lo
    })
}

/// How many pairs of the truth are lost, and how many are invented.
pub(crate) fn lost_and_invented(found: &[PrimitivePair], truth: &[PrimitivePair]) -> [usize; 2] {
    [
        truth.iter().filter(|pair| !found.contains(pair)).count(),
        found.iter().filter(|pair| !truth.contains(pair)).count(),
    ]
}
