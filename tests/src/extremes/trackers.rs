//! Bugs reported to other libraries, by number of the thread: our results and those of the libraries.
//!
//! Inputs follow the text of the reports; attached files are replaced by the shape that the report describes.

use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Mesh, Rotation, SplitMix64, coplanar_quads, displaced_icosphere, icosphere, thin_box};
use canted_obb::{
    Affine,
    vector::{cross, dot, sub},
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, InstanceId, Intersect, Query, Ray, Side, TriangleTest};
use canted_wide::TriangleBvh;

use super::{
    Oracle, Promise, Row,
    hierarchy::{self, Certain},
};
use crate::{
    brute,
    closed::{Closed, rays},
    tracers::{Guarantee, Method, Tracer},
};

/// A bug report and its rows.
pub struct Tracker {
    /// Library and number; also the name of the test.
    pub name: &'static str,
    /// The rows of each tracer on the report's input.
    pub rows: fn(&[Method]) -> Vec<Row>,
}

/// All reports.
pub const TRACKERS: [Tracker; 9] = [
    Tracker { name: "embree_174", rows: embree_174 },
    Tracker { name: "embree_181", rows: embree_181 },
    Tracker { name: "embree_188", rows: embree_188 },
    Tracker { name: "embree_387", rows: embree_387 },
    Tracker { name: "tinybvh_277", rows: tinybvh_277 },
    Tracker { name: "tinybvh_282", rows: tinybvh_282 },
    Tracker { name: "tinybvh_283", rows: tinybvh_283 },
    Tracker { name: "tinybvh_286", rows: tinybvh_286 },
    Tracker { name: "parry_444", rows: parry_444 },
];

/// One row for each tracer: rays, and failed rays.
fn each<'a>(
    promise: Promise,
    methods: impl IntoIterator<Item = &'a Method>,
    failed: impl Fn(&Method) -> (usize, usize),
) -> Vec<Row> {
    let row = |method: &Method| {
        let ((n, n_failed), n_cut) = method.with_cuts(|| failed(method));
        Row { is_peer: method.guarantee == Guarantee::Peer, n_cut, ..promise.count_certain(&method.name, n, n_failed) }
    };
    methods.into_iter().map(row).collect()
}

/// Number of rays, and of rays that miss or are not occluded.
fn slipped(method: &Method, mesh: &Mesh, rays: &[Ray]) -> (usize, usize) {
    let tracer = method.of(mesh);
    let (hits, occluded) = (tracer.closest(rays), tracer.occluded(rays));
    (rays.len(), hits.iter().zip(occluded).filter(|(hit, occluded)| hit.is_none() || !occluded).count())
}

fn ball(mesh: Mesh) -> Closed {
    Closed { name: "sphere", mesh, inner_point: [0.0; 3], clearance: [0.4; 3], is_simple: true }
}

fn rounded(x: [f64; 3]) -> [f32; 3] {
    x.map(|x| x as f32)
}

/// A closed scan has holes one pixel large.
fn parry_444(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "parry #444",
        "a closed displaced mesh of 5,120 triangles, from outside, at its edges",
        "no ray leaks in",
        Oracle::Known,
        "rays",
    );
    let ball = ball(displaced_icosphere(3, 4));
    let from_outside: Vec<Ray> =
        rays(&ball.mesh, &ball, &Affine::IDENTITY, 8_000, 444).into_iter().skip(1).step_by(2).collect();
    each(PROMISE, methods, |method| slipped(method, &ball.mesh, &from_outside))
}

/// In robust mode, rays from inside leave a closed mesh through a vertex.
pub(super) fn embree_174(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "Embree #174",
        "from inside a closed mesh, at its vertices",
        "no ray leaks out",
        Oracle::Known,
        "rays",
    );
    let ball = ball(displaced_icosphere(3, 3));
    let mut rng = SplitMix64::new(174);
    let mut at_vertex = |vertex: &[f32; 3]| {
        let origin: [f32; 3] = if rng.below(2) == 0 { [0.0; 3] } else { rounded(rng.signed3().map(|x| 0.3 * x)) };
        Ray::new(origin, std::array::from_fn(|k| vertex[k] - origin[k]))
    };
    let rays: Vec<Ray> = ball.mesh.positions.iter().map(&mut at_vertex).collect();
    each(PROMISE, methods, |method| slipped(method, &ball.mesh, &rays))
}

/// Positions of a tube's rings of vertices along its axis; both ends are open.
const RINGS: [f64; 3] = [-20.0, 0.0, 20.0];

/// Number of sides of a tube.
const SIDES: u32 = 12;

/// Walls of nested tubes, the k-th of radius `k + 1`, not axis-parallel.
fn tubes(n: u32) -> Mesh {
    let (mut mesh, turn) = (Mesh::default(), Rotation::off_axis());
    for k in 0..n {
        let first = SIDES * 3 * k;
        for side in 0..SIDES {
            let (sin, cos) = canted_fixtures::sin_cos(std::f64::consts::TAU * f64::from(side) / f64::from(SIDES));
            let radius = f64::from(k + 1);
            mesh.positions.extend(RINGS.map(|z| rounded(turn.apply([radius * cos, radius * sin, z]))));
            let [a, b] = [first + 3 * side, first + 3 * ((side + 1) % SIDES)];
            for ring in 0..2 {
                let [p, q] = [a + ring, b + ring];
                mesh.triangles.extend([[p, q, q + 1], [p, q + 1, p + 1]]);
            }
        }
    }
    mesh
}

/// Ten nested tubes: a ray from one tube at a vertex of the next passes it and hits a later one.
pub(super) fn embree_181(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "Embree #181",
        "nested tubes: from one to a vertex or edge of the next",
        "the next tube is hit",
        Oracle::Known,
        "rays",
    );
    let (mesh, turn) = (tubes(10), Rotation::off_axis());
    let mut rng = SplitMix64::new(181);
    let mut asked: Vec<(Ray, u32)> = vec![];
    for tube in 1..10u32 {
        for i in 0..120 {
            // A vertex of the middle ring, or a point on an edge along the tube.
            let middle = (SIDES * 3 * tube) as usize + 3 * (i % SIDES as usize) + 1;
            let [vertex, end] = [middle, middle + 1].map(|index| mesh.positions[index].map(f64::from));
            let along = if i < 2 * SIDES as usize { 0.0 } else { 0.9 * rng.unit() };
            let target: [f64; 3] = std::array::from_fn(|k| vertex[k] + along * (end[k] - vertex[k]));
            let axis = turn.apply([0.0, 0.0, 1.0]);
            let height: f64 = (0..3).map(|k| axis[k] * target[k]).sum();
            // Outside the previous tube at any angle: its corners are closer to the axis.
            let share = (f64::from(tube) + 0.3) / f64::from(tube + 1);
            let origin = rounded(std::array::from_fn(|k| {
                height * axis[k] * (1.0 - share) + share * target[k] + 0.1 * rng.signed() * axis[k]
            }));
            let direction = rounded(std::array::from_fn(|k| target[k] - f64::from(origin[k])));
            asked.push((Ray::new(origin, direction), tube));
        }
    }
    let rays: Vec<Ray> = asked.iter().map(|&(ray, _)| ray).collect();
    each(PROMISE, methods, |method| {
        let hits = method.of(&mesh).closest(&rays);
        let is_other = |(hit, (_, tube)): &(&Option<Hit>, &(Ray, u32))| {
            hit.is_none_or(|hit| hit.primitive.0 / (4 * SIDES) != *tube)
        };
        (rays.len(), hits.iter().zip(&asked).filter(is_other).count())
    })
}

/// All hits of a ray through an edge or vertex count the surface twice.
///
/// Devices are not tested: they return only first hits, with an error larger than an edge.
pub(super) fn embree_188(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "Embree #188",
        "through a convex mesh at edges and vertices; peers continue from each hit",
        "one crossing inward, one outward",
        Oracle::Known,
        "rays",
    );
    let ball = ball(icosphere(3));
    let through: Vec<Ray> = rays(&ball.mesh, &ball, &Affine::IDENTITY, 2_000, 188)
        .into_iter()
        .enumerate()
        // The second ray of each pair starts outside and passes through the edge to a point inside.
        .filter_map(|(i, ray)| (i % 2 == 1).then_some(ray))
        .collect();
    let asked = methods.iter().filter(|method| !matches!(method.guarantee, Guarantee::Device(_)));
    each(PROMISE, asked, |method| {
        let tracer = method.of(&ball.mesh);
        let is_other = |ray: &&Ray| {
            let crossings = tracer.crossings(ray).unwrap_or_else(|| walked(tracer.as_ref(), &ball.mesh, ray));
            crossings.iter().map(|hit| hit.side).ne([Side::Front, Side::Back])
        };
        (through.len(), through.iter().filter(is_other).count())
    })
}

/// Hits found by a caller that continues just behind the last hit; more than two are wrong.
fn walked(tracer: &dyn Tracer, mesh: &Mesh, ray: &Ray) -> Vec<Hit> {
    let (mut rest, mut hits) = (*ray, vec![]);
    while hits.len() < 3 {
        let Some(hit) = tracer.closest(&[rest])[0] else { break };
        let [a, b, c] = mesh.corners(hit.primitive.index());
        let along = dot(cross(sub(b, a), sub(c, a)), ray.direction.map(f64::from));
        hits.push(Hit { side: if along < 0.0 { Side::Front } else { Side::Back }, ..hit });
        rest.t_min = hit.t.next_up();
    }
    hits
}

/// A skinny triangle, edges of 11.2, 9.7 and about 1.5, half a degree from the ray: a hit at a wrong distance.
pub(super) fn embree_387(methods: &[Method]) -> Vec<Row> {
    const PIERCED: Promise = Promise::none(
        "Embree #387",
        "a skinny triangle within a degree of the ray, 600 away",
        hierarchy::PIERCED,
        Oracle::Exact,
        "rays",
    );
    const MISSED: Promise = Promise { promise: hierarchy::MISSED, ..PIERCED };
    let mut rng = SplitMix64::new(387);
    let mut meshes = vec![];
    for _ in 0..12 {
        let (along, center) = (rng.on_sphere(), rng.signed3().map(|x| 300.0 * x));
        let across = loop {
            let other = rng.on_sphere();
            let share: f64 = (0..3).map(|k| other[k] * along[k]).sum();
            let rest: [f64; 3] = std::array::from_fn(|k| other[k] - share * along[k]);
            let length = rest.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.1 {
                break rest.map(|x| x / length);
            }
        };
        let at = |s: f64, h: f64| rounded(std::array::from_fn(|k| center[k] + s * along[k] + h * across[k]));
        let positions = vec![at(0.0, 0.0), at(11.2, 0.0), at(9.7, 0.3)];
        let normal: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            along[i] * across[j] - along[j] * across[i]
        });
        let mut ray = || {
            let (s, h) = (14.0 * rng.unit() - 1.0, 0.8 * rng.unit() - 0.3);
            let (turn, tilt) = (std::f64::consts::TAU * rng.unit(), 0.017 * rng.signed());
            let (sin, cos) = canted_fixtures::sin_cos(turn);
            let target: [f64; 3] = std::array::from_fn(|k| center[k] + s * along[k] + h * across[k]);
            let heading: [f64; 3] = std::array::from_fn(|k| cos * along[k] + sin * across[k] + tilt * normal[k]);
            let distance = 600.0 * rng.unit();
            let origin = rounded(std::array::from_fn(|k| target[k] - distance * heading[k]));
            Ray::new(origin, rounded(std::array::from_fn(|k| target[k] - f64::from(origin[k]))))
        };
        let rays: Vec<Ray> = (0..60).map(|_| ray()).collect();
        meshes.push((Mesh { positions, triangles: vec![[0, 1, 2]] }, rays));
    }
    let counted = |promise, of: fn(&Certain) -> [usize; 2]| {
        each(promise, methods, |method| {
            let counts = meshes.iter().map(|(mesh, rays)| of(&Certain::of_method(method, mesh, rays)));
            counts.fold((0, 0), |(n, n_failed), [more, more_failed]| (n + more, n_failed + more_failed))
        })
    };
    [counted(PIERCED, |certain| certain.pierced), counted(MISSED, |certain| certain.missed)].concat()
}

/// Accepts hits of one instance, and records every `t` that it receives.
struct Only(InstanceId, Vec<f32>);

impl Query for Only {
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.1.push(hit.t);
        hit.instance == self.0
    }
}

/// Plates at z = 0, 8 and 16; the second is scaled and the third mirrored.
fn plates() -> [(Affine, f32); 3] {
    [(1.0, 0.0), (64.0, 8.0), (-4.0, 16.0)]
        .map(|(scale, z): (f32, f32)| (Affine::scale([scale; 3]).then(&Affine::translation([0.0, 0.0, z])), z))
}

/// Rays through all plates, the index of one plate, ray intervals, and the `t` of that plate's hit in each.
fn through_plates() -> Vec<(Ray, usize, Option<f32>)> {
    let mut asked = vec![];
    for (x, y) in [(0.0, 0.0), (0.125, -0.25), (-0.375, 0.375)] {
        for length in [1.0f32, -0.0078125, 1024.0] {
            let start = if length > 0.0 { -4.0 } else { 20.0 };
            let ray = Ray::new([x, y, start], [0.0, -0.0, length]);
            for (plate, (_, z)) in plates().into_iter().enumerate() {
                let t = (z - start) / length;
                let intervals = [
                    (0.0, f32::INFINITY, Some(t)),
                    (t, t, Some(t)),
                    (0.0, t.next_down(), None),
                    (t.next_up(), f32::INFINITY, None),
                ];
                asked.extend(intervals.map(|(t_min, t_max, want)| (Ray { t_min, t_max, ..ray }, plate, want)));
            }
        }
    }
    asked
}

/// Between the top and a bottom level the ray's interval and the queried instance are lost.
///
/// Peers have no such query: each plate is traced alone, under its transform if they support instances.
pub(super) fn tinybvh_277(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "tinybvh #277",
        "two levels: interval and instance, also axis-parallel; peers: one plate at a time",
        "the query sees only its own interval and instance",
        Oracle::Known,
        "rays",
    );
    fn of_levels<B: Intersect>(blas: B, name: &str) -> Row {
        let instances = plates().map(|(placement, _)| Instance::new(0, placement));
        let tlas = Tlas::new(vec![blas], &instances, TopConfig::default()).expect("scales are invertible");
        let is_wrong = |(ray, plate, want): &&(Ray, usize, Option<f32>)| {
            let only = || Only(InstanceId(u32::try_from(*plate).expect("three plates")), vec![]);
            let mut query = only();
            let hit = tlas.closest_hit_with(ray, &mut query).map(|hit| (hit.t, hit.instance));
            let seen_beyond = query.1.iter().any(|&t| !(ray.t_min <= t && t <= ray.t_max));
            let agrees = tlas.occluded_with(ray, &mut only()) == hit.is_some();
            hit != want.map(|t| (t, query.0)) || seen_beyond || !agrees
        };
        let asked = through_plates();
        PROMISE.count(name, asked.len(), asked.iter().filter(is_wrong).count())
    }
    let plate = thin_box(0.0);
    let binary = Bvh2::build(&plate.positions, &plate.triangles, &Bvh2Config::default());
    let wide = TriangleBvh::build(&plate.positions, &plate.triangles);
    let mut rows = vec![
        of_levels(binary.expect("fixtures are valid"), "two-level binary"),
        of_levels(wide.expect("fixtures are valid"), "two-level wide"),
    ];
    let peers = methods.iter().filter(|method| method.guarantee == Guarantee::Peer);
    rows.extend(each(PROMISE, peers, |method| {
        let tracers = plates().map(|(placement, _)| (method.make)(&plate, &placement));
        let asked = through_plates();
        let is_wrong = |(ray, plate, want): &&(Ray, usize, Option<f32>)| {
            let (hits, occluded) = (tracers[*plate].closest(&[*ray]), tracers[*plate].occluded(&[*ray]));
            hits[0].map(|hit| hit.t) != *want || occluded[0] != want.is_some()
        };
        (asked.len(), asked.iter().filter(is_wrong).count())
    }));
    rows
}

/// Axis-parallel rays in both directions through each vertex, with zeros of this sign.
fn along_axes(mesh: &Mesh, zero: f32) -> Vec<Ray> {
    let [min, max] = mesh.bounds();
    let mut rays = vec![];
    for position in &mesh.positions {
        for axis in 0..3 {
            for (from, sign) in [(min[axis] - 1.0, 1.0), (max[axis] + 1.0, -1.0)] {
                let (mut origin, mut direction) = (*position, [zero; 3]);
                (origin[axis], direction[axis]) = (from, sign);
                rays.push(Ray::new(origin, direction));
            }
        }
    }
    rays
}

/// Axis-parallel cubes whose coordinates are not powers of two.
fn cubes() -> Mesh {
    let cube = thin_box(1.0);
    let mut mesh = Mesh::default();
    for i in 0..8u8 {
        let first = u32::from(i) * 8;
        let corner = |p: &[f32; 3]| std::array::from_fn(|k| 0.1 * p[k] + 0.3 * f32::from(i >> k & 1));
        mesh.positions.extend(cube.positions.iter().map(corner));
        mesh.triangles.extend(cube.triangles.iter().map(|t| t.map(|index| index + first)));
    }
    mesh
}

/// A negative zero in the direction selects the wrong octant.
pub(super) fn tinybvh_282(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "tinybvh #282",
        "axis-parallel rays, zeros of either sign",
        "the same answers",
        Oracle::Same,
        "rays",
    );
    let mesh = cubes();
    let (plus, minus) = (along_axes(&mesh, 0.0), along_axes(&mesh, -0.0));
    each(PROMISE, methods, |method| {
        let tracer = method.of(&mesh);
        let (with_plus, with_minus) = (tracer.closest(&plus), tracer.closest(&minus));
        let short = |hit: &Option<Hit>| hit.map(|hit| (hit.t, hit.primitive));
        (plus.len(), with_plus.iter().zip(&with_minus).filter(|(a, b)| short(a) != short(b)).count())
    })
}

/// An absolute epsilon for the determinant drops small triangles.
pub(super) fn tinybvh_283(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "tinybvh #283",
        "right triangles with legs 2e-4 to 2e-13",
        "hit at t = 1",
        Oracle::Known,
        "triangles",
    );
    let legs: Vec<f32> = (4..=13).map(|digits| 2.0 * 10.0f32.powi(-digits)).collect();
    each(PROMISE, methods, |method| {
        let is_missed = |leg: &&f32| {
            let leg = **leg;
            let positions = vec![[0.0; 3], [leg, 0.0, 0.0], [0.0, leg, 0.0]];
            let mesh = Mesh { positions, triangles: vec![[0, 1, 2]] };
            let ray = Ray::new([leg / 3.0, leg / 3.0, -1.0], [0.0, 0.0, 1.0]);
            // Other tracers must only be as accurate as a device.
            let off = if method.guarantee == Guarantee::Loop { 0.0 } else { canted_gpu::HIT_ERROR };
            method.of(&mesh).closest(&[ray])[0].is_none_or(|hit| (hit.t - 1.0).abs() > off)
        };
        (legs.len(), legs.iter().filter(is_missed).count())
    })
}

/// A ray in the face of a box misses geometry that touches that face.
pub(super) fn tinybvh_286(methods: &[Method]) -> Vec<Row> {
    const PROMISE: Promise = Promise::none(
        "tinybvh #286",
        "axis-parallel rays in faces and edges of boxes",
        "the loop's answers",
        Oracle::Loop,
        "rays",
    );
    let quads = coplanar_quads(6);
    let tenths = Mesh { positions: quads.positions.iter().map(|p| p.map(|x| 0.1 * x)).collect(), ..quads };
    let meshes = [cubes(), tenths];
    let asked = meshes.map(|mesh| {
        let rays = along_axes(&mesh, 0.0);
        let wants: Vec<bool> =
            rays.iter().map(brute::of_mesh(&mesh, TriangleTest::Watertight)).map(|hit| hit.is_some()).collect();
        (mesh, rays, wants)
    });
    each(PROMISE, methods, |method| {
        let mut counts = (0, 0);
        for (mesh, rays, wants) in &asked {
            let hits = method.of(mesh).closest(rays);
            // A device may hit anything within its error, so only lost hits count.
            let is_wrong = |(hit, want): &(&Option<Hit>, &bool)| match method.guarantee {
                Guarantee::Device(_) => **want && hit.is_none(),
                Guarantee::Loop | Guarantee::Peer => hit.is_some() != **want,
            };
            counts.0 += rays.len();
            counts.1 += hits.iter().zip(wants).filter(is_wrong).count();
        }
        counts
    })
}
