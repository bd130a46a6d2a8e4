//! Closed meshes by the ray: what slips through, and what is crossed otherwise than in and out in turn.
//!
//! Every way to trace, every mesh, every place. Rays are aimed at shared vertices and edges: every other one from inside,
//! the rest from far outside to a point inside. Not covered: crossings on devices, which tell first hits alone; meshes whose
//! neighbours do not share vertices, and seams between instances, both of which have gaps in their data.

use canted_obb::Affine;
use canted_trace::{Ray, Side};

use crate::{
    closed::{Closed, Place, baked, mirrors, rays},
    crossings::{are_balanced, are_in_turn, opposite},
    tracers::{Tracer, Way, Word},
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
    /// Answers, of two a ray, that the CPU gave because a driver cut the device's walk short.
    pub n_cut: usize,
}

/// How far a search has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// The mesh and the place that rays are shot at.
    pub at: [&'static str; 2],
    /// By whom.
    pub way: &'a str,
    /// Rays shot so far, and rays in all.
    pub n_rays: [usize; 2],
    /// Leaks so far.
    pub n_leaks: usize,
}

/// About `n_rays` rays, shared out over meshes, places and ways; each of them gets some. `tell` hears of every batch.
///
/// Whoever traces on the CPU is asked for crossings, too, by other rays: a leak is then a ray that does not lead in and out of the
/// surface in turn, at least once.
#[must_use]
pub fn search(
    meshes: &[Closed],
    places: &[Place],
    ways: &[Way],
    n_rays: usize,
    tell: &mut dyn FnMut(&Progress<'_>),
) -> Vec<Found> {
    let jobs: Vec<(&Way, bool)> = ways
        .iter()
        .map(|way| (way, false))
        .chain(ways.iter().filter(|way| way.word == Word::Loop).map(|way| (way, true)))
        .collect();
    let share = n_rays.div_ceil(meshes.len() * places.len() * jobs.len());
    let (mut n_shot, mut n_leaks) = (0, 0);
    let n_all = share * meshes.len() * places.len() * jobs.len();
    let mut found = vec![];
    for closed in meshes {
        let mut of_mesh: Vec<Found> = jobs.iter().map(|(way, counts)| Found::none(closed, way, *counts)).collect();
        for (place, seed) in places.iter().zip((1u64..).map(|i| i << 32)) {
            let world = baked(&closed.mesh, &place.world_from_object);
            for (i, ((way, counts), row)) in jobs.iter().zip(&mut of_mesh).enumerate() {
                let tracer = (way.make)(&closed.mesh, &place.world_from_object);
                let sizes = (0..share).step_by(BATCH).map(|first| BATCH.min(share - first));
                for (n, seed) in sizes.zip(seed + ((i as u64) << 20)..) {
                    let rays = rays(&world, closed, &place.world_from_object, n, seed);
                    let leaks = || match counts {
                        false => slipped(tracer.as_ref(), &rays),
                        true => miscounted(tracer.as_ref(), closed, place, &rays),
                    };
                    let (leaks, cut) = way.with_cuts(leaks);
                    row.n_rays += n;
                    row.n_leaks += leaks;
                    row.n_cut += cut;
                    n_shot += n;
                    n_leaks += leaks;
                    let at = [closed.name, place.name];
                    tell(&Progress { at, way: &row.way, n_rays: [n_shot, n_all], n_leaks });
                }
            }
        }
        found.extend(of_mesh);
    }
    found
}

impl Found {
    fn none(closed: &Closed, way: &Way, counts: bool) -> Self {
        Self {
            mesh: closed.name,
            n_triangles: closed.mesh.triangles.len(),
            way: if counts { format!("crossings, {}", way.name) } else { way.name.clone() },
            n_rays: 0,
            n_leaks: 0,
            n_cut: 0,
        }
    }
}

/// Rays that nothing stops, or that an occlusion query lets pass.
fn slipped(tracer: &dyn Tracer, rays: &[Ray]) -> usize {
    let (hits, occluded) = (tracer.closest(rays), tracer.occluded(rays));
    hits.iter().zip(&occluded).filter(|&(hit, &occluded)| hit.is_none() || !occluded).count()
}

/// Rays whose crossings are wrong, or that are not told: those of even number begin inside.
fn miscounted(tracer: &dyn Tracer, closed: &Closed, place: &Place, rays: &[Ray]) -> usize {
    let inward = if mirrors(&place.world_from_object) { opposite(Side::Front) } else { Side::Front };
    let are_right = if closed.is_simple { are_in_turn } else { are_balanced };
    let is_wrong = |&(i, ray): &(usize, &Ray)| {
        tracer.crossings(ray).is_none_or(|crossings| !are_right(&crossings, inward, i % 2 == 0))
    };
    rays.iter().enumerate().filter(is_wrong).count()
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
    use canted_fixtures::icosphere;
    use canted_trace::Hit;

    use super::*;
    use crate::{
        closed::closed,
        tracers::{self, Make},
    };

    /// A way that leaves out every triangle around the first vertex.
    fn without_some(way: Way) -> Way {
        let make: Make = Box::new(move |mesh, place| {
            let mut open = mesh.clone();
            open.triangles.retain(|triangle| !triangle.contains(&0));
            (way.make)(&open, place)
        });
        Way::new(way.name, way.word, make)
    }

    #[test]
    fn a_hole_is_found_by_every_way() {
        let ball = Closed { name: "ball", mesh: icosphere(0), heart: [0.0; 3], room: [0.4; 3], is_simple: true };
        let ways: Vec<Way> = tracers::ours().0.into_iter().map(without_some).collect();
        let n_cpu = ways.iter().filter(|way| way.word == Word::Loop).count();
        let n_rays = 400 * (ways.len() + n_cpu);
        let mut told = 0;
        let found = search(&[ball], &places()[..1], &ways, n_rays, &mut |progress| told = progress.n_rays[0]);
        assert!(found.iter().all(|found| found.n_leaks > 0), "{found:?}");
        assert_eq!((found.len(), told), (ways.len() + n_cpu, n_rays));
    }

    /// A way whose crossings are spoilt.
    struct Spoilt(Box<dyn Tracer>, fn(&mut Vec<Hit>));

    impl Tracer for Spoilt {
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
    fn crossings_that_are_doubled_missing_or_none_are_leaks() {
        let spoil: [fn(&mut Vec<Hit>); 3] =
            [|all| all.extend_from_within(..), |all| all.truncate(all.len() - 1), Vec::clear];
        for spoil in spoil {
            let spoilt = |Way { name, word, make, .. }: Way| {
                let make: Make = Box::new(move |mesh, place| Box::new(Spoilt(make(mesh, place), spoil)));
                Way::new(name, word, make)
            };
            let ways = tracers::ours().0.into_iter().filter(|way| way.word == Word::Loop);
            let ways: Vec<Way> = ways.map(spoilt).collect();
            for found in search(&closed()[..1], &places(), &ways, 2_000, &mut |_| ()) {
                let is_count = found.way.starts_with("crossings");
                assert_eq!(found.n_leaks, if is_count { found.n_rays } else { 0 }, "{found:?}");
            }
        }
    }
}
