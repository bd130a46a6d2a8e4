//! Embree, in every available version.

use canted_obb::PrimId;
use canted_peers::embree::{self, Library, Options, Placement, Quality, Scene};
use canted_trace::{Hit, InstanceId, Ray, Side};

use super::engine::{Engine, Entry, Owner, Promise};
use crate::models::Model;

/// A scene of Embree.
pub(crate) struct Embree(pub(crate) Scene);

impl Engine for Embree {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, out) in rays.iter().zip(hits) {
            *out = self.0.closest(ray.origin, ray.direction, [ray.t_min, ray.t_max]).map(|found| Hit {
                t: found.t,
                u: found.u,
                v: found.v,
                primitive: PrimId(found.primitive),
                instance: InstanceId(found.instance),
                side: Side::Front,
            });
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, out) in rays.iter().zip(occluded) {
            *out = self.0.occluded(ray.origin, ray.direction, [ray.t_min, ray.t_max]);
        }
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(self.0.n_bytes())
    }
}

/// The modes that are measured.
const MODES: [(&str, Quality, bool); 3] =
    [("high", Quality::High, false), ("medium", Quality::Medium, false), ("robust", Quality::High, true)];

/// Every version in every mode, for one scene.
pub(crate) fn entries(model: &Model) -> Vec<Entry<'_>> {
    embree::libraries().into_iter().flat_map(|library| modes(model, library)).collect()
}

/// The newest version in every mode.
pub(crate) fn newest(model: &Model) -> Vec<Entry<'_>> {
    embree::libraries().into_iter().take(1).flat_map(|library| modes(model, library)).collect()
}

fn modes(model: &Model, library: Library) -> [Entry<'_>; 3] {
    MODES.map(|(name, quality, is_robust)| entry(model, (library, name, quality, is_robust)))
}

fn entry<'a>(model: &'a Model, (library, mode, quality, is_robust): (Library, &str, Quality, bool)) -> Entry<'a> {
    let version = library.version();
    Entry {
        name: format!("Embree {}.{} {mode}", version / 10_000, version / 100 % 100),
        owner: Owner::Peer,
        promise: if is_robust { Promise::Watertight } else { Promise::Fast },
        is_placed: model.placed.is_some(),
        is_parallel: true,
        build: Box::new(move |n_threads| {
            let options = Options { quality, is_robust, n_threads };
            Ok(Box::new(Embree(match &model.placed {
                None => Scene::of_mesh(&library, &mesh(&model.mesh), &options)?,
                Some(placed) => {
                    let meshes: Vec<_> = placed.meshes.iter().map(mesh).collect();
                    let placement = |instance: &canted_tlas::Instance| Placement {
                        mesh: instance.blas as usize,
                        world_from_object: instance.world_from_object.columns,
                    };
                    let placements: Vec<_> = placed.instances.iter().map(placement).collect();
                    Scene::of_instances(&library, &meshes, &placements, &options)?
                }
            })))
        }),
    }
}

fn mesh(mesh: &canted_fixtures::Mesh) -> embree::Mesh<'_> {
    embree::Mesh { positions: &mesh.positions, triangles: &mesh.triangles }
}
