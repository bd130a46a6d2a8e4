//! Accessors: typed elements in buffer views, with stride, normalized integers and sparse elements (glTF 2.0, section 3.6.2).

use gltf::json::accessor::{ComponentType, Type, sparse};
use gltf::json::validation::{Checked, USize64};

use super::document::{Document, range};
use crate::read::error::ReadError;

/// Component types of real numbers; integers are normalized or from `KHR_mesh_quantization`.
pub(super) const REALS: &[ComponentType] =
    &[ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];
/// Component types of indices.
pub(super) const INDICES: &[ComponentType] = &[ComponentType::U8, ComponentType::U16, ComponentType::U32];

/// Value of elements without a buffer view; the largest element is a 4 x 4 matrix of `f32`.
const ZEROS: [u8; 64] = [0; 64];

/// An accessor whose elements are all in bounds.
pub(super) struct Accessor<'a> {
    /// Number of elements.
    pub(super) count: usize,
    component: ComponentType,
    normalized: bool,
    n_element_bytes: usize,
    dense: Option<Dense<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Strided elements.
struct Dense<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Sparse elements that replace others.
struct Sparse<'a> {
    /// Indices of the replaced elements, ascending.
    indices: Vec<u32>,
    /// Their values, packed.
    values: &'a [u8],
}

impl<'a> Accessor<'a> {
    /// Opens accessor `index`, referenced from `location`, with the given element type and one of the given component types.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the type differs or the elements exceed the buffer view.
    pub(super) fn open(
        document: &'a Document<'_>,
        index: usize,
        location: &str,
        element_type: Type,
        components: &[ComponentType],
    ) -> Result<Self, ReadError> {
        let accessor = document.get(&document.root.accessors, index, "accessor", location)?;
        let own_location = format!("accessor {index}");
        let malformed = |message: String| document.malformed(&own_location, message);
        let component = match accessor.component_type {
            Checked::Valid(component) if components.contains(&component.0) => component.0,
            Checked::Valid(other) => {
                return Err(malformed(format!("component type {:?} is not allowed for {location}", other.0)));
            }
            Checked::Invalid => return Err(malformed("unknown component type".to_owned())),
        };
        if accessor.type_ != Checked::Valid(element_type) {
            return Err(malformed(format!("expected type {element_type:?} for {location}")));
        }
        let n_element_bytes = component.size() * element_type.multiplicity();
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        let dense = match accessor.buffer_view {
            Some(view) => {
                let (bytes, stride) = document.view(view.value(), &own_location)?;
                let stride = stride.unwrap_or(n_element_bytes);
                if stride < n_element_bytes {
                    return Err(malformed(format!(
                        "stride of {stride} bytes is smaller than the element size of {n_element_bytes} bytes"
                    )));
                }
                let bytes = tail(bytes, accessor.byte_offset.unwrap_or_default())
                    .filter(|bytes| fits(bytes.len(), count, stride, n_element_bytes))
                    .ok_or_else(|| malformed(format!("{count} elements exceed the buffer view")))?;
                Some(Dense { bytes, stride })
            }
            // Without a buffer view the count is not limited by the file size.
            None if count > document.max_virtual_elements() => {
                return Err(malformed(format!("{count} elements without a buffer view")));
            }
            None => None,
        };
        let mut opened =
            Self { count, component, normalized: accessor.normalized, n_element_bytes, dense, sparse: None };
        if let Some(sparse) = &accessor.sparse {
            opened.sparse = Some(opened.open_sparse(document, sparse, &own_location)?);
        }
        Ok(opened)
    }

    fn open_sparse(
        &self,
        document: &'a Document<'_>,
        sparse: &sparse::Sparse,
        location: &str,
    ) -> Result<Sparse<'a>, ReadError> {
        let malformed = |message: String| document.malformed(location, message);
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(malformed("unknown component type of sparse indices".to_owned()));
        };
        let packed = |view: usize, offset: USize64, n_bytes: usize, what: &str| {
            let (bytes, _) = document.view(view, location)?;
            let length = sparse.count.0.saturating_mul(n_bytes as u64);
            range(bytes, offset, USize64(length))
                .ok_or_else(|| malformed(format!("{} sparse {what} exceed their buffer view", sparse.count.0)))
        };
        let (indices, values) = (&sparse.indices, &sparse.values);
        let n_index_bytes = component.0.size();
        let index_bytes = packed(indices.buffer_view.value(), indices.byte_offset, n_index_bytes, "indices")?;
        let values = packed(values.buffer_view.value(), values.byte_offset, self.n_element_bytes, "values")?;
        let indices: Vec<u32> = index_bytes.chunks(n_index_bytes).map(|bytes| integer(component.0, bytes, 0)).collect();
        if let Some(pair) = indices.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(malformed(format!("sparse index {} after {} is not ascending", pair[1], pair[0])));
        }
        match indices.last() {
            Some(&last) if last as usize >= self.count => {
                Err(malformed(format!("sparse index {last} out of range ({} elements)", self.count)))
            }
            _ => Ok(Sparse { indices, values }),
        }
    }

    /// The bytes of an element.
    fn element(&self, index: usize) -> &[u8] {
        let length = self.n_element_bytes;
        if let Some(sparse) = &self.sparse
            && let Ok(replaced) = sparse.indices.binary_search_by(|&at| (at as usize).cmp(&index))
        {
            return &sparse.values[replaced * length..][..length];
        }
        match &self.dense {
            Some(dense) => &dense.bytes[index * dense.stride..][..length],
            None => &ZEROS[..length],
        }
    }

    /// An element as real numbers; applies integer normalization.
    pub(super) fn reals<const N: usize>(&self, index: usize) -> [f32; N] {
        let bytes = self.element(index);
        let part = |value: f32, largest: f32| if self.normalized { (value / largest).max(-1.0) } else { value };
        std::array::from_fn(|k| match self.component {
            ComponentType::F32 => f32::from_le_bytes(at(bytes, k)),
            ComponentType::I8 => part(i8::from_le_bytes(at(bytes, k)).into(), 127.0),
            ComponentType::U8 => part(u8::from_le_bytes(at(bytes, k)).into(), 255.0),
            ComponentType::I16 => part(i16::from_le_bytes(at(bytes, k)).into(), 32767.0),
            ComponentType::U16 => part(u16::from_le_bytes(at(bytes, k)).into(), 65535.0),
            ComponentType::U32 => unreachable!("not in REALS"),
        })
    }

    /// An element as unsigned integers.
    pub(super) fn integers<const N: usize>(&self, index: usize) -> [u32; N] {
        let bytes = self.element(index);
        std::array::from_fn(|k| integer(self.component, bytes, k))
    }
}

/// The bytes from `offset` on.
fn tail(bytes: &[u8], offset: USize64) -> Option<&[u8]> {
    bytes.get(usize::try_from(offset.0).ok()?..)
}

/// Whether `count` elements fit into `n_bytes`.
fn fits(n_bytes: usize, count: usize, stride: usize, n_element_bytes: usize) -> bool {
    let Some(n_gaps) = count.checked_sub(1) else { return true };
    n_gaps.checked_mul(stride).and_then(|start| start.checked_add(n_element_bytes)).is_some_and(|end| end <= n_bytes)
}

/// Component `k` as an unsigned integer.
fn integer(component: ComponentType, bytes: &[u8], k: usize) -> u32 {
    match component {
        ComponentType::U8 => u8::from_le_bytes(at(bytes, k)).into(),
        ComponentType::U16 => u16::from_le_bytes(at(bytes, k)).into(),
        ComponentType::U32 => u32::from_le_bytes(at(bytes, k)),
        _ => unreachable!("not in INDICES"),
    }
}

/// Bytes of component `k` of `N` bytes each.
fn at<const N: usize>(bytes: &[u8], k: usize) -> [u8; N] {
    bytes.as_chunks().0[k]
}
