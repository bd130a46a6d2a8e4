//! Rotations extracted from matrices, including the measured failures of the source, compared with both variants of its listing.

use std::f64::consts::PI;

use canted_fixtures::SplitMix64;
use canted_obb::{
    Quaternion,
    eigen::{self, FULL_PRECISION, Symmetric},
    rotation::{MAX_ITERATIONS, Status, extract},
    vector::{Vector, dot},
};

use super::{Oracle, Promise, Row};
use crate::{
    clouds::random_rotation,
    rotations::{self, Matrix, angle_rad, as_copied, as_listed, diagonal, times, transposed},
};

/// Rounding noise of torque and trace: 64 roundings of `f64` for the extraction, and as many for the oracle.
const NOISE: f64 = 128.0 * f64::EPSILON;

/// The source's iteration with one of the two guards.
type Listing = fn(Matrix, usize) -> (Quaternion, usize);

/// Iteration limit of the listing.
const CAP: usize = 1000;

/// Residual of an eigenvector: each rotation rounds an entry a few times; six sweeps of three rotations, doubled.
const RESIDUAL: f64 = 128.0 * f64::EPSILON;

fn promise(case: &'static str, promise: &'static str, oracle: Oracle, bound: f64, unit: &'static str) -> Promise {
    Promise { stage: "rotation", case, promise, oracle, bound, unit }
}

/// Matrices of one kind with their known rotations.
struct Known {
    case: &'static str,
    bound: f64,
    inputs: Vec<(Matrix, Quaternion)>,
}

/// `turn` times a stretch by `values` along random axes, or along the coordinate axes.
fn stretched(turn: Quaternion, values: Vector, axes: Option<&mut SplitMix64>) -> Matrix {
    let v = axes.map_or(diagonal([1.0; 3]), |rng| random_rotation(rng).columns());
    times(turn.columns(), times(v, times(diagonal(values), transposed(v))))
}

fn known(effort: usize) -> Vec<Known> {
    let mut rng = SplitMix64::new(92);
    let n = 100 * effort;
    let mut kinds = vec![];
    for (case, values) in [
        ("condition 1e6, one small value", [1.0, 1.0, 1e-6]),
        ("condition 1e12, one small value", [1.0, 1.0, 1e-12]),
        ("condition 1e6, two small values", [1.0, 1e-6, 1e-6]),
        ("condition 1e12, two small values", [1.0, 1e-12, 1e-12]),
        ("condition 1e12, three distinct values", [1.0, 1e-6, 1e-12]),
    ] {
        let turn = |rng: &mut SplitMix64| {
            let turn = random_rotation(rng);
            (stretched(turn, values, Some(rng)), turn)
        };
        // Noise divided by the least stiffness, that of a rotation about the first axis.
        let bound = 8.0 * NOISE / (values[1] + values[2]);
        kinds.push(Known { case, bound, inputs: (0..n).map(|_| turn(&mut rng)).collect() });
    }
    for (case, degrees) in [("rotation by 179.999°", 179.999_f64), ("rotation by 180°, exact in f64", 180.0)] {
        let turn = |rng: &mut SplitMix64| {
            let turn = Quaternion::from_axis_angle(random_rotation(rng).columns()[0], degrees.to_radians());
            (stretched(turn, [5.0, 2.0, 0.1], None), turn)
        };
        kinds.push(Known { case, bound: 16.0 * NOISE, inputs: (0..n).map(|_| turn(&mut rng)).collect() });
    }
    let halves = [[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(|signs| {
        let a = diagonal(signs);
        (a, Quaternion::from_columns(a))
    });
    kinds.push(Known { case: "half turns about the coordinate axes", bound: 0.0, inputs: halves.to_vec() });
    let rank_two = |rng: &mut SplitMix64| {
        let (u, v) = (random_rotation(rng), random_rotation(rng));
        let a = times(u.columns(), times(diagonal([2.0, 0.5, 0.0]), transposed(v.columns())));
        (a, u.times(v.conjugate()))
    };
    kinds.push(Known { case: "rank two", bound: 16.0 * NOISE, inputs: (0..n).map(|_| rank_two(&mut rng)).collect() });
    let short = 1e-4;
    let mean = |rng: &mut SplitMix64| {
        let (p, axis) = (random_rotation(rng), random_rotation(rng).columns()[0]);
        let rotated = |angle: f64| Quaternion::from_axis_angle(axis, angle).times(p);
        let (a, b) = (p.columns(), rotated(PI - short).columns());
        ([0, 1, 2].map(|k| [0, 1, 2].map(|j| 0.5 * (a[k][j] + b[k][j]))), rotated(0.5 * (PI - short)))
    };
    kinds.push(Known {
        case: "mean of two frames, half a turn minus 1e-4 apart",
        bound: 8.0 * NOISE / short,
        inputs: (0..n).map(|_| mean(&mut rng)).collect(),
    });
    for (case, exponent) in [("scale 2^-300", -300), ("scale 2^300", 300)] {
        let scale = 2.0_f64.powi(exponent);
        let turn = |rng: &mut SplitMix64| {
            let turn = random_rotation(rng);
            (stretched(turn, [3.0, 2.0, 1.0], Some(rng)).map(|column| column.map(|x| x * scale)), turn)
        };
        kinds.push(Known { case, bound: 16.0 * NOISE, inputs: (0..n).map(|_| turn(&mut rng)).collect() });
    }
    kinds
}

pub(super) fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    for Known { case, bound, inputs } in known(effort) {
        let promise =
            promise(case, "the rotation, up to rounding amplified by the condition", Oracle::Known, bound, "rad");
        let worst = |of: &dyn Fn(Matrix) -> Quaternion| {
            let error = |&(a, turn): &(Matrix, Quaternion)| angle_rad(of(a), turn);
            // NaN counts as the worst error.
            inputs.iter().map(error).fold(0.0, |worst: f64, x| worst.max(if x.is_nan() { PI } else { x }))
        };
        rows.push(promise.row("extract", inputs.len(), worst(&|a| extract(a, MAX_ITERATIONS).rotation)));
        let listings: [(&str, Listing); 2] =
            [("listed, guard in the denominator", as_listed), ("listed, guard added to the quotient", as_copied)];
        for (name, listing) in listings {
            let listed = promise.row(name, inputs.len(), worst(&|a| listing(a, CAP).0));
            rows.push(Row { is_peer: true, ..listed });
        }
    }
    rows.extend([greatest_trace(effort), turns(effort)]);
    rows.extend(degenerate(effort));
    rows.push(graded(effort));
    rows
}

fn random_matrix(rng: &mut SplitMix64) -> Matrix {
    [rng.signed3(), rng.signed3(), rng.signed3()]
}

/// Random matrices, including reflections: no rotation has a greater trace.
fn greatest_trace(effort: usize) -> Row {
    let mut rng = SplitMix64::new(91);
    let n = 2000 * effort;
    let lacks = |a: Matrix| {
        let found = extract(a, MAX_ITERATIONS).rotation.columns();
        let greatest = a.iter().flatten().fold(0.0, |all: f64, x| all.max(x.abs()));
        (rotations::greatest_trace(a) - (0..3).map(|k| dot(found[k], a[k])).sum::<f64>()) / greatest
    };
    let worst = (0..n).map(|_| lacks(random_matrix(&mut rng))).fold(0.0, f64::max);
    promise(
        "random matrices, half of them reflections",
        "no rotation fits better",
        Oracle::Jacobi,
        NOISE,
        "of the greatest entry",
    )
    .row("extract", n, worst)
}

/// Number of iterations over random matrices and those of every condition.
fn turns(effort: usize) -> Row {
    let mut rng = SplitMix64::new(93);
    let inputs: Vec<Matrix> = known(effort)
        .into_iter()
        .flat_map(|known| known.inputs.into_iter().map(|(a, _)| a))
        .chain((0..1000 * effort).map(|_| random_matrix(&mut rng)))
        .collect();
    let taken = |a: &Matrix| extract(*a, MAX_ITERATIONS).iterations as f64;
    // A quarter of the limit leaves a margin for other inputs.
    let bound = MAX_ITERATIONS as f64 / 4.0;
    promise("all of the above", "converges far below the iteration limit", Oracle::Structure, bound, "iterations").row(
        "extract",
        inputs.len(),
        inputs.iter().map(taken).fold(0.0, f64::max),
    )
}

/// Matrices without a unique rotation, reported by the status.
fn degenerate(effort: usize) -> Vec<Row> {
    let mut rng = SplitMix64::new(95);
    let mut row = |case, wanted: &'static str, n: usize, is_other: &mut dyn FnMut(&mut SplitMix64) -> bool| {
        let failed = (0..n).filter(|_| is_other(&mut rng)).count();
        promise(case, wanted, Oracle::Structure, 0.0, "other answers").count("extract", n, failed)
    };
    let is = |a: Matrix, status: Status| {
        let found = extract(a, MAX_ITERATIONS);
        let is_unit = (found.rotation.dot(found.rotation) - 1.0).abs() < 8.0 * f64::EPSILON;
        is_unit && found.status == status
    };
    let zero = [[0.0; 3]; 3];
    vec![
        row("zero matrix", "identity, status rank deficient", 1, &mut |_| {
            !is(zero, Status::RankDeficient) || extract(zero, MAX_ITERATIONS).rotation != Quaternion::IDENTITY
        }),
        row("rank one", "status rank deficient", 100 * effort, &mut |rng| {
            let (u, v) = (rng.on_sphere(), rng.on_sphere());
            !is(v.map(|x| u.map(|y| 3.0 * x * y)), Status::RankDeficient)
        }),
        row(
            "reflected: (3, 2, -1), (1, 1, -1), (1, 1e-9, -1e-9)",
            "a proper rotation, status reflected",
            99 * effort,
            &mut |rng| {
                let values = [[3.0, 2.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1e-9, -1e-9]][rng.below(3)];
                let (u, v) = (random_rotation(rng).columns(), random_rotation(rng).columns());
                !is(times(u, times(diagonal(values), transposed(v))), Status::Reflected)
            },
        ),
        row("NaN, infinity", "a unit quaternion, status not converged", 2, &mut |rng| {
            let bad = [f64::NAN, f64::INFINITY][rng.below(2)];
            !is([[bad, 0.0, 0.0], [0.0; 3], [0.0; 3]], Status::NotConverged)
        }),
    ]
}

/// Eigenvectors for eigenvalues 1, 1e-6 and 1e-12.
fn graded(effort: usize) -> Row {
    let mut rng = SplitMix64::new(96);
    let n = 200 * effort;
    let values = [1.0, 1e-6, 1e-12];
    let residual = |rng: &mut SplitMix64| {
        let axes = random_rotation(rng).columns();
        let entry = |i: usize, j: usize| (0..3).map(|k| values[k] * axes[k][i] * axes[k][j]).sum::<f64>();
        let [xx, xy, xz, yy, yz, zz]: Symmetric =
            [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        let found = eigen::symmetric([xx, xy, xz, yy, yz, zz], FULL_PRECISION);
        let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let off = |v: usize, i: usize| dot(rows[i], found.vectors[v]) - found.values[v] * found.vectors[v][i];
        (0..9).map(|i| off(i / 3, i % 3).abs()).fold(0.0, f64::max)
    };
    let worst = (0..n).map(|_| residual(&mut rng)).fold(0.0, f64::max);
    Promise {
        stage: "eigenvectors",
        case: "eigenvalues 1, 1e-6, 1e-12",
        promise: "residual only from rounding",
        oracle: Oracle::Structure,
        bound: RESIDUAL,
        unit: "of the greatest entry",
    }
    .row("symmetric", n, worst)
}
