//! All BVHs of the chapter.

use anyhow::Result;
use canted_bvh2::{Bvh2, PairOrder};
use canted_fixtures::Mesh;
use canted_lbvh::{self as lbvh, Corners, Leaf, Strategy, VolumeConfig, Volumes, in_leaf_order, volumes};
use canted_obb::{Aabb, Obb};
use canted_sah::{Axes, Builder, PlocConfig, ReinsertConfig, SpatialConfig, Split, TopDownConfig};
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};
use obvhs::BvhBuildParams;

use super::external;
use super::metrics::Metrics;
use crate::models::Model;
use crate::wide::{
    engine::{Engine, Entry, Owner, Promise},
    obvhs as peer,
};

/// Origin and kind of a BVH.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    Aligned,
    Oriented,
    Wide,
    Obvhs,
    Other,
}

impl Family {
    pub(super) const ALL: [Self; 5] = [Self::Aligned, Self::Oriented, Self::Wide, Self::Obvhs, Self::Other];

    pub(super) fn is_ours(self) -> bool {
        matches!(self, Self::Aligned | Self::Oriented | Self::Wide)
    }

    /// Whether all of them use the same traversal.
    pub(super) fn is_binary_of_ours(self) -> bool {
        matches!(self, Self::Aligned | Self::Oriented)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Aligned => "ours, binary, axis-aligned",
            Self::Oriented => "ours, binary, oriented",
            Self::Wide => "ours, WideBvh",
            Self::Obvhs => "obvhs",
            Self::Other => "Embree, tinybvh",
        }
    }
}

/// Computes the metrics of a BVH, given its rays.
type Measure<'a> = Box<dyn Fn(&[Ray]) -> Result<Metrics> + 'a>;

/// A BVH to build.
pub(super) struct Tree<'a> {
    pub(super) entry: Entry<'a>,
    pub(super) family: Family,
    /// `None` if the BVH has no metrics.
    pub(super) metrics: Option<Measure<'a>>,
}

/// Our builders of binary BVHs.
const BUILDERS: [(&str, Builder); 9] = [
    ("radix", Builder::Lbvh),
    ("radix, reinserted", Builder::Reinserted(ReinsertConfig::BALANCED)),
    ("PLOC", Builder::FAST),
    ("PLOC, reinserted", Builder::BALANCED),
    ("PLOC, wide search, reinserted more", Builder::Ploc(PlocConfig::WIDE, Some(ReinsertConfig::QUALITY))),
    ("binned SAH", Builder::TopDown(TopDownConfig::BINNED, None)),
    ("swept SAH", Builder::TopDown(TopDownConfig::SWEEP, None)),
    ("midpoint", halving(Split::Midpoint)),
    ("median", halving(Split::Median)),
];

/// Splits nodes along their longest axis, regardless of cost.
const fn halving(split: Split) -> Builder {
    Builder::TopDown(TopDownConfig { split, axes: Axes::Longest, ..TopDownConfig::BINNED }, None)
}

/// Extra references per triangle of BVHs with spatial splits.
const BUDGETS: [f32; 2] = [0.3, 1.0];

/// Presets of `obvhs`.
fn presets() -> [(&'static str, BvhBuildParams); 6] {
    [
        ("obvhs, fastest", BvhBuildParams::fastest_build()),
        ("obvhs, very fast", BvhBuildParams::very_fast_build()),
        ("obvhs, fast", BvhBuildParams::fast_build()),
        ("obvhs, medium", BvhBuildParams::medium_build()),
        ("obvhs, slow", BvhBuildParams::slow_build()),
        ("obvhs, very slow", BvhBuildParams::very_slow_build()),
    ]
}

/// A WideBvh that computes hits.
pub(super) fn any(mesh: &Mesh) -> Result<TriangleBvh<Watertight>> {
    Ok(TriangleBvh::build(&mesh.positions, &mesh.triangles, &Config::preset(Preset::Fast))?)
}

/// Ours first.
pub(super) fn all<'a>(scene: &str, model: &'a Model) -> Vec<Tree<'a>> {
    let mesh = &model.mesh;
    let mut trees: Vec<Tree<'a>> = BUILDERS
        .iter()
        .map(|&(name, builder)| binary(format!("{name}, AABB"), mesh, builder, Strategy::Aabb))
        .collect();
    trees.extend(BUDGETS.map(|extra| with_splits(mesh, extra)));
    for (name, builder) in [BUILDERS[0], BUILDERS[3]] {
        for strategy in &Strategy::ALL[1..] {
            trees.push(binary(format!("{name}, {strategy:?}"), mesh, builder, *strategy));
        }
    }
    for (name, preset) in [("fast", Preset::Fast), ("balanced", Preset::Balanced), ("quality", Preset::Quality)] {
        let made = move || TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::preset(preset));
        let entry = ours(format!("WideBvh, {name}"), move |_| Ok(Box::new(made()?)));
        let metrics: Measure<'a> = Box::new(move |rays| Ok(external::of_wide(&made()?, rays)));
        trees.push(Tree { entry, family: Family::Wide, metrics: Some(metrics) });
    }
    for (name, params) in presets() {
        let metrics: Measure<'a> = Box::new(move |rays| external::of_obvhs(mesh, params, rays));
        trees.push(Tree { entry: peer::binary(name, mesh, params), family: Family::Obvhs, metrics: Some(metrics) });
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

/// The parts of a binary BVH.
struct Made {
    tree: lbvh::Tree,
    volumes: Volumes,
    corners: Vec<Corners>,
    /// The corners in leaf order.
    sorted: Vec<Corners>,
    bounds: Aabb,
}

fn binary(name: String, mesh: &Mesh, builder: Builder, strategy: Strategy) -> Tree<'_> {
    let family = if strategy == Strategy::Aabb { Family::Aligned } else { Family::Oriented };
    traced(name, family, move || {
        let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?;
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let tree = canted_sah::build(&boxes, &bounds, &builder);
        let sorted = in_leaf_order(&corners, &tree.leaves);
        let volumes = volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
        Ok(Made { tree, volumes, corners, sorted, bounds })
    })
}

/// A BVH with spatial splits and at most `extra` additional references per triangle.
///
/// Inner nodes bound the parts below them. Leaves bound the unsplit triangles, as in any triangle BVH: a ray that
/// enters a leaf outside the part tests the triangle in vain, but loses no hit.
fn with_splits(mesh: &Mesh, extra: f32) -> Tree<'_> {
    traced(format!("spatial splits, {extra} per triangle, AABB"), Family::Aligned, move || {
        let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?;
        let (mut tree, references) =
            canted_sah::spatial(&corners, &SpatialConfig { extra_references: extra, ..SpatialConfig::default() });
        let parts: Vec<Obb> = tree.leaves.iter().map(|part| Obb::from_aabb(&references.boxes[part.index()])).collect();
        let volumes = volumes(&tree, &parts, &VolumeConfig { strategy: Strategy::Aabb, fallback: true });
        tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
        let sorted = in_leaf_order(&corners, &tree.leaves);
        Ok(Made { tree, volumes, corners, sorted, bounds })
    })
}

fn traced<'a>(name: String, family: Family, made: impl Fn() -> Result<Made> + Copy + Send + Sync + 'a) -> Tree<'a> {
    let build = move |_| -> Result<Box<dyn Engine>> {
        let Made { tree, volumes, sorted, bounds, .. } = made()?;
        Ok(Box::new(Traced(Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst))))
    };
    let metrics = move |rays: &[Ray]| {
        let Made { tree, volumes, corners, bounds, .. } = made()?;
        Metrics::of(tree, &volumes, &corners, &bounds, rays)
    };
    Tree { entry: ours(name, build), family, metrics: Some(Box::new(metrics)) }
}

/// A binary BVH of ours.
struct Traced(Bvh2<Watertight>);

impl Engine for Traced {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.closest_hit(ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.0.occluded(ray);
        }
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(self.0.n_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::hierarchies::metrics::METRICS;
    use crate::report::subjects;
    use crate::wide::closest_sets;

    #[test]
    fn binary_bvhs_agree_and_splits_respect_their_budget() {
        let model = subjects::load(subjects::SMALL).unwrap().unwrap();
        let rays = closest_sets(&model, &any(&model.mesh).unwrap(), 32).concat();
        let binary: Vec<Tree<'_>> =
            all(subjects::SMALL, &model).into_iter().filter(|tree| tree.family.is_binary_of_ours()).collect();
        let answers = |tree: &Tree<'_>| {
            let engine = (tree.entry.build)(1).unwrap();
            let mut hits = vec![None; rays.len()];
            engine.closest(&rays, &mut hits);
            (hits, engine.n_bytes().unwrap())
        };
        let (hits, n_bytes) = answers(&binary[0]);
        let n_hits = hits.iter().flatten().count();
        assert!(n_hits > 100, "{n_hits} of {} rays hit", rays.len());
        let mut n_split = 0;
        for tree in &binary {
            let (found, found_bytes) = answers(tree);
            assert_eq!(found, hits, "{}", tree.entry.name);
            if tree.entry.name.starts_with("spatial") {
                n_split += usize::from(found_bytes > n_bytes);
                // Every leaf but the first adds a node.
                let most = 2 * n_bytes + n_bytes / model.mesh.triangles.len();
                assert!(found_bytes <= most, "{}: {found_bytes} bytes, without splits {n_bytes}", tree.entry.name);
                let metrics = tree.metrics.as_ref().unwrap()(&rays).unwrap();
                assert!(METRICS.iter().any(|(_, of)| of(&metrics).is_nan()), "several leaves contain a triangle");
            }
        }
        assert_eq!(n_split, BUDGETS.len());
    }
}
