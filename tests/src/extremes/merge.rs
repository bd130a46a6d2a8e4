//! Merged boxes: containment, growth, and inputs that must not rotate the frame.
//!
//! Not covered: how tight a merge is on ordinary boxes (the report's chapter on boxes).

use std::f64::consts::{FRAC_PI_2, PI};

use canted_fixtures::SplitMix64;
use canted_obb::{
    Aabb, Obb, Quaternion, bound,
    merge::{self, Child, Weight},
};

use super::{Oracle, Promise, REFRAMED, Row};
use crate::{
    clouds::{placed, random_rotation},
    exact,
};

/// A merge rule by name.
pub(crate) type Rule = (&'static str, fn(&Obb, &Obb) -> Obb);

/// Every rule for two boxes.
pub(crate) const RULES: [Rule; 5] = [
    ("bounded by corners", |a, b| merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Corners)),
    ("bounded by area", |a, b| merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Area)),
    ("quaternion", |a, b| merge::quaternion(a, b, [a.area(), b.area()])),
    ("best", |a, b| merge::best(a, b, None)),
    ("combined", |a, b| merge::combined(&Child::Box(*a), &Child::Box(*b))),
];

const fn promise(case: &'static str, promise: &'static str, oracle: Oracle, bound: f64, unit: &'static str) -> Promise {
    Promise { stage: "merge", case, promise, oracle, bound, unit }
}

const PAIRS: Promise = promise("arbitrary boxes", "contains both, corners exact", Oracle::Exact, 0.0, "pairs");
const EQUAL: Promise = promise(
    "equal boxes; nested boxes",
    "grows only by rounding",
    Oracle::Exact,
    REFRAMED,
    "of the greatest half-extent",
);
const FLAT: Promise =
    promise("zero volume: plane, line, point", "contains both, stays finite", Oracle::Exact, 0.0, "pairs");
const QUARTER: Promise = promise(
    "a cube and itself rotated by 90°",
    "the cube, not one rotated by 45°",
    Oracle::Known,
    1.0 + 2.1 * REFRAMED,
    "of its area",
);
const HALF: Promise =
    promise("a box and itself rotated by 180°", "the box", Oracle::Known, 1.0 + 2.1 * REFRAMED, "of its area");
const SIGN: Promise = promise("q and -q", "the same rotation, bit for bit", Oracle::Same, 0.0, "pairs differ");
/// With weights `1e6 : 1` the frame rotates by at most a millionth of a right angle; the frame's rounding, `√3·2^-25`, counts
/// twice.
const LIGHT: Promise = promise(
    "weights 1 : 1e-6",
    "the light box does not rotate the frame",
    Oracle::Known,
    1e-6 * FRAC_PI_2 + 2.0 * 1.733 / 33_554_432.0,
    "rad",
);
const CHAIN: Promise =
    promise("a chain of 30 merges", "contains every vertex below", Oracle::Exact, 0.0, "vertices outside");
const GROWTH: Promise = promise(
    "a chain of 30 merges",
    "growth, reported only",
    Oracle::Exact,
    f64::INFINITY,
    "of the axis-aligned box's area",
);

pub(super) fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    let pairs = pairs(effort);
    let flats = flats(effort);
    let is_invalid = |rule: fn(&Obb, &Obb) -> Obb, (a, b): &(Obb, Obb)| {
        let parent = rule(a, b);
        let is_finite = parent.half_extents.iter().chain(&parent.center).all(|x| x.is_finite());
        !(is_finite && exact::contains_box(&parent, a) && exact::contains_box(&parent, b))
    };
    for (promise, pairs) in [(PAIRS, &pairs), (FLAT, &flats)] {
        rows.extend(RULES.map(|(name, rule)| {
            promise.count(name, pairs.len(), pairs.iter().filter(|pair| is_invalid(rule, pair)).count())
        }));
    }
    let rotations = rotations(effort);
    let worst = |of: &dyn Fn(&Quaternion) -> f64| rotations.iter().map(of).fold(0.0, f64::max);
    for (name, rule) in RULES {
        rows.push(EQUAL.row(name, 2 * rotations.len(), worst(&|turn| growth(rule, turn))));
    }
    for (promise, half, angle) in [(QUARTER, [1.0; 3], FRAC_PI_2), (HALF, [3.0, 1.0, 0.25], PI)] {
        // The principal axes of a cube's corners are arbitrary; only rules that use the children's axes can keep them.
        let keeps = |name: &str| promise.case != QUARTER.case || !name.starts_with("bounded");
        for (name, rule) in RULES.into_iter().filter(|(name, _)| keeps(name)) {
            rows.push(promise.row(name, rotations.len(), worst(&|turn| area_with_rotated(rule, turn, half, angle))));
        }
    }
    rows.push(SIGN.count(
        "average_rotations",
        rotations.len(),
        rotations.iter().filter(|turn| depends_on_sign(turn)).count(),
    ));
    rows.push(LIGHT.row("average", rotations.len(), worst(&rotation_by_light_box)));
    for (name, rule) in RULES {
        let (n, outside, growth) = chain(rule);
        rows.push(CHAIN.count(name, n, outside));
        rows.push(GROWTH.row(name, 1, growth));
    }
    // Group rows by promise.
    rows.sort_by_key(|row| order(row.promise));
    rows
}

fn order(of: Promise) -> usize {
    [PAIRS, FLAT, EQUAL, QUARTER, HALF, SIGN, LIGHT, CHAIN, GROWTH]
        .iter()
        .position(|known| (known.case, known.promise) == (of.case, of.promise))
        .unwrap_or(usize::MAX)
}

fn rotations(effort: usize) -> Vec<Quaternion> {
    let mut rng = SplitMix64::new(43);
    (0..100 * effort).map(|_| random_rotation(&mut rng)).collect()
}

/// Random boxes with scales from 1e-12 to 1e12, and neighbors at 1e7.
fn pairs(effort: usize) -> Vec<(Obb, Obb)> {
    let mut rng = SplitMix64::new(44);
    let mut a_box = |scale: f64, shift: f64| Obb {
        center: rng.signed3().map(|x| (3.0 * scale * x + shift) as f32),
        frame: random_rotation(&mut rng).frame(),
        half_extents: rng.signed3().map(|x| (scale * x.abs()) as f32),
    };
    let mut pairs = vec![];
    for _ in 0..20 * effort {
        for (a, b, shift) in
            [(1.0, 1.0, 0.0), (1e-12, 1.0, 0.0), (1e12, 1e-12, 0.0), (1.0, 1e-3, 1e7), (1e-30, 1e-30, 0.0)]
        {
            pairs.push((a_box(a, shift), a_box(b, shift)));
        }
    }
    pairs
}

fn flats(effort: usize) -> Vec<(Obb, Obb)> {
    let mut rng = SplitMix64::new(49);
    let mut pairs = vec![];
    for _ in 0..20 * effort {
        let turn = random_rotation(&mut rng);
        let flat = Obb { center: [0.0; 3], frame: turn.frame(), half_extents: [2.0, 1.0, 0.0] };
        let line = Obb { half_extents: [2.0, 0.0, 0.0], ..flat };
        let crossing = Obb { half_extents: [0.0, 2.0, 0.0], ..flat };
        let other = Obb { center: placed(&turn, [1.0; 3], [0.0; 3], [5.0, 0.0, 0.0]), ..flat };
        let point = Obb { half_extents: [0.0; 3], ..flat };
        pairs.extend([(flat, other), (flat, point), (line, crossing), (line, line), (point, point)]);
    }
    pairs
}

/// Relative growth when a box is merged with itself or with a box inside it.
fn growth(rule: fn(&Obb, &Obb) -> Obb, turn: &Quaternion) -> f64 {
    let outer = Obb { center: [0.0; 3], frame: turn.frame(), half_extents: [4.0, 1.0, 0.25] };
    let inner = Obb { half_extents: [2.0, 0.5, 0.125], ..outer };
    let excess = |child: &Obb| {
        let mut half = rule(&outer, child).half_extents;
        half.sort_by(f32::total_cmp);
        let grown = half.iter().zip([0.25, 1.0, 4.0]).map(|(&half, was)| f64::from(half) - was);
        grown.fold(0.0, f64::max) / 4.0
    };
    excess(&outer).max(excess(&inner))
}

/// Area of the merge of a box and its image rotated about its third axis, relative to the box's area.
fn area_with_rotated(rule: fn(&Obb, &Obb) -> Obb, turn: &Quaternion, half: [f32; 3], angle_rad: f64) -> f64 {
    let a = Obb { center: [0.5, -1.0, 2.0], frame: turn.frame(), half_extents: half };
    let b = Obb { frame: turn.times(Quaternion::from_axis_angle([0.0, 0.0, 1.0], angle_rad)).frame(), ..a };
    rule(&a, &b).area() / a.area()
}

/// Whether averaging with a rotation depends on the sign of its quaternion.
fn depends_on_sign(turn: &Quaternion) -> bool {
    let other = turn.times(Quaternion::from_axis_angle([0.6, 0.0, 0.8], 0.4));
    let bits = |q: Quaternion| [q.w, q.x, q.y, q.z].map(f64::to_bits);
    let mean = |q: Quaternion| bits(merge::average_rotations(*turn, q, [1.0, 1.0]).canonical());
    mean(other) != mean(other.scaled(-1.0))
}

/// Angle by which a weight of a millionth, at 44°, rotates a frame.
fn rotation_by_light_box(turn: &Quaternion) -> f64 {
    let other = turn.times(Quaternion::from_axis_angle([0.6, 0.0, 0.8], 44.0_f64.to_radians()));
    let mean = Quaternion::from_frame(merge::average(turn.frame(), other.frame(), [1e6, 1.0]));
    let left = turn.conjugate().times(mean);
    2.0 * (left.x * left.x + left.y * left.y + left.z * left.z).sqrt().atan2(left.w.abs())
}

/// Number of vertices in a chain of merges, number outside its box, and its area relative to the axis-aligned box.
fn chain(rule: fn(&Obb, &Obb) -> Obb) -> (usize, usize, f64) {
    let mut rng = SplitMix64::new(50);
    let mut vertices: Vec<[f32; 3]> =
        (0..3).map(|_| placed(&Quaternion::IDENTITY, [1.0; 3], [0.0; 3], rng.signed3())).collect();
    let mut all = bound(random_rotation(&mut rng).frame(), vertices.iter().copied());
    for level in 0..30 {
        let (turn, reach) = (random_rotation(&mut rng), 1.2_f64.powi(level));
        let leaf: Vec<_> = (0..3).map(|_| placed(&turn, [reach, 0.1 * reach, 0.0], [0.0; 3], rng.signed3())).collect();
        let child = bound(turn.frame(), leaf.iter().copied());
        vertices.extend(leaf);
        all = if level % 2 == 0 { rule(&all, &child) } else { rule(&child, &all) };
    }
    let outside = vertices.iter().filter(|&&vertex| !exact::contains(&all, vertex)).count();
    let straight = Aabb::from_points(vertices.iter().copied()).area();
    (vertices.len(), outside, all.area() / straight)
}
