//! Triangles of a binary PLY file, a part at a time: faces are read in order, vertices where faces need them.
//!
//! ```text
//! header -> faces, once to check them -> faces again, with the vertices of each from a bounded cache -> triangles
//! ```

use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;

use super::body::{Body, Element, Encoding, Kind, Scalar, header};
use super::faces;
use crate::read::error::ReadError;
use crate::read::mesh::{MeshChecks, PART, TakeTriangles};

/// Most bytes of a header.
const MAX_HEADER: usize = 1 << 20;

/// Vertices that are read at once.
const PAGE: u64 = 1 << 10;

/// Calls `visit` with the triangles of a file, as [`stream_triangles`](crate::stream_triangles); about `memory` bytes hold vertices.
///
/// `None` without a call for a file of text, or with other elements than vertices and then faces with one list, the indices, and for a file
/// with an error, which the reader of whole files reports.
pub(in crate::read) fn triangles<E: From<ReadError>>(
    path: &Path,
    memory: u64,
    visit: &mut TakeTriangles<'_, E>,
) -> Result<Option<Vec<String>>, E> {
    let Ok(Some((layout, start))) = File::open(path).and_then(|file| read_header(path, file)) else { return Ok(None) };
    if layout.n_faces == 0 {
        return Ok(None);
    }
    let faces_at = start + layout.n_vertices * layout.vertex_bytes as u64;
    let faces = |take: &mut dyn FnMut(&[u32]) -> io::Result<()>| -> io::Result<()> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(faces_at))?;
        layout.each_face(&mut BufReader::with_capacity(1 << 20, file), take)
    };
    if faces(&mut |_| Ok(())).is_err() {
        return Ok(None);
    }
    let io = |error: io::Error| E::from(ReadError::io(path)(error));
    let file = File::open(path).map_err(io)?;
    let mut vertices = Vertices::new(&layout, file, start, memory);
    let (mut checks, mut corners, mut triangles, mut failed) = (MeshChecks::default(), vec![], vec![], None);
    let read = faces(&mut |face| {
        corners.clear();
        for &index in face {
            corners.push(vertices.get(index)?);
        }
        checks.cut(&corners, |corner| corner, &mut triangles);
        if triangles.len() >= PART {
            failed = visit(&triangles).err();
            triangles.clear();
        }
        if failed.is_some() { Err(io::ErrorKind::Other.into()) } else { Ok(()) }
    });
    if let Some(error) = failed {
        return Err(error);
    }
    read.map_err(io)?;
    visit(&triangles)?;
    Ok(Some(checks.warnings(path)?))
}

/// Where numbers are in a binary file.
struct Layout {
    encoding: Encoding,
    n_vertices: u64,
    n_faces: u64,
    /// Bytes of a vertex, and for each coordinate those before it and its type.
    vertex_bytes: usize,
    position: [(usize, Scalar); 3],
    /// Bytes of a face before and after the list of its indices, and the types of the list.
    around: [usize; 2],
    list: (Scalar, Scalar),
}

/// The layout, and where the vertices start; `None` for another one.
fn read_header(path: &Path, mut file: File) -> io::Result<Option<(Layout, u64)>> {
    let mut bytes = vec![];
    file.by_ref().take(MAX_HEADER as u64).read_to_end(&mut bytes)?;
    let Ok((header, body)) = header(path, &bytes) else { return Ok(None) };
    let [vertex, face] = &header.elements[..] else { return Ok(None) };
    if header.encoding == Encoding::Ascii || vertex.name != b"vertex" || face.name != b"face" {
        return Ok(None);
    }
    let layout = Layout::new(header.encoding, vertex, face);
    Ok(layout.filter(|layout| layout.n_vertices <= 1 << 32).map(|layout| (layout, (bytes.len() - body.len()) as u64)))
}

impl Layout {
    fn new(encoding: Encoding, vertex: &Element, face: &Element) -> Option<Self> {
        let (mut vertex_bytes, mut position) = (0, [None; 3]);
        for property in &vertex.properties {
            let scalar = property.scalar()?;
            if let Some(axis) = [b"x", b"y", b"z"].iter().position(|name| property.is_one_of(&[&name[..]])) {
                position[axis].get_or_insert((vertex_bytes, scalar));
            }
            vertex_bytes += scalar.size();
        }
        let [Some(x), Some(y), Some(z)] = position else { return None };
        let (mut around, mut list) = ([0; 2], None);
        for property in &face.properties {
            match property.kind {
                Kind::Scalar(scalar) => around[usize::from(list.is_some())] += scalar.size(),
                Kind::List { count, item } if list.is_none() && faces::is_indices(property) => {
                    list = Some((count, item));
                }
                Kind::List { .. } => return None,
            }
        }
        let (n_vertices, n_faces) = (vertex.count, face.count);
        Some(Self { encoding, n_vertices, n_faces, vertex_bytes, position: [x, y, z], around, list: list? })
    }

    /// Calls `take` with the indices of each face; an error for one that is not below the number of vertices.
    fn each_face(&self, file: &mut impl Read, take: &mut dyn FnMut(&[u32]) -> io::Result<()>) -> io::Result<()> {
        let (mut bytes, mut face) = (vec![], vec![]);
        let invalid = || io::Error::from(io::ErrorKind::InvalidData);
        let (count, item) = self.list;
        for _ in 0..self.n_faces {
            bytes.resize(self.around[0] + count.size(), 0);
            file.read_exact(&mut bytes)?;
            let n = Body::new(self.encoding, &bytes[self.around[0]..]).integer(count).map_err(|_| invalid())?;
            // More are cut with all of the file in memory.
            let n = usize::try_from(n).ok().filter(|&n| n <= MOST_CORNERS).ok_or_else(invalid)?;
            bytes.resize(n * item.size() + self.around[1], 0);
            file.read_exact(&mut bytes)?;
            let mut list = Body::new(self.encoding, &bytes);
            face.clear();
            for _ in 0..n {
                let index = list.integer(item).ok().and_then(|index| u32::try_from(index).ok());
                face.push(index.filter(|&index| u64::from(index) < self.n_vertices).ok_or_else(invalid)?);
            }
            take(&face)?;
        }
        Ok(())
    }
}

/// Most corners of a face that is read in parts.
const MOST_CORNERS: usize = 1 << 16;

/// Vertices of a file, a bounded number of them in memory: a page has one place, whose page it replaces.
struct Vertices<'a> {
    layout: &'a Layout,
    file: File,
    start: u64,
    pages: Vec<Page>,
    bytes: Vec<u8>,
}

/// Vertices from a multiple of [`PAGE`] on; none at first.
#[derive(Clone, Default)]
struct Page {
    number: u64,
    vertices: Vec<[f32; 3]>,
}

impl<'a> Vertices<'a> {
    fn new(layout: &'a Layout, file: File, start: u64, memory: u64) -> Self {
        let n_places =
            (memory / (PAGE * size_of::<[f32; 3]>() as u64)).clamp(1, layout.n_vertices.div_ceil(PAGE).max(1));
        Self { layout, file, start, pages: vec![Page::default(); n_places as usize], bytes: vec![] }
    }

    /// A vertex that exists.
    fn get(&mut self, index: u32) -> io::Result<[f32; 3]> {
        let (number, at) = (u64::from(index) / PAGE, (u64::from(index) % PAGE) as usize);
        let place = (number % self.pages.len() as u64) as usize;
        if self.pages[place].vertices.is_empty() || self.pages[place].number != number {
            self.read(number, place)?;
        }
        Ok(self.pages[place].vertices[at])
    }

    fn read(&mut self, number: u64, place: usize) -> io::Result<()> {
        let Layout { encoding, n_vertices, vertex_bytes, position, .. } = *self.layout;
        let n = PAGE.min(n_vertices - number * PAGE) as usize;
        self.bytes.resize(n * vertex_bytes, 0);
        self.file.seek(SeekFrom::Start(self.start + number * PAGE * vertex_bytes as u64))?;
        self.file.read_exact(&mut self.bytes)?;
        let Page { number: own, vertices } = &mut self.pages[place];
        *own = number;
        vertices.clear();
        for row in self.bytes.chunks_exact(vertex_bytes) {
            let mut vertex = [0.0; 3];
            for (x, (at, scalar)) in vertex.iter_mut().zip(position) {
                let number = Body::new(encoding, &row[at..]).float(scalar);
                *x = number.map_err(|_| io::Error::from(io::ErrorKind::InvalidData))?;
            }
            vertices.push(vertex);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    /// Writes numbers of a type in the order of a file.
    fn put(bytes: &mut Vec<u8>, is_big: bool, scalar: &str, number: f64) {
        let mut word = match scalar {
            "uchar" => vec![number as u8],
            "ushort" => (number as u16).to_le_bytes().to_vec(),
            "int" => (number as i32).to_le_bytes().to_vec(),
            "uint" => (number as u32).to_le_bytes().to_vec(),
            "float" => (number as f32).to_le_bytes().to_vec(),
            "double" => number.to_le_bytes().to_vec(),
            _ => unreachable!("{scalar}"),
        };
        if is_big {
            word.reverse();
        }
        bytes.extend(word);
    }

    /// Vertices with a color between their coordinates, and faces with a number before and a quality after their indices.
    fn file(is_big: bool, [real, count, item]: [&str; 3], vertices: &[[f64; 3]], faces: &[Vec<u32>]) -> Vec<u8> {
        let order = if is_big { "big" } else { "little" };
        let mut bytes = format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex {}\nproperty {real} x\nproperty uchar red\n\
             property {real} z\nproperty {real} y\nelement face {}\nproperty int id\n\
             property list {count} {item} vertex_indices\nproperty float quality\nend_header\n",
            vertices.len(),
            faces.len()
        )
        .into_bytes();
        for &[x, y, z] in vertices {
            put(&mut bytes, is_big, real, x);
            put(&mut bytes, is_big, "uchar", 7.0);
            put(&mut bytes, is_big, real, z);
            put(&mut bytes, is_big, real, y);
        }
        for face in faces {
            put(&mut bytes, is_big, "int", -1.0);
            put(&mut bytes, is_big, count, face.len() as f64);
            face.iter().for_each(|&index| put(&mut bytes, is_big, item, f64::from(index)));
            put(&mut bytes, is_big, "float", 0.5);
        }
        bytes
    }

    type Streamed = (Vec<[[f32; 3]; 3]>, Vec<String>);

    /// All triangles, and the warnings; about `memory` bytes hold vertices.
    fn streamed(path: &Path, memory: u64) -> Option<Streamed> {
        let mut all = vec![];
        let warnings = crate::stream_triangles::<ReadError>(path, memory, |triangles| {
            all.extend_from_slice(triangles);
            Ok(())
        });
        warnings.unwrap().map(|warnings| (all, warnings))
    }

    #[test]
    fn triangles_are_those_of_the_whole_file() {
        let (folder, mut random) = (tempfile::tempdir().unwrap(), SplitMix64::new(3));
        let path = folder.path().join("model.ply");
        let mut vertices: Vec<[f64; 3]> = (0..5000).map(|_| random.signed3()).collect();
        vertices[17] = [f64::NAN, 0.0, 0.0];
        vertices[4000] = [0.0, f64::INFINITY, 0.0];
        let faces: Vec<Vec<u32>> = (0..4000)
            .map(|_| (0..[3, 3, 3, 4, 5, 2][random.below(6)]).map(|_| random.below(5000) as u32).collect())
            .collect();
        for types in [["float", "uchar", "int"], ["double", "uint", "uint"], ["float", "ushort", "ushort"]] {
            for is_big in [false, true] {
                std::fs::write(&path, file(is_big, types, &vertices, &faces)).unwrap();
                let scene = crate::read(&path).unwrap();
                let mesh = &scene.meshes[0];
                let whole: Vec<_> =
                    mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect();
                for memory in [0, 30_000, 1 << 20] {
                    let (triangles, warnings) = streamed(&path, memory).unwrap();
                    assert!(triangles == whole, "{types:?} {is_big} {memory}");
                    assert_eq!(warnings, scene.warnings);
                    assert!(warnings.len() > 1, "{warnings:?}");
                }
            }
        }
    }

    #[test]
    fn other_files_are_left_to_the_reader_of_whole_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.ply");
        let types = ["float", "uchar", "int"];
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let good = file(false, types, &vertices, &[vec![0, 1, 2]]);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let changed = |from: &str, to: &str| {
            let at = text(&good).find(from).unwrap();
            [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
        };
        std::fs::write(&path, &good).unwrap();
        assert_eq!(streamed(&path, 0).unwrap().0.len(), 1);
        for bytes in [
            vec![],
            b"ply\n".to_vec(),
            good[..good.len() - 5].to_vec(),
            file(false, types, &vertices, &[vec![0, 1, 3]]),
            file(false, types, &vertices, &[]),
            changed("binary_little_endian", "ascii"),
            changed("element face 1\n", "element face 1\nproperty list uchar float texcoord\n"),
            changed("element face", "element strip"),
            changed("property float y", "property float w"),
        ] {
            std::fs::write(&path, &bytes).unwrap();
            assert_eq!(streamed(&path, 0), None, "{}", text(&bytes));
        }
        std::fs::write(&path, file(false, types, &vertices, &[vec![0, 1, 1]])).unwrap();
        let error = crate::stream_triangles::<ReadError>(&path, 0, |_| Ok(())).unwrap_err().to_string();
        assert!(error.ends_with("all 1 triangles are degenerate (zero area)"), "{error}");
    }
}
