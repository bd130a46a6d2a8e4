//! Reports to tinybvh's tracker.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Mesh, coplanar_quads, thin_box};
use canted_obb::Affine;
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{Hit, InstanceId, Query, Ray, Watertight};
use canted_wide::{Config, TriangleBvh};

use super::super::{Oracle, Promise, Row};
use super::each;
use crate::{
    brute,
    tracers::{Guarantee, Method},
};

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
    [(1.0, 0.0), (64.0, 8.0), (-4.0, 16.0)].map(|(scale, z): (f32, f32)| {
        let columns = [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale], [0.0, 0.0, z]];
        (Affine { columns }, z)
    })
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
    fn of_levels<B: Blas>(blas: B, name: &str) -> Row {
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
    let binary = Bvh2::<Watertight>::build(&plate.positions, &plate.triangles, &BuildConfig::default());
    let wide = TriangleBvh::<Watertight>::build(&plate.positions, &plate.triangles, &Config::default());
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
        let records = brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
        let wants: Vec<bool> =
            rays.iter().map(|ray| brute::closest_hit::<Watertight>(&records, ray).is_some()).collect();
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
