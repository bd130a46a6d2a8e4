//! One and two levels, every SIMD path and the device, on meshes and rays with large rounding errors, and on invalid rays in a batch with
//! valid ones.
//!
//! Two references: exact arithmetic decides for every tracer what is certain wherever rounding may have moved a vertex; the loop
//! over all triangles with the same kernel gives every bit of our answers. Only rays count that have a certain result or a hit,
//! so a tracer that never hits breaks every promise. Not covered: rays at shared edges of closed meshes (`watertight`), large
//! meshes (`benches/results/grazing.md`).

use canted_fixtures::{Grazing, Mesh, coplanar_quads, identical, outlier, scaffold_of, slivers, soup, thin_box};
use canted_trace::{Hit, Ray, TriangleTest};

use super::{Oracle, Promise, Row};
use crate::{
    exact::{Margin, Verdict, near_plane, verdict},
    rays::{at_insides, from_inside, of_classes},
    reference::{self, corners},
    tracers::{Guarantee, Method},
    variants::{is_same, loop_over_all},
};

/// A mesh and rays.
struct Case {
    name: &'static str,
    mesh: Mesh,
    rays: Vec<Ray>,
}

/// The exact reference handles only rays without an end.
fn is_endless(ray: &Ray) -> bool {
    ray.t_min == 0.0 && ray.t_max == f32::INFINITY
}

fn of_length(rays: &[Ray], scale: f32) -> Vec<Ray> {
    let scaled = rays.iter().map(|ray| Ray { direction: ray.direction.map(|d| d * scale), ..*ray });
    scaled.filter(|ray| ray.direction.iter().any(|&d| d != 0.0)).collect()
}

fn cases(effort: usize) -> Vec<Case> {
    let n = 80 * effort;
    let base = soup(21, 60);
    let around = |mesh: &Mesh, seed: u64| {
        let mut rays = reference::rays(mesh, n, seed);
        rays.extend(of_classes(mesh, &[Grazing::Vertices, Grazing::Edges, Grazing::Planes], n / 8, seed));
        rays.extend(from_inside(mesh, n / 4, seed));
        rays.extend(at_insides(mesh, n / 2, seed));
        rays.retain(is_endless);
        rays
    };
    let mut cases = vec![];
    let mut add = |name, mesh: Mesh| {
        let rays = around(&mesh, 90 + cases_seed(name));
        cases.push(Case { name, mesh, rays });
    };
    add("arbitrary rays", base.clone());
    add("at 1e-20", base.placed(|p| p.map(|x| x * 1e-20)));
    add("at 1e15", base.placed(|p| p.map(|x| x * 1e15)));
    add("denormal coordinates", base.placed(|p| p.map(|x| x * 1e-40)));
    add("at 1e7, size 5e3", base.placed(|p| p.map(|x| x * 5e3 + 1e7)));
    add("at 1e7 along x, 1e-3 across", base.placed(|p| [p[0] * 20.0 + 1e7, p[1] * 1e-3, p[2] * 1e-3]));
    add("at 1e6, size 300, one part at the origin", base.placed(|p| p.map(|x| x * 300.0 - 1e6)).joined(&soup(25, 1)));
    add("1e7 long, 1e-3 thick", base.placed(|p| [p[0] * 1e7, p[1] * 1e7, p[2] * 1e-3]));
    let (tiny, huge) = (soup(22, 30).placed(|p| p.map(|x| x * 1e-6)), soup(23, 30).placed(|p| p.map(|x| x * 1e6)));
    add("scale ratio 1e12 in one mesh", tiny.joined(&huge));
    add("slivers, some of zero area", slivers(8, 60));
    add("box of thickness 1e-6, rotated", thin_box(1e-6).off_axis());
    add("flat box, rotated", thin_box(0.0).off_axis());
    add("struts", scaffold_of(1, true, 2));
    add("one outlier at 1e7", outlier(60));
    add("60 equal triangles", identical(60));
    add("one triangle", soup(24, 1));
    for (name, scale) in
        [("directions of length 1e-30", 1e-30), ("directions of length 1e30", 1e30), ("denormal directions", 1e-38)]
    {
        cases.push(Case { name, mesh: base.clone(), rays: of_length(&reference::rays(&base, n, 95), scale) });
    }
    let quads = coplanar_quads(5);
    let mut rays = of_classes(&quads, &[Grazing::Axes, Grazing::Planes], n, 96);
    rays.retain(is_endless);
    cases.push(Case { name: "axis-parallel, in face planes", mesh: quads, rays });
    cases
}

/// A seed derived from the name, so that cases can be added and removed independently.
fn cases_seed(name: &str) -> u64 {
    name.bytes().fold(0, |sum, byte| 31 * sum % 1_000_003 + u64::from(byte))
}

/// Extra reach of device hits, in scene units: kernels accept points within `TINY` (1e-36) of the ray on two axes, because they
/// may flush small numbers to zero; the factor of two covers the flushing itself.
const DEVICE_UNDERFLOW: f32 = 4e-36;

/// Error bound of hits: the CPU kernels' or the device's.
fn margin(guarantee: Guarantee, ray: &Ray, corners: &[[f32; 3]; 3]) -> Margin {
    let margin = reference::margin(ray, corners);
    let Guarantee::Device(error) = guarantee else { return margin };
    let along = margin.along / canted_trace::HIT_ERROR * error + DEVICE_UNDERFLOW;
    // An error on each axis doubles when seen along the ray's axis, on two axes.
    Margin { across: 2.0 * std::f32::consts::SQRT_2 * along, along }
}

/// The promise that a BVH loses no hit.
pub const PIERCED: &str = "certain hits are found";
/// The promise that a BVH adds no hit.
pub const MISSED: &str = "no certain miss is hit, and no hit is off its plane";
/// The promise that no bit depends on the BVH.
pub const SAME: &str = "the loop's answers, bit for bit; a device loses none of its hits, except where the ray starts within its error of the plane";

/// The rows of every tracer on every case; `effort` multiplies the rays.
#[must_use]
pub fn rows(effort: usize, methods: &[Method]) -> Vec<Row> {
    let mut rows = vec![];
    for Case { name, mesh, rays } in cases(effort) {
        // Classified once for each error bound.
        let mut checked: Vec<(f32, Vec<Vec<Verdict>>)> = vec![];
        let wants = loop_over_all(&mesh, TriangleTest::Watertight, &rays);
        let promise = |promise, oracle| Promise::none("triangle BVH", name, promise, oracle, "rays");
        let mut by_promise: [Vec<Row>; 3] = Default::default();
        for method in methods {
            let tracer = method.of(&mesh);
            let error = if let Guarantee::Device(error) = method.guarantee { error } else { 0.0 };
            if checked.iter().all(|(known, _)| *known != error) {
                checked.push((error, verdicts(&mesh, &rays, method.guarantee)));
            }
            let ((hits, occluded), n_cut) = method.with_cuts(|| (tracer.closest(&rays), tracer.occluded(&rays)));
            let verdicts = checked.iter().find(|(known, _)| *known == error).map_or(&[][..], |(_, of)| of);
            let Certain { pierced, missed } = Certain::of(method.guarantee, &mesh, &rays, verdicts, &hits);
            // A device may hit anything within its error, so only lost hits count.
            let counts = |&i: &usize| match (method.guarantee, &wants[i]) {
                (Guarantee::Device(_), want) => {
                    want.is_some_and(|want| !begins_in(method.guarantee, &mesh, &rays[i], &want))
                }
                (_, want) => want.is_some() || hits[i].is_some(),
            };
            let differs = |&i: &usize| match method.guarantee {
                Guarantee::Loop => !is_same(hits[i], wants[i]) || occluded[i] != wants[i].is_some(),
                Guarantee::Device(_) => hits[i].is_none() || !occluded[i],
                Guarantee::Peer => hits[i].is_some() != wants[i].is_some(),
            };
            let same = [(0..rays.len()).filter(counts).count(), (0..rays.len()).filter(counts).filter(differs).count()];
            let counts =
                [(PIERCED, Oracle::Exact, pierced), (MISSED, Oracle::Exact, missed), (SAME, Oracle::Loop, same)];
            for (of_promise, (words, oracle, [n, n_failed])) in by_promise.iter_mut().zip(counts) {
                let row = promise(words, oracle).count_certain(&method.name, n, n_failed);
                of_promise.push(Row { is_peer: method.guarantee == Guarantee::Peer, n_cut, ..row });
            }
        }
        rows.extend(by_promise.concat());
    }
    rows
}

/// Rays with a certain result: how many there are, and how many got another answer.
pub(super) struct Certain {
    /// Some triangle is certainly hit: failed if there is no hit.
    pub(super) pierced: [usize; 2],
    /// A triangle is certainly missed or some triangle is hit: failed if that one is hit, or the hit is off its plane.
    pub(super) missed: [usize; 2],
}

impl Certain {
    fn of(guarantee: Guarantee, mesh: &Mesh, rays: &[Ray], verdicts: &[Vec<Verdict>], hits: &[Option<Hit>]) -> Self {
        let mut certain = Self { pierced: [0; 2], missed: [0; 2] };
        for ((ray, verdicts), hit) in rays.iter().zip(verdicts).zip(hits) {
            let is_pierced = verdicts.contains(&Verdict::Pierced);
            certain.pierced[0] += usize::from(is_pierced);
            certain.pierced[1] += usize::from(is_pierced && hit.is_none());
            certain.missed[0] += usize::from(hit.is_some() || verdicts.contains(&Verdict::Missed));
            certain.missed[1] += usize::from(hit.is_some_and(|hit| is_invented(guarantee, mesh, ray, verdicts, &hit)));
        }
        certain
    }

    /// Compares a tracer's answers with what is certain.
    pub(super) fn of_method(method: &Method, mesh: &Mesh, rays: &[Ray]) -> Self {
        let verdicts = verdicts(mesh, rays, method.guarantee);
        Self::of(method.guarantee, mesh, rays, &verdicts, &method.of(mesh).closest(rays))
    }
}

/// The verdict for each ray and triangle.
fn verdicts(mesh: &Mesh, rays: &[Ray], guarantee: Guarantee) -> Vec<Vec<Verdict>> {
    let of = |ray: &Ray| {
        let triangle = |triangle| {
            let corners = corners(mesh, triangle);
            verdict(ray, corners, &margin(guarantee, ray, &corners))
        };
        mesh.triangles.iter().map(triangle).collect()
    };
    rays.iter().map(of).collect()
}

/// Whether the hit triangle is certainly missed, or the hit is off its plane.
fn is_invented(guarantee: Guarantee, mesh: &Mesh, ray: &Ray, verdicts: &[Verdict], hit: &Hit) -> bool {
    let id = hit.primitive.index();
    let corners = corners(mesh, &mesh.triangles[id]);
    let is_near = || hit.t.is_finite() && near_plane(ray, hit.t, corners, margin(guarantee, ray, &corners).along);
    verdicts[id] == Verdict::Missed || !is_near()
}

/// Whether a ray starts so close to the plane of the hit triangle that it may start on either side.
fn begins_in(guarantee: Guarantee, mesh: &Mesh, ray: &Ray, hit: &Hit) -> bool {
    let corners = corners(mesh, &mesh.triangles[hit.primitive.index()]);
    near_plane(ray, ray.t_min, corners, margin(guarantee, ray, &corners).along)
}

/// Invalid variants of a ray.
fn invalid(ray: &Ray) -> Vec<Ray> {
    let mut rays = vec![
        Ray { direction: [0.0, -0.0, 0.0], ..*ray },
        Ray { t_min: f32::NAN, ..*ray },
        Ray { t_max: f32::NAN, ..*ray },
        Ray { t_min: 2.0, t_max: 1.0, ..*ray },
    ];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut of_origin, mut of_direction) = (*ray, *ray);
            of_origin.origin[axis] = bad;
            of_direction.direction[axis] = bad;
            rays.extend([of_origin, of_direction]);
        }
    }
    rays
}

pub(super) fn rows_of_invalid_rays(methods: &[Method]) -> Vec<Row> {
    const NONE: Promise = Promise::none(
        "triangle BVH",
        "NaN, infinity, zero direction, empty interval",
        "no hit",
        Oracle::Known,
        "rays hit",
    );
    const BESIDE: Promise = Promise {
        promise: "valid rays in the batch are unaffected",
        oracle: Oracle::Same,
        unit: "rays differ",
        ..NONE
    };
    let mesh = soup(26, 60);
    let good = reference::rays(&mesh, 60, 97);
    // One valid ray, then all its invalid variants.
    let mixed: Vec<(bool, Ray)> = good
        .iter()
        .flat_map(|ray| std::iter::once((true, *ray)).chain(invalid(ray).into_iter().map(|ray| (false, ray))))
        .collect();
    let rays: Vec<Ray> = mixed.iter().map(|&(_, ray)| ray).collect();
    let mut by_promise: [Vec<Row>; 2] = Default::default();
    for method in methods {
        let tracer = method.of(&mesh);
        let ask = |rays: &[Ray]| {
            let short = |hit: Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.primitive));
            tracer.closest(rays).into_iter().map(short).zip(tracer.occluded(rays)).collect::<Vec<_>>()
        };
        let ((alone, among), n_cut) = method.with_cuts(|| (ask(&good), ask(&rays)));
        let of = |is_good: bool| {
            mixed.iter().zip(&among).filter(move |((good, _), _)| *good == is_good).map(|(_, found)| *found)
        };
        let n_hit = of(false).filter(|&found| found != (None, false)).count();
        let n_other = of(true).zip(&alone).filter(|(among, alone)| among != *alone).count();
        let counts = [(rays.len() - good.len(), n_hit), (good.len(), n_other)];
        for ((of_promise, promise), (n, n_failed)) in by_promise.iter_mut().zip([NONE, BESIDE]).zip(counts) {
            of_promise.push(Row {
                is_peer: method.guarantee == Guarantee::Peer,
                n_cut,
                ..promise.count(&method.name, n, n_failed)
            });
        }
    }
    by_promise.concat()
}
