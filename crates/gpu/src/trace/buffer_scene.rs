//! A BVH over triangles in a program's own buffers, rebuilt or refitted in the program's command encoder.
//!
//! ```text
//! vertices, indices -> corners -> domain -> codes -> sort -> tree -> boxes -> nodes, headers     rebuild
//!                      corners ------------------------------------> boxes -> nodes, headers     refit
//! ```
//!
//! Later builds read nothing back: the depth of the tree is bounded by the bits of its codes and positions.

use bytemuck::{Pod, Zeroable};
use canted_shaders::wgsl;

use super::layout::{BvhHeader, CENTER_REACH, HIT_ERROR};
use super::nodes::{DeviceBvh, NewNodes};
use super::scene::TracedScene;
use super::tables::Level;
use crate::build::{
    BuildEncoder, Built, Change, Faults, MeshBoxes, MeshBuffers, Primitives, Scales, Which, fault, refit_aabbs,
};
use crate::{Gpu, GpuError, NamedBinding};

/// How a [`BufferScene`] or an [`InstancedScene`](crate::InstancedScene) is built. A [`DeviceBvh`], a [`BuildConfig`](crate::build::BuildConfig) and a
/// [`WideConfig`](crate::build::WideConfig) convert into this type.
#[derive(Clone, Copy, Debug)]
pub struct BufferConfig<'a> {
    /// Which BVHs.
    pub bvh: DeviceBvh,
    /// In one level: instances as parts of the triangles of all meshes, by the first triangle of each, in order. `None`: each mesh is an instance.
    pub parts: Option<&'a [u32]>,
    /// Whether the first build reports faults of triangles and instances, which waits for the device. Without this check a triangle with a
    /// fault counts as a point, and an instance with a fault is not placed; nothing hits them.
    pub is_checked: bool,
}

impl<T: Into<DeviceBvh>> From<T> for BufferConfig<'_> {
    fn from(bvh: T) -> Self {
        Self { bvh: bvh.into(), parts: None, is_checked: true }
    }
}

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
/// that. Refit what bends a little, as skinned meshes do; rebuild what changes its neighbors.
///
/// ```no_run
/// use canted_gpu::{BufferScene, Gpu, IndexBuffer, MeshBuffers, build::BuildConfig, block_on};
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
/// let mut scene = block_on(BufferScene::new(&gpu, &[mesh], BuildConfig::default()))?;
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
    /// The box of the tree, which only instances need.
    boxes: MeshBoxes,
    faults: Faults,
    /// Triangles of each mesh.
    n_triangles: Vec<u32>,
    bvh: DeviceBvh,
}

impl BufferScene {
    /// Builds a BVH, waits for it and, unless `config` says otherwise, checks the buffers.
    ///
    /// # Errors
    /// A buffer without the usage `STORAGE`, too short, or with an odd layout; a triangle with an index out of range or a vertex that is
    /// not finite or has coordinates above 1e18, by mesh and number; parts that do not start at triangle 0, are not in order, or start beyond the
    /// end; a limit of the device, or device lost.
    pub async fn new<'c>(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        config: impl Into<BufferConfig<'c>>,
    ) -> Result<Self, GpuError> {
        let BufferConfig { bvh, parts, is_checked } = config.into();
        let firsts = match parts {
            None => first_triangles(meshes),
            Some(parts) => {
                let n: u64 = meshes.iter().map(|mesh| u64::from(mesh.n_triangles)).sum();
                let is_in_order = parts.is_sorted() && parts.first().is_none_or(|&first| first == 0);
                if !is_in_order || parts.last().is_some_and(|&last| u64::from(last) > n) {
                    let message = format!("parts of {n} triangles must start at 0, in order and before the end");
                    return Err(GpuError::Input { message });
                }
                parts.to_vec()
            }
        };
        let mut build = BuildEncoder::new(gpu);
        let faults = gpu.zeroed("faults", 2 * meshes.len())?;
        let primitives = Primitives::of_buffers(&build, meshes)?;
        primitives.gather(&mut build, meshes, &faults)?;
        let bvh = bvh.shallow(primitives.len(), 0);
        let built = bvh.build(&mut build, primitives)?;
        let new = NewNodes::new(&mut build, bvh, &built, None)?;
        let depth = new.depth_bound(gpu, bvh, &built, None).await?;
        let traced = TracedScene::over(gpu, new.nodes, &new.headers, &Level::flat(&firsts), depth).await?;
        let n_triangles = meshes.iter().map(|mesh| mesh.n_triangles).collect();
        let boxes = gpu.zeroed("box of the tree", 1)?;
        let scene = Self { traced, built, boxes, faults, n_triangles, bvh };
        scene.put_header(&mut build)?;
        if is_checked {
            scene.check(gpu).await?;
        }
        Ok(scene)
    }

    /// Records a new build over moved vertices.
    ///
    /// # Errors
    /// As for [`BufferScene::new`], except for triangles with faults; another number of triangles in a mesh than before.
    pub fn rebuild(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
    ) -> Result<(), GpuError> {
        self.check_counts(meshes)?;
        let mut build = BuildEncoder::recorded(gpu, encoder);
        self.built.primitives.gather(&mut build, meshes, &self.faults)?;
        self.built.rebuild(&mut build, self.bvh.bottom())?;
        self.put(&mut build, Change::Trees)
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
        let mut build = BuildEncoder::recorded(gpu, encoder);
        self.built.primitives.gather(&mut build, meshes, &self.faults)?;
        refit_aabbs(&mut build, &self.built, [0, self.built.primitives.len()])?;
        self.built.refit_obbs(&mut build, self.bvh.bottom())?;
        self.put(&mut build, Change::Boxes)
    }

    /// Reads back whether the last build or refit found a fault. Waits for submitted work.
    ///
    /// # Errors
    /// A triangle with an index out of range or a bad vertex, by mesh and number; device lost.
    pub async fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        match fault(&gpu.read(&self.faults).await?) {
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

    fn put(&self, build: &mut BuildEncoder<'_>, change: Change) -> Result<(), GpuError> {
        self.traced.nodes.put_again(build, (Which::Bottom, &self.built), [0, 1], change)?;
        self.put_header(build)
    }

    fn put_header(&self, build: &mut BuildEncoder<'_>) -> Result<(), GpuError> {
        put_headers(build, &self.built, &self.traced, (0, &self.boxes), [0, 1])
    }
}

/// The number of the first triangle of each mesh.
fn first_triangles(meshes: &[MeshBuffers<'_>]) -> Vec<u32> {
    let mut n_before = 0_u32;
    let firsts = meshes.iter().map(|mesh| {
        let first = n_before;
        // A sum beyond 32 bits is rejected with the buffers.
        n_before = first.saturating_add(mesh.n_triangles);
        first
    });
    firsts.collect()
}

/// Rejects meshes with other numbers of triangles than before.
pub(super) fn check_same_counts(found: &[u32], before: &[u32]) -> Result<(), GpuError> {
    if found == before {
        return Ok(());
    }
    let message = format!("the meshes have {found:?} triangles, and had {before:?} when they were built");
    Err(GpuError::Input { message })
}

/// `HeaderScale` of `build/scene/headers`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct HeaderScale {
    reach: f32,
    error: f32,
    first_header: u32,
}

/// The scales of a level with these volumes.
pub(super) fn scales(is_oriented: bool) -> Scales {
    Scales { reach: if is_oriented { CENTER_REACH } else { 1.0 }, error: HIT_ERROR }
}

/// Writes the bounds of a range of trees into the headers of a scene, in which the level's first tree has header `first_header`, and their
/// boxes.
pub(super) fn put_headers(
    build: &mut BuildEncoder<'_>,
    built: &Built,
    scene: &TracedScene,
    (first_header, boxes): (u32, &MeshBoxes),
    trees: [u32; 2],
) -> Result<(), GpuError> {
    let gpu = build.gpu();
    let Scales { reach, error } = scales(built.obbs.is_some());
    let scale = gpu.uniform("scale of headers", &HeaderScale { reach, error, first_header })?;
    let headers = scene.tables().headers();
    let more: [NamedBinding<'_>; 4] =
        [("aabbs", &built.aabbs), ("headers", headers), ("header_scale", &scale), ("mesh_boxes", boxes)];
    let bound = built.primitives.bound(&more);
    build.stage("headers", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::scene::HEADERS, &built.primitives.part())?;
        dispatches.range(&kernel, &bound, trees)
    })
}

// The kernel writes four quads per header.
const _: () = assert!(size_of::<BvhHeader>() == 64);
