//! Scenes of one mesh with one material and one instance, as PLY, STL and OFF files give them.

use std::path::Path;

use canted_obb::Affine;

use super::ReadError;
use super::mesh_checks::MeshChecks;
use crate::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene};

/// Adds `mesh`, named after the file, and its material to a scene without meshes.
pub(crate) fn add(
    path: &Path,
    mesh: Mesh,
    material: Material,
    checks: MeshChecks,
    mut scene: Scene,
) -> Result<Scene, ReadError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
    if u32::try_from(mesh.triangles.len()).is_err() {
        return Err(ReadError::unsupported(path, "more than 2^32 triangles"));
    }
    scene.materials.push(material);
    scene.meshes.push(Mesh { name, parts, ..mesh });
    let (mesh, world_from_object) = (MeshId(0), Affine::IDENTITY);
    scene.instances.push(Instance { mesh, world_from_object, world_from_object_close: None, first_primitive: 0 });
    checks.finish(path, &mut scene)?;
    Ok(scene)
}
