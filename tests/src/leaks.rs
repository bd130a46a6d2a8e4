//! Leak search in closed meshes: rays that pass through, and crossings that do not alternate.
//!
//! Covers every tracer, mesh and placement. Rays aim at shared vertices and edges: every second one from inside, the others
//! from far outside towards a point inside. Not covered: crossings on devices, which return only first hits; meshes whose
//! neighbors do not share vertices, and seams between instances, whose data have gaps.

use canted_obb::Affine;
use canted_trace::{Ray, Side};

use crate::{
    closed::{Closed, Placement, baked, mirrors, rays},
    crossings::{are_alternating, are_balanced, opposite},
    tracers::{Guarantee, Method, Tracer},
};

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
pub fn placements() -> Vec<Placement> {
    let mut placements = crate::closed::placements();
    for (name, exponent) in [("at 2^-10", -10), ("at 2^10", 10)] {
        let scale = 2.0f32.powi(exponent);
        let columns = [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale], [0.0; 3]];
        placements.push(Placement { name, world_from_object: Affine { columns } });
    }
    placements
}

#[cfg(test)]
mod tests {
    use canted_fixtures::icosphere;
    use canted_trace::Hit;

    use super::*;
    use crate::{
        closed::closed,
        tracers::{self, Make},
    };

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
            for found in search(&closed()[..1], &placements(), &methods, 2_000, &mut |_| ()) {
                let is_count = found.method.starts_with("crossings");
                assert_eq!(found.n_leaks, if is_count { found.n_rays } else { 0 }, "{found:?}");
            }
        }
    }
}
