//! Box fits: exact containment, area relative to the axis-aligned box, scaling.
//!
//! Not covered: how tight a box is on ordinary input (the report's chapter on boxes).

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, Fit, FitError, Obb, fit, frame};

use super::{Oracle, Promise, REFRAMED, Row};
use crate::{
    clouds::{Cloud, extreme, placed, random_rotation},
    exact,
};

const METHODS: [(&str, Fit); 5] =
    [("aabb", Fit::Aabb), ("pca", Fit::Pca), ("area pca", Fit::AreaPca), ("dito", Fit::Dito), ("dop", Fit::Dop)];

/// Consecutive points as triangles, for the area-weighted method.
fn strip(points: &[[f32; 3]]) -> Vec<[u32; 3]> {
    let n = u32::try_from(points.len()).expect("few points");
    (2..n).map(|i| [i - 2, i - 1, i]).collect()
}

fn fitted(points: &[[f32; 3]], method: Fit) -> Obb {
    fit(points, &strip(points), method).expect("finite points")
}

/// `a / b`, or one if both are zero.
fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 && b == 0.0 { 1.0 } else { a / b }
}

/// Greatest dot product of two axes or deviation of a squared axis length from one; two if the frame is a reflection.
///
/// An axis whose half-extent would overflow `f32` has a power of two as length, which is divided out first.
fn skew(fitted: &Obb) -> f64 {
    let unit = |axis: [f32; 3]| {
        let axis = axis.map(f64::from);
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        axis.map(|x| x / length.log2().round().exp2())
    };
    let axes = fitted.frame.map(unit);
    let dot = |a: usize, b: usize| (0..3).map(|k| axes[a][k] * axes[b][k]).sum::<f64>();
    let errors = [dot(0, 0) - 1.0, dot(1, 1) - 1.0, dot(2, 2) - 1.0, dot(0, 1), dot(1, 2), dot(2, 0)];
    let mirrors = frame::right_handed(fitted.frame) != fitted.frame;
    if mirrors { 2.0 } else { errors.iter().fold(0.0, |worst, e| worst.max(e.abs())) }
}

pub(super) fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    for Cloud { case, sets } in extreme(effort) {
        let promise = |promise, oracle, bound, unit| Promise { stage: "fit", case, promise, oracle, bound, unit };
        let contains = promise("contains every point", Oracle::Exact, 0.0, "points outside");
        let area = promise("no more area than the axis-aligned box", Oracle::Exact, 1.0, "of its area");
        let rotation = promise("a proper rotation", Oracle::Structure, frame::ORTHONORMAL_ERROR, "off orthonormal");
        let n_points: usize = sets.iter().map(Vec::len).sum();
        let boxes = METHODS.map(|(name, method)| {
            (name, sets.iter().map(|points| (points, fitted(points, method))).collect::<Vec<_>>())
        });
        for (name, boxes) in &boxes {
            let outside = |(points, fitted): &(&Vec<[f32; 3]>, Obb)| {
                points.iter().filter(|&&point| !exact::contains(fitted, point)).count()
            };
            rows.push(contains.count(*name, n_points, boxes.iter().map(outside).sum()));
        }
        for (name, boxes) in &boxes {
            let of_straight = |(points, fitted): &(&Vec<[f32; 3]>, Obb)| {
                ratio(fitted.area(), Obb::from_aabb(&Aabb::from_points(points.iter().copied())).area())
            };
            rows.push(area.row(*name, sets.len(), boxes.iter().map(of_straight).fold(0.0, f64::max)));
        }
        for (name, boxes) in &boxes {
            rows.push(rotation.row(*name, sets.len(), boxes.iter().map(|(_, b)| skew(b)).fold(0.0, f64::max)));
        }
    }
    [rows, refused(), scaled(effort), needles(effort), vec![subdivided()]].concat()
}

/// No points, and points that are not finite.
fn refused() -> Vec<Row> {
    const EMPTY: Promise = Promise::none("fit", "no points", "an error", Oracle::Known, "other answers");
    const BAD: Promise =
        Promise::none("fit", "one NaN or infinity", "an error that names the point", Oracle::Known, "other answers");
    let bad = |method, x: f32| {
        let mut points = vec![[0.5f32, 1.0, -2.0]; 9];
        points[6][1] = x;
        usize::from(fit(&points, &strip(&points), method) != Err(FitError::NotFinite { index: 6 }))
    };
    let empty = |method| usize::from(fit(&[], &[], method) != Err(FitError::Empty));
    let bads = |method| [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].map(|x| bad(method, x)).iter().sum();
    let mut rows: Vec<Row> = METHODS.iter().map(|&(name, method)| EMPTY.count(name, 1, empty(method))).collect();
    rows.extend(METHODS.iter().map(|&(name, method)| BAD.count(name, 3, bads(method))));
    rows
}

/// Powers of two from about 1e-20 to 1e20.
fn scaled(effort: usize) -> Vec<Row> {
    const SCALE: Promise =
        Promise::none("fit", "scale 2^-66 to 2^66", "the same box, scaled, bit for bit", Oracle::Same, "boxes differ");
    let mut rng = SplitMix64::new(31);
    let sets: Vec<Vec<[f32; 3]>> = (0..10 * effort)
        .map(|_| {
            let turn = random_rotation(&mut rng);
            (0..40).map(|_| placed(&turn, [3.0, 1.0, 0.1], [0.5, -1.0, 2.0], rng.signed3())).collect()
        })
        .collect();
    let exponents = [-66, -33, 33, 66];
    let differs = |points: &Vec<[f32; 3]>, method| {
        let want = fitted(points, method);
        let is_other = |exponent: &&i32| {
            let scale = |p: [f32; 3]| p.map(|x| x * 2.0f32.powi(**exponent));
            let scaled: Vec<_> = points.iter().map(|&p| scale(p)).collect();
            fitted(&scaled, method)
                != Obb { center: scale(want.center), half_extents: scale(want.half_extents), ..want }
        };
        exponents.iter().filter(is_other).count()
    };
    let n = sets.len() * exponents.len();
    METHODS
        .iter()
        .map(|&(name, method)| SCALE.count(name, n, sets.iter().map(|points| differs(points, method)).sum()))
        .collect()
}

/// Rods a million times longer than thick: how much the thin extents grow.
fn needles(effort: usize) -> Vec<Row> {
    // Each point is off by half a unit in the last place of one, 2^-25, on each of three axes, and so is the frame. The longest
    // axis may also follow the points: three displacements of √3·2^-25 at either end.
    const THICKER: f64 = 2.0 * 3.0 * 1.733 / 33_554_432.0;
    const HALF: [f64; 3] = [0.5, 5e-6, 5e-7];
    let promise = Promise {
        stage: "fit",
        case: "rod, 1e6 : 1, rotated",
        promise: "thin extents are kept up to rounding",
        oracle: Oracle::Known,
        bound: HALF[1] + THICKER,
        unit: "median half-extent",
    };
    let mut rng = SplitMix64::new(32);
    let sets: Vec<Vec<[f32; 3]>> = (0..20 * effort)
        .map(|_| {
            let turn = random_rotation(&mut rng);
            let sign = |i: usize, k: usize| if i >> k & 1 == 1 { 1.0 } else { -1.0 };
            (0..8).map(|i| placed(&turn, HALF, [0.0; 3], [0, 1, 2].map(|k| sign(i, k)))).collect()
        })
        .collect();
    let middle = |fitted: Obb| {
        let mut half = fitted.half_extents;
        half.sort_by(f32::total_cmp);
        f64::from(half[1])
    };
    [("pca", Fit::Pca), ("dito", Fit::Dito)]
        .iter()
        .map(|&(name, method)| {
            let worst = sets.iter().map(|points| middle(fitted(points, method))).fold(0.0, f64::max);
            promise.row(name, sets.len(), worst)
        })
        .collect()
}

/// A surface that is finely tessellated in one corner.
fn subdivided() -> Row {
    let promise = Promise {
        stage: "fit",
        case: "one face tessellated a thousand times as densely",
        promise: "the same box: weights are areas",
        oracle: Oracle::Same,
        // Area depends on products of two extents, each changed by the frame's rounding.
        bound: 1.0 + 2.0 * REFRAMED,
        unit: "of the area",
    };
    // Integer coordinates, so that halving edges five times is exact.
    let edges = [[64.0f32, 0.0, 0.0], [16.0, 96.0, 0.0], [8.0, 24.0, 32.0]];
    let corner =
        |i: u32| std::array::from_fn(|k| (0..3).filter(|&a| i >> a & 1 == 1).map(|a| edges[a][k]).sum::<f32>());
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let coarse: Vec<[[f32; 3]; 3]> =
        faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c].map(corner), [a, c, d].map(corner)]).collect();
    let mut fine = coarse[1..].to_vec();
    let mut dense = vec![coarse[0]];
    for _ in 0..5 {
        dense = dense
            .into_iter()
            .flat_map(|[a, b, c]| {
                let middle = |p: [f32; 3], q: [f32; 3]| std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    fine.extend(dense);
    let area = |triangles: &[[[f32; 3]; 3]]| {
        let points: Vec<[f32; 3]> = triangles.iter().flatten().copied().collect();
        let n = u32::try_from(points.len()).expect("few points");
        let indices: Vec<[u32; 3]> = (0..n / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        fit(&points, &indices, Fit::AreaPca).expect("finite points").area()
    };
    let (a, b) = (area(&coarse), area(&fine));
    promise.row("area pca", 1, (a / b).max(b / a))
}
