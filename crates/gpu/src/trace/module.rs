//! Traversal in a kernel of a program's own: its text, layout and bind group.

use canted_shaders::{MODULE_BUFFERS, ModuleOptions, Variant, traversal_module};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutEntry, BindingType,
    BufferBindingType, ShaderStages,
};

use super::scene::TracedScene;
use crate::{Gpu, GpuError};

impl TracedScene {
    /// WGSL for a kernel of the program's own, whose bind group `group` is left to it:
    ///
    /// ```text
    /// struct Ray { origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32 }
    /// struct Hit { t: f32, u: f32, v: f32, primitive: u32, instance: u32 }
    /// const NONE: u32;                     // the instance of a miss
    /// fn closest_hit(ray: Ray) -> Hit      // least t; ties go to the lowest instance, then the lowest primitive
    /// fn occluded(ray: Ray) -> bool
    /// var<private> is_incomplete: bool;    // whether this invocation ended a traversal early, see below
    /// ```
    ///
    /// `t` is in units of the ray's direction; `u` and `v` are the weights of the second and third vertex. `primitive` is numbered within its
    /// mesh. `instance` is the number in the instance buffer, or that of the mesh in a [`BufferScene`](crate::BufferScene).
    ///
    /// # Rays
    /// Rays are in world space. All their numbers must be finite, `0 <= t_min`, `t_max <= 3e38`, and the direction not zero; it has any length.
    ///
    /// The functions end after a number of steps, counted for each invocation over all its rays: enough for hundreds of rays on Mesa's llvmpipe, which
    /// ends long loops itself, and for many thousands elsewhere. Then `is_incomplete` becomes true and stays true, and the answers are unknown. Test it at the
    /// end of the kernel, and trace fewer rays in an invocation.
    ///
    /// A ray that starts at a hit must not hit the same triangle again. Offset its origin along the normal of the triangle, to the side of the new direction.
    /// With *W* the greatest absolute coordinate of the scene in world space, `5e-5 * W` is enough in a [`BufferScene`](crate::BufferScene), and
    /// `1e-4 * W` in an [`InstancedScene`](crate::InstancedScene) whose transforms rotate, move and scale uniformly. That is the sum of
    /// all roundings, of which [`HIT_ERROR`](crate::HIT_ERROR) is the largest; it does not hold for needles, whose normals are uncertain. The example `wgpu-ao` does so.
    ///
    /// # The text
    /// Declarations of WGSL come in any order, so the texts are simply joined. Your kernel must not declare `Ray`, `Hit`, `NONE`, `closest_hit`,
    /// `occluded` or `is_incomplete`; all other names of the module start with `canted_`. The functions have no barriers: call them in any
    /// control flow, and from any stage that can read storage buffers.
    ///
    /// The module takes three storage buffers of the limit `max_storage_buffers_per_shader_stage`, 8 by default; [`Gpu::check_module`] tells whether yours
    /// fit beside them. The text has constants of this scene. It stays valid after rebuilds, refits and updates. Another scene needs its own text, pipeline and bind group, and a
    /// kernel includes the module of one scene, or those of several with different [prefixes](ModuleOptions::prefix).
    ///
    /// # Errors
    /// [`GpuError::Shader`] for a prefix that no name starts with.
    pub fn module<'a>(&self, options: impl Into<ModuleOptions<'a>>) -> Result<String, GpuError> {
        Ok(traversal_module(&self.traversal(), &self.tables().lengths(), options)?)
    }

    /// The entries of a layout for [`TracedScene::bind_group`], the same for all scenes, for a program that makes its layouts before its pipelines.
    /// `visibility` are the stages that trace rays.
    ///
    /// ```no_run
    /// # fn example(device: &canted_gpu::wgpu::Device, gpu: &canted_gpu::Gpu, scene: &canted_gpu::TracedScene) -> Result<(), canted_gpu::GpuError> {
    /// use canted_gpu::{TracedScene, wgpu};
    ///
    /// let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
    ///     label: Some("traversal"),
    ///     entries: &TracedScene::layout_entries(wgpu::ShaderStages::COMPUTE | wgpu::ShaderStages::FRAGMENT),
    /// });
    /// let traversal = scene.bind_group(gpu, &layout)?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    #[must_use]
    pub fn layout_entries(visibility: ShaderStages) -> Vec<BindGroupLayoutEntry> {
        let entry = |binding: u32| BindGroupLayoutEntry {
            binding,
            visibility,
            ty: BindingType::Buffer {
                ty: BufferBindingType::Storage { read_only: true },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        (0..MODULE_BUFFERS).map(entry).collect()
    }

    /// The bind group of [`TracedScene::module`], in a layout of the program's own ([`TracedScene::layout_entries`]) or one derived from its pipeline.
    ///
    /// # Errors
    /// [`GpuError::Input`] for a layout that does not fit; device lost.
    pub fn bind_group(&self, gpu: &Gpu, layout: &BindGroupLayout) -> Result<BindGroup, GpuError> {
        // Nodes and triangles come first.
        let mut bound = self.nodes.bindings();
        bound.truncate(2);
        bound.push(("tables", self.tables().whole()));
        let entries: Vec<_> = (0..)
            .zip(&bound)
            .map(|(binding, (_, bound))| BindGroupEntry { binding, resource: bound.resource() })
            .collect();
        let descriptor = BindGroupDescriptor { label: Some("traversal"), layout, entries: &entries };
        gpu.guarded(|| gpu.device.create_bind_group(&descriptor)).map_err(|error| match error {
            GpuError::Invalid { message } => {
                GpuError::Input { message: format!("the layout of the bind group does not fit the module: {message}") }
            }
            error => error,
        })
    }

    fn traversal(&self) -> Variant {
        self.specialize(Variant::none().part("mask", "shared/mask/none").part("count", "shared/count/none"))
    }
}

impl Gpu {
    /// Whether a kernel of a program can bind the storage buffers of [`TracedScene::module`] beside `n_own` of its own. Call it before a scene is built: the
    /// driver would reject the kernel afterwards.
    ///
    /// ```no_run
    /// # fn example(gpu: &canted_gpu::Gpu) -> Result<(), canted_gpu::GpuError> {
    /// gpu.check_module(5)?; // the most with the default limits of WebGPU
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`GpuError::Limit`] with the need and the limit of the device.
    pub fn check_module(&self, n_own: u32) -> Result<(), GpuError> {
        let (need, most) = (n_own.saturating_add(MODULE_BUFFERS), self.limits().max_storage_buffers_per_shader_stage);
        if need <= most {
            return Ok(());
        }
        Err(GpuError::Limit {
            what: format!("a kernel with {n_own} storage buffers and the {MODULE_BUFFERS} of the module"),
            need: need.into(),
            limit: "storage buffers per shader stage",
            most: most.into(),
            remedy: "request a higher max_storage_buffers_per_shader_stage of the adapter, or join buffers",
        })
    }
}
