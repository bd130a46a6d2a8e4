//! Peers as ways to trace small meshes: what they do where ours is put to the test.

use canted_fixtures::{Mesh, object_views};
use canted_obb::Affine;
use canted_tests::{
    closed::baked,
    tracers::{Make, Tracer, Way, Word},
};
use canted_trace::{Hit, Ray};

use super::engine::{Engine, Entry};
use crate::models::Model;

/// An engine that answers rays by the slice.
struct Peer(Box<dyn Engine>);

impl Tracer for Peer {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        self.0.closest(rays, &mut hits);
        hits
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let mut occluded = vec![false; rays.len()];
        self.0.occluded(rays, &mut occluded);
        occluded
    }
}

/// What offers engines for a mesh.
type Offer = fn(&Model) -> Vec<Entry<'_>>;

/// Every peer at hand that does not take this process down on such input: `obvhs`, and with the feature `peers` the newest
/// Embree.
pub(crate) fn ways() -> Vec<Way> {
    let ways = of(|model| super::obvhs::entries(&model.mesh)).into_iter();
    #[cfg(feature = "peers")]
    let ways = ways.chain(of(super::embree::newest));
    ways.collect()
}

fn of(offer: Offer) -> Vec<Way> {
    let names: Vec<String> = offer(&model(one())).into_iter().map(|entry| entry.name).collect();
    let way = |(i, name): (usize, String)| {
        let make: Make = Box::new(move |mesh: &Mesh, place: &Affine| {
            let model = model(baked(mesh, place));
            let engine = (offer(&model)[i].build)(1).expect("an engine that was built for a triangle");
            Box::new(Peer(engine))
        });
        Way { name, word: Word::Peer, make }
    };
    names.into_iter().enumerate().map(way).collect()
}

/// A triangle, to ask who is there.
fn one() -> Mesh {
    Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] }
}

/// A mesh as engines take it; nobody looks at it.
fn model(mesh: Mesh) -> Model {
    Model { views: object_views(&mesh), mesh, placed: None }
}
