//! `EXT_mesh_gpu_instancing`: a node instances its mesh by accessors of translations, rotations and scales.

use gltf::json::accessor::Type;

use super::accessor::{Accessor, REALS};
use super::document::Document;
use super::matrix::Matrix;
use crate::read::ReadError;

/// Name of the extension, and its key in a node.
pub(super) const NAME: &str = "EXT_mesh_gpu_instancing";

/// Instance transforms relative to the node; `None` without the extension.
pub(super) fn read(document: &Document<'_>, node_index: usize) -> Result<Option<Vec<Matrix>>, ReadError> {
    let extensions = document.root.nodes[node_index].extensions.as_ref();
    let Some(extension) = extensions.and_then(|extensions| extensions.others.get(NAME)) else { return Ok(None) };
    let location = format!("node {node_index} {NAME}");
    let open = |name: &str, element_type: Type| {
        let Some(index) = extension.get("attributes").and_then(|attributes| attributes.get(name)) else {
            return Ok(None);
        };
        let location = format!("{location} {name}");
        let index = index.as_u64().and_then(|index| usize::try_from(index).ok());
        let index = index.ok_or_else(|| document.malformed(&location, "expected an accessor index"))?;
        Accessor::open(document, index, &location, element_type, REALS).map(Some)
    };
    let translations = open("TRANSLATION", Type::Vec3)?;
    let rotations = open("ROTATION", Type::Vec4)?;
    let scales = open("SCALE", Type::Vec3)?;

    let mut counts = [&translations, &rotations, &scales].into_iter().flatten().map(|accessor| accessor.count);
    let Some(count) = counts.next() else {
        return Err(document.malformed(location, "missing TRANSLATION, ROTATION or SCALE"));
    };
    if let Some(other) = counts.find(|&other| other != count) {
        return Err(document.malformed(location, format!("attributes have different counts, {count} and {other}")));
    }
    let instance = |i: usize| {
        Matrix::from_parts(
            translations.as_ref().map_or([0.0; 3], |accessor| accessor.reals(i)),
            rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |accessor| accessor.reals(i)),
            scales.as_ref().map_or([1.0; 3], |accessor| accessor.reals(i)),
        )
    };
    Ok(Some((0..count).map(instance).collect()))
}
