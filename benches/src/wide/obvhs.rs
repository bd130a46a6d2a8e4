//! `obvhs`, built with its slowest preset, with triangles in leaf order.

use std::time::Duration;

use canted_fixtures::Mesh;
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Ray, Side};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::{Ray as TheirRay, RayHit},
    triangle::Triangle,
};

use super::engine::{Engine, Entry, Owner, Promise};

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
