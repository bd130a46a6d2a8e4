//! Reports to Embree's tracker.

use canted_fixtures::{Mesh, Rotation, SplitMix64, displaced_icosphere, icosphere};
use canted_obb::Affine;
use canted_trace::{Hit, Ray, Side};

use super::super::{
    Oracle, Promise, Row,
    hierarchy::{self, Certain},
};
use super::{ball, each, rounded, slipped};
use crate::{
    closed::rays,
    tracers::{Guarantee, Method, Tracer},
    vector::{cross, dot, sub},
};

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
