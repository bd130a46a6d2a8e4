//! Rays and single triangles compared with exact arithmetic: certain hits are found, certain misses are not hit.
//!
//! Not covered: rays within the margin of an edge, which matter only for closed meshes (`watertight`).

use canted_fixtures::{Mesh, SplitMix64, fan};
use canted_trace::{BaldwinWeber, HIT_ERROR, Kernel, MollerTrumbore, Ray, ScaledRay, Side, TriangleTest, Watertight};

use super::{Oracle, Promise, Row};
use crate::{
    brute,
    exact::{self, Margin, Verdict},
    reference,
};

/// A ray and the corners of a triangle.
pub type Pair = (Ray, [[f32; 3]; 3]);

/// A kernel's answer: `t` in the caller's units, and the side.
type Answer = Option<(f32, Side)>;

fn ask<K: Kernel>((ray, corners): &Pair) -> Answer {
    let scaled = ScaledRay::new(ray)?;
    let hit = K::intersect(&K::prepare(&scaled), &scaled, &K::record(*corners), scaled.t_max)?;
    Some((scaled.caller_t(hit.t), hit.side))
}

/// A kernel by name.
type Routine = (&'static str, fn(&Pair) -> Answer);

const ROUTINES: [Routine; 3] = [
    ("watertight", ask::<Watertight>),
    ("moller trumbore", ask::<MollerTrumbore>),
    ("baldwin weber", ask::<BaldwinWeber>),
];

fn rounded(x: [f64; 3]) -> [f32; 3] {
    x.map(|x| x as f32)
}

/// A triangle of this size around this point, with a height of `thin` times its length.
fn triangle(rng: &mut SplitMix64, size: f64, center: f64, thin: f64) -> [[f32; 3]; 3] {
    let (a, along) = (rng.signed3().map(|x| center + size * x), rng.on_sphere());
    let (by, up) = (rng.unit(), rng.on_sphere());
    let at = |s: f64, h: f64| std::array::from_fn(|k| a[k] + size * (s * along[k] + h * up[k]));
    [rounded(a), rounded(at(1.0, 0.0)), rounded(at(by, thin))]
}

/// A ray from `distance` away towards a point inside or near the triangle.
fn aimed(rng: &mut SplitMix64, corners: &[[f32; 3]; 3], distance: f64) -> Ray {
    let [u, v] = [1.4 * rng.unit() - 0.2, 1.4 * rng.unit() - 0.2];
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let target: [f64; 3] = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
    let away = rng.on_sphere();
    let origin = rounded(std::array::from_fn(|k| target[k] + distance * away[k]));
    Ray::new(origin, rounded(std::array::from_fn(|k| target[k] - f64::from(origin[k]))))
}

/// Kinds of pairs by name.
#[must_use]
pub fn cases(effort: usize) -> Vec<(&'static str, Vec<Pair>)> {
    let n = 400 * effort;
    let mut rng = SplitMix64::new(80);
    let mut case = |name, make: &dyn Fn(&mut SplitMix64) -> Pair| {
        let pairs = (0..n).map(|_| make(&mut rng)).filter(|(ray, _)| ray.direction.iter().any(|&d| d != 0.0));
        (name, pairs.collect::<Vec<_>>())
    };
    let of = |size: f64, center: f64, thin: f64, distance: f64| {
        move |rng: &mut SplitMix64| {
            let corners = triangle(rng, size, center, thin);
            (aimed(rng, &corners, distance), corners)
        }
    };
    let in_plane = |rng: &mut SplitMix64| {
        let corners = triangle(rng, 1.0, 0.0, 0.7);
        let (from, to) = (aimed(rng, &corners, 0.0).origin, aimed(rng, &corners, 0.0).origin);
        let direction: [f32; 3] = std::array::from_fn(|k| to[k] - from[k] + 1e-9 * [1.0f32, -1.0][rng.below(2)]);
        (Ray::new(std::array::from_fn(|k| from[k] - 3.0 * direction[k]), direction), corners)
    };
    let no_area = |rng: &mut SplitMix64| {
        let [a, b, _] = triangle(rng, 1.0, 0.0, 0.5);
        let corners = [[a, b, a], [a, a, a], [a, b, b]][rng.below(3)];
        (aimed(rng, &corners, 2.0), corners)
    };
    let on_boundary = |at_vertex: bool| {
        move |rng: &mut SplitMix64| {
            let corners = triangle(rng, 1.0, 0.0, 0.7);
            let first = rng.below(3);
            let [a, b] = [corners[first], corners[(first + 1) % 3]];
            let along = if at_vertex { 0.0 } else { rng.unit() };
            let away = rng.on_sphere();
            let target: [f64; 3] =
                std::array::from_fn(|k| f64::from(a[k]) + along * (f64::from(b[k]) - f64::from(a[k])));
            let origin = rounded(std::array::from_fn(|k| target[k] + 2.0 * away[k]));
            (Ray::new(origin, rounded(std::array::from_fn(|k| target[k] - f64::from(origin[k])))), corners)
        }
    };
    let of_length = |rng: &mut SplitMix64| {
        let (ray, corners) = of(1.0, 0.0, 0.7, 2.0)(rng);
        let scale = [1e-30, 1e30, 1e-38][rng.below(3)];
        (Ray { direction: ray.direction.map(|d| d * scale), ..ray }, corners)
    };
    vec![
        case("arbitrary triangles", &of(1.0, 0.0, 0.7, 2.0)),
        case("at an edge", &on_boundary(false)),
        case("at a vertex", &on_boundary(true)),
        case("slivers, 1e6 : 1", &of(1.0, 0.0, 1e-6, 2.0)),
        case("slivers, 1e6 : 1, from near", &of(1.0, 0.0, 1e-6, 0.01)),
        case("size 1e-6", &of(1e-6, 0.0, 0.7, 2.0)),
        case("size 1e-6, from 2e-6 away", &of(1e-6, 0.0, 0.7, 2e-6)),
        case("at 1e-20", &of(1e-20, 0.0, 0.7, 2e-20)),
        case("at 1e15", &of(1e15, 0.0, 0.7, 2e15)),
        case("at 1e7", &of(50.0, 1e7, 0.7, 100.0)),
        case("from 1e7 away", &of(10.0, 0.0, 0.7, 1e7)),
        case("denormal coordinates", &of(1e-40, 0.0, 0.7, 2e-40)),
        case("denormal coordinates, from 4e-38 away", &of(1e-40, 0.0, 0.7, 4e-38)),
        case("origin on the triangle", &of(1.0, 0.0, 0.7, 1e-7)),
        case("within 1e-9 of the triangle's plane", &in_plane),
        case("zero area", &no_area),
        case("directions of length 1e-30, 1e-38 and 1e30", &of_length),
    ]
}

/// Error bound of a kernel's triangle vertices.
fn margin(routine: usize, pair: &Pair) -> Margin {
    let margin = reference::margin(&pair.0, &pair.1);
    if routine == 0 {
        return margin;
    }
    // The other kernels' points are off by the hit error on each axis; seen along the ray's axis that doubles, on two axes.
    Margin { across: 2.0 * std::f32::consts::SQRT_2 * margin.along, ..margin }
}

pub(super) fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    for (case, pairs) in cases(effort) {
        let lost = Promise::none("triangle", case, "certain hits are found", Oracle::Exact, "rays");
        let invented = Promise { promise: "certain misses are not hit", ..lost };
        let off = Promise {
            promise: "the hit point lies in the plane",
            bound: 1.0,
            // The bound holds on each of three axes.
            unit: "of √3·HIT_ERROR·(o + v)",
            ..lost
        };
        let answers = ROUTINES.map(|(_, ask)| pairs.iter().map(ask).collect::<Vec<_>>());
        let verdicts = [0, 1].map(|routine| {
            let verdict = |pair: &Pair| exact::verdict(&pair.0, pair.1, &margin(routine, pair));
            pairs.iter().map(verdict).collect::<Vec<_>>()
        });
        for (i, (name, _)) in ROUTINES.iter().enumerate() {
            // Only the watertight kernel finds all certain hits; the others reject ill-conditioned triangles.
            let promise = if i == 0 { lost } else { lost.reported() };
            let [n, n_lost] = certain(&verdicts[i.min(1)], Verdict::Pierced, &answers[i], |answer| answer.is_none());
            rows.push(promise.count_certain(*name, n, n_lost));
        }
        for (i, (name, _)) in ROUTINES.iter().enumerate() {
            let [n, n_invented] = certain(&verdicts[i.min(1)], Verdict::Missed, &answers[i], |answer| answer.is_some());
            rows.push(invented.count_certain(*name, n, n_invented));
        }
        for (i, (name, _)) in ROUTINES.iter().enumerate() {
            let share = |(pair, answer): (&Pair, &Answer)| answer.map_or(0.0, |(t, _)| of_promised(pair, t));
            let worst = pairs.iter().zip(&answers[i]).map(share).fold(0.0, f64::max);
            let n_hits = answers[i].iter().flatten().count();
            let promise = if n_hits == 0 { off.reported() } else { off };
            rows.push(promise.row(*name, n_hits, worst));
        }
    }
    [rows, ties(), hubs()].concat()
}

/// Number of rays with this verdict, and of those with a wrong answer.
fn certain(verdicts: &[Verdict], of: Verdict, answers: &[Answer], is_wrong: fn(&Answer) -> bool) -> [usize; 2] {
    let answers = || verdicts.iter().zip(answers).filter(|(verdict, _)| **verdict == of).map(|(_, answer)| answer);
    [answers().count(), answers().filter(|answer| is_wrong(answer)).count()]
}

/// Distance of the point at `t` from the plane, relative to the bound.
fn of_promised((ray, corners): &Pair, t: f32) -> f64 {
    let reach = |points: &[f32]| points.iter().fold(0.0f64, |all, &x| all.max(f64::from(x).abs()));
    let scale = reach(&ray.origin) + reach(corners.as_flattened());
    let promised = 3.0f64.sqrt() * f64::from(HIT_ERROR) * scale + f64::from(f32::MIN_POSITIVE);
    // A degenerate triangle has no plane; the verdict says whether it may be hit.
    Some(exact::plane_distance(ray, t, *corners)).filter(|distance| distance.is_finite()).unwrap_or(0.0) / promised
}

/// Coplanar copies in either order, some flipped.
fn ties() -> Vec<Row> {
    const TIES: Promise = Promise::none(
        "triangle",
        "coplanar copies, some flipped",
        "the lowest index wins, on either side",
        Oracle::Known,
        "rays",
    );
    let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
    let mut mesh = Mesh { positions: corners.to_vec(), triangles: vec![] };
    mesh.triangles = (0..20).map(|i| if i % 2 == 0 { [0, 1, 2] } else { [0, 2, 1] }).collect();
    let rays = [[1.0, 1.0, 0.0], [1.0, 1.0, 2.0], [0.5, 0.25, 0.0]].map(|origin| {
        let down = if origin[2] > 1.0 { -1.0 } else { 1.0 };
        Ray::new(origin, [0.0, 0.0, down])
    });
    let row = |((name, _), test): (&Routine, TriangleTest)| {
        let closest = brute::of_mesh(&mesh, test);
        let is_other = |ray: &&Ray| {
            let wanted = if ray.direction[2] < 0.0 { Side::Front } else { Side::Back };
            closest(ray).is_none_or(|hit| hit.primitive.0 != 0 || hit.side != wanted)
        };
        TIES.count(*name, rays.len(), rays.iter().filter(is_other).count())
    };
    ROUTINES.iter().zip(TriangleTest::ALL).map(row).collect()
}

/// Rays at the shared vertex of closed fans.
fn hubs() -> Vec<Row> {
    const HUBS: Promise = Promise::none(
        "triangle",
        "at the shared vertex and the edges of a closed fan",
        "at least one triangle is hit",
        Oracle::Known,
        "rays leak",
    );
    let mut rng = SplitMix64::new(81);
    let (mut n, mut slipped) = (0, 0);
    for spokes in 3..40 {
        let mesh = fan(spokes).off_axis();
        let closest = brute::of_mesh(&mesh, TriangleTest::Watertight);
        let hub = mesh.positions[0].map(f64::from);
        for i in 0..20 {
            let corner = mesh.positions[1 + rng.below(spokes as usize)].map(f64::from);
            let along = if i % 2 == 0 { 0.0 } else { 0.9 * rng.unit() };
            let target: [f64; 3] = std::array::from_fn(|k| hub[k] + along * (corner[k] - hub[k]));
            // Above the cone around the rotated z axis: any ray from there to the target hits the fan.
            let axis = canted_fixtures::Rotation::off_axis().apply([0.0, 0.0, 1.0]);
            let stray = rng.signed3();
            let origin = rounded(std::array::from_fn(|k| hub[k] + 2.0 * axis[k] + 0.2 * stray[k]));
            let ray = Ray::new(origin, rounded(std::array::from_fn(|k| target[k] - f64::from(origin[k]))));
            slipped += usize::from(closest(&ray).is_none());
            n += 1;
        }
    }
    vec![HUBS.count("watertight", n, slipped)]
}
