//! A scene whose meshes and instances move while the shutter is open: two poses in one.

use crate::{Instance, Mesh, MeshClose, Scene};

/// Adds the positions of `close`, a later pose of the same scene, to those of `open` as the ones at shutter close.
///
/// # Errors
/// What differs, other than positions, normals, tangents and transforms.
pub(super) fn join(open: &mut Scene, close: Scene) -> Result<(), &'static str> {
    if open.meshes.len() != close.meshes.len() {
        return Err("other meshes");
    }
    let is_same = |(a, b): (&Instance, &Instance)| a.mesh == b.mesh && a.first_primitive == b.first_primitive;
    if open.instances.len() != close.instances.len() || !open.instances.iter().zip(&close.instances).all(is_same) {
        return Err("other instances");
    }
    let is_same = |(a, b): (&Mesh, &Mesh)| a.triangles == b.triangles && a.positions.len() == b.positions.len();
    if !open.meshes.iter().zip(&close.meshes).all(is_same) {
        return Err("other triangles");
    }
    for (mesh, later) in open.meshes.iter_mut().zip(close.meshes) {
        if mesh.positions != later.positions {
            let Mesh { positions, normals, tangents, .. } = later;
            mesh.close = Some(MeshClose { positions, normals, tangents });
        }
    }
    for (instance, later) in open.instances.iter_mut().zip(close.instances) {
        let close = later.world_from_object;
        instance.world_from_object_close = (close != instance.world_from_object).then_some(close);
    }
    for warning in close.warnings {
        if !open.warnings.contains(&warning) {
            open.warnings.push(warning);
        }
    }
    Ok(())
}
