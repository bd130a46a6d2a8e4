//! Instances of meshes in a program's own buffers, built in the program's command encoder.
//!
//! ```text
//! vertices, indices -> corners -> one tree per mesh -> nodes, headers, mesh boxes      rebuild, or one mesh: rebuild or refit
//! transforms, mesh boxes -> place -> tree over instances -> nodes, header              update of the top level
//! ```
//!
//! Updates read nothing back: inverses and boxes of instances are computed on the device.

use super::buffer_scene::{BufferConfig, check_same_counts, put_headers, scales};
use super::layout::{BvhHeader, EMPTY};
use super::nodes::{DeviceBvh, NewNodes};
use super::scene::TracedScene;
use super::tables::Level;
use crate::build::{
    BuildEncoder, Built, Change, Faults, InstanceBuffer, MeshBoxes, MeshBuffers, N_INSTANCE_FAULTS, Primitives, Which,
    fault, instance_fault, refit_aabbs,
};
use crate::{Buffer, Gpu, GpuError};

/// BVHs over meshes in a program's own buffers, and one over instances of them, whose transforms are in a buffer, too. [`DeviceBvh`] says
/// which BVHs.
///
/// | what changed | record |
/// |---|---|
/// | transforms | [`Self::update_top`] |
/// | vertices of a mesh | [`Self::refit_mesh`] or [`Self::rebuild_mesh`], then [`Self::update_top`] |
/// | many meshes | [`Self::refit`] or [`Self::rebuild`] |
///
/// The rules of [`BufferScene`](crate::BufferScene) hold here, too. The number of instances is fixed: leave room in the instance buffer, and mark unused entries with
/// [`NOT_PLACED`](crate::NOT_PLACED). An instance of no mesh, or with a bad transform, is not placed; [`Self::check`] reports it. With oriented boxes
/// a refit of one mesh computes those of all meshes again: rebuild the mesh instead where others are large.
///
/// ```no_run
/// use canted_gpu::{Gpu, InstanceBuffer, InstancedScene, MeshBuffers, build::WideConfig, block_on};
///
/// # fn example(device: wgpu::Device, queue: wgpu::Queue, mesh: MeshBuffers<'_>, transforms: wgpu::Buffer) -> Result<(), canted_gpu::GpuError> {
/// let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
/// // Each instance: twelve f32 (the rows of world_from_object), the number of its mesh, three unused words.
/// let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 64, n_instances: 100, has_masks: false };
/// let mut scene = block_on(InstancedScene::new(&gpu, &[mesh], &instances, WideConfig::default()))?;
/// let wgsl = scene.traced().module(1)?; // closest_hit(ray), occluded(ray), with buffers in bind group 1
///
/// // Each frame: the program writes transforms, and moves vertices of mesh 0.
/// let mut encoder = device.create_command_encoder(&Default::default());
/// scene.refit_mesh(&gpu, &mut encoder, 0, &mesh)?;
/// scene.update_top(&gpu, &mut encoder, &instances)?;
/// queue.submit([encoder.finish()]);
/// # Ok(())
/// # }
/// ```
pub struct InstancedScene {
    traced: TracedScene,
    bottom: Built,
    top: Built,
    boxes: MeshBoxes,
    faults: Faults,
    instance_faults: Buffer<u32>,
    bvh: DeviceBvh,
}

impl InstancedScene {
    /// Builds both levels, waits for them and, unless `config` says otherwise, checks the buffers.
    ///
    /// # Errors
    /// As for [`BufferScene::new`](crate::BufferScene::new); an instance of no mesh, with a transform that is not finite, is singular or has
    /// a condition number above [`MAX_CONDITION`](crate::MAX_CONDITION), or with coordinates above 1e18 in world space, by its number.
    pub async fn new<'c>(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
        config: impl Into<BufferConfig<'c>>,
    ) -> Result<Self, GpuError> {
        let BufferConfig { bvh, parts, is_checked } = config.into();
        if parts.is_some() {
            return Err(GpuError::Input { message: "parts of meshes as instances in two levels".to_owned() });
        }
        let mut build = BuildEncoder::new(gpu);
        let faults = gpu.zeroed("faults", 2 * meshes.len())?;
        let primitives = Primitives::trees_of_buffers(&build, meshes)?;
        primitives.gather(&mut build, meshes, &faults)?;
        let most = meshes.iter().map(|mesh| mesh.n_triangles).max().unwrap_or(0);
        let bvh = bvh.shallow(most, instances.n_instances);
        let bottom = bvh.build(&mut build, primitives)?;
        let top = bvh.build_top(&mut build, instances.n_instances)?;
        let new = NewNodes::new(&mut build, bvh, &bottom, Some(&top))?;
        let depth = new.depth_bound(gpu, bvh, &bottom, Some(&top)).await?;
        let NewNodes { nodes, mut headers, .. } = new;
        // For instances that are not placed.
        headers.push(BvhHeader::binary(EMPTY, 0));
        let level = Level::unplaced(instances.n_instances);
        let traced = TracedScene::over(gpu, nodes, &headers, &level, depth).await?;
        let boxes = gpu.zeroed("boxes of meshes", meshes.len())?;
        let instance_faults = gpu.zeroed("faults of instances", N_INSTANCE_FAULTS)?;
        let mut scene = Self { traced, bottom, top, boxes, faults, instance_faults, bvh };
        // Recorded, because a build of the top level that is not would wait.
        let mut encoder = gpu.encoder();
        let mut build = BuildEncoder::recorded(gpu, &mut encoder);
        scene.put_roots(&mut build, [0, scene.n_meshes()])?;
        scene.put_top(&mut build, instances)?;
        gpu.submit(encoder)?;
        if is_checked {
            scene.check(gpu).await?;
        }
        Ok(scene)
    }

    /// Records a new build of all meshes and of the top level.
    ///
    /// # Errors
    /// As for [`Self::new`], except for faults of triangles and instances; another number of meshes, of triangles in a mesh, or of instances than before.
    pub fn rebuild(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
    ) -> Result<(), GpuError> {
        let mut build = BuildEncoder::recorded(gpu, encoder);
        self.gather_all(&mut build, meshes)?;
        self.bottom.rebuild(&mut build, self.bvh.bottom())?;
        self.put_bottom(&mut build, [0, self.n_meshes()], Change::Trees)?;
        self.put_roots(&mut build, [0, self.n_meshes()])?;
        self.put_top(&mut build, instances)
    }

    /// Records new boxes for the moved vertices of all meshes over the same trees, and a new top level.
    ///
    /// # Errors
    /// As for [`Self::rebuild`].
    pub fn refit(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
    ) -> Result<(), GpuError> {
        let mut build = BuildEncoder::recorded(gpu, encoder);
        self.gather_all(&mut build, meshes)?;
        self.refit_trees(&mut build, [0, self.n_meshes()])?;
        self.put_top(&mut build, instances)
    }

    /// Records a new build over the moved vertices of one mesh. Rays see it in the right place after [`Self::update_top`].
    ///
    /// # Errors
    /// As for [`Self::rebuild`]; no such mesh.
    pub fn rebuild_mesh(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        number: u32,
        mesh: &MeshBuffers<'_>,
    ) -> Result<(), GpuError> {
        let mut build = BuildEncoder::recorded(gpu, encoder);
        self.gather_one(&mut build, number, mesh)?;
        self.bottom.rebuild_tree(&mut build, number as usize, self.bvh.bottom())?;
        self.put_bottom(&mut build, [number, number + 1], Change::Trees)?;
        self.put_roots(&mut build, [number, number + 1])
    }

    /// Records new boxes for the moved vertices of one mesh over the same tree. Rays see it in the right place after [`Self::update_top`].
    /// Oriented boxes of all meshes are computed again.
    ///
    /// # Errors
    /// As for [`Self::rebuild_mesh`].
    pub fn refit_mesh(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        number: u32,
        mesh: &MeshBuffers<'_>,
    ) -> Result<(), GpuError> {
        let mut build = BuildEncoder::recorded(gpu, encoder);
        self.gather_one(&mut build, number, mesh)?;
        self.refit_trees(&mut build, [number, number + 1])
    }

    /// Records a new top level: the inverses and boxes of all instances, and the tree over them. Meshes stay.
    ///
    /// # Errors
    /// Another number of instances than before, a layout that does not fit its buffer, or device lost.
    pub fn update_top(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        instances: &InstanceBuffer<'_>,
    ) -> Result<(), GpuError> {
        self.put_top(&mut BuildEncoder::recorded(gpu, encoder), instances)
    }

    /// Reads back whether the last builds and updates found a fault. Waits for submitted work.
    ///
    /// # Errors
    /// A triangle with an index out of range or a bad vertex, by mesh and number; an instance of no mesh or with a bad transform, by
    /// number; device lost.
    pub async fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        let of_meshes = fault(&gpu.read(&self.faults).await?);
        let of_instances = instance_fault(&gpu.read(&self.instance_faults).await?, self.boxes.len());
        match of_meshes.or(of_instances) {
            None => Ok(()),
            Some(message) => Err(GpuError::Input { message }),
        }
    }

    /// The scene as kernels trace it. A hit's instance is its number in the buffer.
    #[must_use]
    pub fn traced(&self) -> &TracedScene {
        &self.traced
    }

    fn n_meshes(&self) -> u32 {
        crate::build::count(self.boxes.len())
    }

    fn n_triangles(&self) -> Vec<u32> {
        self.bottom.primitives.ranges().iter().map(|range| range.count).collect()
    }

    /// Copies the vertices of all meshes.
    fn gather_all(&self, build: &mut BuildEncoder<'_>, meshes: &[MeshBuffers<'_>]) -> Result<(), GpuError> {
        let found: Vec<u32> = meshes.iter().map(|mesh| mesh.n_triangles).collect();
        check_same_counts(&found, &self.n_triangles())?;
        self.bottom.primitives.gather(build, meshes, &self.faults)
    }

    /// Copies the vertices of a mesh.
    fn gather_one(&self, build: &mut BuildEncoder<'_>, number: u32, mesh: &MeshBuffers<'_>) -> Result<(), GpuError> {
        let Some(&range) = self.bottom.primitives.ranges().get(number as usize) else {
            let message = format!("mesh {number} of {}", self.n_meshes());
            return Err(GpuError::Input { message });
        };
        check_same_counts(&[mesh.n_triangles], &[range.count])?;
        self.bottom.primitives.gather_mesh(build, mesh, number, range.first, &self.faults)
    }

    /// Computes boxes of the bottom level again, and writes them.
    fn refit_trees(&mut self, build: &mut BuildEncoder<'_>, trees: [u32; 2]) -> Result<(), GpuError> {
        refit_aabbs(build, &self.bottom, self.bottom.primitives.of_trees(trees))?;
        self.bottom.refit_obbs(build, self.bvh.bottom())?;
        self.put_bottom(build, trees, Change::Boxes)?;
        self.put_roots(build, trees)
    }

    /// Writes nodes of the bottom level.
    fn put_bottom(&self, build: &mut BuildEncoder<'_>, trees: [u32; 2], change: Change) -> Result<(), GpuError> {
        self.traced.nodes.put_again(build, (Which::Bottom, &self.bottom), trees, change)
    }

    /// Writes the headers and boxes of meshes.
    fn put_roots(&self, build: &mut BuildEncoder<'_>, meshes: [u32; 2]) -> Result<(), GpuError> {
        put_headers(build, &self.bottom, &self.traced, (1, &self.boxes), meshes)
    }

    /// Places instances and builds the top level.
    fn put_top(&mut self, build: &mut BuildEncoder<'_>, instances: &InstanceBuffer<'_>) -> Result<(), GpuError> {
        let n = self.top.primitives.len();
        if instances.n_instances != n {
            let message = format!("{} instances, and {n} when the scene was built", instances.n_instances);
            return Err(GpuError::Input { message });
        }
        self.traced.has_masks |= instances.has_masks;
        let tables = self.traced.tables();
        let Some(placed) = tables.instances() else { return Ok(()) };
        let nodes = &self.traced.nodes;
        let targets = (placed, tables.headers(), &self.instance_faults);
        let scales = scales(nodes.top_is_oriented());
        self.top.primitives.place(build, instances, &self.boxes, scales, targets)?;
        self.top.rebuild(build, self.bvh.top())?;
        nodes.put_again(build, (Which::Top, &self.top), [0, 1], Change::Trees)
    }
}
