use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{self as lbvh, Corners, Leaf, Strategy, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_tlas::Blas;
use canted_trace::{Hit, InstanceId, Query, Ray};
use canted_wide::{Config, LaneKernel, Preset, TriangleBvh};

use crate::PrepareError;

/// Which builder makes the binary trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Builder {
    /// The preset's; [`Builder::Ploc`] for volumes by name, which have no preset.
    #[default]
    Auto,
    /// Neighbours along the curve joined by area, then subtrees reinserted.
    Ploc,
    /// The radix tree as it is.
    Lbvh,
    /// From the root down, where the surface area heuristic says.
    Sah,
    /// `obvhs`: its tree, our boxes.
    #[cfg(feature = "baseline")]
    Obvhs,
}

/// How a bottom level is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelConfig {
    pub(crate) builder: Builder,
    pub(crate) preset: Preset,
    /// Volumes of a binary tree; `None` makes a wide one.
    pub(crate) strategy: Option<Strategy>,
}

/// A bottom level of either kind.
pub enum Level<K: LaneKernel> {
    /// Eight-wide nodes that lean where that pays.
    Wide(TriangleBvh<K>),
    /// A binary tree with volumes of one strategy.
    Binary(Bvh2<K>, Strategy),
}

impl<K: LaneKernel> Level<K> {
    /// Memory of nodes and triangles.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        match self {
            Self::Wide(wide) => wide.n_bytes(),
            Self::Binary(binary, _) => binary.n_bytes(),
        }
    }

    /// Whether any of its nodes leans.
    pub(crate) fn leans(&self) -> bool {
        match self {
            Self::Wide(wide) => {
                let [_, oriented] = wide.sizes().nodes;
                oriented > 0 || wide.frame() != Obb::IDENTITY_FRAME
            }
            Self::Binary(_, strategy) => *strategy != Strategy::Aabb,
        }
    }
}

impl<K: LaneKernel> Blas for Level<K> {
    fn bounds(&self) -> Obb {
        match self {
            Self::Wide(wide) => wide.bounds(),
            Self::Binary(binary, _) => binary.bounds(),
        }
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        match self {
            Self::Wide(wide) => wide.closest_hit_with(ray_object, instance, query),
            Self::Binary(binary, _) => binary.closest_hit_with(ray_object, instance, query),
        }
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        match self {
            Self::Wide(wide) => wide.occluded_with(ray_object, instance, query),
            Self::Binary(binary, _) => binary.occluded_with(ray_object, instance, query),
        }
    }
}

/// Builds one bottom level.
pub(crate) fn build_level<K: LaneKernel>(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    config: &LevelConfig,
) -> Result<Level<K>, PrepareError> {
    match config.strategy {
        None => Ok(Level::Wide(wide(positions, triangles, config)?)),
        Some(strategy) => {
            let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
            let tree = binary_tree(&corners, &bounds, config.builder)?;
            let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
            let volumes = lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
            Ok(Level::Binary(Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst), strategy))
        }
    }
}

fn wide<K: LaneKernel>(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    config: &LevelConfig,
) -> Result<TriangleBvh<K>, PrepareError> {
    let preset = Config::preset(config.preset);
    #[cfg(feature = "baseline")]
    if config.builder == Builder::Obvhs && triangles.len() > 1 {
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let tree = binary_tree(&corners, &bounds, config.builder)?;
        return Ok(TriangleBvh::over(&tree, &corners, &bounds, &preset)?);
    }
    let config = match own(config.builder) {
        Some(builder) => Config { builder, alternative_builder: None, ..preset },
        None => preset,
    };
    Ok(TriangleBvh::build(positions, triangles, &config)?)
}

/// The builder of ours that a name stands for; `None` for the preset's.
fn own(builder: Builder) -> Option<canted_sah::Builder> {
    match builder {
        Builder::Lbvh => Some(canted_sah::Builder::Lbvh),
        Builder::Ploc => Some(canted_sah::Builder::BALANCED),
        Builder::Sah => Some(canted_sah::Builder::TopDown(canted_sah::TopDownConfig::BINNED, None)),
        _ => None,
    }
}

/// A binary tree over triangles, one a leaf.
fn binary_tree(corners: &[Corners], bounds: &Aabb, builder: Builder) -> Result<lbvh::Tree, PrepareError> {
    match builder {
        #[cfg(feature = "baseline")]
        Builder::Obvhs if corners.len() > 1 => {
            Ok(crate::baseline::obvhs_tree(corners, obvhs::BvhBuildParams::medium_build())?)
        }
        // The radix tree of a binary level stands over centroids, as `canted tree` writes it.
        Builder::Lbvh => {
            let bits = lbvh::Bits::B63;
            let codes = lbvh::morton_codes(&lbvh::Domain::new(bounds, 3, bits), corners);
            Ok(lbvh::radix(lbvh::sort_by_code(&codes, bits)))
        }
        _ => {
            let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
            Ok(canted_sah::build(&boxes, bounds, &own(builder).unwrap_or_default()))
        }
    }
}
