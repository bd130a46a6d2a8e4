//! A BVH over triangles in a program's own buffers, rebuilt or refitted in the program's command encoder.
//!
//! ```text
//! vertices, indices -> corners -> domain -> codes -> sort -> tree -> boxes -> pairs, headers     rebuild
//!                      corners ------------------------------------> boxes -> pairs, headers     refit
//! ```
//!
//! Nothing is read back: the depth of the tree is bounded by the bits of its codes and positions.

use super::binary::{Pairs, header};
use super::headers::put_headers;
use super::layout::HitError;
use super::level::Level;
use super::scene::{Nodes, TracedScene};
use crate::build::{BuildConfig, Built, Faults, Items, MeshBuffers, Run, depth_bound, fault, refit_aabbs};
use crate::{Gpu, GpuError};

/// A binary BVH over the triangles of meshes in a program's own buffers, in world space. Meshes are numbered as instances.
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
    config: BuildConfig,
}

impl BufferScene {
    /// Builds a BVH, waits for it and checks the buffers.
    ///
    /// # Errors
    /// A buffer without the usage `STORAGE`, too short, or with an odd layout; a triangle with an index out of range or a vertex that is
    /// not finite or has coordinates above 1e18, by mesh and number; a limit of the device, or device lost.
    pub fn new(gpu: &Gpu, meshes: &[MeshBuffers<'_>], config: BuildConfig) -> Result<Self, GpuError> {
        let scene = Self::without_check(gpu, meshes, config)?;
        scene.check(gpu)?;
        Ok(scene)
    }

    /// Builds a BVH without checking the buffers. A triangle with a fault counts as a point, which nothing hits.
    ///
    /// # Errors
    /// As for [`BufferScene::new`], except for triangles with faults.
    pub fn without_check(gpu: &Gpu, meshes: &[MeshBuffers<'_>], config: BuildConfig) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let faults = gpu.zeroed("faults", 2 * meshes.len())?;
        let items = Items::of_buffers(&run, meshes)?;
        items.gather(&mut run, meshes, &faults)?;
        let n = items.len();
        let built = Built::new(&mut run, items, config)?;
        let pairs = Pairs::over(&mut run, &built)?;
        let mut n_before = 0;
        let firsts = meshes.iter().map(|mesh| {
            let first = n_before;
            n_before += mesh.n_triangles;
            first
        });
        let firsts: Vec<u32> = firsts.collect();
        let header = header(built.items.ranges()[0], 0, 0.0, HitError::of_triangles(0.0), pairs.is_oriented());
        let level = Level::flat(gpu, &firsts)?;
        let traced = TracedScene::over(gpu, Nodes::Binary(pairs), &[header], level, depth_bound(n, config.bits))?;
        let scene =
            Self { traced, built, faults, n_triangles: meshes.iter().map(|mesh| mesh.n_triangles).collect(), config };
        scene.put_header(&mut run)?;
        Ok(scene)
    }

    /// Records a new build over moved vertices. The bindings of [`BufferScene::traced`] stay valid.
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
        self.built.rebuild(&mut run, self.config)?;
        self.put(&mut run)
    }

    /// Records new boxes for moved vertices over the same tree, which costs less than a build; rays take longer the more the mesh
    /// deforms. The bindings of [`BufferScene::traced`] stay valid.
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
        self.built.refit_obbs(&mut run, self.config)?;
        self.put(&mut run)
    }

    /// Reads back whether the last build or refit found a fault. Waits for submitted work.
    ///
    /// # Errors
    /// A triangle with an index out of range or a bad vertex, by mesh and number; device lost.
    pub fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        match fault(&gpu.read(&self.faults)?) {
            None => Ok(()),
            Some(message) => Err(GpuError::Invalid { message }),
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

    fn put(&self, run: &mut Run<'_>) -> Result<(), GpuError> {
        if let Nodes::Binary(pairs) = &self.traced.nodes {
            pairs.put_again(run, &self.built, 0, [0, self.built.items.len()])?;
        }
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
    Err(GpuError::Invalid { message })
}
