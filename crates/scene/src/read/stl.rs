//! STL, ASCII and binary.
//!
//! ```text
//! bytes -> ascii or binary -> welded triangles -> mesh
//! ```
//!
//! Gives one mesh with one instance, in file order, also for several solids. Vertices with equal bits are welded. Normals are
//! those of the triangles, so the file's are ignored, and so are attributes such as colors.
//!
//! Source: 3D Systems, StereoLithography Interface Specification, 1989.

mod ascii;
mod binary;

use std::path::Path;

use super::mesh_checks::MeshChecks;
use super::weld::Weld;
use super::{ReadError, single};
use crate::{Material, Mesh, Scene};

/// Bytes examined for the format: more than the header of a binary file.
const HEAD_BYTES: usize = 1024;

/// Parses an STL file; `path` is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let mut triangles = Triangles::new();
    let mut scene = Scene::default();
    if is_ascii(bytes) {
        ascii::read(path, bytes, &mut triangles, &mut scene.warnings)?;
    } else {
        binary::read(path, bytes, &mut triangles, &mut scene.warnings)?;
    }
    let Triangles { weld, triangles, checks } = triangles;
    let mesh = Mesh { positions: weld.finish(), triangles, ..Mesh::default() };
    single::add(path, mesh, Material::default(), checks, scene)
}

/// Whether a file is ASCII: it begins with `solid` and has neither the size that a binary file declares nor a zero byte.
///
/// Headers of binary files may begin with `solid` too, but their triangle count has a zero byte up to 2^24 triangles.
pub(super) fn is_ascii(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let is_solid = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    is_solid
        && !binary::has_declared_size(bytes, bytes.len() as u64)
        && !bytes[..bytes.len().min(HEAD_BYTES)].contains(&0)
}

/// Whether the first bytes of a file of `n_bytes` are STL: ASCII with a facet, or binary of the size that it declares.
pub(super) fn is_stl(head: &[u8], n_bytes: u64) -> bool {
    let has_facet = || head.to_ascii_lowercase().windows(5).any(|word| word == b"facet");
    binary::has_declared_size(head, n_bytes) || is_ascii(head) && has_facet()
}

/// Triangles with welded vertices.
struct Triangles {
    weld: Weld,
    triangles: Vec<[u32; 3]>,
    checks: MeshChecks,
}

impl Triangles {
    fn new() -> Self {
        Self { weld: Weld::new(), triangles: Vec::new(), checks: MeshChecks::default() }
    }

    /// Adds a triangle unless a vertex is not finite; `None` for too many vertices.
    fn add(&mut self, corners: [[f32; 3]; 3]) -> Option<()> {
        if self.checks.keeps(corners) {
            self.push(corners)?;
        }
        Some(())
    }

    fn push(&mut self, [a, b, c]: [[f32; 3]; 3]) -> Option<()> {
        let triangle = [self.weld.index(a)?, self.weld.index(b)?, self.weld.index(c)?];
        self.triangles.push(triangle);
        Some(())
    }
}

/// The error for `None` of [`Triangles`].
fn too_many(path: &Path) -> ReadError {
    ReadError::unsupported(path, "more than 2^32 vertices")
}

#[cfg(test)]
mod tests;
