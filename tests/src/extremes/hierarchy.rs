//! Whole trees, one level and two, every path and the device, on meshes and rays where rounding is large.
//!
//! Two judges: integers, for what is certain wherever rounding may have put a vertex, of everyone; and the loop over all
//! triangles with the same kernel, for every bit of ours. Not covered: rays at shared edges of closed meshes
//! (`watertight`), large meshes (`tests/GRAZING.md`).

use canted_fixtures::{Grazing, Mesh, coplanar_quads, identical, outlier, scaffold_of, slivers, soup, thin_box};
use canted_trace::{Hit, Ray, Watertight};

use super::{Oracle, Promise, Row};
use crate::{
    brute,
    exact::{Margin, Verdict, near_plane, verdict},
    judge::{self, corners},
    rays::{from_inside, of_classes},
    tracers::{Way, Word},
};

/// A mesh and rays.
struct Case {
    name: &'static str,
    mesh: Mesh,
    rays: Vec<Ray>,
}

fn placed(mesh: &Mesh, place: impl Fn([f32; 3]) -> [f32; 3]) -> Mesh {
    Mesh { positions: mesh.positions.iter().map(|&p| place(p)).collect(), triangles: mesh.triangles.clone() }
}

fn joined(a: &Mesh, b: &Mesh) -> Mesh {
    let first = u32::try_from(a.positions.len()).expect("few vertices");
    let moved = b.triangles.iter().map(|t| t.map(|index| index + first));
    Mesh {
        positions: [&a.positions[..], &b.positions].concat(),
        triangles: a.triangles.iter().copied().chain(moved).collect(),
    }
}

/// What is judged by integers has no end.
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
        let mut rays = judge::rays(mesh, n, seed);
        rays.extend(of_classes(mesh, &[Grazing::Vertices, Grazing::Edges, Grazing::Planes], n / 8, seed));
        rays.extend(from_inside(mesh, n / 4, seed));
        rays.retain(is_endless);
        rays
    };
    let mut cases = vec![];
    let mut add = |name, mesh: Mesh| {
        let rays = around(&mesh, 90 + cases_seed(name));
        cases.push(Case { name, mesh, rays });
    };
    add("of any kind", base.clone());
    add("at 1e-20", placed(&base, |p| p.map(|x| x * 1e-20)));
    add("at 1e15", placed(&base, |p| p.map(|x| x * 1e15)));
    add("denormal coordinates", placed(&base, |p| p.map(|x| x * 1e-40)));
    add("at 1e7, 5e3 large", placed(&base, |p| p.map(|x| x * 5e3 + 1e7)));
    add("at 1e7 along x, 1e-3 across", placed(&base, |p| [p[0] * 20.0 + 1e7, p[1] * 1e-3, p[2] * 1e-3]));
    add("1e7 long, 1e-3 thick", placed(&base, |p| [p[0] * 1e7, p[1] * 1e7, p[2] * 1e-3]));
    let (tiny, huge) = (placed(&soup(22, 30), |p| p.map(|x| x * 1e-6)), placed(&soup(23, 30), |p| p.map(|x| x * 1e6)));
    add("scales over 1e12 in one mesh", joined(&tiny, &huge));
    add("slivers, some without area", slivers(8, 60));
    add("box 1e-6 thin, turned", thin_box(1e-6).turned());
    add("flat box, turned", thin_box(0.0).turned());
    add("struts", scaffold_of(1, true, 2));
    add("one outlier at 1e7", outlier(60));
    add("60 equal triangles", identical(60));
    add("one triangle", soup(24, 1));
    for (name, scale) in
        [("directions of length 1e-30", 1e-30), ("directions of length 1e30", 1e30), ("denormal directions", 1e-38)]
    {
        cases.push(Case { name, mesh: base.clone(), rays: of_length(&judge::rays(&base, n, 95), scale) });
    }
    let quads = coplanar_quads(5);
    let mut rays = of_classes(&quads, &[Grazing::Axes, Grazing::Planes], n, 96);
    rays.retain(is_endless);
    cases.push(Case { name: "along axes, in the plane of faces", mesh: quads, rays });
    cases
}

/// A seed from a name, so that cases may come and go.
fn cases_seed(name: &str) -> u64 {
    name.bytes().fold(0, |sum, byte| 31 * sum % 1_000_003 + u64::from(byte))
}

/// What a device hits besides, in units of the space: kernels accept what is within `TINY`, 1e-36, of the ray on either of two
/// axes, for they may flush what is small to zero; twice that leaves room for the flushing itself.
const DEVICE_UNDERFLOW: f32 = 4e-36;

/// How far hits may be off: as the kernels of the CPU promise, or the device's.
fn margin(word: Word, ray: &Ray, corners: &[[f32; 3]; 3]) -> Margin {
    let margin = judge::margin(ray, corners);
    let Word::Device(error) = word else { return margin };
    let along = margin.along / canted_trace::HIT_ERROR * error + DEVICE_UNDERFLOW;
    // A point that is off on each axis is off twice as far seen along the ray's, on two axes.
    Margin { across: 2.0 * std::f32::consts::SQRT_2 * along, along }
}

/// What each way does on every case; `effort` multiplies the rays.
#[must_use]
pub fn rows(effort: usize, ways: &[Way]) -> Vec<Row> {
    let mut rows = vec![];
    for Case { name, mesh, rays } in cases(effort) {
        // Judged once for each bound that any way has.
        let mut judged: Vec<(f32, Vec<Vec<Verdict>>)> = vec![];
        let records = brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
        let wants: Vec<Option<Hit>> = rays.iter().map(|ray| brute::closest_hit::<Watertight>(&records, ray)).collect();
        let certain =
            Promise::none("tree of triangles", name, "no certain hit lost, none invented", Oracle::Exact, "rays");
        let same = Promise {
            promise: "the loop's answers, bit for bit; on a device nothing that it hits is lost",
            oracle: Oracle::Loop,
            ..certain
        };
        let mut of_loop = vec![];
        for way in ways {
            let tracer = way.of(&mesh);
            let error = if let Word::Device(error) = way.word { error } else { 0.0 };
            if judged.iter().all(|(known, _)| *known != error) {
                judged.push((error, verdicts(&mesh, &rays, way.word)));
            }
            let (hits, occluded) = (tracer.closest(&rays), tracer.occluded(&rays));
            let verdicts = judged.iter().find(|(known, _)| *known == error).map_or(&[][..], |(_, of)| of);
            let is_wrong = |&i: &usize| is_wrong(way.word, &mesh, &rays[i], &verdicts[i], hits[i].as_ref());
            let n_wrong = (0..rays.len()).filter(is_wrong).count();
            rows.push(Row { is_peer: way.word == Word::Peer, ..certain.count(&way.name, rays.len(), n_wrong) });
            let differs = |&i: &usize| match way.word {
                Word::Loop => !is_same(hits[i], wants[i]) || occluded[i] != wants[i].is_some(),
                Word::Device(_) => wants[i].is_some() && !(hits[i].is_some() && occluded[i]),
                Word::Peer => hits[i].is_some() != wants[i].is_some(),
            };
            let n_other = (0..rays.len()).filter(differs).count();
            of_loop.push(Row { is_peer: way.word == Word::Peer, ..same.count(&way.name, rays.len(), n_other) });
        }
        rows.extend(of_loop);
    }
    rows
}

/// Rays that a way answers against what is certain.
pub(super) fn n_wrong(way: &Way, mesh: &Mesh, rays: &[Ray]) -> usize {
    let (verdicts, hits) = (verdicts(mesh, rays, way.word), way.of(mesh).closest(rays));
    (0..rays.len()).filter(|&i| is_wrong(way.word, mesh, &rays[i], &verdicts[i], hits[i].as_ref())).count()
}

/// For each ray the verdict on each triangle.
fn verdicts(mesh: &Mesh, rays: &[Ray], word: Word) -> Vec<Vec<Verdict>> {
    let of = |ray: &Ray| {
        let triangle = |triangle| {
            let corners = corners(mesh, triangle);
            verdict(ray, corners, &margin(word, ray, &corners))
        };
        mesh.triangles.iter().map(triangle).collect()
    };
    rays.iter().map(of).collect()
}

/// Whether an answer contradicts what is certain: a miss where a triangle is pierced, a hit of one that is missed, or a hit
/// off its plane.
fn is_wrong(word: Word, mesh: &Mesh, ray: &Ray, verdicts: &[Verdict], hit: Option<&Hit>) -> bool {
    let Some(hit) = hit else { return verdicts.contains(&Verdict::Pierced) };
    let id = hit.primitive.0 as usize;
    let corners = corners(mesh, &mesh.triangles[id]);
    let is_near = || hit.t.is_finite() && near_plane(ray, hit.t, corners, margin(word, ray, &corners).along);
    verdicts[id] == Verdict::Missed || !is_near()
}

/// Whether two answers are the same bits; `==` would take -0.0 for 0.0.
fn is_same(a: Option<Hit>, b: Option<Hit>) -> bool {
    let bits = |hit: Hit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.primitive, hit.instance, hit.side);
    a.map(bits) == b.map(bits)
}
