//! What trees are built over: triangles of meshes, also in buffers of a program's own, and boxes of instances.

use canted_shaders::{choice, wgsl};
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Corners;
use canted_obb::{Aabb, Obb};
use wgpu::{BufferUsages, IndexFormat};

use super::BuildEncoder;
use super::encoder::Dispatches;
use crate::buffer::Slot;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Variant};

/// The primitives of one tree, as a range of the level's primitives.
///
/// Its leaves use the same range of positions. Its inner nodes use the same range of slots, the last of which is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Range {
    /// The first primitive.
    pub first: u32,
    /// Number of primitives.
    pub count: u32,
}

/// The primitives of a level. All trees of a level are built together.
pub struct Primitives {
    ranges: Vec<Range>,
    n: u32,
    device_ranges: Buffer<Range>,
    pub(super) leaf: Leaf,
}

/// The kind of a primitive.
pub(super) enum Leaf {
    /// A triangle of a mesh.
    Triangle { corners: Arc<Buffer<Corners>> },
    /// World-space box of an instance, and its axis-aligned bounding box.
    Box { boxes: Buffer<Obb>, aabbs: Buffer<Aabb> },
}

impl Primitives {
    /// Triangles, one tree per mesh.
    ///
    /// # Errors
    /// A vertex that is not finite, by mesh and triangle; out of memory.
    pub fn triangles<'m>(gpu: &Gpu, meshes: impl IntoIterator<Item = &'m [Corners]>) -> Result<Self, GpuError> {
        let mut all = vec![];
        let mut ranges = vec![];
        for (mesh, corners) in meshes.into_iter().enumerate() {
            let is_bad = |corners: &Corners| !corners.iter().flatten().all(|x| x.is_finite());
            if let Some(triangle) = corners.iter().position(is_bad) {
                let message = format!("mesh {mesh}: triangle {triangle} has a vertex that is not finite");
                return Err(GpuError::Input { message });
            }
            ranges.push(Range { first: count(all.len()), count: count(corners.len()) });
            all.extend_from_slice(corners);
        }
        let leaf = Leaf::Triangle { corners: Arc::new(gpu.buffer("corners", &all)?) };
        Self::new(gpu, ranges, leaf)
    }

    /// Boxes of instances, in one tree.
    ///
    /// # Errors
    /// Out of memory.
    pub fn boxes(gpu: &Gpu, boxes: &[Obb]) -> Result<Self, GpuError> {
        let ranges = vec![Range { first: 0, count: count(boxes.len()) }];
        let aabbs: Vec<Aabb> = boxes.iter().map(Obb::aabb).collect();
        let leaf = Leaf::Box {
            boxes: gpu.buffer("boxes", boxes)?,
            aabbs: gpu.buffer("axis-aligned boxes of primitives", &aabbs)?,
        };
        Self::new(gpu, ranges, leaf)
    }

    /// Boxes of `n` instances in one tree, which are not computed yet; see [`super::place`].
    pub(crate) fn unplaced(gpu: &Gpu, n: u32) -> Result<Self, GpuError> {
        let (boxes, aabbs) =
            (gpu.zeroed("boxes", n as usize)?, gpu.zeroed("axis-aligned boxes of primitives", n as usize)?);
        Self::new(gpu, vec![Range { first: 0, count: n }], Leaf::Box { boxes, aabbs })
    }

    pub(super) fn new(gpu: &Gpu, ranges: Vec<Range>, leaf: Leaf) -> Result<Self, GpuError> {
        let n = ranges.iter().map(|range| range.count).sum();
        Ok(Self { device_ranges: gpu.buffer("ranges of trees", &ranges)?, n, ranges, leaf })
    }

    /// Number of primitives of all trees.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.n
    }

    /// Whether there are no primitives.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// The primitives of each tree.
    #[must_use]
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// The primitives of a range of trees.
    pub(crate) fn of_trees(&self, [first, end]: [u32; 2]) -> [u32; 2] {
        let first_item = |tree: u32| self.ranges.get(tree as usize).map_or(self.n, |range| range.first);
        [first_item(first), first_item(end)]
    }

    /// The vertices of the triangles; none for boxes.
    pub(crate) fn corners(&self) -> Option<&Arc<Buffer<Corners>>> {
        match &self.leaf {
            Leaf::Triangle { corners } => Some(corners),
            Leaf::Box { .. } => None,
        }
    }

    /// Bits of a tree index.
    pub(super) fn tree_bits(&self) -> u32 {
        count(self.ranges.len()).max(1).next_power_of_two().ilog2()
    }

    /// The shader part that reads these primitives.
    pub(crate) fn part(&self) -> Variant {
        let file = match self.leaf {
            Leaf::Triangle { .. } => choice::Item::Triangles,
            Leaf::Box { .. } => choice::Item::Boxes,
        };
        Variant::none().with(file)
    }

    /// `more`, and the bindings of that part and of `shared/build/tree/forest`.
    pub(crate) fn bound<'a>(&'a self, more: &[NamedBinding<'a>]) -> Vec<NamedBinding<'a>> {
        let mut bound: Vec<NamedBinding<'a>> = vec![("ranges", &self.device_ranges)];
        match &self.leaf {
            Leaf::Triangle { corners } => bound.push(("corners", &**corners)),
            Leaf::Box { boxes, aabbs } => {
                let both: [NamedBinding<'a>; 2] = [("item_boxes", boxes), ("item_aabbs", aabbs)];
                bound.extend(both);
            }
        }
        bound.extend_from_slice(more);
        bound
    }
}

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

/// `MeshLayout` of `build/scene/corners`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct MeshLayout {
    first_item: u32,
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

impl Primitives {
    /// The triangles of all meshes in one tree, still without vertices; see [`Primitives::gather`].
    pub(crate) fn of_buffers(build: &BuildEncoder<'_>, meshes: &[MeshBuffers<'_>]) -> Result<Self, GpuError> {
        let count = ranges(meshes)?.last().map_or(0, |last| last.first + last.count);
        Self::unknown_triangles(build.gpu(), vec![Range { first: 0, count }])
    }

    /// The triangles of each mesh in a tree of its own, still without vertices; see [`Primitives::gather`].
    pub(crate) fn trees_of_buffers(build: &BuildEncoder<'_>, meshes: &[MeshBuffers<'_>]) -> Result<Self, GpuError> {
        Self::unknown_triangles(build.gpu(), ranges(meshes)?)
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
        build: &mut BuildEncoder<'_>,
        meshes: &[MeshBuffers<'_>],
        faults: &Faults,
    ) -> Result<(), GpuError> {
        let firsts = ranges(meshes)?.into_iter().map(|range| range.first);
        let meshes: Vec<_> = (0..).zip(firsts).zip(meshes).collect();
        self.gather_meshes(build, &meshes, faults)
    }

    /// Copies the vertices of a mesh, whose triangles start at `first_triangle`, and reports its faults.
    pub(crate) fn gather_mesh(
        &self,
        build: &mut BuildEncoder<'_>,
        mesh: &MeshBuffers<'_>,
        number: u32,
        first_triangle: u32,
        faults: &Faults,
    ) -> Result<(), GpuError> {
        self.gather_meshes(build, &[((number, first_triangle), mesh)], faults)
    }

    /// Copies the vertices of meshes, each with its number and the number of its first triangle, and reports faults. Small meshes share
    /// dispatches: a kernel binds few buffers, so their buffers are copied into one before.
    fn gather_meshes(
        &self,
        build: &mut BuildEncoder<'_>,
        meshes: &[((u32, u32), &MeshBuffers<'_>)],
        faults: &Faults,
    ) -> Result<(), GpuError> {
        let gpu = build.gpu();
        let Some(corners) = self.corners() else { return Ok(()) };
        let all = meshes.iter().map(|&(numbers, mesh)| SourceMesh::new(gpu, numbers, mesh));
        let all = all.collect::<Result<Vec<_>, GpuError>>()?;
        let (small, large): (Vec<_>, Vec<_>) = all.into_iter().partition(SourceMesh::is_small);
        build.stage("corners", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::scene::CORNERS, &Variant::none())?;
            let dispatch =
                |work: &mut Dispatches<'_>, layouts: &[MeshLayout], [vertices, indices]: [Slot<'_>; 2], n| {
                    let layouts = gpu.buffer("mesh layouts", layouts)?;
                    let bound: [NamedBinding<'_>; 5] = [
                        ("mesh_layouts", &layouts),
                        ("mesh_vertices", &vertices),
                        ("mesh_indices", &indices),
                        ("corners", &**corners),
                        ("faults", faults),
                    ];
                    work.items(&kernel, &bound, n)
                };
            for ((number, _), _) in meshes {
                dispatches.work.clear_range(faults, 2 * number, 2);
            }
            for one in &large {
                dispatch(dispatches, &[one.layout], [one.vertices, one.indices], one.n_triangles)?;
            }
            let most = gpu.limits().max_storage_buffer_binding_size.min(MOST_COPIED);
            for batch in batches(&small, most) {
                if let [one] = batch {
                    dispatch(dispatches, &[one.layout], [one.vertices, one.indices], one.n_triangles)?;
                    continue;
                }
                let n_bytes: u64 = batch.iter().map(SourceMesh::n_bytes).sum();
                let words = gpu.zeroed::<u32>("words of small meshes", (n_bytes / 4) as usize)?;
                let (mut n_words, mut n_items, mut layouts) = (0, 0, vec![]);
                for one in batch {
                    layouts.push(one.moved(n_words, n_items));
                    for part in one.parts() {
                        dispatches.work.copy_slot(&part, &words, n_words);
                        n_words += (part.n_bytes / 4) as u32;
                    }
                    n_items += one.n_triangles;
                }
                let words = words.slot(0, n_words as usize);
                dispatch(dispatches, &layouts, [words, words], n_items)?;
            }
            Ok(())
        })
    }
}

/// Most bytes of vertices and indices of a small mesh, whose copy takes less than a dispatch, and of all that are copied together.
const SMALL: u64 = 1 << 22;
const MOST_COPIED: u64 = 1 << 26;

/// A mesh in buffers of a program.
struct SourceMesh<'a> {
    layout: MeshLayout,
    n_triangles: u32,
    vertices: Slot<'a>,
    indices: Slot<'a>,
}

impl<'a> SourceMesh<'a> {
    /// A mesh with its number and the number of its first triangle.
    fn new(gpu: &Gpu, (number, first_triangle): (u32, u32), mesh: &MeshBuffers<'a>) -> Result<Self, GpuError> {
        let (layout, vertices, indices) =
            layout(gpu, mesh).map_err(|message| GpuError::Input { message: format!("mesh {number}: {message}") })?;
        let layout = MeshLayout { first_triangle, first_fault: 2 * number, ..layout };
        Ok(Self { layout, n_triangles: mesh.n_triangles, vertices, indices })
    }

    /// What the mesh reads: vertices, and indices if there are any.
    fn parts(&self) -> impl Iterator<Item = Slot<'a>> + use<'a> {
        [self.vertices].into_iter().chain((self.layout.index_bytes > 0).then_some(self.indices))
    }

    fn n_bytes(&self) -> u64 {
        self.parts().map(|part| part.n_bytes).sum()
    }

    /// Whether it is small, and can be copied.
    fn is_small(&self) -> bool {
        let is_copied =
            |part: Slot<'_>| part.buffer.usage().contains(BufferUsages::COPY_SRC) && part.n_bytes.is_multiple_of(4);
        self.parts().all(is_copied) && self.n_bytes() <= SMALL
    }

    /// Its layout where its parts follow each other from a word on, and its triangles are items from `first_item` on.
    fn moved(&self, first: u32, first_item: u32) -> MeshLayout {
        let MeshLayout { first_word, first_index, index_bytes, .. } = self.layout;
        let indices = first + (self.vertices.n_bytes / 4) as u32;
        let per_word = if index_bytes == 2 { 2 } else { 1 };
        MeshLayout {
            first_item,
            first_word: first + first_word,
            first_index: first_index + per_word * indices,
            ..self.layout
        }
    }
}

/// Meshes that are copied together: runs of at most so many bytes, or of one mesh.
fn batches<'s, 'a>(meshes: &'s [SourceMesh<'a>], most: u64) -> Vec<&'s [SourceMesh<'a>]> {
    let (mut runs, mut first, mut n_bytes) = (vec![], 0, 0);
    for (i, mesh) in meshes.iter().enumerate() {
        if i > first && n_bytes + mesh.n_bytes() > most {
            runs.push(&meshes[first..i]);
            (first, n_bytes) = (i, 0);
        }
        n_bytes += mesh.n_bytes();
    }
    if first < meshes.len() {
        runs.push(&meshes[first..]);
    }
    runs
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
        first_item: 0,
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

/// A count as `u32`.
pub(crate) fn count(n: usize) -> u32 {
    n as u32
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
