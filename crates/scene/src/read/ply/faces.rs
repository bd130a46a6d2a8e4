//! The faces of PLY: vertex indices, what files store for faces and their corners (texture coordinates, colors, the number of a texture),
//! and the triangles of both.

use std::path::Path;

use super::body::{Body, Element, Kind, Property, Scalar};
use super::colors::{Colors, MATERIAL, RGB};
use crate::read::error::ReadError;
use crate::read::mesh::{Corner, MeshChecks};

/// Property names of the vertex indices of a face.
const INDICES: [&[u8]; 4] = [b"vertex_indices", b"vertex_index", b"vertex_indexes", b"indices"];

/// Property names of the texture coordinates of the corners of a face: a list of u and v of each.
const UVS: [&[u8]; 7] = [b"texcoord", b"texcoords", b"tex_coord", b"tex_coords", b"texture_coordinates", b"uv", b"uvs"];

/// Property names of the texture of a face: a number of a `TextureFile`, from 0.
pub(super) const TEXTURE: [&[u8]; 5] = [b"texnumber", b"tex_number", b"texture_number", b"texture_index", b"texid"];

/// Whether a property is the list of the vertices of a face.
pub(super) fn is_indices(property: &Property) -> bool {
    matches!(property.kind, Kind::List { .. }) && property.is_one_of(&INDICES)
}

/// What a property of a face means.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Slot {
    Indices,
    Uvs,
    Texture,
    Material,
    Color(usize),
}

/// The meaning of each property of a face.
pub(super) struct Layout {
    slots: Vec<Option<Slot>>,
    has_uvs: bool,
    /// The type of the colors, if there are any.
    colors: Option<Scalar>,
}

impl Layout {
    /// Of an element of faces or of strips.
    pub(super) fn of(element: &Element) -> Result<Self, String> {
        let mut slots: Vec<Option<Slot>> = Vec::with_capacity(element.properties.len());
        for property in &element.properties {
            let is = |names: &[&[u8]]| property.is_one_of(names);
            let slot = match property.kind {
                Kind::List { .. } if is_indices(property) => Some(Slot::Indices),
                Kind::List { .. } if is(&UVS) => Some(Slot::Uvs),
                Kind::Scalar(_) if is(&TEXTURE) => Some(Slot::Texture),
                Kind::Scalar(_) if is(&MATERIAL) => Some(Slot::Material),
                Kind::Scalar(_) => RGB.iter().position(|names| is(names)).map(Slot::Color),
                Kind::List { .. } => None,
            };
            // The first of several with the same meaning is used.
            slots.push(slot.filter(|slot| !slots.contains(&Some(*slot))));
        }
        let has = |slot: Slot| slots.contains(&Some(slot));
        if !has(Slot::Indices) {
            return Err("missing property 'vertex_indices'".into());
        }
        let red = slots.iter().position(|&slot| slot == Some(Slot::Color(0)));
        let has_colors = (0..3).all(|k| has(Slot::Color(k)));
        Ok(Self {
            has_uvs: has(Slot::Uvs),
            colors: red.filter(|_| has_colors).and_then(|red| element.properties[red].scalar()),
            slots,
        })
    }
}

/// All faces, vertex indices unchecked. Meshes of triangles, which are the most and the largest, need no ends of lists.
#[derive(Debug, Default)]
pub(super) struct Faces {
    /// All faces, as long as each has three corners.
    triangles: Vec<[u32; 3]>,
    /// All faces, from the first that has not.
    polygons: Option<Polygons>,
    pub(super) attributes: Attributes,
    /// Memory of a face.
    face: Vec<u32>,
}

/// What files store besides the vertices of faces. Each list is empty where the file has none, or where not all faces have it.
#[derive(Debug, Default)]
pub(super) struct Attributes {
    /// One per corner of all faces.
    pub(super) uvs: Vec<[f32; 2]>,
    /// One per face.
    pub(super) colors: Colors,
    /// One per face.
    pub(super) textures: Vec<i64>,
    /// One per face: the row of the element `material`.
    pub(super) materials: Vec<i64>,
    /// Faces whose texture coordinates are not two numbers per corner; they are zero.
    pub(super) n_wrong_uvs: usize,
}

/// Faces of any number of corners.
#[derive(Debug)]
struct Polygons {
    /// Vertex indices of all faces, concatenated.
    corners: Vec<u32>,
    /// End of each face in `corners`.
    ends: Vec<usize>,
}

impl Faces {
    /// Makes room for `n` more triangles.
    pub(super) fn reserve(&mut self, n: usize, layout: &Layout) {
        self.triangles.reserve_exact(n);
        self.attributes.colors.scalar = layout.colors;
    }

    /// Reads a face.
    pub(super) fn read(&mut self, body: &mut Body, element: &Element, layout: &Layout) -> Result<(), String> {
        let mut face = std::mem::take(&mut self.face);
        face.clear();
        let first_uv = self.attributes.uvs.len();
        let mut color = [0.0; 3];
        for (property, slot) in element.properties.iter().zip(&layout.slots) {
            match (property.kind, slot) {
                (Kind::List { count, item }, Some(Slot::Indices)) => corners(body, count, item, &mut face)?,
                (Kind::List { count, item }, Some(Slot::Uvs)) => self.attributes.read_uvs(body, count, item)?,
                (Kind::Scalar(kind), Some(Slot::Texture)) => self.attributes.textures.push(body.integer(kind)?),
                (Kind::Scalar(kind), Some(Slot::Material)) => self.attributes.materials.push(body.integer(kind)?),
                (Kind::Scalar(kind), &Some(Slot::Color(k))) => color[k] = body.float(kind)?,
                (kind, _) => body.skip(kind)?,
            }
        }
        if layout.has_uvs {
            self.attributes.check_uvs(first_uv, face.len());
        }
        if layout.colors.is_some() {
            self.attributes.colors.list.push(color);
        }
        self.push(&face);
        self.face = face;
        Ok(())
    }

    /// Reads triangle strips: each index after the first two of a strip makes a triangle with the two before it, every other one
    /// turned around; a negative index ends a strip. Triangles with a repeated index only join strips.
    pub(super) fn read_strips(&mut self, body: &mut Body, element: &Element, layout: &Layout) -> Result<(), String> {
        for (property, slot) in element.properties.iter().zip(&layout.slots) {
            let (count, item) = match (property.kind, slot) {
                (Kind::List { count, item }, Some(Slot::Indices)) => (count, item),
                (kind, _) => {
                    body.skip(kind)?;
                    continue;
                }
            };
            let (mut strip, mut n_strip) = ([0_u32; 2], 0_usize);
            for _ in 0..body.length(count, item)? {
                let index = body.integer(item)?;
                if index < 0 {
                    n_strip = 0;
                    continue;
                }
                let c = u32::try_from(index).map_err(|_| format!("invalid vertex index {index}"))?;
                let [a, b] = strip;
                if n_strip >= 2 && a != b && b != c && c != a {
                    self.push(&if n_strip.is_multiple_of(2) { [a, b, c] } else { [b, a, c] });
                }
                (strip, n_strip) = ([b, c], n_strip + 1);
            }
        }
        Ok(())
    }

    /// Adds a face.
    fn push(&mut self, face: &[u32]) {
        match (&mut self.polygons, face) {
            (None, &[a, b, c]) => self.triangles.push([a, b, c]),
            (Some(polygons), face) => polygons.push(face),
            (None, face) => {
                let ends = (1..=self.triangles.len()).map(|n| 3 * n).collect();
                let mut polygons = Polygons { corners: std::mem::take(&mut self.triangles).into_flattened(), ends };
                polygons.push(face);
                self.polygons = Some(polygons);
            }
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.polygons.is_none()
    }

    /// Takes the attributes, without lists that not all faces have: strips store none.
    pub(super) fn take_attributes(&mut self) -> Attributes {
        let (n_faces, n_corners) = match &self.polygons {
            Some(polygons) => (polygons.ends.len(), polygons.corners.len()),
            None => (self.triangles.len(), 3 * self.triangles.len()),
        };
        let mut attributes = std::mem::take(&mut self.attributes);
        let Attributes { uvs, colors, textures, materials, .. } = &mut attributes;
        uvs.truncate(if uvs.len() == n_corners { n_corners } else { 0 });
        colors.list.truncate(if colors.list.len() == n_faces { n_faces } else { 0 });
        for numbers in [textures, materials] {
            numbers.truncate(if numbers.len() == n_faces { n_faces } else { 0 });
        }
        attributes
    }

    /// Triangulates the faces in file order and checks vertex indices. Where all are triangles, the result is in their memory.
    pub(super) fn triangulate(
        self,
        path: &Path,
        positions: &[[f32; 3]],
        checks: &mut MeshChecks,
    ) -> Result<Vec<[u32; 3]>, ReadError> {
        let Some(polygons) = self.polygons else {
            let mut triangles = self.triangles;
            for (face, &index) in triangles.iter().enumerate().flat_map(|(face, t)| t.iter().map(move |i| (face, i))) {
                position(path, positions, face, index)?;
            }
            triangles.retain(|triangle| checks.keeps(triangle.map(|index| positions[index as usize])));
            return Ok(triangles);
        };
        let mut triangles = Vec::with_capacity(polygons.ends.len());
        for (face, indices) in polygons.iter().enumerate() {
            check(path, positions, face, indices)?;
            checks.cut(indices, |index| positions[index as usize], &mut triangles);
        }
        Ok(triangles)
    }

    /// As [`Faces::triangulate`], with the corners by which attributes are found.
    pub(super) fn triangulate_corners(
        self,
        path: &Path,
        positions: &[[f32; 3]],
        checks: &mut MeshChecks,
    ) -> Result<Vec<[Corner; 3]>, ReadError> {
        let too_many = || ReadError::unsupported(path, "more than 2^32 corners of faces");
        let polygons = match self.polygons {
            Some(polygons) => polygons,
            None => {
                let ends = (1..=self.triangles.len()).map(|n| 3 * n).collect();
                Polygons { corners: self.triangles.into_flattened(), ends }
            }
        };
        u32::try_from(polygons.corners.len().max(polygons.ends.len())).map_err(|_| too_many())?;
        let (mut triangles, mut face_corners, mut number) = (Vec::with_capacity(polygons.ends.len()), Vec::new(), 0);
        for (face, indices) in polygons.iter().enumerate() {
            check(path, positions, face, indices)?;
            face_corners.clear();
            face_corners.extend(indices.iter().map(|&vertex| {
                number += 1;
                Corner { vertex, number: number - 1, face: face as u32 }
            }));
            checks.cut(&face_corners, |corner| positions[corner.vertex as usize], &mut triangles);
        }
        Ok(triangles)
    }
}

impl Polygons {
    /// The faces, in order.
    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&start, &end)| &self.corners[start..end])
    }

    fn push(&mut self, face: &[u32]) {
        self.corners.extend_from_slice(face);
        self.ends.push(self.corners.len());
    }
}

impl Attributes {
    /// Appends a list of texture coordinates; an odd last number is dropped.
    fn read_uvs(&mut self, body: &mut Body, count: Scalar, item: Scalar) -> Result<(), String> {
        let n = body.length(count, item)?;
        for k in 0..n {
            let number = body.float(item)?;
            match (k % 2, self.uvs.last_mut()) {
                (1, Some(uv)) => uv[1] = number,
                _ if k + 1 < n => self.uvs.push([number, 0.0]),
                _ => {}
            }
        }
        Ok(())
    }

    /// Replaces texture coordinates from the `first` on by zeros if there are not as many as corners.
    fn check_uvs(&mut self, first: usize, n_corners: usize) {
        if self.uvs.len() != first + n_corners {
            self.n_wrong_uvs += 1;
            self.uvs.truncate(first);
            self.uvs.resize(first + n_corners, [0.0; 2]);
        }
    }
}

/// The position of a vertex of a face.
fn position(path: &Path, positions: &[[f32; 3]], face: usize, index: u32) -> Result<[f32; 3], ReadError> {
    positions.get(index as usize).copied().ok_or_else(|| {
        let message = format!("vertex index {index} out of range ({} vertices)", positions.len());
        ReadError::malformed(path, format!("face {face}"), message)
    })
}

/// Checks the vertices of a face, which is skipped if it has fewer than three.
fn check(path: &Path, positions: &[[f32; 3]], face: usize, indices: &[u32]) -> Result<(), ReadError> {
    if indices.len() < 3 {
        return Ok(());
    }
    indices.iter().try_for_each(|&index| position(path, positions, face, index).map(drop))
}

/// Appends the vertex indices of a face.
fn corners(body: &mut Body, count: Scalar, item: Scalar, face: &mut Vec<u32>) -> Result<(), String> {
    for _ in 0..body.length(count, item)? {
        let index = body.integer(item)?;
        face.push(u32::try_from(index).map_err(|_| format!("invalid vertex index {index}"))?);
    }
    Ok(())
}
