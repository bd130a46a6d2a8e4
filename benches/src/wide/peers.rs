//! Peers as tracers of small meshes, for the same tests as ours; `obvhs`, built with its slowest preset, with triangles in leaf order.
//!
//! A peer that panics while it builds or traces, as `obvhs` does on many equal triangles, loses all hits.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::Duration,
};

use canted_fixtures::{Mesh, object_views};
use canted_obb::{Affine, PrimId};
use canted_tests::{
    scenes::baked,
    tracers::{Guarantee, Make, Method, Tracer},
};
use canted_tlas::Instance;
use canted_trace::{Hit, InstanceId, Ray, Side};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::{Ray as TheirRay, RayHit},
    triangle::Triangle,
};

use crate::{
    models::{Model, Placed},
    wide::engine::{Engine, Entry, Owner, Promise},
};

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
    let methods = of(|model| entries(&model.mesh), Placing::Moved).into_iter();
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

/// A BVH of `obvhs` with its triangles.
struct Obvhs<T> {
    tree: T,
    /// In leaf order: a split triangle occurs more than once.
    triangles: Vec<Triangle>,
    /// The caller's index of each triangle.
    primitives: Vec<u32>,
}

impl<T> Obvhs<T> {
    fn new(tree: T, all: &[Triangle], primitives: Vec<u32>) -> Self {
        let triangles = primitives.iter().map(|&i| all[i as usize]).collect();
        Self { tree, triangles, primitives }
    }

    /// Converts a hit of `obvhs`.
    fn hit(&self, found: bool, hit: &RayHit) -> Option<Hit> {
        found.then(|| Hit {
            t: hit.t,
            u: 0.0,
            v: 0.0,
            primitive: PrimId(self.primitives[hit.primitive_id as usize]),
            instance: InstanceId(0),
            side: Side::Front,
        })
    }
}

/// Both BVH types have traversal functions of the same names, but no common trait.
macro_rules! engine_of {
    ($tree:ty) => {
        impl Engine for Obvhs<$tree> {
            fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
                for (ray, out) in rays.iter().zip(hits) {
                    let mut hit = RayHit::none();
                    let found =
                        self.tree.ray_traverse(theirs(ray), &mut hit, |ray, i| self.triangles[i].intersect(ray));
                    *out = self.hit(found, &hit);
                }
            }

            fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
                for (ray, out) in rays.iter().zip(occluded) {
                    *out = !self.tree.ray_traverse_miss(theirs(ray), |ray, i| self.triangles[i].intersect(ray));
                }
            }

            fn n_bytes(&self) -> Option<usize> {
                Some(
                    size_of_val(&self.tree.nodes[..])
                        + size_of_val(&self.triangles[..])
                        + size_of_val(&self.primitives[..]),
                )
            }
        }
    };
}

engine_of!(Bvh2);
engine_of!(CwBvh);

/// Converts a ray for `obvhs`.
#[inline]
pub(crate) fn theirs(ray: &Ray) -> TheirRay {
    TheirRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

/// Both BVH types, built with the slowest preset.
pub(crate) fn entries(mesh: &Mesh) -> Vec<Entry<'_>> {
    let params = BvhBuildParams::very_slow_build();
    vec![binary("obvhs BVH2", mesh, params), wide("obvhs CWBVH", mesh, params)]
}

/// Their binary BVH with their own traversal.
fn binary<'a>(name: &str, mesh: &'a Mesh, params: BvhBuildParams) -> Entry<'a> {
    entry(name, move || {
        let all = triangles(mesh);
        let tree = build_bvh2_from_tris(&all, params, &mut Duration::default());
        let primitives = tree.primitive_indices.clone();
        Box::new(Obvhs::new(tree, &all, primitives))
    })
}

fn wide<'a>(name: &str, mesh: &'a Mesh, params: BvhBuildParams) -> Entry<'a> {
    entry(name, move || {
        let all = triangles(mesh);
        let tree = build_cwbvh_from_tris(&all, params, &mut Duration::default());
        let primitives = tree.primitive_indices.clone();
        Box::new(Obvhs::new(tree, &all, primitives))
    })
}

fn entry<'a>(name: &str, build: impl Fn() -> Box<dyn Engine> + Send + Sync + 'a) -> Entry<'a> {
    Entry {
        name: name.to_owned(),
        owner: Owner::Peer,
        promise: Promise::Fast,
        is_placed: false,
        is_parallel: false,
        build: Box::new(move |_| Ok(build())),
    }
}

/// Their triangles, in the mesh's order.
pub(crate) fn triangles(mesh: &Mesh) -> Vec<Triangle> {
    let corner = |i: u32| glam::Vec3A::from_array(mesh.positions[i as usize]);
    mesh.triangles.iter().map(|&[a, b, c]| Triangle { v0: corner(a), v1: corner(b), v2: corner(c) }).collect()
}
