//! Our trees.

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_lbvh::{Strategy, VolumeConfig};
use canted_tlas::{BuildConfig, MeshBlas, Tlas};
use canted_trace::{Hit, Kernel, MollerTrumbore, Ray, Watertight};
use canted_wide::{Config, LaneKernel, Preset, Wide};

use super::engine::{Build, Engine, Entry, Owner, Promise};
use crate::models::{Model, Placed};

impl<K: LaneKernel> Engine for Wide<K> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_hits(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_many(rays, occluded);
    }

    fn n_bytes(&self) -> usize {
        Wide::n_bytes(self)
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

/// Presets of the wide tree, the most careful first.
const PRESETS: [(&str, Preset); 3] =
    [("wide quality", Preset::Quality), ("wide balanced", Preset::Balanced), ("wide fast", Preset::Fast)];

/// Ours, for one scene: with either promise.
pub(crate) fn entries(model: &Model) -> Vec<Entry<'_>> {
    let mut entries = promising::<MollerTrumbore>(Promise::Fast, model);
    entries.extend(promising::<Watertight>(Promise::Watertight, model));
    entries
}

fn promising<K: LaneKernel + 'static>(promise: Promise, model: &Model) -> Vec<Entry<'_>> {
    let mesh = &model.mesh;
    let entry = |name: &str, is_placed, build| {
        let name = name.to_owned();
        Entry { name, owner: Owner::Ours, promise, is_placed, is_parallel: true, build }
    };
    let wide = |preset| -> Build<'_> {
        Box::new(move |_| Ok(Box::new(Wide::<K>::build(&mesh.positions, &mesh.triangles, &Config::preset(preset))?)))
    };
    let mut entries: Vec<Entry<'_>> =
        PRESETS.into_iter().map(|(name, preset)| entry(name, false, wide(preset))).collect();
    if let Some(placed) = &model.placed {
        let build: Build<'_> = Box::new(|_| Ok(Box::new(TwoLevels(two_levels::<K>(placed)?))));
        entries.insert(0, entry("two levels, binary", true, build));
    }
    entries
}

/// The tree that the program builds where nothing is asked for.
pub(crate) fn one_level<K: Kernel>(mesh: &Mesh) -> Result<MeshBlas<K>> {
    let (corners, bounds) = canted_lbvh::gather(&mesh.positions, &mesh.triangles)?;
    let volumes = VolumeConfig { strategy: Strategy::Combined, fallback: true };
    let config = BuildConfig { volumes, ..BuildConfig::default() };
    Ok(MeshBlas::over(crate::models::binary_tree(&corners, &bounds), &corners, &bounds, &config))
}

/// A tree of each mesh, and one of the instances.
pub(crate) fn two_levels<K: Kernel>(placed: &Placed) -> Result<Tlas<MeshBlas<K>>> {
    let blas = placed.meshes.iter().map(one_level).collect::<Result<_>>()?;
    Ok(Tlas::new(blas, &placed.instances, VolumeConfig { strategy: Strategy::Combined, fallback: true })?)
}
