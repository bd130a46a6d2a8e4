//! Closed meshes, their placements, rays that must not pass through the surface without a hit, and the search for leaks.
//!
//! The search covers every tracer, mesh and placement: rays that pass through, and crossings that do not alternate. Rays aim at shared
//! vertices and edges: every second one from inside, the others from far outside towards a point inside. Not covered: crossings on
//! devices, which return only first hits; meshes whose neighbors do not share vertices, and seams between instances, whose data have
//! gaps.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use canted_fixtures::{Mesh, Rotation, SplitMix64, displaced_icosphere, icosphere, thin_box, torus};
use canted_obb::{
    Affine,
    vector::{cross, dot},
};
use canted_trace::{Ray, Side};

use crate::{
    crossings::{are_alternating, are_balanced, opposite},
    scenes::{affine, baked, mirrors},
    tracers::{Guarantee, Method, Tracer},
};

/// A closed mesh, star-shaped around `inner_point` except for the torus.
pub struct Closed {
    /// Name for messages.
    pub name: &'static str,
    /// The mesh.
    pub mesh: Mesh,
    /// A point inside.
    pub inner_point: [f64; 3],
    /// Every point within this distance of `inner_point`, along each axis, is inside.
    pub clearance: [f64; 3],
    /// Whether the surface does not intersect itself, so that crossings alternate between entering and leaving.
    pub is_simple: bool,
}

/// One mesh of each closed shape.
#[must_use]
pub fn closed() -> Vec<Closed> {
    let origin = [0.0; 3];
    vec![
        Closed { name: "icosphere", mesh: icosphere(2), inner_point: origin, clearance: [0.5; 3], is_simple: true },
        Closed {
            name: "displaced icosphere",
            mesh: displaced_icosphere(3, 2),
            inner_point: origin,
            clearance: [0.4; 3],
            is_simple: true,
        },
        Closed {
            name: "torus",
            mesh: torus(24, 8),
            inner_point: [1.0, 0.0, 0.0],
            clearance: [0.2; 3],
            is_simple: true,
        },
        Closed {
            name: "thin box",
            mesh: thin_box(0.01),
            inner_point: origin,
            clearance: [0.4, 0.4, 0.004],
            is_simple: true,
        },
    ]
}

/// A transform of a closed mesh.
pub struct Placement {
    /// Name for messages.
    pub name: &'static str,
    /// The transform.
    pub world_from_object: Affine,
}

/// Identity, rotated, tiny, huge, far away, sheared and mirrored.
#[must_use]
pub fn placements() -> Vec<Placement> {
    let placement = |name, turn: Rotation, scale: [f64; 3], shift: f32| Placement {
        name,
        world_from_object: affine(&turn, scale, [shift, -shift, shift]),
    };
    let mut sheared = placement("sheared and mirrored", Rotation::off_axis(), [1.0, -0.5, 2.0], 0.3);
    sheared.world_from_object.columns[1][0] += 0.7;
    vec![
        placement("unchanged", Rotation::IDENTITY, [1.0; 3], 0.0),
        placement("at 1e-6, rotated", Rotation::off_axis(), [1e-6; 3], 0.0),
        placement("at 1e6, rotated", Rotation::off_axis(), [1e6; 3], 0.0),
        // Adjacent f32 values are 1 apart here, and the thin box is 20 thick.
        placement("at 1e7", Rotation::off_axis(), [2e3; 3], 1e7),
        sheared,
    ]
}

/// `a + by·(b - a)`.
fn between(a: [f64; 3], b: [f64; 3], by: f64) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + by * (b[k] - a[k]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Rays through a vertex or an edge of `mesh` (in world space). Even rays start inside; odd ones start far outside and pass
/// through the edge to a point inside.
#[must_use]
pub fn rays(mesh: &Mesh, closed: &Closed, world_from_object: &Affine, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    // Computed once, because it visits every triangle.
    let diagonal = mesh.diagonal();
    (0..n)
        .map(|i| {
            // A third start at the inner point itself, where coordinates repeat and rays hit vertices exactly.
            let offset = if i % 3 == 0 { [0.0; 3] } else { rng.signed3() };
            let inside_object = std::array::from_fn(|k| closed.inner_point[k] + offset[k] * closed.clearance[k]);
            let inside = world_from_object.point_f64(inside_object);
            let corners = mesh.corners(rng.below(mesh.triangles.len()));
            let first = rng.below(3);
            let along_edge = [0.0, 0.5, rng.unit()][i / 2 % 3];
            let target = between(corners[first], corners[(first + 1) % 3], along_edge);
            // The mesh ends within a diagonal of the target.
            let outside = between(inside, target, 1.0 + diagonal / distance(inside, target));
            let (from, to) = if i % 2 == 0 { (inside, target) } else { (outside, inside) };
            let origin = from.map(|x| x as f32);
            let direction = std::array::from_fn(|k| (to[k] - f64::from(origin[k])) as f32);
            Ray::new(origin, direction)
        })
        .collect()
}

/// Closes each hole with a fan around one of its vertices. `None` if an edge has more than two triangles, or no point is found
/// inside.
#[must_use]
pub fn closed_up(name: &'static str, mut mesh: Mesh) -> Option<Closed> {
    weld(&mut mesh);
    let mut next = BTreeMap::new();
    let all: BTreeSet<[u32; 2]> = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
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
        // Back at the first vertex.
        around.pop();
        let fan = around.windows(2).skip(1).map(|pair| [around[0], pair[0], pair[1]]);
        mesh.triangles.extend(fan.collect::<Vec<_>>());
    }
    if mesh.open_edge().is_some() {
        return None;
    }
    let inner_point = inside(&mesh)?;
    let clearance = [0.002 * mesh.diagonal(); 3];
    // The fans may intersect the rest of the surface.
    Some(Closed { name, mesh, inner_point, clearance, is_simple: false })
}

/// Merges vertices with equal coordinates and removes triangles that become degenerate.
fn weld(mesh: &mut Mesh) {
    let mut first_of = HashMap::new();
    let first: Vec<u32> = (0u32..)
        .zip(&mesh.positions)
        .map(|(i, position)| *first_of.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(i))
        .collect();
    for triangle in &mut mesh.triangles {
        *triangle = triangle.map(|index| first[index as usize]);
    }
    mesh.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
}

/// A point with winding number one; so have points a two-hundredth of the diagonal away.
fn inside(mesh: &Mesh) -> Option<[f64; 3]> {
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

/// Winding number of the surface around a point: its solid angle over that of a sphere (Van Oosterom, Strackee 1983).
fn winding(mesh: &Mesh, p: [f64; 3]) -> f64 {
    let solid_angle = |i: usize| {
        let [a, b, c] = mesh.corners(i).map(|corner| std::array::from_fn(|k| corner[k] - p[k]));
        let [la, lb, lc] = [a, b, c].map(|v| dot(v, v).sqrt());
        2.0 * dot(a, cross(b, c)).atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    };
    (0..mesh.triangles.len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Least number of rays for each structure, so that tracing takes longer than building.
const BATCH: usize = 1 << 14;

/// Result of one mesh in all placements for one tracer.
#[derive(Clone, Debug)]
pub struct Found {
    /// The mesh.
    pub mesh: &'static str,
    /// Its number of triangles.
    pub n_triangles: usize,
    /// Name of the tracer.
    pub method: String,
    /// Rays traced, each for its first hit and for any hit.
    pub n_rays: usize,
    /// Rays for which one of the two queries finds nothing, or whose crossings are wrong.
    pub n_leaks: usize,
    /// Queries, two for each ray, answered by the CPU because a driver ended the device's traversal early.
    pub n_cut: usize,
}

/// Progress of a search.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Current mesh and placement.
    pub at: [&'static str; 2],
    /// Current tracer.
    pub method: &'a str,
    /// Rays traced so far, and in total.
    pub n_rays: [usize; 2],
    /// Leaks so far.
    pub n_leaks: usize,
}

/// Distributes about `n_rays` rays over meshes, placements and tracers, at least one each. Calls `report` after every batch.
///
/// CPU tracers also return crossings for further rays. There, a ray leaks unless it crosses the surface at least once, alternately
/// entering and leaving.
#[must_use]
pub fn search(
    meshes: &[Closed],
    placements: &[Placement],
    methods: &[Method],
    n_rays: usize,
    report: &mut dyn FnMut(&Progress<'_>),
) -> Vec<Found> {
    let jobs: Vec<(&Method, bool)> = methods
        .iter()
        .map(|method| (method, false))
        .chain(methods.iter().filter(|method| method.guarantee == Guarantee::Loop).map(|method| (method, true)))
        .collect();
    let share = n_rays.div_ceil(meshes.len() * placements.len() * jobs.len());
    let (mut n_shot, mut n_leaks) = (0, 0);
    let n_all = share * meshes.len() * placements.len() * jobs.len();
    let mut found = vec![];
    for closed in meshes {
        let mut of_mesh: Vec<Found> =
            jobs.iter().map(|(method, counts)| Found::none(closed, method, *counts)).collect();
        for (placement, seed) in placements.iter().zip((1u64..).map(|i| i << 32)) {
            let world = baked(&closed.mesh, &placement.world_from_object);
            for (i, ((method, counts), row)) in jobs.iter().zip(&mut of_mesh).enumerate() {
                let tracer = (method.make)(&closed.mesh, &placement.world_from_object);
                let sizes = (0..share).step_by(BATCH).map(|first| BATCH.min(share - first));
                for (n, seed) in sizes.zip(seed + ((i as u64) << 20)..) {
                    let rays = rays(&world, closed, &placement.world_from_object, n, seed);
                    let leaks = || match counts {
                        false => slipped(tracer.as_ref(), &rays),
                        true => miscounted(tracer.as_ref(), closed, placement, &rays),
                    };
                    let (leaks, cut) = method.with_cuts(leaks);
                    row.n_rays += n;
                    row.n_leaks += leaks;
                    row.n_cut += cut;
                    n_shot += n;
                    n_leaks += leaks;
                    let at = [closed.name, placement.name];
                    report(&Progress { at, method: &row.method, n_rays: [n_shot, n_all], n_leaks });
                }
            }
        }
        found.extend(of_mesh);
    }
    found
}

impl Found {
    fn none(closed: &Closed, method: &Method, counts: bool) -> Self {
        Self {
            mesh: closed.name,
            n_triangles: closed.mesh.triangles.len(),
            method: if counts { format!("crossings, {}", method.name) } else { method.name.clone() },
            n_rays: 0,
            n_leaks: 0,
            n_cut: 0,
        }
    }
}

/// Number of rays without a closest hit or without occlusion.
fn slipped(tracer: &dyn Tracer, rays: &[Ray]) -> usize {
    let (hits, occluded) = (tracer.closest(rays), tracer.occluded(rays));
    hits.iter().zip(&occluded).filter(|&(hit, &occluded)| hit.is_none() || !occluded).count()
}

/// Number of rays with wrong or missing crossings; even ones start inside.
fn miscounted(tracer: &dyn Tracer, closed: &Closed, placement: &Placement, rays: &[Ray]) -> usize {
    let inward = if mirrors(&placement.world_from_object) { opposite(Side::Front) } else { Side::Front };
    let are_right = if closed.is_simple { are_alternating } else { are_balanced };
    let is_wrong = |&(i, ray): &(usize, &Ray)| {
        tracer.crossings(ray).is_none_or(|crossings| !are_right(&crossings, inward, i % 2 == 0))
    };
    rays.iter().enumerate().filter(is_wrong).count()
}

/// All placements of the search: unchanged, tiny, huge, far away, sheared and mirrored, and scales in between.
#[must_use]
pub fn all_placements() -> Vec<Placement> {
    let mut placements = placements();
    for (name, exponent) in [("at 2^-10", -10), ("at 2^10", 10)] {
        placements.push(Placement { name, world_from_object: Affine::scale([2.0f32.powi(exponent); 3]) });
    }
    placements
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{displaced_icosphere, icosphere};
    use canted_trace::Hit;

    use super::*;
    use crate::tracers::{self, Make};

    #[test]
    fn holes_are_closed_and_an_inner_point_is_found() {
        let mut mesh = displaced_icosphere(3, 2);
        // Two adjacent triangles, and one that shares at most a vertex with them.
        let n = mesh.triangles.len();
        mesh.triangles.remove(n - 1);
        mesh.triangles.remove(n - 2);
        mesh.triangles.remove(3);
        let closed = closed_up("sphere", mesh.clone()).expect("two simple holes");
        assert_eq!(closed.mesh.open_edge(), None);
        assert!((winding(&closed.mesh, closed.inner_point) - 1.0).abs() < 1e-9);
        assert!(winding(&closed.mesh, [9.0, 0.0, 0.0]).abs() < 1e-9);
        // An edge of three triangles is not manifold.
        mesh.triangles.push([0, 1, 2]);
        mesh.triangles.push([0, 1, 3]);
        assert!(closed_up("none", mesh).is_none());
    }

    /// A tracer without the triangles around the first vertex.
    fn without_some(method: Method) -> Method {
        let make: Make = Box::new(move |mesh, placement| {
            let mut open = mesh.clone();
            open.triangles.retain(|triangle| !triangle.contains(&0));
            (method.make)(&open, placement)
        });
        Method::new(method.name, method.guarantee, make)
    }

    #[test]
    fn every_method_finds_a_hole() {
        let ball =
            Closed { name: "sphere", mesh: icosphere(0), inner_point: [0.0; 3], clearance: [0.4; 3], is_simple: true };
        let methods: Vec<Method> = tracers::ours().0.into_iter().map(without_some).collect();
        let n_cpu = methods.iter().filter(|method| method.guarantee == Guarantee::Loop).count();
        let n_rays = 400 * (methods.len() + n_cpu);
        let mut reported = 0;
        let found =
            search(&[ball], &placements()[..1], &methods, n_rays, &mut |progress| reported = progress.n_rays[0]);
        assert!(found.iter().all(|found| found.n_leaks > 0), "{found:?}");
        assert_eq!((found.len(), reported), (methods.len() + n_cpu, n_rays));
    }

    /// A tracer with modified crossings.
    struct Modified(Box<dyn Tracer>, fn(&mut Vec<Hit>));

    impl Tracer for Modified {
        fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
            self.0.closest(rays)
        }

        fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
            self.0.occluded(rays)
        }

        fn crossings(&self, ray: &Ray) -> Option<Vec<Hit>> {
            let mut crossings = self.0.crossings(ray)?;
            (self.1)(&mut crossings);
            Some(crossings)
        }
    }

    #[test]
    fn duplicate_and_missing_crossings_are_leaks() {
        let modify: [fn(&mut Vec<Hit>); 3] =
            [|all| all.extend_from_within(..), |all| all.truncate(all.len() - 1), Vec::clear];
        for modify in modify {
            let modified = |Method { name, guarantee, make, .. }: Method| {
                let make: Make = Box::new(move |mesh, placement| Box::new(Modified(make(mesh, placement), modify)));
                Method::new(name, guarantee, make)
            };
            let methods = tracers::ours().0.into_iter().filter(|method| method.guarantee == Guarantee::Loop);
            let methods: Vec<Method> = methods.map(modified).collect();
            for found in search(&closed()[..1], &all_placements(), &methods, 2_000, &mut |_| ()) {
                let is_count = found.method.starts_with("crossings");
                assert_eq!(found.n_leaks, if is_count { found.n_rays } else { 0 }, "{found:?}");
            }
        }
    }
}
