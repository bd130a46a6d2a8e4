//! Binary BVHs that the device builds and traverses.
//!
//! ```text
//! corners of meshes -> build::Built -> pairs        bottom levels
//! boxes of instances -> build::Built -> pairs       top level
//! ```
//!
//! Read back are the depth of the trees, which sizes the stack, and the boxes of the roots, from which the CPU places instances.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Corners;
use canted_obb::{Aabb, Obb};
use canted_tlas::Instance;

use super::coordinates::check_coordinates;
use super::layout::{BvhHeader, HitError, Quad};
use super::level::{Instances, Level};
use super::nodes::{EMPTY, LEAF};
use super::scene::{Nodes, TracedScene};
use super::top_level::{MeshBounds, Packing};
use crate::build::{BuildConfig, Built, Items, Range, Run, Which};
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation, wait::block_on};

/// How far the center of an oriented box may lie from the origin, in units of the greatest coordinate of what it encloses; see
/// `shared/binary/volume/obb`.
pub(super) const CENTER_REACH: f32 = 3.0;

/// Binary trees in the form that rays traverse: `build/pairs`.
pub(super) struct Pairs {
    pairs: Buffer<Quad>,
    /// Vertices of the triangles.
    corners: Arc<Buffer<Corners>>,
    is_oriented: bool,
    /// First node of the second level.
    first_top_node: u32,
}

/// `Level` of `build/pairs`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TargetLevel {
    first_node: u32,
}

impl Pairs {
    /// Converts trees, whose nodes are numbered one level after another. The first level is over triangles.
    pub(super) fn new(run: &mut Run<'_>, first: &Built, second: Option<&Built>) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        let Some(corners) = first.items.corners() else {
            return Err(GpuError::Input { message: "the first level is not over triangles".to_owned() });
        };
        let is_oriented = first.obbs.is_some();
        let first_top_node = first.items.len();
        let n_nodes = first_top_node + second.map_or(0, |built| built.items.len());
        let quads = if is_oriented { 8 } else { 4 };
        let pairs = gpu.zeroed("binary nodes", n_nodes as usize * quads)?;
        let corners = corners.clone();
        let pairs = Self { pairs, corners, is_oriented, first_top_node };
        pairs.put(run, Which::Bottom, first, [0, first.items.len()])?;
        if let Some(second) = second {
            pairs.put(run, Which::Top, second, [0, second.items.len()])?;
        }
        Ok(pairs)
    }

    /// Converts a single level.
    pub(super) fn over(run: &mut Run<'_>, built: &Built) -> Result<Self, GpuError> {
        Self::new(run, built, None)
    }

    /// Converts a range of items of a level: whole trees.
    pub(super) fn put(&self, run: &mut Run<'_>, which: Which, built: &Built, items: [u32; 2]) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let first_node = if which == Which::Top { self.first_top_node } else { 0 };
        let level = gpu.uniform("level", &TargetLevel { first_node })?;
        let (part, volumes): (_, NamedBinding<'_>) = match &built.obbs {
            None => ("shared/build/pair/aabb", ("aabbs", &built.aabbs)),
            Some(obbs) => ("shared/build/pair/obb", ("obbs", obbs)),
        };
        let bound = built.items.bound(&[
            volumes,
            ("nodes", &built.trees.nodes),
            ("leaves", &built.leaves),
            ("pairs", &self.pairs),
            ("target_level", &level),
        ]);
        run.stage("pairs", |dispatches| {
            let kernel = gpu.kernel("build/pairs", &built.items.part().part("pair", part))?;
            dispatches.range(&kernel, &bound, items)
        })
    }

    pub(super) fn is_oriented(&self) -> bool {
        self.is_oriented
    }

    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        vec![("nodes", &self.pairs), ("corners", &*self.corners)]
    }

    pub(super) fn specialise(&self, chosen: Specialisation) -> Specialisation {
        let volume = if self.is_oriented { "shared/binary/volume/obb" } else { "shared/binary/volume/aabb" };
        chosen.part("traverse", "shared/binary/traverse/stack").part("volume", volume)
    }

    pub(super) fn n_bytes(&self) -> u64 {
        self.pairs.n_bytes() + self.corners.n_bytes()
    }
}

impl TracedScene {
    /// Builds, on the device, one binary BVH over the triangles of all instances, in world space. `first_triangles` are the
    /// indices of the first triangle of each instance, in order.
    ///
    /// ```no_run
    /// use canted_gpu::{Choice, Gpu, TracedScene, build::BuildConfig};
    /// use canted_trace::Ray;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let gpu = Gpu::open(&Choice::Best)?;
    /// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let scene = TracedScene::build_single_level(&gpu, &[triangle], &[0], BuildConfig::default())?;
    /// let hits = scene.closest_hits(&gpu, &[Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])])?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// An unsupported strategy; coordinates above [`MAX_COORDINATE`](crate::MAX_COORDINATE); a limit of the device, or device lost.
    pub fn build_single_level(
        gpu: &Gpu,
        corners: &[Corners],
        first_triangles: &[u32],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        block_on(Self::build_single_level_async(gpu, corners, first_triangles, config))
    }

    /// [`TracedScene::build_single_level`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::build_single_level`].
    pub async fn build_single_level_async(
        gpu: &Gpu,
        corners: &[Corners],
        first_triangles: &[u32],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let bottom = Built::new_async(&mut run, Items::triangles(gpu, [corners])?, config).await?;
        let bounds = mesh_bounds(gpu, &bottom).await?;
        check_coordinates(|| "the scene".to_owned(), bounds[0].reach.into())?;
        let depth = gpu.read_async(&bottom.trees.depth).await?[0];
        let pairs = Pairs::over(&mut run, &bottom)?;
        let headers = headers(bottom.items.ranges(), &bounds, pairs.is_oriented);
        let level = Level::flat(gpu, first_triangles)?;
        Self::over(gpu, Nodes::Binary(pairs), &headers, level, depth).await
    }

    /// Builds, on the device, one binary BVH per mesh, and one over the instances.
    ///
    /// # Errors
    /// As for [`TracedScene::build_single_level`] and [`TracedScene::two_level`].
    pub fn build_two_level(
        gpu: &Gpu,
        meshes: &[&[Corners]],
        instances: &[Instance],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        block_on(Self::build_two_level_async(gpu, meshes, instances, config))
    }

    /// [`TracedScene::build_two_level`] for browsers.
    ///
    /// # Errors
    /// As for [`TracedScene::build_two_level`].
    pub async fn build_two_level_async(
        gpu: &Gpu,
        meshes: &[&[Corners]],
        instances: &[Instance],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let bottom = Built::new_async(&mut run, Items::triangles(gpu, meshes.iter().copied())?, config).await?;
        let bounds = mesh_bounds(gpu, &bottom).await?;
        let packing = Packing::of(&bounds, instances)?;
        let boxes = placed_boxes(&packing, &bottom.roots_async(gpu).await?, instances);
        let top = Built::new_async(&mut run, Items::boxes(gpu, &boxes)?, config).await?;
        let depth = gpu.read_async(&bottom.trees.depth).await?[0] + gpu.read_async(&top.trees.depth).await?[0];
        let n_bottom = bottom.items.len();
        let pairs = Pairs::new(&mut run, &bottom, Some(&top))?;
        let reach = packing.boxes.iter().fold(0.0, |all: f32, of_instance| all.max(of_instance.reach()));
        let range = Range { first: 0, count: top.items.len() };
        let top_header = header(range, n_bottom, reach, packing.error, pairs.is_oriented);
        let headers: Vec<BvhHeader> =
            std::iter::once(top_header).chain(headers(bottom.items.ranges(), &bounds, pairs.is_oriented)).collect();
        let level = Level::Two(Instances::new(gpu, &packing, &packing.numbers)?);
        Self::over(gpu, Nodes::Binary(pairs), &headers, level, depth).await
    }
}

/// Bounds of each mesh, read back.
pub(super) async fn mesh_bounds(gpu: &Gpu, bottom: &Built) -> Result<Vec<MeshBounds>, GpuError> {
    let of_root = |aabb: Aabb| MeshBounds { reach: if aabb.is_empty() { 0.0 } else { aabb.reach() }, aabb };
    Ok(bottom.root_aabbs(gpu).await?.into_iter().map(of_root).collect())
}

/// World-space boxes of instances with triangles: the transformed root, which is oriented; all places of a moving one.
pub(super) fn placed_boxes(packing: &Packing, roots: &[Option<Obb>], instances: &[Instance]) -> Vec<Obb> {
    let placed = |(&number, swept): (&u32, &Aabb)| {
        let instance = &instances[number as usize];
        match &roots[instance.blas as usize] {
            Some(root) if instance.world_from_object_close.is_none() => root.transformed(&instance.world_from_object),
            _ => Obb::from_aabb(swept),
        }
    };
    packing.numbers.iter().zip(&packing.boxes).map(placed).collect()
}

/// Headers of the trees over triangles.
fn headers(ranges: &[Range], bounds: &[MeshBounds], is_oriented: bool) -> Vec<BvhHeader> {
    let of = |(range, bounds): (&Range, &MeshBounds)| {
        header(*range, 0, bounds.reach, HitError::of_triangles(bounds.reach), is_oriented)
    };
    ranges.iter().zip(bounds).map(of).collect()
}

pub(super) fn header(range: Range, first_node: u32, reach: f32, error: HitError, is_oriented: bool) -> BvhHeader {
    let root = match range.count {
        0 => EMPTY,
        1 => LEAF | range.first,
        _ => first_node + range.first,
    };
    BvhHeader::binary(root, range.first, if is_oriented { CENTER_REACH * reach } else { reach }, error)
}
