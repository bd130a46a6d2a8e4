//! Triangles in buffers of a program's own.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use wgpu::{BufferUsages, IndexFormat};

use super::items::Leaf;
use super::{Items, Range, Run};
use crate::{Buffer, GpuError, NamedBinding, Specialisation};

/// A mesh whose vertices and indices are in device buffers of a program's own. The buffers must have the usage `STORAGE`.
#[derive(Clone, Copy, Debug)]
pub struct MeshBuffers<'a> {
    /// Holds positions as three `f32`.
    pub vertices: &'a wgpu::Buffer,
    /// Byte of the first position; a multiple of 4.
    pub first_byte: u64,
    /// Bytes from position to position; a multiple of 4, at least 12.
    pub stride: u64,
    /// Number of vertices.
    pub n_vertices: u32,
    /// Three indices for each triangle; `None` if vertices are in order.
    pub indices: Option<IndexBuffer<'a>>,
    /// Number of triangles.
    pub n_triangles: u32,
}

/// Indices in a device buffer.
#[derive(Clone, Copy, Debug)]
pub struct IndexBuffer<'a> {
    /// Holds the indices.
    pub buffer: &'a wgpu::Buffer,
    /// `Uint16` or `Uint32`.
    pub format: IndexFormat,
    /// Byte of the first index; a multiple of the size of one.
    pub first_byte: u64,
}

/// `MeshLayout` of `build/corners`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct MeshLayout {
    first_word: u32,
    stride: u32,
    n_vertices: u32,
    first_index: u32,
    index_bytes: u32,
    first_triangle: u32,
}

/// The complement of the lowest triangle with each kind of fault; 0 for none.
pub(crate) type Faults = Buffer<u32>;

impl Items {
    /// The triangles of all meshes in one tree, still without vertices; see [`Items::gather`].
    pub(crate) fn of_buffers(run: &Run<'_>, meshes: &[MeshBuffers<'_>]) -> Result<Self, GpuError> {
        let count = meshes.iter().map(|mesh| u64::from(mesh.n_triangles)).sum::<u64>();
        let count = u32::try_from(count).map_err(|_| GpuError::Unsupported {
            what: format!("a BVH over {count} triangles, more than 4294967295"),
        })?;
        let corners = Arc::new(run.gpu().zeroed("corners", count as usize)?);
        Self::new(run.gpu(), vec![Range { first: 0, count }], Leaf::Triangle { corners })
    }

    /// Copies the vertices of all triangles, and reports faults.
    pub(crate) fn gather(
        &self,
        run: &mut Run<'_>,
        meshes: &[MeshBuffers<'_>],
        faults: &Faults,
    ) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let Some(corners) = self.corners() else { return Ok(()) };
        let layouts = layouts(meshes)?;
        run.stage("corners", |dispatches| {
            dispatches.work.clear(faults);
            let kernel = gpu.kernel("build/corners", &Specialisation::none())?;
            for (mesh, layout) in meshes.iter().zip(&layouts) {
                let uniform = gpu.uniform("mesh layout", layout)?;
                let indices = mesh.indices.map_or(mesh.vertices, |indices| indices.buffer);
                let bound: [NamedBinding<'_>; 5] = [
                    ("mesh_layout", &uniform),
                    ("mesh_vertices", mesh.vertices),
                    ("mesh_indices", indices),
                    ("corners", &**corners),
                    ("faults", faults),
                ];
                dispatches.items(&kernel, &bound, mesh.n_triangles)?;
            }
            Ok(())
        })
    }
}

/// The first fault that a build found, as a sentence.
pub(crate) fn fault(faults: &[u32], meshes: &[u32]) -> Option<String> {
    let place = |word: u32| {
        let mut triangle = !word;
        for (mesh, &n_triangles) in meshes.iter().enumerate() {
            if triangle < n_triangles {
                return format!("mesh {mesh}: triangle {triangle}");
            }
            triangle -= n_triangles;
        }
        format!("triangle {triangle}")
    };
    match faults {
        [index, _] if *index != 0 => Some(format!("{} has an index out of range", place(*index))),
        [_, vertex] if *vertex != 0 => {
            Some(format!("{} has a vertex that is not finite or has coordinates above 1e18", place(*vertex)))
        }
        _ => None,
    }
}

/// Layouts of meshes, checked against the sizes of their buffers.
fn layouts(meshes: &[MeshBuffers<'_>]) -> Result<Vec<MeshLayout>, GpuError> {
    let mut first_triangle = 0;
    let layout = |(number, mesh): (usize, &MeshBuffers<'_>)| {
        let layout = layout(mesh, first_triangle)
            .map_err(|message| GpuError::Invalid { message: format!("mesh {number}: {message}") });
        first_triangle += mesh.n_triangles;
        layout
    };
    meshes.iter().enumerate().map(layout).collect()
}

fn layout(mesh: &MeshBuffers<'_>, first_triangle: u32) -> Result<MeshLayout, String> {
    let &MeshBuffers { vertices, first_byte, stride, n_vertices, indices, n_triangles } = mesh;
    if stride % 4 != 0 || stride < 12 || first_byte % 4 != 0 {
        return Err(format!(
            "stride {stride} and first byte {first_byte} must be multiples of 4, the stride at least 12"
        ));
    }
    let end = if n_vertices == 0 { 0 } else { first_byte + u64::from(n_vertices - 1) * stride + 12 };
    check_buffer("vertices", vertices, end)?;
    let n_corners = 3 * u64::from(n_triangles);
    let (first_index, index_bytes) = match indices {
        None if n_corners > u64::from(n_vertices) => {
            return Err(format!("{n_triangles} triangles without indices need {n_corners} vertices, not {n_vertices}"));
        }
        None => (0, 0),
        Some(IndexBuffer { buffer, format, first_byte }) => {
            let size = format.byte_size() as u64;
            if first_byte % size != 0 {
                return Err(format!("the first byte {first_byte} of the indices must be a multiple of {size}"));
            }
            check_buffer("indices", buffer, first_byte + n_corners * size)?;
            (first_byte / size, size)
        }
    };
    let word = |x: u64| u32::try_from(x).map_err(|_| format!("an offset of {x} is out of range"));
    Ok(MeshLayout {
        first_word: word(first_byte / 4)?,
        stride: word(stride / 4)?,
        n_vertices,
        first_index: word(first_index)?,
        index_bytes: word(index_bytes)?,
        first_triangle,
    })
}

fn check_buffer(what: &str, buffer: &wgpu::Buffer, end: u64) -> Result<(), String> {
    if !buffer.usage().contains(BufferUsages::STORAGE) {
        return Err(format!("the buffer of the {what} lacks the usage STORAGE"));
    }
    if end > buffer.size() {
        return Err(format!("the {what} end at byte {end} of a buffer of {} bytes", buffer.size()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_name_mesh_and_triangle() {
        assert_eq!(fault(&[0, 0], &[3]), None);
        assert_eq!(fault(&[!4, 0], &[3, 5]).unwrap(), "mesh 1: triangle 1 has an index out of range");
        let vertex = fault(&[0, !2], &[3, 5]).unwrap();
        assert_eq!(vertex, "mesh 0: triangle 2 has a vertex that is not finite or has coordinates above 1e18");
    }
}
