//! Peers as methods to trace small meshes: what they do where ours is put to the test.
//!
//! One that panics while it builds or traces, as `obvhs` does on a pile of equal triangles, answers no ray: all are lost.

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

/// An engine that answers rays by the slice; none where building it failed.
struct Peer(Option<Box<dyn Engine>>);

impl Peer {
    /// What the engine writes over answers that are no hits.
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

/// What offers engines for a mesh.
type Offer = fn(&Model) -> Vec<Entry<'_>>;

/// Whether a mesh that stands elsewhere is moved, its vertices rounded, or placed as an instance.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Placing {
    Moved,
    #[cfg(feature = "peers")]
    Placed,
}

/// Every peer at hand that does not end this process on such input, as tinybvh may: `obvhs`, and with the feature `peers` the newest
/// Embree, which knows instances.
pub(crate) fn methods() -> Vec<Method> {
    let methods = of(|model| super::obvhs::entries(&model.mesh), Placing::Moved).into_iter();
    #[cfg(feature = "peers")]
    let methods = methods.chain(of(super::embree::newest, Placing::Placed));
    methods.collect()
}

/// Peers that are not among the methods, by name, each with the reason.
pub(crate) fn left_out() -> Vec<String> {
    #[cfg(not(feature = "peers"))]
    let left_out = ["Embree and tinybvh: built without the feature `peers`, which `--peers` adds"];
    #[cfg(feature = "peers")]
    let left_out = [
        "tinybvh: what it takes for a fatal error ends the process that asks it, and its bindings lack occlusion",
        "Embree: there is no library, of the system or where `CANTED_EMBREE` points",
    ];
    #[cfg(feature = "peers")]
    let left_out = left_out.into_iter().take(1 + usize::from(canted_peers::embree::libraries().is_empty()));
    left_out.into_iter().map(str::to_owned).collect()
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

/// A triangle, to ask who is there.
fn one() -> Mesh {
    Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] }
}

/// A mesh as engines take it; nobody looks at it.
fn model(mesh: Mesh) -> Model {
    Model { views: object_views(&mesh), mesh, placed: None }
}
