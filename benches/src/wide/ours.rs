//! Our BVHs, and the list of all engines.

use anyhow::Result;
use canted_bvh2::{Bvh2, Bvh2Boxes, Bvh2Config};
use canted_fixtures::Mesh;
use canted_lbvh::{Strategy, VolumeConfig};
use canted_tlas::{Tlas, TopConfig};
use canted_trace::TriangleTest;
use canted_wide::{Config, Preset, TriangleBvh};

use super::engine::{Build, Entry, Owner, Promise, WithBytes};
use crate::{
    models::{Model, Placed},
    options::Options,
    wide::peers,
};

/// The name of the preset `balanced`.
pub(crate) const BALANCED: &str = "WideBvh balanced";

/// Presets of WideBvh, the slowest build first.
const PRESETS: [(&str, Preset); 4] = [
    ("WideBvh quality", Preset::Quality),
    (BALANCED, Preset::Balanced),
    ("WideBvh fast", Preset::Fast),
    ("WideBvh dynamic", Preset::Dynamic),
];

/// Ours, for one scene: watertight with each preset, and `quality` once with the Möller-Trumbore test.
pub(crate) fn entries(model: &Model) -> Vec<Entry<'_>> {
    let mut entries = promising(TriangleTest::Watertight, Promise::Watertight, &PRESETS, model);
    entries.extend(promising(TriangleTest::MollerTrumbore, Promise::Fast, &PRESETS[..1], model));
    entries
}

/// The name of `balanced` when it may not use oriented nodes.
pub(crate) const ALIGNED: &str = "WideBvh balanced, aligned nodes only";

/// Watertight BVHs with each preset, of two levels where the model places its meshes, the slowest build first; then
/// [`ALIGNED`].
pub(crate) fn presets(model: &Model) -> Vec<Entry<'_>> {
    let aligned = Config { oriented: false, ..Config::preset(Preset::Balanced) };
    let configs = PRESETS.map(|(name, preset)| (name, Config::preset(preset))).into_iter().chain([(ALIGNED, aligned)]);
    let entry = |(name, config): (&str, Config)| {
        let build: Build<'_> = match &model.placed {
            Some(placed) => Box::new(move |_| Ok(Box::new(wide_levels(placed, config)?))),
            None => one_level_wide(&model.mesh, config),
        };
        let (name, promise, is_placed) = (name.to_owned(), Promise::Watertight, model.placed.is_some());
        Entry { name, owner: Owner::Ours, promise, is_placed, is_parallel: true, build }
    };
    configs.map(entry).collect()
}

fn promising<'a>(test: TriangleTest, promise: Promise, presets: &[(&str, Preset)], model: &'a Model) -> Vec<Entry<'a>> {
    let entry = |name: &str, is_placed, build| {
        let name = name.to_owned();
        Entry { name, owner: Owner::Ours, promise, is_placed, is_parallel: true, build }
    };
    let config = move |preset| Config { test, ..Config::preset(preset) };
    let wide = |preset| one_level_wide(&model.mesh, config(preset));
    let mut entries: Vec<Entry<'a>> = presets.iter().map(|&(name, preset)| entry(name, false, wide(preset))).collect();
    if let Some(placed) = &model.placed {
        let build: Build<'a> = Box::new(move |_| Ok(Box::new(wide_levels(placed, config(Preset::Quality))?)));
        entries.insert(0, entry("TLAS, WideBvh quality", true, build));
    }
    entries
}

/// A binary BVH of a mesh.
pub(crate) fn one_level(mesh: &Mesh) -> Result<Bvh2> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?;
    let volumes = VolumeConfig { strategy: Strategy::Combined, fallback: true };
    let config = Bvh2Config { volumes, ..Bvh2Config::default() };
    Ok(Bvh2::over(crate::models::binary_tree(&corners, &bounds), &corners, &bounds, &config))
}

/// A binary BVH of each mesh, and a TLAS of the instances.
pub(crate) fn two_levels(placed: &Placed) -> Result<Tlas<Bvh2>> {
    let blas = placed.meshes.iter().map(one_level).collect::<Result<_>>()?;
    let top = TopConfig::other(Bvh2Boxes::builder(VolumeConfig { strategy: Strategy::Combined, fallback: true }));
    Ok(Tlas::new(blas, &placed.instances, top)?)
}

/// A WideBvh of a mesh.
fn one_level_wide(mesh: &Mesh, config: Config) -> Build<'_> {
    Box::new(move |_| {
        let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config)?;
        let n_bytes = bvh.n_bytes();
        Ok(Box::new(WithBytes(bvh, n_bytes)))
    })
}

/// A WideBvh of each mesh, and a TLAS of the instances.
fn wide_levels(placed: &Placed, config: Config) -> Result<WithBytes<Tlas<TriangleBvh>>> {
    let build = |mesh: &Mesh| Ok(TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config)?);
    let blas = placed.meshes.iter().map(build).collect::<Result<Vec<_>>>()?;
    let n_bytes: usize = blas.iter().map(TriangleBvh::n_bytes).sum();
    let tlas = Tlas::new(blas, &placed.instances, TopConfig::Wide(config))?;
    let n_bytes = n_bytes + tlas.n_bytes();
    Ok(WithBytes(tlas, n_bytes))
}

/// Every available and requested engine, ours first.
pub(crate) fn with_peers<'a>(scene: &str, model: &'a Model, options: &Options) -> Vec<Entry<'a>> {
    let mut entries = entries(model);
    #[cfg(feature = "peers")]
    entries.extend(super::embree::entries(model));
    entries.extend(peers::entries(&model.mesh));
    #[cfg(all(feature = "peers", target_feature = "avx2"))]
    if options.wants_engine("tinybvh") {
        entries.extend(super::tinybvh::entry(scene, &model.mesh));
    }
    #[cfg(not(all(feature = "peers", target_feature = "avx2")))]
    let _ = scene;
    entries.retain(|entry| options.wants_engine(&entry.name));
    entries
}
