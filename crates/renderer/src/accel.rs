//! The BVH of one mesh: which one, and how it is built.

mod bvh;

use canted_bih::Bih;
use canted_bvh2::{BuildConfig, Bvh2, PairOrder};
use canted_kdtree::KdTree;
use canted_lbvh::{self as lbvh, Corners, Leaf, Strategy, VolumeConfig};
use canted_obb::{Aabb, Obb, PrimId};
use canted_sah::{SpatialConfig, TopDownConfig};
use canted_scene::Mesh;
use canted_tlas::TopConfig;
use canted_trace::pad_aabb;
use canted_wide::{Config, LaneKernel, MAX_TRIANGLES, MovingBvh, Preset, TriangleBvh};

use crate::PrepareError;

pub use bvh::Bvh;

/// The acceleration structure over a mesh, and over the instances of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accel {
    /// Eight-wide nodes, aligned or oriented, whichever is predicted to be cheaper.
    Wide {
        /// Build effort.
        preset: Preset,
        /// Builder of the binary tree that is collapsed; `None` for the preset's.
        builder: Option<Builder>,
    },
    /// Binary nodes with one kind of bounding volume.
    Binary {
        /// The bounding volumes.
        strategy: Strategy,
        /// Builder of the tree; `None` for [`Builder::Ploc`].
        builder: Option<Builder>,
    },
    /// A bounding interval hierarchy over the triangles of a mesh, below wide nodes over instances.
    Bih,
    /// A SAH kd-tree over the triangles of a mesh, below wide nodes over instances.
    KdTree,
}

impl Default for Accel {
    fn default() -> Self {
        Self::Wide { preset: Preset::default(), builder: None }
    }
}

/// Builder of binary trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Builder {
    /// Merges neighbors along the Morton curve by area, then reinserts subtrees.
    Ploc,
    /// The radix tree over Morton codes.
    Lbvh,
    /// Top down by the surface area heuristic.
    Sah,
    /// As [`Builder::Sah`], but triangles that cross a split may be in both children, each with the box of its part.
    Sbvh,
    /// The external crate `obvhs`, of which only the tree is used.
    #[cfg(feature = "baseline")]
    Obvhs,
}

impl Builder {
    /// Our own builder; `None` for an external one.
    fn own(self) -> Option<canted_sah::Builder> {
        match self {
            Self::Lbvh => Some(canted_sah::Builder::Lbvh),
            Self::Ploc => Some(canted_sah::Builder::BALANCED),
            Self::Sah => Some(canted_sah::Builder::TopDown(TopDownConfig::BINNED, None)),
            Self::Sbvh => None,
            #[cfg(feature = "baseline")]
            Self::Obvhs => None,
        }
    }

    /// The tree over triangles, one per leaf.
    fn tree(self, corners: &[Corners], bounds: &Aabb) -> Result<lbvh::Tree, PrepareError> {
        match self {
            #[cfg(feature = "baseline")]
            Self::Obvhs if corners.len() > 1 => {
                Ok(crate::baseline::obvhs_tree(corners, obvhs::BvhBuildParams::medium_build())?)
            }
            // Over centroids, as `canted tree` writes it; `canted_sah` builds its radix tree over boxes.
            Self::Lbvh => {
                let bits = lbvh::Bits::B63;
                let codes = lbvh::morton_codes(&lbvh::Domain::new(bounds, 3, bits), corners);
                Ok(lbvh::radix(lbvh::sort_by_code(&codes, bits)))
            }
            _ => {
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                Ok(canted_sah::build(&boxes, bounds, &self.own().unwrap_or_default()))
            }
        }
    }
}

impl Accel {
    /// Triangles that one BVH can index.
    pub(crate) fn max_triangles(&self) -> usize {
        match self {
            Self::Wide { .. } => MAX_TRIANGLES,
            Self::Binary { .. } | Self::Bih | Self::KdTree => lbvh::MAX_PRIMITIVES,
        }
    }

    /// The BVH over instances.
    pub(crate) fn top(&self) -> TopConfig {
        match *self {
            Self::Wide { preset, .. } => TopConfig::Wide(Config::preset(preset)),
            Self::Binary { strategy, .. } => TopConfig::Binary(VolumeConfig { strategy, fallback: true }),
            Self::Bih | Self::KdTree => TopConfig::Wide(Config::default()),
        }
    }

    /// Builds the BVH of a mesh.
    pub(crate) fn build<K: LaneKernel>(
        &self,
        Triangles { positions, close, triangles }: Triangles,
    ) -> Result<Bvh<K>, PrepareError> {
        if let Some(close) = close {
            let &Self::Wide { preset, .. } = self else { return Err(PrepareError::MovingTriangles) };
            return Ok(Bvh::Moving(MovingBvh::build(positions, close, triangles, &Config::preset(preset))?));
        }
        let (strategy, builder) = match *self {
            Self::Wide { preset, builder } => return Ok(Bvh::Wide(wide(positions, triangles, preset, builder)?)),
            Self::Binary { strategy, builder } => (strategy, builder.unwrap_or(Builder::Ploc)),
            Self::Bih => return Ok(Bvh::Bih(Bih::build(positions, triangles, &canted_bih::Config::default())?)),
            Self::KdTree => {
                return Ok(Bvh::KdTree(KdTree::build(positions, triangles, &canted_kdtree::Config::default())?));
            }
        };
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let config = VolumeConfig { strategy, fallback: true };
        if builder != Builder::Sbvh {
            let config = BuildConfig { volumes: config, ..BuildConfig::default() };
            return Ok(Bvh::Binary(Bvh2::over(builder.tree(&corners, &bounds)?, &corners, &bounds, &config), strategy));
        }
        let (tree, volumes) = {
            let (tree, parts) = parts(&corners);
            // Padded by the reach of the whole triangle, to which the errors of its hits are relative.
            let padded = |(part, leaf): (&Aabb, &PrimId)| pad_aabb(part, corners[leaf.index()].aabb().reach());
            let leaves: Vec<Obb> = parts.iter().zip(&tree.leaves).map(|of| Obb::from_aabb(&padded(of))).collect();
            let volumes = lbvh::volumes(&tree, &leaves, &config);
            (tree, volumes)
        };
        let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
        Ok(Bvh::Binary(Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst), strategy))
    }
}

/// A tree with spatial splits whose leaves name triangles, and the boxes of their parts in leaf order.
fn parts(corners: &[Corners]) -> (lbvh::Tree, Vec<Aabb>) {
    let (mut tree, references) = canted_sah::spatial(corners, &SpatialConfig::default());
    let parts = tree.leaves.iter().map(|part| references.boxes[part.index()]).collect();
    tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
    (tree, parts)
}

/// The triangles of a mesh, or of all instances.
#[derive(Clone, Copy)]
pub(crate) struct Triangles<'a> {
    pub(crate) positions: &'a [[f32; 3]],
    /// Positions at shutter close, if the vertices move.
    pub(crate) close: Option<&'a [[f32; 3]]>,
    pub(crate) triangles: &'a [[u32; 3]],
}

impl<'a> From<&'a Mesh> for Triangles<'a> {
    fn from(Mesh { positions, close, triangles, .. }: &'a Mesh) -> Self {
        Self { positions, close: close.as_ref().map(|close| &close.positions[..]), triangles }
    }
}

fn wide<K: LaneKernel>(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    preset: Preset,
    builder: Option<Builder>,
) -> Result<TriangleBvh<K>, PrepareError> {
    let preset = Config::preset(preset);
    let config = match builder.map(|builder| (builder, builder.own())) {
        None => preset,
        Some((_, Some(own))) => Config { builder: own, alternative_builder: None, groups: None, ..preset },
        Some((Builder::Sbvh, _)) => {
            let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
            let (tree, parts) = parts(&corners);
            return Ok(TriangleBvh::over_parts(&tree, parts, &corners, &bounds, &preset)?);
        }
        Some((external, None)) if triangles.len() > 1 => {
            let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
            let tree = external.tree(&corners, &bounds)?;
            return Ok(TriangleBvh::over(&tree, &corners, &bounds, &preset)?);
        }
        Some(_) => preset,
    };
    Ok(TriangleBvh::build(positions, triangles, &config)?)
}
