//! A BVH over triangles in a program's own buffers, rebuilt or refitted in the program's command encoder.
//!
//! ```text
//! vertices, indices -> corners -> domain -> codes -> sort -> tree -> boxes -> pairs, headers     rebuild
//!                      corners ------------------------------------> boxes -> pairs, headers     refit
//! ```
//!
//! Nothing is read back: the depth of the tree is bounded by the bits of its codes and positions.

use bytemuck::{Pod, Zeroable};
use canted_lbvh::{Bits, Strategy};

use super::binary::{CENTER_REACH, Pairs, header};
use super::layout::{BvhHeader, HIT_ERROR, HitError};
use super::level::Level;
use super::scene::{Nodes, TracedScene};
use crate::build::{BuildConfig, Built, Faults, Items, MeshBuffers, Run, aabbs, fault};
use crate::{Gpu, GpuError, NamedBinding};

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

/// `HeaderScale` of `build/headers`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct HeaderScale {
    reach: f32,
    error: f32,
}

impl BufferScene {
    /// Builds a BVH, waits for it and checks the buffers.
    ///
    /// # Errors
    /// A buffer without the usage `STORAGE`, too short, or with an odd layout; a triangle with an index out of range or a vertex that is
    /// not finite or has coordinates above 1e18, by mesh and number; strategies other than [`Strategy::Aabb`] and [`Strategy::Dop`],
    /// whose builds read results back; a limit of the device, or device lost.
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
        if !matches!(config.strategy, Strategy::Aabb | Strategy::Dop) {
            let what = format!("recorded builds with volumes {:?}, which read results back", config.strategy);
            return Err(GpuError::Unsupported { what });
        }
        let mut run = Run::new(gpu);
        let faults = gpu.zeroed("faults", 2)?;
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
    /// As for [`BufferScene::rebuild`]; a strategy other than [`Strategy::Aabb`].
    pub fn refit(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
    ) -> Result<(), GpuError> {
        self.check_counts(meshes)?;
        if self.config.strategy != Strategy::Aabb {
            return Err(GpuError::Unsupported { what: "a refit of oriented boxes".to_owned() });
        }
        let mut run = Run::recorded(gpu, encoder);
        self.built.items.gather(&mut run, meshes, &self.faults)?;
        self.built.aabbs = aabbs(&mut run, &self.built.items, &self.built.leaves, &self.built.trees)?;
        self.put(&mut run)
    }

    /// Reads back whether the last build or refit found a fault. Waits for submitted work.
    ///
    /// # Errors
    /// A triangle with an index out of range or a bad vertex, by mesh and number; device lost.
    pub fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        match fault(&gpu.read(&self.faults)?, &self.n_triangles) {
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
        if found == self.n_triangles {
            return Ok(());
        }
        let message =
            format!("the meshes have {found:?} triangles, and had {:?} when they were built", self.n_triangles);
        Err(GpuError::Invalid { message })
    }

    fn put(&self, run: &mut Run<'_>) -> Result<(), GpuError> {
        if let Nodes::Binary(pairs) = &self.traced.nodes {
            pairs.put_again(run, &self.built)?;
        }
        self.put_header(run)
    }

    fn put_header(&self, run: &mut Run<'_>) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let reach = if self.built.obbs.is_some() { CENTER_REACH } else { 1.0 };
        let scale = gpu.uniform("scale of headers", &HeaderScale { reach, error: HIT_ERROR })?;
        let more: [NamedBinding<'_>; 3] =
            [("aabbs", &self.built.aabbs), ("headers", self.traced.headers()), ("header_scale", &scale)];
        let bound = self.built.items.bound(&more);
        run.stage("headers", |dispatches| {
            let kernel = gpu.kernel("build/headers", &self.built.items.part())?;
            dispatches.items(&kernel, &bound, 1)
        })
    }
}

/// Greatest number of nodes between the root and a leaf, both counted: a level for each bit of a code and of a position.
fn depth_bound(n: u32, bits: Bits) -> u32 {
    let code = if bits == Bits::B30 { 30 } else { 63 };
    code + n.max(1).next_power_of_two().ilog2() + 1
}

// The kernel writes four quads per header.
const _: () = assert!(size_of::<BvhHeader>() == 64);
