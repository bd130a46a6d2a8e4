//! A BVH over triangles in a program's own buffers, rebuilt or refitted in the program's command encoder.
//!
//! ```text
//! vertices, indices -> corners -> domain -> codes -> sort -> tree -> boxes -> nodes, headers     rebuild
//!                      corners ------------------------------------> boxes -> nodes, headers     refit
//! ```
//!
//! Later builds read nothing back: the depth of the tree is bounded by the bits of its codes and positions.

use super::device_bvh::{DeviceBvh, NewNodes};
use super::headers::put_headers;
use super::level::Level;
use super::scene::TracedScene;
use crate::build::{Built, Change, Faults, Items, MeshBuffers, Run, Which, fault, refit_aabbs};
use crate::{Gpu, GpuError, wait::block_on};

/// A BVH over the triangles of meshes in a program's own buffers, in world space. Meshes are numbered as instances. [`DeviceBvh`] says
/// which BVH.
///
/// * [`Self::new`] submits work of its own and waits for it. Submit before what fills the buffers.
/// * [`Self::rebuild`] and [`Self::refit`] record into the program's encoder and read nothing back. Submit encoders in the order of recording.
/// * If an encoder is dropped, or a call returns an error, call `rebuild` next, not `refit`.
/// * The number of meshes is fixed, and the number of triangles in each. For others make a new scene, module, pipeline and bind group.
/// * Positions are copied, so the program may overwrite its buffers after the submission.
/// * The bindings of [`Self::traced`] stay valid as long as the scene.
/// * A rebuild allocates its working buffers anew.
///
/// # Bad contents
/// Kernels read what the buffers contain: a triangle with an index out of range, or with a vertex that is not finite or has coordinates above
/// 1e18, counts as a point, which nothing hits. [`Self::new`] reports the first with a bad index, or else the first with a bad vertex. After a rebuild or refit [`Self::check`] does; it waits
/// for the device, so call it while debugging, or once in many frames.
///
/// # Rebuild or refit
/// A refit takes a fifth to a quarter of the time of a rebuild, but keeps the topology: rays take longer the more the mesh deforms, and the device does not measure
/// that. Refit what bends a little, as skinned meshes do; rebuild what changes its neighbours.
///
/// ```no_run
/// use canted_gpu::{BufferScene, Gpu, IndexBuffer, MeshBuffers, build::BuildConfig};
///
/// # fn example(device: wgpu::Device, queue: wgpu::Queue, vertices: wgpu::Buffer, indices: wgpu::Buffer) -> Result<(), canted_gpu::GpuError> {
/// let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
/// let mesh = MeshBuffers {
///     vertices: &vertices,
///     first_byte: 0,
///     stride: 32, // position, normal and texture coordinates
///     n_vertices: 1000,
///     indices: Some(IndexBuffer { buffer: &indices, format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
///     n_triangles: 2000,
/// };
/// let mut scene = BufferScene::new(&gpu, &[mesh], BuildConfig::default())?;
/// let wgsl = scene.traced().module(1)?; // closest_hit(ray), occluded(ray), with buffers in bind group 1
///
/// // Each frame: the program moves vertices, the BVH follows, and a kernel that includes `wgsl` traces rays.
/// let mut encoder = device.create_command_encoder(&Default::default());
/// scene.rebuild(&gpu, &mut encoder, &[mesh])?;
/// queue.submit([encoder.finish()]);
/// # Ok(())
/// # }
/// ```
pub struct BufferScene {
    traced: TracedScene,
    built: Built,
    faults: Faults,
    /// Triangles of each mesh.
    n_triangles: Vec<u32>,
    bvh: DeviceBvh,
}

impl BufferScene {
    /// Builds a BVH, waits for it and checks the buffers.
    ///
    /// # Errors
    /// A buffer without the usage `STORAGE`, too short, or with an odd layout; a triangle with an index out of range or a vertex that is
    /// not finite or has coordinates above 1e18, by mesh and number; a limit of the device, or device lost.
    pub fn new(gpu: &Gpu, meshes: &[MeshBuffers<'_>], bvh: impl Into<DeviceBvh>) -> Result<Self, GpuError> {
        block_on(Self::new_async(gpu, meshes, bvh))
    }

    /// [`BufferScene::new`] for browsers.
    ///
    /// # Errors
    /// As for [`BufferScene::new`].
    pub async fn new_async(gpu: &Gpu, meshes: &[MeshBuffers<'_>], bvh: impl Into<DeviceBvh>) -> Result<Self, GpuError> {
        let scene = Self::without_check_async(gpu, meshes, bvh).await?;
        scene.check_async(gpu).await?;
        Ok(scene)
    }

    /// The same, where the instances are parts of the triangles of all meshes: `first_triangles` has where each starts, in order.
    ///
    /// # Errors
    /// As for [`BufferScene::new`]; parts that do not start at triangle 0, are not in order, or start beyond the end.
    pub fn new_in_parts(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        first_triangles: &[u32],
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        block_on(Self::new_in_parts_async(gpu, meshes, first_triangles, bvh))
    }

    /// [`BufferScene::new_in_parts`] for browsers.
    ///
    /// # Errors
    /// As for [`BufferScene::new_in_parts`].
    pub async fn new_in_parts_async(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        first_triangles: &[u32],
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        let n: u64 = meshes.iter().map(|mesh| u64::from(mesh.n_triangles)).sum();
        let is_in_order = first_triangles.is_sorted() && first_triangles.first().is_none_or(|&first| first == 0);
        if !is_in_order || first_triangles.last().is_some_and(|&last| u64::from(last) > n) {
            let message = format!("parts of {n} triangles must start at 0, in order and before the end");
            return Err(GpuError::Input { message });
        }
        let scene = Self::over(gpu, meshes, first_triangles, bvh.into()).await?;
        scene.check_async(gpu).await?;
        Ok(scene)
    }

    /// Builds a BVH without checking the buffers. A triangle with a fault counts as a point, which nothing hits.
    ///
    /// # Errors
    /// As for [`BufferScene::new`], except for triangles with faults.
    pub fn without_check(gpu: &Gpu, meshes: &[MeshBuffers<'_>], bvh: impl Into<DeviceBvh>) -> Result<Self, GpuError> {
        block_on(Self::without_check_async(gpu, meshes, bvh))
    }

    /// [`BufferScene::without_check`] for browsers.
    ///
    /// # Errors
    /// As for [`BufferScene::without_check`].
    pub async fn without_check_async(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        let mut n_before = 0_u32;
        let firsts = meshes.iter().map(|mesh| {
            let first = n_before;
            // A sum beyond 32 bits is rejected with the buffers.
            n_before = first.saturating_add(mesh.n_triangles);
            first
        });
        let firsts: Vec<u32> = firsts.collect();
        Self::over(gpu, meshes, &firsts, bvh.into()).await
    }

    /// A BVH whose instances start at these triangles.
    async fn over(gpu: &Gpu, meshes: &[MeshBuffers<'_>], firsts: &[u32], bvh: DeviceBvh) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let faults = gpu.zeroed("faults", 2 * meshes.len())?;
        let items = Items::of_buffers(&run, meshes)?;
        items.gather(&mut run, meshes, &faults)?;
        let bvh = bvh.shallow(items.len(), 0);
        let built = bvh.build(&mut run, items).await?;
        let NewNodes { nodes, headers, depth } = NewNodes::new(&mut run, bvh, &built, None).await?;
        let traced = TracedScene::over(gpu, nodes, &headers, Level::flat(gpu, firsts)?, depth).await?;
        let n_triangles = meshes.iter().map(|mesh| mesh.n_triangles).collect();
        let scene = Self { traced, built, faults, n_triangles, bvh };
        scene.put_header(&mut run)?;
        Ok(scene)
    }

    /// Records a new build over moved vertices.
    ///
    /// # Errors
    /// As for [`BufferScene::without_check`]; another number of triangles in a mesh than before.
    pub fn rebuild(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
    ) -> Result<(), GpuError> {
        self.check_counts(meshes)?;
        let mut run = Run::recorded(gpu, encoder);
        self.built.items.gather(&mut run, meshes, &self.faults)?;
        self.built.rebuild(&mut run, self.bvh.bottom())?;
        self.put(&mut run, Change::Trees)
    }

    /// Records new boxes for moved vertices over the same tree.
    ///
    /// # Errors
    /// As for [`BufferScene::rebuild`].
    pub fn refit(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
    ) -> Result<(), GpuError> {
        self.check_counts(meshes)?;
        let mut run = Run::recorded(gpu, encoder);
        self.built.items.gather(&mut run, meshes, &self.faults)?;
        refit_aabbs(&mut run, &self.built, [0, self.built.items.len()])?;
        self.built.refit_obbs(&mut run, self.bvh.bottom())?;
        self.put(&mut run, Change::Boxes)
    }

    /// Reads back whether the last build or refit found a fault. Waits for submitted work.
    ///
    /// # Errors
    /// A triangle with an index out of range or a bad vertex, by mesh and number; device lost.
    pub fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        block_on(self.check_async(gpu))
    }

    /// [`BufferScene::check`] for browsers.
    ///
    /// # Errors
    /// As for [`BufferScene::check`].
    pub async fn check_async(&self, gpu: &Gpu) -> Result<(), GpuError> {
        match fault(&gpu.read_async(&self.faults).await?) {
            None => Ok(()),
            Some(message) => Err(GpuError::Input { message }),
        }
    }

    /// The scene as kernels trace it.
    #[must_use]
    pub fn traced(&self) -> &TracedScene {
        &self.traced
    }

    fn check_counts(&self, meshes: &[MeshBuffers<'_>]) -> Result<(), GpuError> {
        let found: Vec<u32> = meshes.iter().map(|mesh| mesh.n_triangles).collect();
        check_same_counts(&found, &self.n_triangles)
    }

    fn put(&self, run: &mut Run<'_>, change: Change) -> Result<(), GpuError> {
        self.traced.nodes.put_again(run, (Which::Bottom, &self.built), [0, 1], change)?;
        self.put_header(run)
    }

    fn put_header(&self, run: &mut Run<'_>) -> Result<(), GpuError> {
        put_headers(run, &self.built, &self.traced, 0, [0, 1])
    }
}

/// Rejects meshes with other numbers of triangles than before.
pub(super) fn check_same_counts(found: &[u32], before: &[u32]) -> Result<(), GpuError> {
    if found == before {
        return Ok(());
    }
    let message = format!("the meshes have {found:?} triangles, and had {before:?} when they were built");
    Err(GpuError::Input { message })
}
