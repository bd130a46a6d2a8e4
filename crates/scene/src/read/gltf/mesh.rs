//! A glTF mesh: all its primitives joined, one part each.

use super::document::Document;
use super::material::UvSource;
use super::pose::Pose;
use super::primitive::{Patch, Reading};
use crate::read::ReadError;
use crate::read::repair::Repair;
use crate::{MaterialId, Mesh, Part};

/// Reads mesh `index` of the file in a pose; primitives without triangles leave no part.
pub(super) fn read(
    document: &Document<'_>,
    index: usize,
    pose: &Pose<'_>,
    uv_sources: &[Option<UvSource>],
    repair: &mut Repair,
    warnings: &mut Vec<String>,
) -> Result<Mesh, ReadError> {
    let source = &document.root.meshes[index];
    let mut mesh = Mesh { name: source.name.clone().unwrap_or_else(|| format!("mesh {index}")), ..Mesh::default() };
    for (k, primitive) in source.primitives.iter().enumerate() {
        let place = format!("mesh {index} primitive {k}");
        let material = match primitive.material {
            Some(material) => {
                document.get(&document.root.materials, material.value(), "material", &place)?;
                material.value()
            }
            // The default material stands behind those of the file.
            None => document.root.materials.len(),
        };
        let reading = Reading { document, pose, uv_source: uv_sources[material].as_ref(), place: &place };
        let patch = reading.read(primitive, repair, warnings)?;
        join(&mut mesh, patch, material)
            .ok_or_else(|| document.malformed(place, "takes its mesh beyond what 32 bits count"))?;
    }
    Ok(mesh)
}

/// Appends a patch; `None` where numbers exceed 32 bits.
///
/// Where only some patches have normals or texture coordinates, the others get zeros.
fn join(mesh: &mut Mesh, patch: Patch, material: usize) -> Option<()> {
    if patch.triangles.is_empty() {
        return Some(());
    }
    let first_triangle = u32::try_from(mesh.triangles.len()).ok()?;
    let (before, after) = (mesh.positions.len(), mesh.positions.len() + patch.positions.len());
    let first_vertex = u32::try_from(before).ok().filter(|_| u32::try_from(after).is_ok())?;
    mesh.parts.push(Part { first_triangle, material: MaterialId(u32::try_from(material).ok()?) });
    mesh.positions.extend(patch.positions);
    mesh.triangles.extend(patch.triangles.into_iter().map(|triangle| triangle.map(|corner| corner + first_vertex)));
    extend(&mut mesh.normals, patch.normals, before, after);
    extend(&mut mesh.uvs, patch.uvs, before, after);
    Some(())
}

/// Appends values for the vertices `before..after` to a list that exists once any patch has values.
fn extend<T: Copy + Default>(list: &mut Option<Vec<T>>, values: Option<Vec<T>>, before: usize, after: usize) {
    if list.is_none() && values.is_none() {
        return;
    }
    let list = list.get_or_insert_with(|| vec![T::default(); before]);
    list.extend(values.unwrap_or_default());
    list.resize(after, T::default());
}
