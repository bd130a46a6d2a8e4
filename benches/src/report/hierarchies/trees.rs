//! All trees of the chapter.

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_lbvh::{Corners, Leaf, Strategy, VolumeConfig, in_leaf_order, volumes};
use canted_obb::Aabb;
use canted_sah::{Builder, PlocConfig, ReinsertConfig, TopDownConfig};
use canted_tlas::{Blas, MeshBlas, PairOrder};
use canted_trace::{Hit, InstanceId, Ray, Watertight};
use canted_wide::{Config, Preset, Wide};
use obvhs::BvhBuildParams;

use super::metrics::Metrics;
use crate::models::Model;
use crate::wide::{
    engine::{Engine, Entry, Owner, Promise},
    obvhs as peer,
};

/// Whose tree it is, and of what kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    Aligned,
    Leaning,
    Wide,
    Obvhs,
    Other,
}

impl Family {
    pub(super) const ALL: [Self; 5] = [Self::Aligned, Self::Leaning, Self::Wide, Self::Obvhs, Self::Other];

    pub(super) fn is_ours(self) -> bool {
        matches!(self, Self::Aligned | Self::Leaning | Self::Wide)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Aligned => "ours, binary, axis-aligned",
            Self::Leaning => "ours, binary, leaning",
            Self::Wide => "ours, wide",
            Self::Obvhs => "obvhs",
            Self::Other => "Embree, tinybvh",
        }
    }
}

/// Metrics of a tree, from the rays that it answers.
type Measure<'a> = Box<dyn Fn(&[Ray]) -> Result<Metrics> + 'a>;

/// A tree to be built.
pub(super) struct Tree<'a> {
    pub(super) entry: Entry<'a>,
    pub(super) family: Family,
    /// Of binary trees.
    pub(super) metrics: Option<Measure<'a>>,
}

/// Our builders of binary trees.
const BUILDERS: [(&str, Builder); 7] = [
    ("radix", Builder::Lbvh),
    ("radix, reinserted", Builder::Reinserted(ReinsertConfig::BALANCED)),
    ("PLOC", Builder::FAST),
    ("PLOC, reinserted", Builder::BALANCED),
    ("PLOC, wide, reinserted more", Builder::Ploc(PlocConfig::WIDE, Some(ReinsertConfig::QUALITY))),
    ("binned SAH", Builder::TopDown(TopDownConfig::BINNED, None)),
    ("swept SAH", Builder::TopDown(TopDownConfig::SWEEP, None)),
];

/// Presets of `obvhs`.
fn presets() -> [(&'static str, BvhBuildParams); 4] {
    [
        ("obvhs, fastest", BvhBuildParams::fastest_build()),
        ("obvhs, fast", BvhBuildParams::fast_build()),
        ("obvhs, medium", BvhBuildParams::medium_build()),
        ("obvhs, very slow", BvhBuildParams::very_slow_build()),
    ]
}

/// A wide tree, for whoever needs hits.
pub(super) fn any(mesh: &Mesh) -> Result<Wide<Watertight>> {
    Ok(Wide::build(&mesh.positions, &mesh.triangles, &Config::preset(Preset::Fast))?)
}

/// Ours first.
pub(super) fn all<'a>(scene: &str, model: &'a Model) -> Vec<Tree<'a>> {
    let mesh = &model.mesh;
    let mut trees: Vec<Tree<'a>> = BUILDERS
        .iter()
        .map(|&(name, builder)| binary(format!("{name}, AABB"), mesh, builder, Strategy::Aabb))
        .collect();
    for (name, builder) in [BUILDERS[0], BUILDERS[3]] {
        for strategy in &Strategy::ALL[1..] {
            trees.push(binary(format!("{name}, {strategy:?}"), mesh, builder, *strategy));
        }
    }
    for (name, preset) in [("fast", Preset::Fast), ("balanced", Preset::Balanced), ("quality", Preset::Quality)] {
        let build = move |_| -> Result<Box<dyn Engine>> {
            Ok(Box::new(Wide::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::preset(preset))?))
        };
        trees.push(Tree { entry: ours(format!("wide, {name}"), build), family: Family::Wide, metrics: None });
    }
    for (name, params) in presets() {
        trees.push(Tree { entry: peer::binary(name, mesh, params), family: Family::Obvhs, metrics: None });
    }
    let cwbvh = peer::entries(mesh).into_iter().filter(|entry| entry.name.contains("CWBVH"));
    trees.extend(cwbvh.map(|entry| Tree { entry, family: Family::Obvhs, metrics: None }));
    others(scene, model, &mut trees);
    trees
}

#[cfg(feature = "peers")]
fn others<'a>(scene: &str, model: &'a Model, trees: &mut Vec<Tree<'a>>) {
    let entries = crate::wide::embree::newest(model);
    #[cfg(target_feature = "avx2")]
    let entries: Vec<_> = entries.into_iter().chain(crate::wide::tinybvh::entry(scene, &model.mesh)).collect();
    #[cfg(not(target_feature = "avx2"))]
    let _ = scene;
    trees.extend(entries.into_iter().map(|entry| Tree { entry, family: Family::Other, metrics: None }));
}

#[cfg(not(feature = "peers"))]
fn others<'a>(_: &str, _: &'a Model, _: &mut Vec<Tree<'a>>) {}

fn ours<'a>(name: String, build: impl Fn(usize) -> Result<Box<dyn Engine>> + Send + Sync + 'a) -> Entry<'a> {
    let (owner, promise) = (Owner::Ours, Promise::Watertight);
    Entry { name, owner, promise, is_placed: false, is_parallel: true, build: Box::new(build) }
}

fn binary(name: String, mesh: &Mesh, builder: Builder, strategy: Strategy) -> Tree<'_> {
    let made = move || -> Result<_> {
        let (corners, bounds) = canted_lbvh::gather(&mesh.positions, &mesh.triangles)?;
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let tree = canted_sah::build(&boxes, &bounds, &builder);
        let sorted = in_leaf_order(&corners, &tree.leaves);
        let volumes = volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
        Ok((tree, volumes, corners, sorted, bounds))
    };
    let build = move |_| -> Result<Box<dyn Engine>> {
        let (tree, volumes, _, sorted, bounds) = made()?;
        Ok(Box::new(Walked(MeshBlas::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst))))
    };
    let metrics = move |rays: &[Ray]| {
        let (tree, volumes, corners, _, bounds): (_, _, Vec<Corners>, _, _) = made()?;
        Metrics::of(tree, &volumes, &corners, &bounds, rays)
    };
    let family = if strategy == Strategy::Aabb { Family::Aligned } else { Family::Leaning };
    Tree { entry: ours(name, build), family, metrics: Some(Box::new(metrics)) }
}

/// A binary tree of ours.
struct Walked(MeshBlas<Watertight>);

impl Engine for Walked {
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
