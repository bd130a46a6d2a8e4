//! Traversal in a kernel of a program's own.

use canted_shaders::{Shader, Specialisation, traversal_module};
use wgpu::{BindGroup, BindGroupLayout};

use super::TracedScene;
use crate::commands::bind_groups;
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
    /// The module takes three storage buffers for one mesh, four for several in one level, five for instances, and six with motion blur. The text
    /// has constants of this scene. It stays valid after rebuilds, refits and updates. Another scene needs its own text, pipeline and bind group, and a
    /// kernel includes the module of one scene.
    ///
    /// # Errors
    /// None for scenes of this crate.
    pub fn module(&self, group: u32) -> Result<String, GpuError> {
        Ok(traversal_module(&self.traversal(), group)?)
    }

    /// The bind group of [`TracedScene::module`], in a layout of the program's own or one derived from its pipeline.
    ///
    /// # Errors
    /// [`GpuError::Input`] for a layout that does not fit; device lost.
    pub fn bind_group(&self, gpu: &Gpu, layout: &BindGroupLayout) -> Result<BindGroup, GpuError> {
        let shader = Shader::new("trace/closest", &self.traversal())?;
        let bindings: Vec<_> = shader
            .entries
            .iter()
            .flat_map(|entry| &entry.bindings)
            .filter(|binding| binding.group == 0)
            .cloned()
            .collect();
        let made = gpu.guarded(|| bind_groups(gpu, "traversal", &bindings, &self.bindings(), |_| layout.clone()));
        let groups = made.map_err(|error| match error {
            GpuError::Invalid { message } => {
                GpuError::Input { message: format!("the layout of the bind group does not fit the module: {message}") }
            }
            error => error,
        })??;
        let [(_, group)] = <[_; 1]>::try_from(groups)
            .map_err(|_| GpuError::Invalid { message: "the traversal has no bindings".to_owned() })?;
        Ok(group)
    }

    fn traversal(&self) -> Specialisation {
        self.specialise(Specialisation::none().part("mask", "shared/mask/none").part("count", "shared/count/none"))
    }
}
