//! Ray-box tests compared with exact fractions: a box that contains any point of the ray is never rejected. Alone, and as axis-aligned
//! boxes in eight-wide nodes on every available SIMD path.
//!
//! A derived pad makes boxes slightly larger; the number of misses that pass is reported, not bounded. Not covered: rays of
//! primitives whose hits have an error (the proof in `canted_trace`'s `slab`, tested there). Oriented boxes in wide nodes are covered by
//! `hierarchy`: their test has no public entry point.

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{Intersect, Ray, ScaledRay, ray_aabb, ray_obb, with_stack};
use canted_wide::{Order, SimdPath, WideBvh};

use super::{Oracle, Promise, Row};
use crate::{clouds::random_rotation, exact};

/// A ray and a box.
pub type Pair = (Ray, Obb);

/// Pairs of one kind.
pub struct Case {
    /// The kind.
    pub name: &'static str,
    /// The pairs.
    pub pairs: Vec<Pair>,
}

fn signed_f32(rng: &mut SplitMix64, scale: f64) -> [f32; 3] {
    rng.signed3().map(|x| (scale * x) as f32)
}

/// A point of a box: a corner, a point on an edge or a face, or an inner point.
fn target(rng: &mut SplitMix64, obb: &Obb) -> [f64; 3] {
    let q: [f64; 3] = std::array::from_fn(|_| [-1.0, 1.0, rng.signed()][rng.below(3)]);
    std::array::from_fn(|k| {
        let along = |a: usize| f64::from(obb.frame[a][k]) * f64::from(obb.half_extents[a]) * q[a];
        f64::from(obb.center[k]) + along(0) + along(1) + along(2)
    })
}

/// A rounded ray from `distance` away towards a point of the box.
fn aimed(rng: &mut SplitMix64, obb: &Obb, distance: f64) -> Ray {
    let (target, away) = (target(rng, obb), rng.on_sphere());
    let origin: [f32; 3] = std::array::from_fn(|k| (target[k] + distance * away[k]) as f32);
    Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
}

fn oriented(rng: &mut SplitMix64, scale: f64, shift: f32) -> Obb {
    let center = signed_f32(rng, scale).map(|x| x + shift);
    Obb { center, frame: random_rotation(rng).frame(), half_extents: signed_f32(rng, scale).map(f32::abs) }
}

/// Integer coordinates from -4 to 4: faces, edges and corners are hit exactly.
fn on_lattice(rng: &mut SplitMix64) -> Pair {
    let mut lattice_point = || std::array::from_fn(|_| rng.below(9) as f32 - 4.0);
    let (center, origin): ([f32; 3], [f32; 3]) = (lattice_point(), lattice_point());
    let half = std::array::from_fn(|_| rng.below(3) as f32);
    let mut direction = [[0.0, -0.0][rng.below(2)]; 3];
    direction[rng.below(3)] = [1.0, -1.0, 2.0, -0.5][rng.below(4)];
    if rng.below(3) == 0 {
        direction[rng.below(3)] = [1.0, -1.0][rng.below(2)];
    }
    (Ray::new(origin, direction), Obb { center, frame: Obb::IDENTITY_FRAME, half_extents: half })
}

/// All kinds of pairs.
#[must_use]
pub fn cases(effort: usize) -> Vec<Case> {
    let n = 400 * effort;
    let mut rng = SplitMix64::new(70);
    let mut case = |name, make: &dyn Fn(&mut SplitMix64) -> Pair| Case {
        name,
        pairs: (0..n).map(|_| make(&mut rng)).filter(|(ray, _)| ray.direction.iter().any(|&d| d != 0.0)).collect(),
    };
    let at = |distance: f64| move |rng: &mut SplitMix64, obb: Obb| (aimed(rng, &obb, distance), obb);
    vec![
        case("axis-parallel, in faces, edges, corners; flat boxes and points", &on_lattice),
        case("from far, at corners and edges, oriented", &|rng| {
            let obb = oriented(rng, 1.0, 0.0);
            at(1e3)(rng, obb)
        }),
        case("at 1e7, oriented", &|rng| {
            let obb = oriented(rng, 10.0, 1e7);
            at(30.0)(rng, obb)
        }),
        case("from 1e7 away, box of size 1", &|rng| {
            let obb = oriented(rng, 1.0, 0.0);
            at(1e7)(rng, obb)
        }),
        case("origin inside or on the box", &|rng| {
            let obb = oriented(rng, 1.0, 0.0);
            let start = target(rng, &obb);
            (Ray::new(start.map(|x| x as f32), signed_f32(rng, 1.0)), obb)
        }),
        case("flat and needle-like, oriented", &|rng| {
            let mut obb = oriented(rng, 1.0, 0.0);
            (0..3).filter(|_| rng.below(2) == 0).for_each(|k| obb.half_extents[k] *= [0.0, 1e-6, 1e-20][k]);
            at(2.0)(rng, obb)
        }),
        case("size 1e-19, coordinates near 1", &|rng| {
            let obb = Obb { half_extents: signed_f32(rng, 1e-19).map(f32::abs), ..oriented(rng, 1.0, 0.0) };
            at(1.0)(rng, obb)
        }),
        case("all at 1e-19", &|rng| {
            let obb = oriented(rng, 1e-19, 0.0);
            at(1e-19)(rng, obb)
        }),
        case("all at 1e15", &|rng| {
            let obb = oriented(rng, 1e15, 0.0);
            at(1e15)(rng, obb)
        }),
        case("within 1e-9 of an oriented axis", &|rng| {
            let obb = oriented(rng, 1.0, 0.0);
            let (along, stray) = (obb.frame[rng.below(3)], signed_f32(rng, 1e-9));
            let start = aimed(rng, &obb, 0.0).origin;
            let direction = std::array::from_fn(|k| along[k] + stray[k]);
            (Ray::new(std::array::from_fn(|k| start[k] - 3.0 * direction[k]), direction), obb)
        }),
        case("directions of length 1e-30 and 1e30", &|rng| {
            let obb = oriented(rng, 1.0, 0.0);
            let (ray, scale) = (aimed(rng, &obb, 3.0), [1e-30, 1e30][rng.below(2)]);
            (Ray { direction: ray.direction.map(|d| d * scale), ..ray }, obb)
        }),
        case("denormal components, and denormal directions", &|rng| {
            let obb = oriented(rng, 1.0, 0.0);
            let ray = aimed(rng, &obb, 3.0);
            let scale = if rng.below(2) == 0 { [1.0, 1e-39, 1e-39] } else { [1e-39; 3] };
            (Ray { direction: [0, 1, 2].map(|k| ray.direction[k] * scale[k]), ..ray }, obb)
        }),
        case("skewed frames", &|rng| {
            let mut obb = oriented(rng, 1.0, 0.0);
            obb.frame[1] = [0, 1, 2].map(|k| obb.frame[1][k] + 0.7 * obb.frame[0][k]);
            at(3.0)(rng, obb)
        }),
        case("intervals that begin or end on a face", &|rng| {
            let (ray, obb) = on_lattice(rng);
            let end = [0.0, 1.0, 2.0, 3.0, 4.0][rng.below(5)];
            match rng.below(3) {
                0 => (Ray { t_max: end, ..ray }, obb),
                1 => (Ray { t_min: end, ..ray }, obb),
                _ => (Ray { t_min: end, t_max: end, ..ray }, obb),
            }
        }),
    ]
}

pub(super) fn rows(effort: usize) -> Vec<Row> {
    let mut rows = vec![];
    for Case { name, pairs } in cases(effort) {
        let none_lost = Promise::none("box", name, "no ray that hits the box is rejected", Oracle::Exact, "rays lost");
        let reported =
            Promise { promise: "misses accepted because of padding", unit: "of all misses", ..none_lost }.reported();
        let straight = |obb: &Obb| obb.frame == Obb::IDENTITY_FRAME;
        type Enters = fn(&Pair) -> bool;
        let routines: [(&str, Enters); 2] = [
            ("ray_obb", |(ray, obb)| ray_obb(ray, obb).is_some()),
            ("ray_aabb", |(ray, obb)| ray_aabb(ray, &obb.aabb()).is_some()),
        ];
        let verdicts: Vec<bool> = pairs.iter().map(|(ray, obb)| exact::intersects_box(ray, obb)).collect();
        let n_missed = verdicts.iter().filter(|&&hits| !hits).count();
        // An oriented box lies in its axis-aligned bounds: a ray that hits it must enter those, too.
        for (routine, enters) in routines {
            let lost = pairs.iter().zip(&verdicts).filter(|&(pair, &hits)| hits && !enters(pair)).count();
            rows.push(none_lost.count(routine, pairs.len() - n_missed, lost));
        }
        let all_straight = pairs.iter().all(|(_, obb)| straight(obb));
        for (routine, enters) in routines.into_iter().take(if all_straight { 2 } else { 1 }) {
            let entered = pairs.iter().zip(&verdicts).filter(|&(pair, &hits)| !hits && enters(pair)).count();
            rows.push(reported.share(routine, n_missed, entered));
        }
    }
    [rows, same(effort)].concat()
}

/// Rays that differ only in the sign of zeros or by a power of two in the direction, and invalid rays.
fn same(effort: usize) -> Vec<Row> {
    const ZEROS: Promise =
        Promise::none("box", "-0.0 in place of +0.0", "the same interval, bit for bit", Oracle::Same, "rays differ");
    const LENGTH: Promise = Promise::none(
        "box",
        "directions times 2^-90 to 2^90",
        "the same interval, scaled, bit for bit",
        Oracle::Same,
        "rays differ",
    );
    const NONE: Promise =
        Promise::none("box", "inverted interval, NaN, zero direction", "a miss", Oracle::Known, "rays that enter");
    let mut rng = SplitMix64::new(71);
    let lattice: Vec<Pair> = (0..400 * effort).map(|_| on_lattice(&mut rng)).collect();
    let with_zero = |(ray, obb): &Pair, zero: f32| {
        let direction = ray.direction.map(|d| if d == 0.0 { zero } else { d });
        let ray = Ray { direction, ..*ray };
        (ray_obb(&ray, obb), ray_aabb(&ray, &obb.aabb()))
    };
    let differ = lattice.iter().filter(|pair| with_zero(pair, 0.0) != with_zero(pair, -0.0)).count();
    let any: Vec<Pair> = (0..200 * effort)
        .map(|_| {
            let obb = oriented(&mut rng, 1.0, 0.0);
            (aimed(&mut rng, &obb, 3.0), obb)
        })
        .collect();
    let of_length = |(ray, obb): &Pair, exponent: i32| {
        let scale = 2.0f32.powi(exponent);
        let scaled = Ray { direction: ray.direction.map(|d| d * scale), ..*ray };
        ray_obb(&scaled, obb).map(|(near, far)| (near * scale, far * scale))
    };
    let lengths = [-90, -45, 45, 90];
    let is_other = |pair: &&Pair| lengths.iter().filter(|&&e| of_length(pair, e) != of_length(pair, 0)).count() > 0;
    let differ_in_length = any.iter().filter(is_other).count();
    let (ray, obb) = any[0];
    let none = [
        Ray { t_min: 2.0, t_max: 1.0, ..ray },
        Ray { t_min: f32::NAN, ..ray },
        Ray { t_max: f32::NAN, ..ray },
        Ray { direction: [0.0, -0.0, 0.0], ..ray },
        Ray { direction: [f32::NAN, 1.0, 0.0], ..ray },
        Ray { direction: [f32::INFINITY, 1.0, 0.0], ..ray },
        Ray { origin: [f32::NAN; 3], ..ray },
    ];
    let enters = none.iter().filter(|ray| ray_obb(ray, &obb).is_some() || ray_aabb(ray, &obb.aabb()).is_some()).count();
    vec![
        ZEROS.count("ray_obb, ray_aabb", lattice.len(), differ),
        LENGTH.count("ray_obb", any.len(), differ_in_length),
        NONE.count("ray_obb, ray_aabb", none.len(), enters),
    ]
}

/// Boxes of one BVH, which fit one node.
const LANES: usize = 8;

/// Every row of a box in a wide node.
pub(super) fn rows_of_nodes(effort: usize) -> Vec<Row> {
    let paths = || SimdPath::ALL.into_iter().filter(|path| path.is_available());
    let mut rows = vec![];
    for Case { name, pairs } in cases(effort) {
        let lost = Promise::none(
            "box in an eight-wide node",
            name,
            "no ray that hits the box is rejected",
            Oracle::Exact,
            "rays lost",
        );
        let reported =
            Promise { promise: "misses accepted because of padding", unit: "of all misses", ..lost }.reported();
        // A product and a sum may be rounded once or twice (`canted_wide`'s `simd`); padding covers both, and paths may differ.
        let same = Promise {
            promise: "rays that enter other boxes than on the scalar path (fused rounding)",
            oracle: Oracle::Same,
            unit: "of all rays",
            ..lost
        }
        .reported();
        // An oriented box lies in its axis-aligned bounds: a ray that hits it must enter those.
        let verdicts: Vec<bool> = pairs.iter().map(|(ray, obb)| exact::intersects_box(ray, obb)).collect();
        let n_hit = verdicts.iter().filter(|&&hits| hits).count();
        let straight = pairs.iter().all(|(_, obb)| obb.frame == canted_obb::Obb::IDENTITY_FRAME);
        let wants = entered(&pairs, SimdPath::Scalar);
        let mut by_promise: [Vec<Row>; 3] = Default::default();
        for path in paths() {
            let found = entered(&pairs, path);
            let own = |hits: bool, enters: bool| {
                let is_so =
                    |(i, among): (usize, &Vec<usize>)| verdicts[i] == hits && among.contains(&(i % LANES)) == enters;
                found.iter().enumerate().filter(|&pair| is_so(pair)).count()
            };
            by_promise[0].push(lost.count(path.name(), n_hit, own(true, false)));
            if straight {
                by_promise[1].push(reported.share(path.name(), pairs.len() - n_hit, own(false, true)));
            }
            if path != SimdPath::Scalar {
                let n_other = found.iter().zip(&wants).filter(|(found, wanted)| found != wanted).count();
                by_promise[2].push(same.share(path.name(), pairs.len(), n_other));
            }
        }
        rows.extend(by_promise.concat());
    }
    rows
}

/// For each ray the indices of the boxes of its node that it enters, ascending; its own box keeps its index among the pairs.
fn entered(pairs: &[Pair], path: SimdPath) -> Vec<Vec<usize>> {
    let of_node = |pairs: &[Pair]| {
        let boxes: Vec<Aabb> = pairs.iter().map(|(_, obb)| obb.aabb()).collect();
        let tree = WideBvh::over(boxes).expect("boxes are finite").with_path(path);
        let of_ray = |(ray, _): &Pair| {
            let mut entered = vec![];
            if let Some(ray) = ScaledRay::new(ray) {
                let mut enter = |number: PrimId, t_max| {
                    entered.push(number.index());
                    t_max
                };
                with_stack(tree.stack_len(), |stack| tree.traverse_scaled(&ray, 0.0, Order::Any, stack, &mut enter));
            }
            entered.sort_unstable();
            entered
        };
        pairs.iter().map(of_ray).collect::<Vec<_>>()
    };
    pairs.chunks(LANES).flat_map(of_node).collect()
}
