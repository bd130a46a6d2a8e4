//! Primitives compressed by `KHR_draco_mesh_compression`. When a file is opened they become plain ones, with indices and
//! attributes in buffer views of their own, so that no other module knows them.
//!
//! The decoder is `draco-core`, a port of Google's to Rust without `unsafe`. What primitives declare is compared with the size of
//! the file before anything is decoded, and limits what is decoded.

use std::collections::{BTreeMap, HashMap};

use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use gltf::json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Index, Value};
use rayon::prelude::*;

use super::document::{DRACO, Document};
use crate::read::error::ReadError;

/// Most declared bytes of a file, and how many for each of its bytes beyond a first few.
const MAX_BYTES: u64 = 1 << 32;
const MAX_PER_BYTE: u64 = 4096;
const MIN_BYTES: u64 = 1 << 24;

/// Points, triangles and bytes beyond those declared: the encoder splits vertices at seams, and some programs declare the numbers
/// before.
const SLACK: u64 = 4;
const MIN_SLACK: u64 = 1 << 12;

/// A compressed primitive.
struct Compressed {
    /// Numbers of its mesh and in its mesh.
    mesh: usize,
    primitive: usize,
    /// The buffer view with the data.
    view: usize,
    /// The numbers of attributes in the data.
    attributes: Vec<(Semantic, u32)>,
    declared: Size,
}

/// Sizes that a primitive declares.
#[derive(Clone, Copy, Default)]
struct Size {
    n_points: u64,
    n_triangles: u64,
    n_bytes: u64,
}

impl Size {
    fn max(self, other: Self) -> Self {
        Self {
            n_points: self.n_points.max(other.n_points),
            n_triangles: self.n_triangles.max(other.n_triangles),
            n_bytes: self.n_bytes.max(other.n_bytes),
        }
    }
}

/// Makes the compressed primitives of a document plain.
///
/// # Errors
/// [`ReadError::Malformed`] for invalid declarations and data.
pub(super) fn make_plain(document: &mut Document<'_>) -> Result<(), ReadError> {
    let primitives = compressed(document)?;
    let mut declared = BTreeMap::<usize, Size>::new();
    for primitive in &primitives {
        let size = declared.entry(primitive.view).or_default();
        *size = size.max(primitive.declared);
    }
    let n_bytes = declared.values().fold(0_u64, |sum, size| sum.saturating_add(size.n_bytes));
    let n_stored = document.n_stored_bytes();
    if n_bytes > MAX_BYTES.min(n_stored.saturating_mul(MAX_PER_BYTE).saturating_add(MIN_BYTES)) {
        return Err(document.malformed("meshes", format!("{n_bytes} decoded bytes in a file of {n_stored}")));
    }
    let decoded: Vec<Result<(usize, Mesh), ReadError>> = declared
        .into_par_iter()
        .map(|(view, size)| {
            let (bytes, _) = document.view(view, DRACO)?;
            let malformed = |error| document.malformed(format!("buffer view {view}"), error);
            Ok((view, decode(bytes, size).map_err(malformed)?))
        })
        .collect();
    let decoded = decoded.into_iter().collect::<Result<HashMap<_, _>, _>>()?;
    let mut plain = Plain { document, decoded, views: HashMap::new() };
    primitives.iter().try_for_each(|primitive| plain.replace(primitive))
}

/// The primitives of a document that have no other data than compressed.
fn compressed(document: &Document<'_>) -> Result<Vec<Compressed>, ReadError> {
    let mut list = Vec::new();
    for (mesh, its) in document.root.meshes.iter().enumerate() {
        for (k, primitive) in its.primitives.iter().enumerate().filter(|(_, primitive)| document.needs_draco(primitive))
        {
            let location = format!("mesh {mesh} primitive {k}");
            let extension = primitive.extensions.as_ref().and_then(|all| all.others.get(DRACO));
            let malformed = |what: &str| document.malformed(&location, format!("{DRACO}: {what}"));
            let number = |value: Option<&Value>| value.and_then(Value::as_u64).and_then(|n| usize::try_from(n).ok());
            let view =
                number(extension.and_then(|all| all.get("bufferView"))).ok_or_else(|| malformed("bufferView"))?;
            let numbers = extension.and_then(|all| all.get("attributes"));
            let mut attributes = Vec::new();
            let mut declared = Size::default();
            for (semantic, index) in &primitive.attributes {
                let Checked::Valid(semantic) = semantic else { continue };
                let Some(id) = numbers.and_then(|all| all.get(semantic.to_string())) else { continue };
                let id = id.as_u64().and_then(|id| u32::try_from(id).ok());
                attributes.push((semantic.clone(), id.ok_or_else(|| malformed("attributes"))?));
                let accessor = document.get(&document.root.accessors, index.value(), "accessor", &location)?;
                // A vector of four numbers of four bytes at most.
                declared.n_bytes = declared.n_bytes.saturating_add(accessor.count.0.saturating_mul(16));
                declared.n_points = declared.n_points.max(accessor.count.0);
            }
            let n_indices = match primitive.indices {
                Some(index) => document.get(&document.root.accessors, index.value(), "accessor", &location)?.count.0,
                None => declared.n_points,
            };
            declared.n_triangles = n_indices / 3;
            declared.n_bytes = declared.n_bytes.saturating_add(n_indices.saturating_mul(4));
            list.push(Compressed { mesh, primitive: k, view, attributes, declared });
        }
    }
    Ok(list)
}

/// Decodes the data of a mesh.
fn decode(bytes: &[u8], declared: Size) -> Result<Mesh, String> {
    let [max_points, max_triangles, max_bytes] = [declared.n_points, declared.n_triangles, declared.n_bytes]
        .map(|n| n.saturating_mul(SLACK).saturating_add(MIN_SLACK));
    // Each corner of a triangle may be a point.
    let max_points = max_points.max(3 * max_triangles);
    let limits = DecodeLimits::default()
        .with_max_points(max_points)
        .with_max_faces(max_triangles)
        .with_max_decoded_bytes(max_bytes.max(16 * max_points));
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
        .map_err(|error| format!("malformed Draco data: {error}"))?;
    if mesh.num_points() as u64 > max_points {
        return Err(format!("malformed Draco data: {} points instead of {}", mesh.num_points(), declared.n_points));
    }
    Ok(mesh)
}

/// A document whose compressed primitives are replaced.
struct Plain<'a, 'b> {
    document: &'a mut Document<'b>,
    /// By buffer view, what it decodes to.
    decoded: HashMap<usize, Mesh>,
    /// Buffer views with decoded elements: by their compressed view, number of the attribute and size and kind of its components.
    views: HashMap<(usize, Option<(u32, u32)>), Decoded>,
}

/// Decoded elements.
#[derive(Clone, Copy)]
struct Decoded {
    view: usize,
    count: usize,
    element_type: Type,
}

impl Plain<'_, '_> {
    fn replace(&mut self, compressed: &Compressed) -> Result<(), ReadError> {
        let Compressed { mesh, primitive, view, attributes, .. } = compressed;
        let location = format!("mesh {mesh} primitive {primitive}");
        let indices = self.indices(*view);
        let indices = self.accessor(indices, ComponentType::U32, false);
        let mut accessors = Vec::new();
        for (semantic, id) in attributes {
            let index =
                self.document.root.meshes[*mesh].primitives[*primitive].attributes[&Checked::Valid(semantic.clone())];
            let old = &self.document.root.accessors[index.value()];
            let normalized = old.normalized;
            let Checked::Valid(GenericComponentType(component)) = old.component_type else {
                return Err(self.document.malformed(format!("accessor {}", index.value()), "unknown component type"));
            };
            let elements = self.elements(*view, *id, component).map_err(|error| {
                self.document.malformed(&location, format!("{}: malformed Draco data: {error}", semantic.to_string()))
            })?;
            accessors.push((Checked::Valid(semantic.clone()), self.accessor(elements, component, normalized)));
        }
        let primitive = &mut self.document.root.meshes[*mesh].primitives[*primitive];
        primitive.attributes.extend(accessors);
        primitive.indices = Some(indices);
        // Data of strips is triangles, too.
        primitive.mode = Checked::Valid(Mode::Triangles);
        Ok(())
    }

    /// The corners of the triangles.
    fn indices(&mut self, view: usize) -> Decoded {
        if let Some(known) = self.views.get(&(view, None)) {
            return *known;
        }
        let faces = self.decoded[&view].faces();
        let bytes: Vec<u8> = faces.as_flattened().iter().flat_map(|point| point.0.to_le_bytes()).collect();
        let count = 3 * faces.len();
        let indices = Decoded { view: self.document.add_view(bytes, 4), count, element_type: Type::Scalar };
        self.views.insert((view, None), indices);
        indices
    }

    /// The values of an attribute, one for each point.
    fn elements(&mut self, view: usize, id: u32, component: ComponentType) -> Result<Decoded, String> {
        let key = (view, Some((id, component.as_gl_enum())));
        if let Some(known) = self.views.get(&key) {
            return Ok(*known);
        }
        let mesh = &self.decoded[&view];
        let attribute = mesh.attribute_by_unique_id(id).ok_or_else(|| format!("no attribute {id}"))?;
        let element_type = match attribute.num_components() {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            4 => Type::Vec4,
            n => return Err(format!("values of {n} components")),
        };
        let bytes = values(mesh, attribute, component)?;
        let stride = element_type.multiplicity() * component.size();
        let count = mesh.num_points();
        let elements = Decoded { view: self.document.add_view(bytes, stride), count, element_type };
        self.views.insert(key, elements);
        Ok(elements)
    }

    /// Adds an accessor.
    fn accessor(&mut self, elements: Decoded, component: ComponentType, normalized: bool) -> Index<Accessor> {
        let Decoded { view, count, element_type } = elements;
        self.document.root.push(Accessor {
            buffer_view: Some(Index::new(view as u32)),
            byte_offset: None,
            count: USize64(count as u64),
            component_type: Checked::Valid(GenericComponentType(component)),
            extensions: None,
            extras: None,
            type_: Checked::Valid(element_type),
            min: None,
            max: None,
            name: None,
            normalized,
            sparse: None,
        })
    }
}

/// The values of an attribute for each point, with components of a type.
fn values(mesh: &Mesh, attribute: &PointAttribute, component: ComponentType) -> Result<Vec<u8>, String> {
    let (from, stored) = (attribute.data_type(), attribute.buffer().data());
    let n_bytes = usize::from(attribute.num_components()) * from.byte_length();
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or_default().max(n_bytes);
    let mut bytes = Vec::new();
    for point in 0..mesh.num_points() {
        let value = attribute.mapped_index(PointIndex(point as u32)).0 as usize;
        let value = value.checked_mul(stride).and_then(|start| stored.get(start..)?.get(..n_bytes));
        let value = value.ok_or_else(|| format!("point {point} has no value"))?;
        if is_same(from, component) {
            bytes.extend_from_slice(value);
            continue;
        }
        for part in value.chunks_exact(from.byte_length()) {
            let number = number(part, from).ok_or_else(|| format!("values of type {from:?}"))?;
            put(&mut bytes, number, component).ok_or_else(|| format!("{number} does not fit {component:?}"))?;
        }
    }
    Ok(bytes)
}

/// Whether two types of components are the same.
fn is_same(from: DataType, to: ComponentType) -> bool {
    matches!(
        (from, to),
        (DataType::Float32, ComponentType::F32)
            | (DataType::Int8, ComponentType::I8)
            | (DataType::Uint8, ComponentType::U8)
            | (DataType::Int16, ComponentType::I16)
            | (DataType::Uint16, ComponentType::U16)
            | (DataType::Uint32, ComponentType::U32)
    )
}

/// A stored component.
fn number(bytes: &[u8], from: DataType) -> Option<f64> {
    Some(match from {
        DataType::Int8 => i8::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Uint8 | DataType::Bool => u8::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Int16 => i16::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Uint16 => u16::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Int32 => i32::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Uint32 => u32::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Float32 => f32::from_le_bytes(bytes.try_into().ok()?).into(),
        DataType::Float64 => f64::from_le_bytes(bytes.try_into().ok()?),
        DataType::Int64 | DataType::Uint64 | DataType::Invalid => return None,
    })
}

/// Appends a component; `None` if an integer type does not have the number.
fn put(bytes: &mut Vec<u8>, number: f64, to: ComponentType) -> Option<()> {
    macro_rules! exactly {
        ($integer:ty) => {{
            let integer = number as $integer;
            (f64::from(integer) == number).then(|| bytes.extend(integer.to_le_bytes()))
        }};
    }
    match to {
        ComponentType::I8 => exactly!(i8),
        ComponentType::U8 => exactly!(u8),
        ComponentType::I16 => exactly!(i16),
        ComponentType::U16 => exactly!(u16),
        ComponentType::U32 => exactly!(u32),
        ComponentType::F32 => {
            bytes.extend((number as f32).to_le_bytes());
            Some(())
        }
    }
}
