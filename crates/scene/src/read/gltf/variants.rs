//! `KHR_materials_variants`: other materials for the primitives of a file, by name.

use gltf::json::{Index, Value};

use super::document::Document;
use crate::read::ReadError;

/// Name of the extension.
pub(super) const NAME: &str = "KHR_materials_variants";

/// Gives primitives the materials of the variant of this name, else of this number.
///
/// # Errors
/// [`ReadError::UnknownVariant`] if the file has no such variant.
pub(super) fn choose(document: &mut Document<'_>, wanted: &str) -> Result<(), ReadError> {
    let extensions = document.root.extensions.as_ref().map(|extensions| &extensions.others);
    let list = extensions.and_then(|others| others.get(NAME)?.get("variants")?.as_array());
    let names: Vec<String> = list
        .into_iter()
        .flatten()
        .map(|variant| variant.get("name").and_then(Value::as_str).unwrap_or_default().to_owned())
        .collect();
    let numbered = || wanted.parse().ok().filter(|&number: &usize| number < names.len());
    let Some(variant) = names.iter().position(|name| name == wanted).or_else(numbered) else {
        let known = names.iter().enumerate().map(|(number, name)| format!("{number} {name:?}")).collect();
        return Err(ReadError::UnknownVariant { path: document.path().to_owned(), wanted: wanted.to_owned(), known });
    };
    for primitive in document.root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        let mappings =
            primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(NAME)?.get("mappings"));
        let named = |mapping: &&Value| {
            let variants = mapping.get("variants").and_then(Value::as_array);
            variants.into_iter().flatten().any(|number| number.as_u64() == Some(variant as u64))
        };
        let mapping = mappings.and_then(Value::as_array).into_iter().flatten().find(named);
        if let Some(material) = mapping.and_then(|mapping| mapping.get("material")?.as_u64()) {
            // An index out of range is reported with the primitive.
            primitive.material = Some(Index::new(u32::try_from(material).unwrap_or(u32::MAX)));
        }
    }
    Ok(())
}
