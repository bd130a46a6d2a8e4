//! Our trees.

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_lbvh::{Strategy, VolumeConfig};
use canted_tlas::{Blas, BuildConfig, MeshBlas, Tlas};
use canted_trace::{Hit, InstanceId, Kernel, MollerTrumbore, Ray, Watertight};

use super::engine::{Build, Engine, Entry, Owner, Promise};
use crate::models::{Model, Placed};

/// The binary tree over one mesh.
struct Binary<K: Kernel>(MeshBlas<K>);

impl<K: Kernel> Engine for Binary<K> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.closest_hit(ray, InstanceId(0), &mut ());
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.0.occluded(ray, InstanceId(0), &mut ());
        }
    }

    fn n_bytes(&self) -> usize {
        self.0.n_bytes()
    }
}

/// Binary trees, and a tree of their instances.
struct TwoLevels<K: Kernel>(Tlas<MeshBlas<K>>);

impl<K: Kernel> Engine for TwoLevels<K> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.closest_hit(ray, &mut ());
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.0.occluded(ray, &mut ());
        }
    }

    fn n_bytes(&self) -> usize {
        self.0.blas().iter().map(MeshBlas::n_bytes).sum::<usize>() + self.0.binary().n_bytes()
    }
}

/// Ours, for one scene.
pub(crate) fn entries(model: &Model) -> Vec<Entry<'_>> {
    vec![entry::<MollerTrumbore>("ours", Promise::Fast, model), entry::<Watertight>("ours", Promise::Watertight, model)]
}

fn entry<'a, K: Kernel + 'static>(name: &str, promise: Promise, model: &'a Model) -> Entry<'a> {
    let build: Build<'a> = match &model.placed {
        None => Box::new(|_| Ok(Box::new(Binary(one_level::<K>(&model.mesh)?)))),
        Some(placed) => Box::new(|_| Ok(Box::new(TwoLevels(two_levels::<K>(placed)?)))),
    };
    let is_placed = model.placed.is_some();
    Entry { name: name.to_owned(), owner: Owner::Ours, promise, is_placed, is_parallel: true, build }
}

/// The tree that the program builds where nothing is asked for.
pub(crate) fn one_level<K: Kernel>(mesh: &Mesh) -> Result<MeshBlas<K>> {
    let (corners, bounds) = canted_lbvh::gather(&mesh.positions, &mesh.triangles)?;
    let volumes = VolumeConfig { strategy: Strategy::Combined, fallback: true };
    let config = BuildConfig { volumes, ..BuildConfig::default() };
    Ok(MeshBlas::over(canted_renderer::ploc_tree(&corners, &bounds), &corners, &bounds, &config))
}

/// A tree of each mesh, and one of the instances.
pub(crate) fn two_levels<K: Kernel>(placed: &Placed) -> Result<Tlas<MeshBlas<K>>> {
    let blas = placed.meshes.iter().map(one_level).collect::<Result<_>>()?;
    Ok(Tlas::new(blas, &placed.instances, VolumeConfig { strategy: Strategy::Combined, fallback: true })?)
}
