//! The BVH of one mesh: which one, and how it is built.

use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{self as lbvh, Corners, Leaf, Strategy, VolumeConfig};
use canted_obb::{Aabb, Obb};
use canted_sah::TopDownConfig;
use canted_tlas::{Blas, TopConfig};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Query, Ray};
use canted_wide::{Config, LaneKernel, MAX_TRIANGLES, Preset, RefitError, TriangleBvh};

use crate::PrepareError;

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
            Self::Binary { .. } => lbvh::MAX_PRIMITIVES,
        }
    }

    /// The BVH over instances.
    pub(crate) fn top(&self) -> TopConfig {
        match *self {
            Self::Wide { preset, .. } => TopConfig::Wide(Config::preset(preset)),
            Self::Binary { strategy, .. } => TopConfig::Binary(VolumeConfig { strategy, fallback: true }),
        }
    }

    /// Builds the BVH of a mesh.
    pub(crate) fn build<K: LaneKernel>(
        &self,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Bvh<K>, PrepareError> {
        let (strategy, builder) = match *self {
            Self::Wide { preset, builder } => return Ok(Bvh::Wide(wide(positions, triangles, preset, builder)?)),
            Self::Binary { strategy, builder } => (strategy, builder.unwrap_or(Builder::Ploc)),
        };
        let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
        let tree = builder.tree(&corners, &bounds)?;
        let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
        let volumes = lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
        Ok(Bvh::Binary(Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst), strategy))
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
        Some((external, None)) if triangles.len() > 1 => {
            let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
            let tree = external.tree(&corners, &bounds)?;
            return Ok(TriangleBvh::over(&tree, &corners, &bounds, &preset)?);
        }
        Some(_) => preset,
    };
    Ok(TriangleBvh::build(positions, triangles, &config)?)
}

/// A bottom-level BVH.
pub enum Bvh<K: LaneKernel> {
    /// Eight-wide, with aligned and oriented nodes.
    Wide(TriangleBvh<K>),
    /// Binary, with volumes of one strategy.
    Binary(Bvh2<K>, Strategy),
}

impl<K: LaneKernel> Bvh<K> {
    /// Memory of nodes and triangles.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        match self {
            Self::Wide(wide) => wide.n_bytes(),
            Self::Binary(binary, _) => binary.n_bytes(),
        }
    }

    /// Updates the boxes to new vertices of the same triangles; returns the drift, or `None` where this kind of BVH cannot be
    /// refitted.
    pub(crate) fn refit(
        &mut self,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Option<f32>, PrepareError> {
        match self {
            Self::Wide(wide) => match wide.refit(positions, triangles) {
                Ok(refit) => Ok(Some(refit.drift)),
                Err(RefitError::Geometry(error)) => Err(error.into()),
                // The caller then builds a BVH over the new number of triangles.
                Err(_) => Ok(None),
            },
            Self::Binary(..) => Ok(None),
        }
    }

    /// Whether it has oriented nodes.
    pub(crate) fn has_oriented_nodes(&self) -> bool {
        match self {
            Self::Wide(wide) => {
                let [_, oriented] = wide.sizes().nodes;
                oriented > 0 || wide.frame() != Obb::IDENTITY_FRAME
            }
            Self::Binary(_, strategy) => *strategy != Strategy::Aabb,
        }
    }
}

impl<K: LaneKernel> Blas for Bvh<K> {
    fn bounds(&self) -> Obb {
        match self {
            Self::Wide(wide) => wide.bounds(),
            Self::Binary(binary, _) => binary.bounds(),
        }
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
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

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        match self {
            Self::Wide(wide) => wide.all_hits_with(ray_object, instance, query, hits),
            Self::Binary(binary, _) => binary.all_hits_with(ray_object, instance, query, hits),
        }
    }
}
