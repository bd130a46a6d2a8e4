//! Peers as tracers of small meshes, for the same tests as ours.
//!
//! A peer that panics while it builds or traces, as `obvhs` does on many equal triangles, loses all hits.

use std::panic::{AssertUnwindSafe, catch_unwind};

use canted_fixtures::{Mesh, object_views};
use canted_obb::Affine;
use canted_tests::{
    closed::baked,
    tracers::{Guarantee, Make, Method, Tracer},
};
use canted_tlas::Instance;
use canted_trace::{Hit, Ray};

use super::engine::{Engine, Entry};
use crate::models::{Model, Placed};

/// An engine that traces slices of rays; `None` if its build failed.
struct Peer(Option<Box<dyn Engine>>);

impl Peer {
    /// The engine's answers, which start as `nothing`.
    fn ask<T: Clone>(&self, n: usize, nothing: T, ask: impl FnOnce(&dyn Engine, &mut [T])) -> Vec<T> {
        let answer = || {
            let mut answers = vec![nothing.clone(); n];
            if let Some(engine) = &self.0 {
                ask(engine.as_ref(), &mut answers);
            }
            answers
        };
        catch_unwind(AssertUnwindSafe(answer)).unwrap_or_else(|_| vec![nothing; n])
    }
}

impl Tracer for Peer {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        self.ask(rays.len(), None, |engine, hits| engine.closest(rays, hits))
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        self.ask(rays.len(), false, |engine, occluded| engine.occluded(rays, occluded))
    }
}

/// Creates engines for a mesh.
type Offer = fn(&Model) -> Vec<Entry<'_>>;

/// Whether a transformed mesh is flattened with rounded vertices or placed as an instance.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Placing {
    Moved,
    #[cfg(feature = "peers")]
    Placed,
}

/// Every available peer that does not abort this process on such input, as tinybvh may: `obvhs`, and with the feature
/// `peers` the newest Embree, which supports instances.
pub(crate) fn methods() -> Vec<Method> {
    let methods = of(|model| super::obvhs::entries(&model.mesh), Placing::Moved).into_iter();
    #[cfg(feature = "peers")]
    let methods = methods.chain(of(super::embree::newest, Placing::Placed));
    methods.collect()
}

/// Peers that are not measured, by name, each with the reason.
pub(crate) fn skipped() -> Vec<String> {
    #[cfg(not(feature = "peers"))]
    let skipped = ["Embree and tinybvh: built without the feature `peers`, which `--peers` adds"];
    #[cfg(feature = "peers")]
    let skipped = [
        "tinybvh: a fatal error ends the process, and its bindings lack occlusion",
        "Embree: no library found in the system or at `CANTED_EMBREE`",
    ];
    #[cfg(feature = "peers")]
    let skipped = skipped.into_iter().take(1 + usize::from(canted_peers::embree::libraries().is_empty()));
    skipped.into_iter().map(str::to_owned).collect()
}

fn of(offer: Offer, placing: Placing) -> Vec<Method> {
    let names: Vec<String> = offer(&model(one())).into_iter().map(|entry| entry.name).collect();
    let method = |(i, name): (usize, String)| {
        let make: Make = Box::new(move |mesh: &Mesh, placement: &Affine| {
            let mut model = model(baked(mesh, placement));
            if placing != Placing::Moved && *placement != Affine::IDENTITY {
                let instances = vec![Instance::new(0, *placement)];
                model.placed = Some(Placed { meshes: vec![mesh.clone()], instances });
            }
            let build = || (offer(&model)[i].build)(1).ok();
            Box::new(Peer(catch_unwind(AssertUnwindSafe(build)).ok().flatten()))
        });
        Method::new(name, Guarantee::Peer, make)
    };
    names.into_iter().enumerate().map(method).collect()
}

/// A triangle, to list the available peers.
fn one() -> Mesh {
    Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] }
}

/// A model without views.
fn model(mesh: Mesh) -> Model {
    Model { views: object_views(&mesh), mesh, placed: None }
}
