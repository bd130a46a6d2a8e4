//! Traversal in a kernel of a program's own: its text, layout and bind group.

use canted_shaders::{MODULE_BUFFERS, ModuleOptions, Variant, choice, driver_module, traversal_module};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutEntry, BindingType,
    BufferBindingType, ShaderStages,
};

use super::scene::TracedScene;
use crate::{Gpu, GpuError};

impl TracedScene {
    /// WGSL for a kernel of the program's own, which leaves a bind group to it:
    ///
    /// ```text
    /// struct Ray { origin: vec3<f32>, t_min: f32, direction: vec3<f32>, t_max: f32 }
    /// struct Hit { t: f32, u: f32, v: f32, primitive: u32, instance: u32, place: u32 }
    /// const NONE: u32;                                   // the instance of a miss
    /// fn ray(origin: vec3<f32>, direction: vec3<f32>, t_max: f32) -> Ray      // t_min is 0
    /// fn closest_hit(ray: Ray) -> Hit                    // least t; ties go to the lowest instance, then the lowest primitive
    /// fn occluded(ray: Ray) -> bool
    /// fn closest_hit_masked(ray: Ray, mask: u32) -> Hit  // only instances whose masks have a bit of this one
    /// fn occluded_masked(ray: Ray, mask: u32) -> bool
    /// fn normal_of(hit: Hit) -> vec3<f32>                // unit, geometric, on the front, in world space
    /// struct Surface { position: vec3<f32>, error: f32, normal: vec3<f32>, is_front: bool }
    /// fn surface_of(hit: Hit, ray: Ray) -> Surface
    /// fn origin_beside(hit: Hit, ray: Ray, direction: vec3<f32>) -> vec3<f32> // where a ray in this direction leaves the hit of `ray`
    /// var<private> is_incomplete: bool;                  // whether this invocation ended a traversal early, see below
    /// ```
    ///
    /// Every ray is decided by exact arithmetic in this traversal but those of [`Source::DriverRayQueries`](crate::Source::DriverRayQueries), as there is
    /// no second dispatch for rays that `f32` does not decide. So it takes many more instructions than the kernels of batches.
    ///
    /// `t` is in units of the ray's direction; `u` and `v` are the weights of the second and third vertex. `primitive` is numbered within its
    /// mesh. `instance` is the number in the instance buffer, or that of the mesh in a [`BufferScene`](crate::BufferScene). `place` is where the BVH has the
    /// triangle, for the functions that take a hit, until it is built again. In memory a hit is a [`ModuleHit`](crate::ModuleHit).
    ///
    /// ```no_run
    /// # fn example(scene: &canted_gpu::TracedScene) -> Result<String, canted_gpu::GpuError> {
    /// // Shadows of a sun, in bind group 1.
    /// let text = scene.module(1)? + "
    ///     @group(0) @binding(0) var<storage, read_write> light: array<f32>;
    ///     @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    ///         let down = ray(vec3f(f32(id.x), 0.0, 9.0), vec3f(0.0, 0.0, -1.0), 3e38);
    ///         let hit = closest_hit(down);
    ///         if hit.instance == NONE { return; }
    ///         let sun = vec3f(0.3, 0.2, 1.0);
    ///         let shadow = ray(origin_beside(hit, down, sun), sun, 3e38);
    ///         light[id.x] = select(max(dot(normal_of(hit), normalize(sun)), 0.0), 0.0, occluded(shadow));
    ///     }";
    /// # Ok(text)
    /// # }
    /// ```
    ///
    /// # Rays
    /// Rays are in world space. All their numbers must be finite, `0 <= t_min`, `t_max <= 3e38`, and the direction not zero; it has any length.
    ///
    /// The functions end after a number of steps, counted for each invocation over all its rays: enough for hundreds of rays on Mesa's llvmpipe, which
    /// ends long loops itself, and for many thousands elsewhere. Then `is_incomplete` becomes true and stays true, and the answers are unknown. Test it at the
    /// end of the kernel, and trace fewer rays in an invocation. A driver compiles the traversal for each call of a function that traces: call it in a loop.
    ///
    /// # Surfaces
    /// The front of a triangle is the side from which its vertices run counter-clockwise; in a mirroring instance the normal is the image of that in object
    /// space, as on the CPU. Each component errs by at most 2^-20 times the condition number of the instance's transform, for needles, too; `is_front` may be
    /// wrong where the cosine between ray and normal is smaller than that. `position` is within `error` of the triangle, in each coordinate.
    ///
    /// A ray that starts at `origin_beside` and leaves in that direction, with `t_min` 0, does not hit the same triangle again, nor any of the same mesh that lies behind its plane,
    /// as the neighbors across a convex edge. The distance follows from the error bounds of the traversal, so there is nothing to choose; it is about
    /// 3e-5 times the largest coordinate. In one level the origin serves all directions on that side. This holds for instances whose transforms have condition numbers up to 128, or 64 for those that move, and for triangles whose height is more than 2^-38 of
    /// their length.
    ///
    /// # Masks
    /// [`Instance::mask`](canted_tlas::Instance::mask) and [`InstanceBuffer::has_masks`](crate::InstanceBuffer::has_masks) give each instance a mask. The functions without a mask
    /// trace rays with all bits. In one level all instances have all bits.
    ///
    /// [`ModuleOptions::accepts`] names a function of your kernel that decides which hits count, as for textures with holes.
    ///
    /// # The text
    /// Declarations of WGSL come in any order, so the texts are simply joined. Your kernel must not declare the names above, unless
    /// [`ModuleOptions::prefix`] changes them; all other names of the module start with `canted_` after that prefix. The functions have no barriers: call them in any
    /// control flow, and from any stage that can read storage buffers.
    ///
    /// The module takes three storage buffers of the limit `max_storage_buffers_per_shader_stage`, 8 by default; [`Gpu::check_module`] tells whether yours
    /// fit beside them. The text has constants of this scene. It stays valid after rebuilds, refits and updates. Another scene needs its own text, pipeline and bind group, and a
    /// kernel includes the module of one scene, or those of several with different prefixes.
    ///
    /// # Rays of the driver
    /// From [`Source::DriverRayQueries`](crate::Source::DriverRayQueries) the functions that trace rays answer with hits of the driver, and
    /// there are none of surfaces, whose bounds follow from this crate's traversal: take normals from the program's vertices.
    /// `is_incomplete` stays false. The module starts with the directive `enable wgpu_ray_query;`, a line of its own, so its text comes before
    /// that of the kernel; of a second such module leave that line out. It takes no storage buffer, but an acceleration structure.
    ///
    /// # Errors
    /// [`GpuError::Shader`] for a prefix that no name starts with, or a function with no such name; [`GpuError::Unsupported`] for a scene with
    /// curves, or a function that accepts hits of the driver.
    pub fn module<'a>(&self, options: impl Into<ModuleOptions<'a>>) -> Result<String, GpuError> {
        if self.has_curves() {
            return Err(GpuError::Unsupported { what: "curves in a kernel of a program's own".to_owned() });
        }
        let options = options.into();
        if !self.is_of_driver() {
            return Ok(traversal_module(&self.traversal(), &self.tables().lengths(), options)?);
        }
        if options.accepts.is_some() {
            return Err(GpuError::Unsupported { what: "a function that accepts hits of the driver".to_owned() });
        }
        Ok(driver_module(options.group, options.prefix)?)
    }

    /// The entries of a layout for [`TracedScene::bind_group`], the same for all scenes but [those of the driver](Self::is_of_driver), for
    /// a program that makes its layouts before its pipelines. `visibility` are the stages that trace rays.
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

    /// The same for scenes of the driver.
    #[must_use]
    pub fn driver_layout_entries(visibility: ShaderStages) -> Vec<BindGroupLayoutEntry> {
        let ty = BindingType::AccelerationStructure { vertex_return: false };
        vec![BindGroupLayoutEntry { binding: 0, visibility, ty, count: None }]
    }

    /// The bind group of [`TracedScene::module`], in a layout of the program's own ([`TracedScene::layout_entries`]) or one derived from its pipeline.
    ///
    /// # Errors
    /// [`GpuError::Input`] for a layout that does not fit; device lost.
    pub fn bind_group(&self, gpu: &Gpu, layout: &BindGroupLayout) -> Result<BindGroup, GpuError> {
        // Nodes and triangles come first, or what the driver traces.
        let mut bound = self.nodes.bindings();
        if !self.is_of_driver() {
            bound.truncate(2);
            bound.push(("tables", self.tables().whole()));
        }
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
        self.specialize(Variant::none().with(choice::Count::None))
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
