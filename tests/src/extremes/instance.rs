//! Placed meshes: mirrored, sheared, nearly singular, far off; hits judged in world space against the exact image.
//!
//! Not covered: seams between instances, which no promise closes (`ARCHITECTURE.md`); what moves (`instances/moving.rs`).

use canted_fixtures::{Mesh, Rotation, SplitMix64, soup};
use canted_obb::Affine;
use canted_tlas::{Blas, Instance, MAX_CONDITION, MeshBlas, Tlas, TopConfig};
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Wide};

use super::{Oracle, Promise, Row};
use crate::{
    brute, instances as oracle,
    tracers::{Way, Word},
    transforms::affine,
};

/// Placements by name.
fn places() -> Vec<(&'static str, Affine)> {
    let turn = Rotation::turn();
    let mut sheared = affine(&turn, [1.0; 3], [0.3, 0.1, -2.0]);
    sheared.columns[1][0] += 0.9;
    vec![
        ("mirrored", affine(&turn, [-1.0, 1.0, 1.0], [0.0; 3])),
        ("sheared", sheared),
        ("scaled by 1e2, 1e-3 and 1", affine(&turn, [1e2, 1e-3, 1.0], [5.0, 5.0, 5.0])),
        ("scaled by 1e-6", affine(&turn, [1e-6; 3], [0.0; 3])),
        ("scaled by 1e6", affine(&turn, [1e6; 3], [0.0; 3])),
        ("1e-3 large at 1e7", affine(&turn, [1e-3; 3], [1e7, -1e7, 1e7])),
        ("condition just below 2^20", affine(&Rotation::IDENTITY, [1.0, 1.0, 1.01 / MAX_CONDITION], [0.5; 3])),
    ]
}

/// Rays in world space at vertices, edges and triangles of the placed mesh.
#[expect(clippy::cast_possible_truncation, reason = "rays are rounded like everything")]
fn rays(mesh: &Mesh, world_from_object: &Affine, n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(110);
    let ray = |i: usize| {
        let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
        let [u, v] = [[0.0, 0.0], [rng.unit(), 0.0], [0.4 * rng.unit(), 0.4 * rng.unit()]][i % 3];
        let target = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let from = std::array::from_fn(|k| target[k] + 1.5 * rng.signed3()[k]);
        let [target, from] = [target, from].map(|p| world_from_object.point_f64(p));
        let origin = from.map(|x| x as f32);
        Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
    };
    (0..n).map(ray).filter(|ray| ray.direction.iter().any(|&d| d != 0.0)).collect()
}

/// Distance of the point on the ray from the image of the point by weights, over what is promised; both in `f64`, whose
/// roundings are a billionth of it.
fn of_promised(mesh: &Mesh, world_from_object: &Affine, ray: &Ray, hit: &Hit) -> f64 {
    let [a, b, c] = mesh.corners(hit.primitive.index());
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    let object: [f64; 3] = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
    let (image, on_ray) = (world_from_object.point_f64(object), ray.at(f64::from(hit.t)));
    let reach = mesh.positions.iter().flatten().fold(0.0f32, |all, x| all.max(x.abs()));
    // The weights are rounded too: by a unit of two edges, which the bound on the point leaves out.
    let weights = f64::from(f32::EPSILON) * norm(world_from_object) * f64::from(reach);
    let distance = (0..3).map(|k| (image[k] - on_ray[k]).abs()).fold(0.0, f64::max);
    distance / (oracle::hit_error(world_from_object, reach, ray) + weights)
}

/// Greatest row sum of the linear part.
fn norm(map: &Affine) -> f64 {
    (0..3).map(|k| map.columns[..3].iter().map(|column| f64::from(column[k].abs())).sum()).fold(0.0, f64::max)
}

pub(super) fn rows(effort: usize, ways: &[Way]) -> Vec<Row> {
    let mut rows = vec![];
    let mesh = soup(25, 80);
    let binary = || {
        MeshBlas::<Watertight>::build(&mesh.positions, &mesh.triangles, &canted_tlas::BuildConfig::default())
            .expect("fixtures are valid")
    };
    let wide =
        || Wide::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::default()).expect("fixtures are valid");
    for (name, world_from_object) in places() {
        let same = Promise::none("instance", name, "the loop's answers, bit for bit", Oracle::Loop, "rays");
        let near = Promise {
            promise: "hits lie on the image of their triangle",
            oracle: Oracle::Known,
            bound: 1.0,
            unit: "of the stated error",
            ..same
        };
        let rays = rays(&mesh, &world_from_object, 300 * effort);
        let records = brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
        let trace = |_: usize, ray: &Ray| brute::closest_hit::<Watertight>(&records, ray);
        let wants: Vec<_> = rays.iter().map(|ray| oracle::closest_hit(&[world_from_object], ray, trace)).collect();
        let instance = Instance::still(0, world_from_object);
        let of = |hits: &[Option<Hit>]| {
            let n_other = hits.iter().zip(&wants).filter(|(hit, want)| hit != want).count();
            let n_hits = hits.iter().flatten().count();
            let share = |(ray, hit): (&Ray, &Option<Hit>)| {
                hit.as_ref().map_or(0.0, |hit| of_promised(&mesh, &world_from_object, ray, hit))
            };
            (n_other, n_hits, rays.iter().zip(hits).map(share).fold(0.0, f64::max))
        };
        let answers =
            [("binary", of(&closest(binary(), instance, &rays))), ("wide", of(&closest(wide(), instance, &rays)))];
        rows.extend(answers.map(|(kind, (n_other, ..))| same.count(kind, rays.len(), n_other)));
        for way in ways.iter().filter(|way| way.word == Word::Peer) {
            // Whether anything is hit: a peer may round the ray or the vertices, and none says what it does.
            let hits = (way.make)(&mesh, &world_from_object).closest(&rays);
            let n_other = hits.iter().zip(&wants).filter(|(hit, want)| hit.is_some() != want.is_some()).count();
            rows.push(Row { is_peer: true, ..same.count(&way.name, rays.len(), n_other) });
        }
        rows.extend(answers.map(|(kind, (_, n_hits, worst))| near.row(kind, n_hits, worst)));
    }
    rows.push(refused(&mesh));
    rows
}

fn closest<B: Blas>(blas: B, instance: Instance, rays: &[Ray]) -> Vec<Option<Hit>> {
    let tlas = Tlas::new(vec![blas], &[instance], TopConfig::default()).expect("the condition is within the bound");
    rays.iter().map(|ray| tlas.closest_hit(ray, &mut ())).collect()
}

/// Transforms that leave too little of object space.
fn refused(mesh: &Mesh) -> Row {
    const REFUSED: Promise = Promise::none(
        "instance",
        "singular; condition above 2^20; NaN, infinity",
        "an error that names the instance",
        Oracle::Known,
        "transforms taken",
    );
    let turn = Rotation::turn();
    let mut bad = vec![
        affine(&turn, [1.0, 1.0, 0.0], [0.0; 3]),
        affine(&turn, [1e-30, 1e-30, 0.0], [0.0; 3]),
        affine(&turn, [1.0, 1.0, 0.4 / MAX_CONDITION], [0.0; 3]),
        affine(&turn, [1e9, 1e-9, 1.0], [0.0; 3]),
    ];
    for x in [f32::NAN, f32::INFINITY] {
        let mut map = Affine::IDENTITY;
        map.columns[1][2] = x;
        bad.push(map);
    }
    let is_taken = |map: &&Affine| {
        let blas = Wide::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::default());
        let instances = [Instance::still(0, Affine::IDENTITY), Instance::still(0, **map)];
        let placed = Tlas::new(vec![blas.expect("fixtures are valid")], &instances, TopConfig::default());
        placed.err().is_none_or(|error| !error.to_string().contains("instance 1"))
    };
    REFUSED.count("Tlas::new", bad.len(), bad.iter().filter(is_taken).count())
}
