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
    /// mesh. `instance` is the number in the instance buffer, or that of the mesh in a [`BufferScene`](crate::BufferScene). No function continues a
    /// ray from a hit: offset the origin, as the example `wgpu-ao` does.
    ///
    /// The module takes three storage buffers for one mesh, four for several in one level, five for instances, six if any of them moves. The text
    /// has constants of this scene: it stays valid after rebuilds, refits and updates, and is generated again for another scene. A kernel includes the
    /// module of one scene.
    ///
    /// Rays are in world space. All their numbers must be finite, `0 <= t_min`, `t_max <= 3e38`, and the direction not zero; it has any
    /// length. All other names of the module start with `canted_`. Declarations come in any order, so the texts are simply joined.
    ///
    /// An invocation takes at most as many steps as drivers allow in one dispatch: hundreds of rays on Mesa's llvmpipe, many thousands
    /// elsewhere. Beyond, `is_incomplete` is set and answers are unknown; trace fewer rays in an invocation.
    ///
    /// # Errors
    /// None for scenes of this crate.
    pub fn module(&self, group: u32) -> Result<String, GpuError> {
        Ok(traversal_module(&self.traversal(), group)?)
    }

    /// The bind group of [`TracedScene::module`], in a layout of the program's own or one derived from its pipeline.
    ///
    /// # Errors
    /// A layout that does not fit.
    pub fn bind_group(&self, gpu: &Gpu, layout: &BindGroupLayout) -> Result<BindGroup, GpuError> {
        let shader = Shader::new("trace/closest", &self.traversal())?;
        let bindings: Vec<_> = shader
            .entries
            .iter()
            .flat_map(|entry| &entry.bindings)
            .filter(|binding| binding.group == 0)
            .cloned()
            .collect();
        let groups =
            gpu.guarded(|| bind_groups(gpu, "traversal", &bindings, &self.bindings(), |_| layout.clone()))??;
        let [(_, group)] = <[_; 1]>::try_from(groups)
            .map_err(|_| GpuError::Invalid { message: "the traversal has no bindings".to_owned() })?;
        Ok(group)
    }

    fn traversal(&self) -> Specialisation {
        self.specialise(Specialisation::none().part("mask", "shared/mask/none").part("count", "shared/count/none"))
    }
}
