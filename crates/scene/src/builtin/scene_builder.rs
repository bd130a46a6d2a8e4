use canted_obb::Affine;
use canted_obb::vector::{Vector as Vec3, cross, to_f32};

use super::mesh_builder::unit;
use crate::{Instance, Mesh, MeshId, Scene};

/// A scene under construction.
#[derive(Default)]
pub(super) struct SceneBuilder {
    pub(super) scene: Scene,
    n_placed: u32,
}

impl SceneBuilder {
    /// Adds a mesh without an instance.
    pub(super) fn mesh(&mut self, mesh: Mesh) -> MeshId {
        self.scene.meshes.push(mesh);
        MeshId(u32::try_from(self.scene.meshes.len() - 1).expect("few meshes"))
    }

    /// Adds an instance.
    pub(super) fn place(&mut self, mesh: MeshId, world_from_object: Affine) {
        self.scene.instances.push(Instance {
            mesh,
            world_from_object,
            world_from_object_close: None,
            first_primitive: self.n_placed,
        });
        let n_triangles = self.scene.meshes[mesh.0 as usize].triangles.len();
        self.n_placed += u32::try_from(n_triangles).expect("the scene is small");
    }
}

/// The affine transform with the given images of the axes and of the origin.
pub(super) fn affine(columns: [Vec3; 4]) -> Affine {
    Affine { columns: columns.map(to_f32) }
}

/// Scales per axis, rotates about y by `heading_rad` and translates to `position`.
pub(super) fn upright(position: Vec3, heading_rad: f64, scale: Vec3) -> Affine {
    tilted(position, [0.0, 1.0, 0.0], heading_rad, scale)
}

/// Scales per axis, rotates about y by `heading_rad`, tilts y to `upward` and translates to `position`.
///
/// `upward` is not parallel to z.
pub(super) fn tilted(position: Vec3, upward: Vec3, heading_rad: f64, scale: Vec3) -> Affine {
    let y = unit(upward);
    let x = unit(cross(y, [0.0, 0.0, 1.0]));
    let z = cross(x, y);
    let (sin, cos) = heading_rad.sin_cos();
    let mix = |a: f64, b: f64, by: f64| std::array::from_fn(|k| by * (a * x[k] + b * z[k]));
    affine([mix(cos, -sin, scale[0]), y.map(|c| c * scale[1]), mix(sin, cos, scale[2]), position])
}
