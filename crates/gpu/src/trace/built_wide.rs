//! Eight-wide BVHs that the device builds.
//!
//! ```text
//! corners of meshes  -> build::Built -> build::WideBvhs        bottom levels
//! boxes of instances -> build::Built -^                         top level
//! ```
//!
//! Read back are the number of nodes of each level, whose depth sizes the stack, and the boxes of the roots.

use canted_lbvh::Corners;
use canted_tlas::Instance;

use super::binary::{CENTER_REACH, mesh_bounds, placed_boxes};
use super::coordinates::check_coordinates;
use super::layout::{BvhHeader, HitError};
use super::level::{Instances, Level};
use super::scene::{Nodes, TracedScene};
use super::top_level::{MeshBounds, Packing};
use super::wide::WideNodes;
use crate::build::{BuildConfig, Built, Items, Run, WideBvhs, WideConfig};
use crate::{Gpu, GpuError, wait::block_on};

impl TracedScene {
    /// Builds, on the device, one eight-wide BVH over the triangles of all instances, in world space: a binary
    /// tree collapsed there. `first_triangles` are the indices of the first triangle of each instance, in order.
    ///
    /// # Errors
    /// As for [`TracedScene::build_single_level`]; more than 2^26 triangles.
    pub fn build_wide_single_level(
        gpu: &Gpu,
        corners: &[Corners],
        first_triangles: &[u32],
        config: WideConfig,
    ) -> Result<Self, GpuError> {
        block_on(Self::build_wide_single_level_async(gpu, corners, first_triangles, config))
    }

    /// [`TracedScene::build_wide_single_level`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::build_wide_single_level`].
    pub async fn build_wide_single_level_async(
        gpu: &Gpu,
        corners: &[Corners],
        first_triangles: &[u32],
        config: WideConfig,
    ) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let bottom = bottom(&mut run, Items::triangles(gpu, [corners])?, config).await?;
        let bvhs = WideBvhs::new_async(&mut run, &bottom, None).await?;
        let bounds = mesh_bounds(gpu, &bottom).await?;
        check_coordinates(|| "the scene".to_owned(), bounds[0].reach.into())?;
        let level = &bvhs.levels[0];
        let header = header(level.roots[0], level.first_quad, bounds[0].reach, bvhs.is_oriented);
        let depth = level.depth;
        let level = Level::flat(gpu, first_triangles)?;
        Self::over(gpu, Nodes::Wide(WideNodes::built(bvhs)), &[header], level, depth).await
    }

    /// Builds, on the device, one eight-wide BVH per mesh, and one over the instances.
    ///
    /// # Errors
    /// As for [`TracedScene::build_two_level`]; more than 2^26 triangles.
    pub fn build_wide_two_level(
        gpu: &Gpu,
        meshes: &[&[Corners]],
        instances: &[Instance],
        config: WideConfig,
    ) -> Result<Self, GpuError> {
        block_on(Self::build_wide_two_level_async(gpu, meshes, instances, config))
    }

    /// [`TracedScene::build_wide_two_level`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::build_wide_two_level`].
    pub async fn build_wide_two_level_async(
        gpu: &Gpu,
        meshes: &[&[Corners]],
        instances: &[Instance],
        config: WideConfig,
    ) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let bottom = bottom(&mut run, Items::triangles(gpu, meshes.iter().copied())?, config).await?;
        let bounds = mesh_bounds(gpu, &bottom).await?;
        let packing = Packing::of(&bounds, instances)?;
        let boxes = placed_boxes(&packing, &bottom.roots_async(gpu).await?, instances);
        let config = BuildConfig { bits: config.bits, ..BuildConfig::default() };
        let top = Built::new_async(&mut run, Items::boxes(gpu, &boxes)?, config).await?;
        let bvhs = WideBvhs::new_async(&mut run, &bottom, Some(&top)).await?;
        let reach = packing.boxes.iter().fold(0.0, |all: f32, of_instance| all.max(of_instance.reach()));
        let [below, above] = [&bvhs.levels[0], &bvhs.levels[1]];
        let top_header = BvhHeader::wide(above.roots[0], above.first_quad, reach, packing.error);
        let of_mesh =
            |(&root, bounds): (&u32, &MeshBounds)| header(root, below.first_quad, bounds.reach, bvhs.is_oriented);
        let headers: Vec<BvhHeader> =
            std::iter::once(top_header).chain(below.roots.iter().zip(&bounds).map(of_mesh)).collect();
        let depth = below.depth + above.depth;
        let level = Level::Two(Instances::new(gpu, &packing, &packing.numbers)?);
        Self::over(gpu, Nodes::Wide(WideNodes::built(bvhs)), &headers, level, depth).await
    }
}

async fn bottom(run: &mut Run<'_>, items: Items, config: WideConfig) -> Result<Built, GpuError> {
    let WideConfig { bits, topology, strategy } = config;
    Built::with_topology_async(run, items, BuildConfig { bits, strategy }, topology).await
}

/// The header of a BVH over triangles with coordinates up to `reach`.
fn header(root: u32, first_quad: u32, reach: f32, is_oriented: bool) -> BvhHeader {
    let centers = if is_oriented { CENTER_REACH * reach } else { reach };
    BvhHeader::wide(root, first_quad, centers, HitError::of_triangles(reach))
}
