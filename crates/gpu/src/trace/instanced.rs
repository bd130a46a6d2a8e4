//! Instances of meshes in a program's own buffers, built in the program's command encoder.
//!
//! ```text
//! vertices, indices -> corners -> one tree per mesh -> nodes, headers, mesh boxes      rebuild, or one mesh: rebuild or refit
//! transforms, mesh boxes -> place -> tree over instances -> nodes, header              update of the top level
//! ```
//!
//! Updates read nothing back: inverses and boxes of instances are computed on the device.

use super::buffers::check_same_counts;
use super::device_bvh::{DeviceBvh, NewNodes};
use super::headers::{put_headers, scales};
use super::level::{Instances, Level};
use super::scene::TracedScene;
use crate::build::{
    Built, Change, Faults, InstanceBuffer, Items, MeshBoxes, MeshBuffers, N_INSTANCE_FAULTS, Run, Which, fault,
    instance_fault, refit_aabbs,
};
use crate::{Buffer, Gpu, GpuError, wait::block_on};

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
/// use canted_gpu::{Gpu, InstanceBuffer, InstancedScene, MeshBuffers, build::WideConfig};
///
/// # fn example(device: wgpu::Device, queue: wgpu::Queue, mesh: MeshBuffers<'_>, transforms: wgpu::Buffer) -> Result<(), canted_gpu::GpuError> {
/// let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
/// // Each instance: twelve f32 (the rows of world_from_object), the number of its mesh, three unused words.
/// let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 64, n_instances: 100 };
/// let mut scene = InstancedScene::new(&gpu, &[mesh], &instances, WideConfig::default())?;
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
    /// Builds both levels, waits for them and checks the buffers.
    ///
    /// # Errors
    /// As for [`BufferScene::new`](crate::BufferScene::new); an instance of no mesh, with a transform that is not finite, is singular or has
    /// a condition number above [`MAX_CONDITION`](crate::MAX_CONDITION), or with coordinates above 1e18 in world space, by its number.
    pub fn new(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        block_on(Self::new_async(gpu, meshes, instances, bvh))
    }

    /// [`InstancedScene::new`] for browsers.
    ///
    /// # Errors
    /// As for [`InstancedScene::new`].
    pub async fn new_async(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        let scene = Self::without_check_async(gpu, meshes, instances, bvh).await?;
        scene.check_async(gpu).await?;
        Ok(scene)
    }

    /// Builds both levels without checking the buffers. A triangle with a fault counts as a point, and an instance with a fault is not
    /// placed; nothing hits them.
    ///
    /// # Errors
    /// As for [`Self::new`], except for faults of triangles and instances.
    pub fn without_check(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        block_on(Self::without_check_async(gpu, meshes, instances, bvh))
    }

    /// [`InstancedScene::without_check`] for browsers.
    ///
    /// # Errors
    /// As for [`InstancedScene::without_check`].
    pub async fn without_check_async(
        gpu: &Gpu,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
        bvh: impl Into<DeviceBvh>,
    ) -> Result<Self, GpuError> {
        let mut run = Run::new(gpu);
        let faults = gpu.zeroed("faults", 2 * meshes.len())?;
        let items = Items::trees_of_buffers(&run, meshes)?;
        items.gather(&mut run, meshes, &faults)?;
        let most = meshes.iter().map(|mesh| mesh.n_triangles).max().unwrap_or(0);
        let bvh = bvh.into().shallow(most, instances.n_instances);
        let bottom = bvh.build(&mut run, items).await?;
        let top = bvh.build_top(&mut run, gpu, instances.n_instances).await?;
        let NewNodes { nodes, headers, depth } = NewNodes::new(&mut run, bvh, &bottom, Some(&top)).await?;
        let level = Level::Two(Instances::unplaced(gpu, instances.n_instances)?);
        let traced = TracedScene::over(gpu, nodes, &headers, level, depth).await?;
        let boxes = gpu.zeroed("boxes of meshes", meshes.len())?;
        let instance_faults = gpu.zeroed("faults of instances", N_INSTANCE_FAULTS)?;
        let mut scene = Self { traced, bottom, top, boxes, faults, instance_faults, bvh };
        // Recorded, because a build of the top level that is not would wait.
        let mut encoder = gpu.encoder();
        let mut run = Run::recorded(gpu, &mut encoder);
        scene.put_roots(&mut run, [0, scene.n_meshes()])?;
        scene.put_top(&mut run, instances)?;
        gpu.submit(encoder)?;
        Ok(scene)
    }

    /// Records a new build of all meshes and of the top level.
    ///
    /// # Errors
    /// As for [`Self::without_check`]; another number of meshes, of triangles in a mesh, or of instances than before.
    pub fn rebuild(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        meshes: &[MeshBuffers<'_>],
        instances: &InstanceBuffer<'_>,
    ) -> Result<(), GpuError> {
        let mut run = Run::recorded(gpu, encoder);
        self.gather_all(&mut run, meshes)?;
        self.bottom.rebuild(&mut run, self.bvh.bottom())?;
        self.put_bottom(&mut run, [0, self.n_meshes()], Change::Trees)?;
        self.put_roots(&mut run, [0, self.n_meshes()])?;
        self.put_top(&mut run, instances)
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
        let mut run = Run::recorded(gpu, encoder);
        self.gather_all(&mut run, meshes)?;
        self.refit_trees(&mut run, [0, self.n_meshes()])?;
        self.put_top(&mut run, instances)
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
        let mut run = Run::recorded(gpu, encoder);
        self.gather_one(&mut run, number, mesh)?;
        self.bottom.rebuild_tree(&mut run, number as usize, self.bvh.bottom())?;
        self.put_bottom(&mut run, [number, number + 1], Change::Trees)?;
        self.put_roots(&mut run, [number, number + 1])
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
        let mut run = Run::recorded(gpu, encoder);
        self.gather_one(&mut run, number, mesh)?;
        self.refit_trees(&mut run, [number, number + 1])
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
        self.put_top(&mut Run::recorded(gpu, encoder), instances)
    }

    /// Reads back whether the last builds and updates found a fault. Waits for submitted work.
    ///
    /// # Errors
    /// A triangle with an index out of range or a bad vertex, by mesh and number; an instance of no mesh or with a bad transform, by
    /// number; device lost.
    pub fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        block_on(self.check_async(gpu))
    }

    /// [`InstancedScene::check`] for browsers.
    ///
    /// # Errors
    /// As for [`InstancedScene::check`].
    pub async fn check_async(&self, gpu: &Gpu) -> Result<(), GpuError> {
        let of_meshes = fault(&gpu.read_async(&self.faults).await?);
        let of_instances = instance_fault(&gpu.read_async(&self.instance_faults).await?, self.boxes.len());
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
        self.bottom.items.ranges().iter().map(|range| range.count).collect()
    }

    /// Copies the vertices of all meshes.
    fn gather_all(&self, run: &mut Run<'_>, meshes: &[MeshBuffers<'_>]) -> Result<(), GpuError> {
        let found: Vec<u32> = meshes.iter().map(|mesh| mesh.n_triangles).collect();
        check_same_counts(&found, &self.n_triangles())?;
        self.bottom.items.gather(run, meshes, &self.faults)
    }

    /// Copies the vertices of a mesh.
    fn gather_one(&self, run: &mut Run<'_>, number: u32, mesh: &MeshBuffers<'_>) -> Result<(), GpuError> {
        let Some(&range) = self.bottom.items.ranges().get(number as usize) else {
            let message = format!("mesh {number} of {}", self.n_meshes());
            return Err(GpuError::Input { message });
        };
        check_same_counts(&[mesh.n_triangles], &[range.count])?;
        self.bottom.items.gather_mesh(run, mesh, number, range.first, &self.faults)
    }

    /// Computes boxes of the bottom level again, and writes them.
    fn refit_trees(&mut self, run: &mut Run<'_>, trees: [u32; 2]) -> Result<(), GpuError> {
        refit_aabbs(run, &self.bottom, self.bottom.items.of_trees(trees))?;
        self.bottom.refit_obbs(run, self.bvh.bottom())?;
        self.put_bottom(run, trees, Change::Boxes)?;
        self.put_roots(run, trees)
    }

    /// Writes nodes of the bottom level.
    fn put_bottom(&self, run: &mut Run<'_>, trees: [u32; 2], change: Change) -> Result<(), GpuError> {
        self.traced.nodes.put_again(run, (Which::Bottom, &self.bottom), trees, change)
    }

    /// Writes the headers and boxes of meshes.
    fn put_roots(&self, run: &mut Run<'_>, meshes: [u32; 2]) -> Result<(), GpuError> {
        put_headers(run, &self.bottom, &self.traced, 1, meshes)?;
        self.bottom.put_boxes(run, &self.boxes, meshes)
    }

    /// Places instances and builds the top level.
    fn put_top(&mut self, run: &mut Run<'_>, instances: &InstanceBuffer<'_>) -> Result<(), GpuError> {
        let n = self.top.items.len();
        if instances.n_instances != n {
            let message = format!("{} instances, and {n} when the scene was built", instances.n_instances);
            return Err(GpuError::Input { message });
        }
        let Level::Two(placed) = self.traced.level() else { return Ok(()) };
        let nodes = &self.traced.nodes;
        let targets = (placed.data(), self.traced.headers(), &self.instance_faults);
        let scales = scales(nodes.top_is_oriented());
        self.top.items.place(run, instances, &self.boxes, scales, targets)?;
        self.top.rebuild(run, self.bvh.top())?;
        nodes.put_again(run, (Which::Top, &self.top), [0, 1], Change::Trees)
    }
}

#[cfg(test)]
mod tests;
