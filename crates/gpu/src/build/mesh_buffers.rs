//! Triangles in buffers of a program's own.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use wgpu::{BufferUsages, IndexFormat};

use super::items::Leaf;
use super::{Items, Range, Run};
use crate::commands::Slot;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation};

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
    first_fault: u32,
}

/// For each mesh the complement of its lowest triangle with each of two kinds of fault; 0 for none.
pub(crate) type Faults = Buffer<u32>;

impl Items {
    /// The triangles of all meshes in one tree, still without vertices; see [`Items::gather`].
    pub(crate) fn of_buffers(run: &Run<'_>, meshes: &[MeshBuffers<'_>]) -> Result<Self, GpuError> {
        let count = ranges(meshes)?.last().map_or(0, |last| last.first + last.count);
        Self::unknown_triangles(run.gpu(), vec![Range { first: 0, count }])
    }

    /// The triangles of each mesh in a tree of its own, still without vertices; see [`Items::gather`].
    pub(crate) fn trees_of_buffers(run: &Run<'_>, meshes: &[MeshBuffers<'_>]) -> Result<Self, GpuError> {
        Self::unknown_triangles(run.gpu(), ranges(meshes)?)
    }

    /// Triangles without vertices.
    pub(super) fn unknown_triangles(gpu: &Gpu, ranges: Vec<Range>) -> Result<Self, GpuError> {
        let n = ranges.last().map_or(0, |last| last.first + last.count);
        let corners = Arc::new(gpu.zeroed("corners", n as usize)?);
        Self::new(gpu, ranges, Leaf::Triangle { corners })
    }

    /// Copies the vertices of all triangles, and reports faults.
    pub(crate) fn gather(
        &self,
        run: &mut Run<'_>,
        meshes: &[MeshBuffers<'_>],
        faults: &Faults,
    ) -> Result<(), GpuError> {
        let ranges = ranges(meshes)?;
        (0..)
            .zip(meshes)
            .zip(ranges)
            .try_for_each(|((number, mesh), range)| self.gather_mesh(run, mesh, number, range.first, faults))
    }

    /// Copies the vertices of a mesh, whose triangles start at `first_triangle`, and reports its faults.
    pub(crate) fn gather_mesh(
        &self,
        run: &mut Run<'_>,
        mesh: &MeshBuffers<'_>,
        number: u32,
        first_triangle: u32,
        faults: &Faults,
    ) -> Result<(), GpuError> {
        let gpu = run.gpu();
        let Some(corners) = self.corners() else { return Ok(()) };
        let (layout, vertices, indices) =
            layout(gpu, mesh).map_err(|message| GpuError::Input { message: format!("mesh {number}: {message}") })?;
        let layout = MeshLayout { first_triangle, first_fault: 2 * number, ..layout };
        run.stage("corners", |dispatches| {
            dispatches.work.clear_range(faults, 2 * number, 2);
            let kernel = gpu.kernel("build/corners", &Specialisation::none())?;
            let uniform = gpu.uniform("mesh layout", &layout)?;
            let bound: [NamedBinding<'_>; 5] = [
                ("mesh_layout", &uniform),
                ("mesh_vertices", &vertices),
                ("mesh_indices", &indices),
                ("corners", &**corners),
                ("faults", faults),
            ];
            dispatches.items(&kernel, &bound, mesh.n_triangles)
        })
    }
}

/// The first fault that a build found, as a sentence.
pub(crate) fn fault(faults: &[u32]) -> Option<String> {
    faults.chunks_exact(2).enumerate().find_map(|(mesh, words)| match *words {
        [index, _] if index != 0 => Some(format!("mesh {mesh}: triangle {} has an index out of range", !index)),
        [_, vertex] if vertex != 0 => Some(format!(
            "mesh {mesh}: triangle {} has a vertex that is not finite or has coordinates above 1e18",
            !vertex
        )),
        _ => None,
    })
}

/// The triangles of each mesh among all.
fn ranges(meshes: &[MeshBuffers<'_>]) -> Result<Vec<Range>, GpuError> {
    let mut first = 0_u32;
    let range = |mesh: &MeshBuffers<'_>| {
        let range = Range { first, count: mesh.n_triangles };
        first = first.checked_add(mesh.n_triangles)?;
        Some(range)
    };
    let ranges: Option<Vec<Range>> = meshes.iter().map(range).collect();
    ranges.ok_or_else(|| GpuError::Unsupported { what: "meshes with more than 4294967295 triangles".to_owned() })
}

/// The layout of a mesh, checked against the sizes of its buffers, and the used parts of vertices and indices.
fn layout<'a>(gpu: &Gpu, mesh: &MeshBuffers<'a>) -> Result<(MeshLayout, Slot<'a>, Slot<'a>), String> {
    let &MeshBuffers { vertices, first_byte, stride, n_vertices, indices, n_triangles } = mesh;
    if stride % 4 != 0 || stride < 12 || first_byte % 4 != 0 {
        return Err(format!(
            "stride {stride} and first byte {first_byte} must be multiples of 4, the stride at least 12"
        ));
    }
    let end = end_of([first_byte, stride], n_vertices, 12);
    let n_corners = 3 * u64::from(n_triangles);
    let used = window(gpu, "vertices", vertices, [first_byte, end])?;
    let first_word = first_byte.saturating_sub(used.first_byte) / 4;
    let (first_index, index_bytes, used_indices) = match indices {
        None if n_corners > u64::from(n_vertices) => {
            return Err(format!("{n_triangles} triangles without indices need {n_corners} vertices, not {n_vertices}"));
        }
        None => (0, 0, used),
        Some(IndexBuffer { buffer, format, first_byte }) => {
            let size = format.byte_size() as u64;
            if first_byte % size != 0 {
                return Err(format!("the first byte {first_byte} of the indices must be a multiple of {size}"));
            }
            let used = window(gpu, "indices", buffer, [first_byte, first_byte.saturating_add(n_corners * size)])?;
            (first_byte.saturating_sub(used.first_byte) / size, size, used)
        }
    };
    let word = |x: u64| u32::try_from(x).map_err(|_| format!("an offset of {x} is out of range"));
    let layout = MeshLayout {
        first_word: word(first_word)?,
        stride: word(stride / 4)?,
        n_vertices,
        first_index: word(first_index)?,
        index_bytes: word(index_bytes)?,
        first_triangle: 0,
        first_fault: 0,
    };
    Ok((layout, used, used_indices))
}

/// The end of `n` things of `size` bytes, `stride` bytes apart. Where that exceeds 64 bits, no buffer is large enough.
pub(super) fn end_of([first_byte, stride]: [u64; 2], n: u32, size: u64) -> u64 {
    let Some(last) = n.checked_sub(1) else { return 0 };
    first_byte.saturating_add(u64::from(last).saturating_mul(stride)).saturating_add(size)
}

/// Bytes to which the start of a binding is rounded down, a multiple of the alignment that any device requires.
const ALIGNMENT: u64 = 256;

/// The part of a buffer from `first_byte` to `end` as a binding, which may start somewhat before.
pub(super) fn window<'a>(
    gpu: &Gpu,
    what: &str,
    buffer: &'a wgpu::Buffer,
    [first_byte, end]: [u64; 2],
) -> Result<Slot<'a>, String> {
    check_buffer(what, buffer, end)?;
    let first_byte = first_byte / ALIGNMENT * ALIGNMENT;
    // Without contents, something must be bound.
    let first_byte = if first_byte < end { first_byte } else { 0 };
    // `end` is at most the size of the buffer.
    let n_bytes = (end.max(4) - first_byte).next_multiple_of(4).min(buffer.size() - first_byte);
    let most = gpu.limits().max_storage_buffer_binding_size;
    if n_bytes > most {
        return Err(format!("the {what} have {n_bytes} bytes, and a storage binding of the device {most}"));
    }
    Ok(Slot { buffer, first_byte, n_bytes })
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
        assert_eq!(fault(&[0, 0]), None);
        assert_eq!(fault(&[0, 0, !1, 0]).unwrap(), "mesh 1: triangle 1 has an index out of range");
        let vertex = fault(&[0, !2, !0, 0]).unwrap();
        assert_eq!(vertex, "mesh 0: triangle 2 has a vertex that is not finite or has coordinates above 1e18");
    }
}
