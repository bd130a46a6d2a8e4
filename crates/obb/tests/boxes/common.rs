//! The exact containment oracle, the point sets that tests share, the same on every run, and what a merge may add to a child.
//!
//! Not covered: points that are not finite (refused by `fit`), more than a few hundred points a set.

use canted_obb::{Affine, Frame, Obb, Quaternion};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [-1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    pub(crate) fn vector(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.signed())
    }

    /// Uniform over all rotations (Marsaglia's rejection in four dimensions).
    pub(crate) fn rotation(&mut self) -> Quaternion {
        loop {
            let q = Quaternion { w: self.signed(), x: self.signed(), y: self.signed(), z: self.signed() };
            let square = q.dot(q);
            if square > 0.01 && square <= 1.0 {
                return q.normalized();
            }
        }
    }

    pub(crate) fn frame(&mut self) -> Frame {
        self.rotation().frame()
    }
}

/// `frame · (scale ∘ x) + offset`, rounded to `f32`.
pub(crate) fn placed(frame: Frame, scale: [f64; 3], offset: [f64; 3], x: [f64; 3]) -> [f32; 3] {
    std::array::from_fn(|k| ((0..3).map(|a| f64::from(frame[a][k]) * scale[a] * x[a]).sum::<f64>() + offset[k]) as f32)
}

fn cloud(seed: u64, n: usize, scale: [f64; 3], offset: [f64; 3]) -> Vec<[f32; 3]> {
    let mut random = Random(seed);
    let frame = random.frame();
    (0..n).map(|_| placed(frame, scale, offset, random.vector())).collect()
}

/// Every set has at least one point; all are finite.
pub(crate) fn all_clouds() -> Vec<(String, Vec<[f32; 3]>)> {
    let mut sets: Vec<(String, Vec<[f32; 3]>)> = Vec::new();
    let mut add = |name: &str, points: Vec<[f32; 3]>| sets.push((name.to_owned(), points));
    add("one point", vec![[0.1, -7.3, 1e6]]);
    add("two points", vec![[0.1, 0.2, 0.3], [-4.7, 1.1, 9.9]]);
    add("copies of a point", vec![[0.1, -3.7, 123.456]; 50]);
    add("negative zeros", vec![[-0.0, 0.0, -0.0], [0.0, -0.0, 1.0], [-0.0, 1.0, -0.0]]);
    add("collinear", (0..40).map(|i| [0.3 * i as f32, 0.7 * i as f32, -1.1 * i as f32]).collect());
    add("flat in a wall", (0..60).map(|i| [2.5, (i % 7) as f32 * 0.1, (i % 11) as f32 * 0.3]).collect());
    let corners = |side: f32| (0..8).map(move |i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { side } else { -side }));
    add("cube", corners(1.0).collect());
    add("box", corners(1.0).map(|[x, y, z]| [x, 5.0 * y, 0.1 * z]).collect());
    add(
        "octahedron",
        vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
    );
    add("tetrahedron", vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]);
    let bits = |seed| {
        let mut random = Random(seed);
        (0..40).map(|_| [0; 3].map(|_: u32| f32::from_bits((random.bits() as u32) & 0x807f_ffff))).collect()
    };
    add("denormals", bits(1));
    let mut random = Random(2);
    let any = std::iter::repeat_with(|| f32::from_bits(random.bits() as u32)).filter(|x| x.is_finite());
    let any: Vec<f32> = any.take(120).collect();
    add("any bits", any.chunks(3).map(|c| [c[0], c[1], c[2]]).collect());
    add("full range", vec![[f32::MAX, f32::MAX, f32::MIN], [f32::MIN, f32::MAX, 0.0], [0.0, f32::MIN, f32::MIN]]);
    for seed in 10..16 {
        add("random", cloud(seed, 60, [3.0, 1.0, 0.3], [1.0, -2.0, 5.0]));
        add("needle", cloud(seed, 40, [1e3, 1e-3, 1e-3], [0.0; 3]));
        add("oblique plane", cloud(seed, 60, [4.0, 3.0, 0.0], [0.1, 0.2, 0.3]));
        add("oblique line", cloud(seed, 30, [4.0, 0.0, 0.0], [9.0, 0.0, 0.0]));
        add("far away", cloud(seed, 60, [5.0, 2.0, 1.0], [1e7, -1e7, 3e6]));
        add("far on one axis", cloud(seed, 60, [1e-3, 2e-3, 1e-3], [1e7, 0.0, -0.5]));
        add("tiny", cloud(seed, 40, [1e-20, 2e-20, 1e-21], [0.0; 3]));
        add("huge", cloud(seed, 40, [1e20, 2e20, 1e19], [-1e20; 3]));
        add("near denormal", cloud(seed, 40, [1e-38, 2e-38, 1e-39], [0.0; 3]));
    }
    sets
}

pub(crate) type Point = [BigRational; 3];

pub(crate) fn exact(x: f32) -> BigRational {
    BigRational::from_float(x).expect("a finite number")
}

pub(crate) fn exact_point(p: [f32; 3]) -> Point {
    p.map(exact)
}

/// Nearest `f64`, for reports and bounds on sizes.
pub(crate) fn to_f64(x: &BigRational) -> f64 {
    x.to_f64().expect("rationals round to f64")
}

/// A box with the inverse of its frame, by elimination; the library never divides like this.
pub(crate) struct ExactBox {
    center: Point,
    inverse: [[BigRational; 3]; 3],
    half: Point,
}

impl ExactBox {
    pub(crate) fn of(obb: &Obb) -> Self {
        let frame = obb.frame.map(exact_point);
        // Row k of the matrix holds coordinate k of each axis.
        let rows = std::array::from_fn(|k| std::array::from_fn(|a| frame[a][k].clone()));
        Self { center: exact_point(obb.center), inverse: inverted(rows), half: exact_point(obb.half_extents) }
    }

    pub(crate) fn coordinates(&self, p: &Point) -> Point {
        let d: Point = std::array::from_fn(|j| &p[j] - &self.center[j]);
        std::array::from_fn(|k| (0..3).map(|j| &self.inverse[k][j] * &d[j]).sum())
    }

    pub(crate) fn contains(&self, p: &Point) -> bool {
        self.coordinates(p).iter().zip(&self.half).all(|(q, half)| q.abs() <= *half)
    }
}

/// The eight exact corners.
pub(crate) fn corners(obb: &Obb) -> Vec<Point> {
    let frame = obb.frame.map(exact_point);
    (0..8)
        .map(|i| {
            std::array::from_fn(|k| {
                (0..3).fold(exact(obb.center[k]), |sum, a| {
                    let side = &frame[a][k] * exact(obb.half_extents[a]);
                    if i >> a & 1 == 1 { sum + side } else { sum - side }
                })
            })
        })
        .collect()
}

/// The real image of a point.
pub(crate) fn image(map: &Affine, p: &Point) -> Point {
    std::array::from_fn(|k| {
        (0..3).map(|j| exact(map.columns[j][k]) * &p[j]).fold(exact(map.columns[3][k]), |sum, x| sum + x)
    })
}

/// Gauss and Jordan; panics on a singular matrix.
fn inverted(mut rows: [[BigRational; 3]; 3]) -> [[BigRational; 3]; 3] {
    let one = || BigRational::from_integer(BigInt::from(1));
    let mut inverse: [[BigRational; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { one() } else { BigRational::zero() }));
    for column in 0..3 {
        let pivot = (column..3).find(|&row| !rows[row][column].is_zero()).expect("an invertible frame");
        rows.swap(column, pivot);
        inverse.swap(column, pivot);
        let scale = one() / &rows[column][column];
        for k in 0..3 {
            rows[column][k] *= &scale;
            inverse[column][k] *= &scale;
        }
        for row in (0..3).filter(|&row| row != column) {
            let factor = rows[row][column].clone();
            for k in 0..3 {
                let (a, b) = (&rows[column][k] * &factor, &inverse[column][k] * &factor);
                rows[row][k] -= a;
                inverse[row][k] -= b;
            }
        }
    }
    inverse
}

#[track_caller]
pub(crate) fn assert_contains(name: &str, parent: &Obb, children: &[Obb]) {
    let oracle = ExactBox::of(parent);
    for child in children {
        assert!(corners(child).iter().all(|corner| oracle.contains(corner)), "{name}: {child:?} in {parent:?}");
    }
}

/// `f32` roundings of a frame's columns, and of a half-extent, that a merge may add: the frame is rounded in the child
/// and in the parent, by half a unit in the last place of each of three entries, and rotations the box's diagonal.
pub(crate) const REFRAMED: f64 = 2.0 * 3.0 * 1.733 * 0.5 * f32::EPSILON as f64;

/// How far the half-extents of `parent`, in any order, exceed those of `child`, over its greatest.
pub(crate) fn growth(parent: &Obb, child: &Obb) -> f64 {
    let sorted = |obb: &Obb| {
        let mut half = obb.half_extents;
        half.sort_by(f32::total_cmp);
        half.map(f64::from)
    };
    let (grown, original) = (sorted(parent), sorted(child));
    (0..3).map(|k| grown[k] - original[k]).fold(0.0, f64::max) / original[2]
}
