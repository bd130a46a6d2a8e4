//! Closed meshes by the ray: what slips through, and what is crossed otherwise than as often inward as outward.
//!
//! Every way to trace, every mesh, every place. Rays are aimed at shared vertices and edges: every other one from inside,
//! the rest from far outside to a point inside. Not covered: meshes whose neighbours do not share vertices, and seams between
//! instances; both have gaps in their data.

use canted_fixtures::SplitMix64;
use canted_obb::Affine;
use canted_trace::{Ray, Side, Watertight};
use canted_wide::{Config, SimdPath, Wide};

use crate::{
    closed::{Closed, Place, baked, rays},
    tracers::{Way, lean},
};

/// Rays that a structure is built for, at least: more of them in one place than building takes.
const BATCH: usize = 1 << 14;

/// What was found for one mesh in all places, by one way.
#[derive(Clone, Debug)]
pub struct Found {
    /// The mesh.
    pub mesh: &'static str,
    /// Its triangles.
    pub n_triangles: usize,
    /// Who was asked.
    pub way: String,
    /// Rays asked, each for its first hit and for any.
    pub n_rays: usize,
    /// Rays that one of the two answers let through, or whose crossings are wrong.
    pub n_leaks: usize,
}

/// About `n_rays` rays, shared out over meshes, places and ways; each of them gets some.
///
/// Rows of crossings stand beside those of leaks: there a leak is a surface that is not crossed as often inward as outward.
#[must_use]
pub fn search(meshes: &[Closed], places: &[Place], ways: &[Way], n_rays: usize) -> Vec<Found> {
    let counters = counters();
    let share = n_rays.div_ceil(meshes.len() * places.len() * (ways.len() + counters.len()));
    let mut found = vec![];
    for closed in meshes {
        let mut by_way: Vec<Found> = ways
            .iter()
            .map(|way| way.name.clone())
            .chain(counters.iter().map(|(name, ..)| name.clone()))
            .map(|way| Found {
                mesh: closed.name,
                n_triangles: closed.mesh.triangles.len(),
                way,
                n_rays: 0,
                n_leaks: 0,
            })
            .collect();
        for (place, seed) in places.iter().zip((1u64..).map(|i| i << 32)) {
            let world = baked(&closed.mesh, &place.world_from_object);
            let batches = |seed: u64| {
                let sizes = (0..share).step_by(BATCH).map(move |first| BATCH.min(share - first));
                let batch = |(n, seed)| rays(&world, closed, &place.world_from_object, n, seed);
                sizes.zip(seed..).map(batch).collect::<Vec<_>>()
            };
            for (i, way) in ways.iter().enumerate() {
                let tracer = (way.make)(&closed.mesh, &place.world_from_object);
                for rays in batches(seed + ((i as u64) << 20)) {
                    let (hits, occluded) = (tracer.closest(&rays), tracer.occluded(&rays));
                    by_way[i].n_rays += rays.len();
                    by_way[i].n_leaks +=
                        hits.iter().zip(&occluded).filter(|&(hit, &occluded)| hit.is_none() || !occluded).count();
                }
            }
            for (i, (_, path, config)) in counters.iter().enumerate() {
                let tree = Wide::<Watertight>::build(&world.positions, &world.triangles, config);
                let tree = tree.expect("places keep coordinates finite").with_path(*path);
                let row = &mut by_way[ways.len() + i];
                for rays in batches(seed + ((i as u64) << 16)) {
                    row.n_rays += rays.len();
                    row.n_leaks += miscounted(&tree, &rays);
                }
            }
        }
        found.extend(by_way);
    }
    found
}

/// Trees whose crossings are counted: every path, either kind of node.
fn counters() -> Vec<(String, SimdPath, Config)> {
    let there = SimdPath::ALL.into_iter().filter(|path| path.is_available());
    let both = |path: SimdPath| {
        [("", Config::default()), ("lean ", lean())]
            .map(|(kind, config)| (format!("crossings, {kind}{}", path.name()), path, config))
    };
    there.flat_map(both).collect()
}

/// Rays that cross the surface otherwise than in turn outward and inward: those of even number begin inside.
fn miscounted(tree: &Wide<Watertight>, rays: &[Ray]) -> usize {
    let mut crossings = vec![];
    let is_wrong = |(i, ray): &(usize, &Ray)| {
        tree.crossings(ray, &mut crossings);
        let n_front = crossings.iter().filter(|hit| hit.side == Side::Front).count();
        let n_back = crossings.len() - n_front;
        // A place that mirrors turns inside and outside.
        let more = n_front.abs_diff(n_back);
        more != usize::from(i % 2 == 0)
    };
    rays.iter().enumerate().filter(is_wrong).count()
}

/// A closed mesh of one without: each hole is closed by a fan around one of its vertices. `None` where an edge has more
/// than two triangles, or nothing is inside.
#[must_use]
pub fn closed_up(name: &'static str, mut mesh: canted_fixtures::Mesh) -> Option<Closed> {
    weld(&mut mesh);
    let mut next = std::collections::BTreeMap::new();
    let all: std::collections::BTreeSet<[u32; 2]> =
        mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    for &[a, b] in &all {
        if !all.contains(&[b, a]) && next.insert(b, a).is_some() {
            return None;
        }
    }
    while let Some((&first, _)) = next.iter().next() {
        let mut around = vec![first];
        let mut at = first;
        while let Some(after) = next.remove(&at) {
            around.push(after);
            at = after;
        }
        // Back where it began.
        around.pop();
        let fan = around.windows(2).skip(1).map(|pair| [around[0], pair[0], pair[1]]);
        mesh.triangles.extend(fan.collect::<Vec<_>>());
    }
    if mesh.open_edge().is_some() {
        return None;
    }
    let heart = inside(&mesh)?;
    let room = [0.002 * mesh.diagonal(); 3];
    Some(Closed { name, mesh, heart, room })
}

/// Vertices of equal coordinates become one, and triangles that lose a corner by it go.
fn weld(mesh: &mut canted_fixtures::Mesh) {
    let mut first_of = std::collections::HashMap::new();
    let first: Vec<u32> = (0u32..)
        .zip(&mesh.positions)
        .map(|(i, position)| *first_of.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(i))
        .collect();
    for triangle in &mut mesh.triangles {
        *triangle = triangle.map(|index| first[index as usize]);
    }
    mesh.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
}

/// A point about which the surface winds once, as do points a two-hundredth of the diagonal away.
fn inside(mesh: &canted_fixtures::Mesh) -> Option<[f64; 3]> {
    let [min, max] = mesh.bounds().map(|p| p.map(f64::from));
    let mut rng = SplitMix64::new(5);
    let step = 0.005 * mesh.diagonal();
    (0..100).map(|_| std::array::from_fn(|k| min[k] + (0.3 + 0.4 * rng.unit()) * (max[k] - min[k]))).find(|p| {
        let around = (0..7).map(|i: usize| {
            let mut q: [f64; 3] = *p;
            if i < 6 {
                q[i / 2] += if i.is_multiple_of(2) { step } else { -step };
            }
            q
        });
        around.into_iter().all(|q| (winding(mesh, q) - 1.0).abs() < 1e-6)
    })
}

/// How often the surface winds about a point: its solid angle over that of a sphere (Van Oosterom, Strackee 1983).
fn winding(mesh: &canted_fixtures::Mesh, p: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let solid_angle = |i: usize| {
        let [a, b, c] = mesh.corners(i).map(|corner| std::array::from_fn(|k| corner[k] - p[k]));
        let [la, lb, lc] = [a, b, c].map(|v| dot(v, v).sqrt());
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        2.0 * dot(a, cross).atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    };
    (0..mesh.triangles.len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Every place that leaks are searched in: as it is, tiny, huge, far off, sheared and mirrored, and scales between.
#[must_use]
pub fn places() -> Vec<Place> {
    let mut places = crate::closed::places();
    for (name, exponent) in [("at 2^-10", -10), ("at 2^10", 10)] {
        let scale = 2.0f32.powi(exponent);
        let columns = [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale], [0.0; 3]];
        places.push(Place { name, world_from_object: Affine { columns } });
    }
    places
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{displaced_icosphere, icosphere};

    use super::*;
    use crate::tracers::{self, Make};

    #[test]
    fn holes_are_closed_and_their_inside_is_found() {
        let mut mesh = displaced_icosphere(3, 2);
        // Two neighbours and one that shares only a vertex with neither.
        let n = mesh.triangles.len();
        mesh.triangles.remove(n - 1);
        mesh.triangles.remove(n - 2);
        mesh.triangles.remove(3);
        let closed = closed_up("ball", mesh.clone()).expect("two simple holes");
        assert_eq!(closed.mesh.open_edge(), None);
        assert!((winding(&closed.mesh, closed.heart) - 1.0).abs() < 1e-9);
        assert!(winding(&closed.mesh, [9.0, 0.0, 0.0]).abs() < 1e-9);
        // An edge of three triangles belongs to no surface.
        mesh.triangles.push([0, 1, 2]);
        mesh.triangles.push([0, 1, 3]);
        assert!(closed_up("none", mesh).is_none());
    }

    /// A way that leaves out every triangle around the first vertex.
    fn without_some(way: Way) -> Way {
        let Way { name, word, make } = way;
        let make: Make = Box::new(move |mesh, place| {
            let mut open = mesh.clone();
            open.triangles.retain(|triangle| !triangle.contains(&0));
            make(&open, place)
        });
        Way { name, word, make }
    }

    #[test]
    fn a_hole_is_found_by_every_way() {
        let ball = || Closed { name: "ball", mesh: icosphere(0), heart: [0.0; 3], room: [0.4; 3] };
        let ways: Vec<Way> = tracers::ours().0.into_iter().map(without_some).collect();
        let n_rays = 400 * (ways.len() + counters().len());
        let found = search(&[ball()], &places()[..1], &ways, n_rays);
        let is_by_way = |found: &&Found| !found.way.starts_with("crossings");
        assert!(found.iter().filter(is_by_way).all(|found| found.n_leaks > 0), "{found:?}");
        // Crossings are counted in trees of the mesh itself.
        let mut open = ball();
        open.mesh.triangles.pop();
        let found = search(&[open], &places()[..1], &[], 4_000 * counters().len());
        assert!(!found.is_empty() && found.iter().all(|found| found.n_leaks > 0), "{found:?}");
    }
}
