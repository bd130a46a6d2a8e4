//! OFF in ASCII, with normals (`NOFF`), colors (`COFF`) and texture coordinates (`STOFF`).
//!
//! ```text
//! lines -> header -> vertices -> faces -> mesh
//! ```
//!
//! Gives one mesh with one instance, in the file's order. Each vertex and each face is a line. Texture coordinates are
//! skipped, as no texture goes with them; colors of faces are reported.
//!
//! Source: Geomview manual, section "OFF Files".

mod header;

use std::path::Path;

use super::mesh_checks::{MeshChecks, unit_normal};
use super::text::{self, quoted};
use super::warning_groups::WarningGroups;
use super::{ReadError, single, vertex_colors};
use crate::{Material, Mesh, Scene};
use header::Header;
pub(super) use header::is_off;

/// A line: its number and its words.
struct Line<'a> {
    number: usize,
    words: Vec<&'a [u8]>,
}

impl Line<'_> {
    fn malformed(&self, path: &Path, message: impl Into<String>) -> ReadError {
        ReadError::malformed(path, format!("line {}", self.number), message)
    }
}

/// Lines with words; comments are skipped.
fn lines(bytes: &[u8]) -> impl Iterator<Item = Line<'_>> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let line = |(line, number): (_, usize)| Line { number, words: text::words(line).collect() };
    bytes.split(|&byte| byte == b'\n').zip(1..).map(line).filter(|line| !line.words.is_empty())
}

/// Vertices of a file, and the problems of their attributes.
#[derive(Default)]
struct Vertices {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    colors: Vec<[f32; 3]>,
}

/// Parses an OFF file; `path` is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let mut lines = lines(bytes);
    let (mut scene, mut grouped) = (Scene::default(), WarningGroups::default());
    let header = header::read(path, &mut lines)?;
    let mut next = |what: &str, k: u64, n: u64| {
        let missing = || ReadError::malformed(path, "end of file", format!("{what} {k} of {n} is missing"));
        lines.next().ok_or_else(missing)
    };
    let mut vertices = Vertices::default();
    for k in 0..header.n_vertices {
        vertices.add(path, &header, &next("vertex", k, header.n_vertices)?, &mut grouped)?;
    }
    let (mut checks, mut triangles) = (MeshChecks::default(), Vec::new());
    let (mut indices, mut polygon, mut cuts) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..header.n_faces {
        face(path, &next("face", k, header.n_faces)?, vertices.positions.len(), &mut indices, &mut grouped)?;
        if indices.len() < 3 {
            checks.n_small_faces += 1;
            continue;
        }
        polygon.clear();
        polygon.extend(indices.iter().map(|&index| vertices.positions[index as usize]));
        checks.triangulate(&polygon, &mut cuts);
        triangles.extend(cuts.iter().map(|cut| cut.map(|k| indices[k])));
    }
    if let Some(line) = lines.next() {
        grouped.add("ignoring lines after the last declared face", &format!("line {}", line.number));
    }
    grouped.finish(&mut scene.warnings);
    let (mesh, material) = vertices.into_mesh(triangles, &mut scene.warnings);
    single::add(path, mesh, material, checks, scene)
}

impl Vertices {
    /// Reads a vertex: `x y z`, then as the header says `nx ny nz`, `r g b` or `r g b a`, and `s t`.
    fn add(&mut self, path: &Path, header: &Header, line: &Line, grouped: &mut WarningGroups) -> Result<(), ReadError> {
        let mut numbers = Vec::with_capacity(line.words.len().min(12));
        for word in &line.words {
            let invalid = || line.malformed(path, format!("vertex: expected a number, found {}", quoted(word)));
            numbers.push(text::float(word).ok_or_else(invalid)?);
        }
        let (position, mut rest) = numbers
            .split_first_chunk::<3>()
            .ok_or_else(|| line.malformed(path, format!("vertex has {} coordinates (expected 3)", numbers.len())))?;
        let location = format!("line {}", line.number);
        self.positions.push(*position);
        if header.has_normals {
            let (normal, after) = rest.split_first_chunk::<3>().unwrap_or((&[0.0; 3], &[]));
            if rest.len() < 3 {
                grouped.add("vertices without a normal", &location);
            }
            self.normals.push(*normal);
            rest = after;
        }
        if header.has_uvs {
            rest = &rest[..rest.len().saturating_sub(2)];
        }
        if header.has_colors {
            let color = match *rest {
                [r, g, b] | [r, g, b, _] => [r, g, b],
                _ => {
                    grouped.add("vertices without a color of 3 or 4 numbers", &location);
                    vertex_colors::NO_COLOR
                }
            };
            self.colors.push(color);
        } else if !rest.is_empty() {
            grouped.add("ignoring surplus numbers after a vertex", &location);
        }
        Ok(())
    }

    /// The mesh, and a material that is white under vertex colors.
    fn into_mesh(self, triangles: Vec<[u32; 3]>, warnings: &mut Vec<String>) -> (Mesh, Material) {
        let Self { positions, normals, colors } = self;
        let mut mesh = Mesh { positions, triangles, ..Mesh::default() };
        let mut material = Material::default();
        if !normals.is_empty() {
            mesh.normals = Some(normals.into_iter().map(unit_normal).collect());
        }
        if !colors.is_empty() {
            match vertex_colors::linear(colors, None) {
                Ok(colors) => {
                    mesh.colors = Some(colors);
                    material.base_color = [1.0; 3];
                }
                Err(warning) => warnings.push(warning),
            }
        }
        (mesh, material)
    }
}

/// Reads a face: a count, that many indices, and an optional color.
fn face(
    path: &Path,
    line: &Line,
    n_vertices: usize,
    indices: &mut Vec<u32>,
    grouped: &mut WarningGroups,
) -> Result<(), ReadError> {
    indices.clear();
    let count = line.words[0];
    let n = text::integer(count).and_then(|n| usize::try_from(n).ok());
    let n = n.ok_or_else(|| line.malformed(path, format!("invalid number of corners {}", quoted(count))))?;
    let words = line.words.get(1..).and_then(|words| words.split_at_checked(n));
    let (corners, rest) = words.ok_or_else(|| {
        line.malformed(path, format!("face of {n} corners, but the line has {}", line.words.len() - 1))
    })?;
    for word in corners {
        let index = text::integer(word)
            .ok_or_else(|| line.malformed(path, format!("invalid vertex index {}", quoted(word))))?;
        let in_range = u32::try_from(index).ok().filter(|&index| (index as usize) < n_vertices);
        indices.push(in_range.ok_or_else(|| {
            line.malformed(path, format!("vertex index {index} out of range ({n_vertices} vertices)"))
        })?);
    }
    if !rest.is_empty() {
        grouped.add("ignoring colors of faces", &format!("line {}", line.number));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
