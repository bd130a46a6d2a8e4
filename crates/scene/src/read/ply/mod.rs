//! Stanford PLY, ASCII and binary of both byte orders.
//!
//! ```text
//! bytes -> header -> body (vertices and faces, others are skipped) -> mesh
//! ```
//!
//! Gives one mesh with one instance, in the file's vertex order. Texture coordinates are kept if a comment names a texture,
//! vertex colors always. Triangle strips become triangles.

mod body;

use std::path::Path;

use body::{Body, Element, Header, Kind, Scalar, header};

use super::folder::Folder;
use super::mesh::{MeshChecks, linear_colors, single_mesh, unit_normal, usable_uv};
use super::text::{self, quoted};
use super::{error::ReadError, image};
use crate::{Material, Mesh, Scene, TextureId, TextureRef};

/// Parses a PLY file; `path` gives the folder of the texture and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let (header, body) = header(path, bytes)?;
    let (table, is_read_to_end) = table(path, &header, body)?;
    if table.faces.is_empty() {
        return Err(ReadError::empty(path, "no faces"));
    }
    let mut scene = Scene { warnings: header.warnings, ..Scene::default() };
    if !is_read_to_end {
        scene.warnings.push("ignoring bytes after the last declared element".into());
    }
    let mut material = material(path, header.texture, &mut scene);
    let mut checks = MeshChecks::default();
    let mut table = table;
    let triangles = triangles(path, &table.positions, std::mem::take(&mut table.faces), &mut checks)?;
    let colors = table
        .colors
        .take()
        .and_then(|colors| linear_colors(colors, table.max_color).map_err(|warning| scene.warnings.push(warning)).ok());
    if colors.is_some() {
        // Colors are reflectances, not factors of the default gray.
        material.base_color = [1.0; 3];
    }
    let mesh = Mesh { colors, ..to_mesh(table, triangles, !scene.textures.is_empty()) };
    single_mesh(path, mesh, material, checks, scene)
}

/// The default material, or one with the texture of the header.
fn material(path: &Path, texture: Option<&[u8]>, scene: &mut Scene) -> Material {
    let Some(name) = texture else { return Material::default() };
    let name = String::from_utf8_lossy(name);
    let bytes = Folder::of(path).map_err(|error| error.to_string()).and_then(|folder| {
        let bytes = folder.read(&name);
        scene.files = folder.found();
        bytes
    });
    match bytes.and_then(|bytes| image::decode(&name, &bytes)) {
        Ok(texture) => {
            scene.textures.push(texture);
            Material {
                base_color: [1.0; 3],
                base_color_texture: Some(TextureRef::new(TextureId(0))),
                ..Material::default()
            }
        }
        Err(message) => {
            scene.warnings.push(format!("skipping texture {}: {message}", text::quoted(name.as_bytes())));
            Material::default()
        }
    }
}

/// Triangulates the faces in file order and checks vertex indices. Where all are triangles, the result is in their memory.
fn triangles(
    path: &Path,
    positions: &[[f32; 3]],
    faces: Faces,
    checks: &mut MeshChecks,
) -> Result<Vec<[u32; 3]>, ReadError> {
    let position = |face: usize, index: u32| {
        positions.get(index as usize).copied().ok_or_else(|| {
            let message = format!("vertex index {index} out of range ({} vertices)", positions.len());
            ReadError::malformed(path, format!("face {face}"), message)
        })
    };
    let polygons = match faces.into_triangles() {
        Ok(mut triangles) => {
            for (face, &index) in triangles.iter().enumerate().flat_map(|(face, t)| t.iter().map(move |i| (face, i))) {
                position(face, index)?;
            }
            triangles.retain(|triangle| checks.keeps(triangle.map(|index| positions[index as usize])));
            return Ok(triangles);
        }
        Err(polygons) => polygons,
    };
    let mut triangles = Vec::with_capacity(polygons.len());
    for (face, indices) in polygons.iter().enumerate() {
        if indices.len() >= 3 {
            indices.iter().try_for_each(|&index| position(face, index).map(drop))?;
        }
        checks.cut(indices, |index| positions[index as usize], &mut triangles);
    }
    Ok(triangles)
}

fn to_mesh(table: Table, triangles: Vec<[u32; 3]>, is_textured: bool) -> Mesh {
    let normals = table.normals.map(|normals| normals.into_iter().map(unit_normal).collect());
    let uvs = table.uvs.filter(|_| is_textured).map(|uvs| uvs.into_iter().map(usable_uv).collect());
    Mesh { positions: table.positions, triangles, normals, uvs, ..Mesh::default() }
}

/// Vertices and faces. Vertex indices are unchecked.
#[derive(Debug, Default)]
struct Table {
    positions: Vec<[f32; 3]>,
    /// One per position.
    normals: Option<Vec<[f32; 3]>>,
    /// One per position.
    uvs: Option<Vec<[f32; 2]>>,
    /// One per position, each value from 0 to [`Table::max_color`].
    colors: Option<Vec<[f32; 3]>>,
    /// The color value of full intensity; `None` for numbers that are not integers, whose range decides.
    max_color: Option<f32>,
    faces: Faces,
}

/// Number of entries of [`VERTEX`].
const N_SLOTS: usize = 11;

/// Property names of position, normal, texture coordinates and color.
const VERTEX: [&[&[u8]]; N_SLOTS] = [
    &[b"x"],
    &[b"y"],
    &[b"z"],
    &[b"nx"],
    &[b"ny"],
    &[b"nz"],
    &[b"u", b"s", b"texture_u", b"texture_s"],
    &[b"v", b"t", b"texture_v", b"texture_t"],
    &[b"red", b"r", b"diffuse_red"],
    &[b"green", b"g", b"diffuse_green"],
    &[b"blue", b"b", b"diffuse_blue"],
];

/// Property names of the vertex indices of a face.
const FACE: [&[u8]; 2] = [b"vertex_indices", b"vertex_index"];

/// Reads all elements; also whether the body ends after the last one.
fn table(path: &Path, header: &Header, bytes: &[u8]) -> Result<(Table, bool), ReadError> {
    let mut body = Body::new(header.encoding, bytes);
    let mut table = Table::default();
    for element in &header.elements {
        let name = String::from_utf8_lossy(element.name);
        let of_element = |message| ReadError::malformed(path, format!("element {}", quoted(element.name)), message);
        let of_row = |row: usize, message| ReadError::malformed(path, format!("{name} {row}"), message);
        let n_rows = body.rows(element).map_err(of_element)?;
        match element.name {
            b"vertex" => {
                let slots = vertex_slots(element).map_err(of_element)?;
                table.reserve_vertices(n_rows, &slots);
                table.max_color = max_color(element, &slots);
                for row in 0..n_rows {
                    table.vertex(&mut body, element, &slots).map_err(|message| of_row(row, message))?;
                }
            }
            b"tristrips" => {
                let list = face_list(element).map_err(of_element)?;
                for row in 0..n_rows {
                    table.strips(&mut body, element, list).map_err(|message| of_row(row, message))?;
                }
            }
            b"face" => {
                let list = face_list(element).map_err(of_element)?;
                table.faces.reserve(n_rows);
                let mut face = Vec::new();
                for row in 0..n_rows {
                    table.face(&mut body, element, list, &mut face).map_err(|message| of_row(row, message))?;
                }
            }
            _ => {
                for row in 0..n_rows {
                    let mut properties = element.properties.iter();
                    properties.try_for_each(|property| body.skip(property.kind)).map_err(|m| of_row(row, m))?;
                }
            }
        }
    }
    Ok((table, body.is_at_end()))
}

/// Index into [`VERTEX`] of each vertex property; the first of several with the same meaning is used.
fn vertex_slots(element: &Element) -> Result<Vec<Option<usize>>, String> {
    let mut is_taken = [false; N_SLOTS];
    let slots = element.properties.iter().map(|property| {
        let is_scalar = matches!(property.kind, Kind::Scalar(_));
        let slot = VERTEX.iter().position(|names| is_scalar && names.contains(&property.name));
        slot.filter(|&slot| !std::mem::replace(&mut is_taken[slot], true))
    });
    let slots = slots.collect();
    match is_taken[..3].iter().position(|&taken| !taken) {
        Some(axis) => Err(format!("missing property '{}'", ["x", "y", "z"][axis])),
        None => Ok(slots),
    }
}

/// Index of the property with the vertex indices.
fn face_list(element: &Element) -> Result<usize, String> {
    let list = element.properties.iter().position(|property| FACE.contains(&property.name));
    let list = list.ok_or("missing property 'vertex_indices'")?;
    match element.properties[list].kind {
        Kind::List { item, .. } if item.is_integer() => Ok(list),
        _ => Err("'vertex_indices' must be a list of integers".into()),
    }
}

/// The largest value of the integer type of the first color property.
fn max_color(element: &Element, slots: &[Option<usize>]) -> Option<f32> {
    let red = slots.iter().position(|&slot| slot == Some(8))?;
    match element.properties[red].kind {
        Kind::Scalar(Scalar::U8 | Scalar::I8) => Some(255.0),
        Kind::Scalar(Scalar::U16 | Scalar::I16) => Some(65_535.0),
        _ => None,
    }
}

impl Table {
    fn reserve_vertices(&mut self, n: usize, slots: &[Option<usize>]) {
        let has = |needed: std::ops::Range<usize>| needed.into_iter().all(|slot| slots.contains(&Some(slot)));
        self.positions.reserve_exact(n);
        self.normals = has(3..6).then(|| Vec::with_capacity(n));
        self.uvs = has(6..8).then(|| Vec::with_capacity(n));
        self.colors = has(8..N_SLOTS).then(|| Vec::with_capacity(n));
    }

    fn vertex(&mut self, body: &mut Body, element: &Element, slots: &[Option<usize>]) -> Result<(), String> {
        let mut numbers = [0.0; N_SLOTS];
        for (property, slot) in element.properties.iter().zip(slots) {
            match (property.kind, slot) {
                (Kind::Scalar(scalar), &Some(slot)) => numbers[slot] = body.float(scalar)?,
                (kind, _) => body.skip(kind)?,
            }
        }
        let [x, y, z, nx, ny, nz, u, v, r, g, b] = numbers;
        self.positions.push([x, y, z]);
        if let Some(normals) = &mut self.normals {
            normals.push([nx, ny, nz]);
        }
        if let Some(uvs) = &mut self.uvs {
            uvs.push([u, v]);
        }
        if let Some(colors) = &mut self.colors {
            colors.push([r, g, b]);
        }
        Ok(())
    }

    /// Reads a face; `face` is memory.
    fn face(&mut self, body: &mut Body, element: &Element, list: usize, face: &mut Vec<u32>) -> Result<(), String> {
        face.clear();
        for (k, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::List { count, item } if k == list => corners(body, count, item, face)?,
                kind => body.skip(kind)?,
            }
        }
        self.faces.push(face);
        Ok(())
    }

    /// Triangle strips: each index after the first two of a strip makes a triangle with the two before it, every other one
    /// turned around; a negative index ends a strip. Triangles with a repeated index only join strips.
    fn strips(&mut self, body: &mut Body, element: &Element, list: usize) -> Result<(), String> {
        for (k, property) in element.properties.iter().enumerate() {
            let (count, item) = match property.kind {
                Kind::List { count, item } if k == list => (count, item),
                kind => {
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
                    self.faces.push(&if n_strip.is_multiple_of(2) { [a, b, c] } else { [b, a, c] });
                }
                (strip, n_strip) = ([b, c], n_strip + 1);
            }
        }
        Ok(())
    }
}

/// Appends the vertex indices of a face.
fn corners(body: &mut Body, count: Scalar, item: Scalar, face: &mut Vec<u32>) -> Result<(), String> {
    for _ in 0..body.length(count, item)? {
        let index = body.integer(item)?;
        face.push(u32::try_from(index).map_err(|_| format!("invalid vertex index {index}"))?);
    }
    Ok(())
}

/// Vertex indices of all faces, unchecked: meshes of triangles, which are the most and the largest, need no ends of lists.
#[derive(Debug, Default)]
struct Faces {
    /// All faces, as long as each has three corners.
    triangles: Vec<[u32; 3]>,
    /// All faces, from the first that has not.
    polygons: Option<Polygons>,
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
    fn reserve(&mut self, n: usize) {
        self.triangles.reserve_exact(n);
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

    fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.polygons.is_none()
    }

    /// All faces where each has three corners, in the memory that holds them; else all faces as polygons.
    fn into_triangles(self) -> Result<Vec<[u32; 3]>, Polygons> {
        self.polygons.map_or(Ok(self.triangles), Err)
    }
}

impl Polygons {
    /// The faces, in order.
    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&start, &end)| &self.corners[start..end])
    }

    fn len(&self) -> usize {
        self.ends.len()
    }

    fn push(&mut self, face: &[u32]) {
        self.corners.extend_from_slice(face);
        self.ends.push(self.corners.len());
    }
}

#[cfg(test)]
mod tests {
    //! A cube in every encoding, and malformed files.

    use super::*;
    use crate::read::testing::{QUADS, corner, encoded, is_cube, rejects_truncations};

    const VERTICES: &str = "element vertex 8\nproperty float x\nproperty float y\nproperty float z\n";
    const FACES: &str = "element face 6\nproperty list uchar int vertex_indices\n";
    fn file(format: &str, elements: &str, body: impl AsRef<[u8]>) -> Vec<u8> {
        let header = format!("ply\nformat {format} 1.0\n{elements}end_header\n");
        [header.as_bytes(), body.as_ref()].concat()
    }

    fn ply(bytes: impl AsRef<[u8]>) -> Result<Scene, ReadError> {
        parse(Path::new("model.ply"), bytes.as_ref())
    }

    fn ascii_cube() -> String {
        let vertices = (0..8).map(|k| corner(k).map(|x| x.to_string()).join(" ") + "\n");
        let faces = QUADS.iter().map(|quad| format!("4 {}\n", quad.map(|k| k.to_string()).join(" ")));
        vertices.chain(faces).collect()
    }

    fn binary_cube(float: impl Fn(f32) -> [u8; 4], int: impl Fn(i32) -> [u8; 4]) -> Vec<u8> {
        let vertices = (0..8).flat_map(corner).flat_map(float);
        let faces =
            QUADS.iter().flat_map(|quad| [vec![4], quad.iter().flat_map(|&k| int(i32::from(k))).collect()].concat());
        vertices.chain(faces).collect()
    }

    fn little_endian_cube() -> Vec<u8> {
        binary_cube(f32::to_le_bytes, i32::to_le_bytes)
    }

    /// An ASCII triangle with additional vertex `properties` and `values`.
    fn triangle(properties: &str, values: &str, face: &str) -> Vec<u8> {
        let elements = format!(
            "element vertex 3\nproperty double x\n{properties}property short y\nproperty float z\n\
             element face 1\nproperty list uchar uint vertex_index\n"
        );
        file("ascii", &elements, format!("0 {values} 0 0\n1 {values} 0 0\n0 {values} 1 0\n{face}"))
    }

    #[test]
    fn all_encodings_agree() {
        let elements = format!("{VERTICES}{FACES}");
        let ascii = file("ascii", &elements, ascii_cube());
        is_cube(ply(String::from_utf8(ascii.clone()).unwrap().replace('\n', "\r\n")), &[]);
        is_cube(ply(ascii), &[]);
        is_cube(ply(file("binary_little_endian", &elements, little_endian_cube())), &[]);
        is_cube(ply(file("binary_big_endian", &elements, binary_cube(f32::to_be_bytes, i32::to_be_bytes))), &[]);
    }

    #[test]
    fn reads_every_number_type_in_both_byte_orders() {
        let types = ["char", "uint8", "short", "uint16", "int32", "uint", "float32", "double"];
        for (format, order) in [("binary_little_endian", false), ("binary_big_endian", true)] {
            let bytes = |value: i8| -> [Vec<u8>; 8] {
                let (short, int) = (i16::from(value).to_le_bytes(), i32::from(value).to_le_bytes());
                let (float, double) = (f32::from(value).to_le_bytes(), f64::from(value).to_le_bytes());
                let byte = value.to_le_bytes();
                let mut all = [&byte[..], &byte, &short, &short, &int, &int, &float, &double].map(<[u8]>::to_vec);
                if order {
                    all.iter_mut().for_each(|bytes| bytes.reverse());
                }
                all
            };
            for (k, name) in types.iter().enumerate() {
                let elements = format!(
                    "element vertex 3\nproperty {name} x\nproperty {name} y\nproperty {name} z\n\
                     element face 1\nproperty list {0} {0} vertex_indices\n",
                    types[k.min(5)]
                );
                let numbers = [7, 0, 0, 0, 100, 0, 0, 0, 1].map(|value| bytes(value)[k].clone());
                let face = [3, 2, 0, 1].map(|value| bytes(value)[k.min(5)].clone());
                let scene = ply(file(format, &elements, [numbers.concat(), face.concat()].concat())).unwrap();
                assert_eq!(scene.meshes[0].positions, [[7.0, 0.0, 0.0], [0.0, 100.0, 0.0], [0.0, 0.0, 1.0]], "{name}");
                assert_eq!(scene.meshes[0].triangles, [[2, 0, 1]], "{name}");
            }
        }
    }

    #[test]
    fn skips_other_elements_and_properties() {
        let elements = format!(
            "comment c\nobj_info o\nelement nothing 4000000000\nelement edge 1\nproperty int a\nproperty list char double b\n\
             element face 6\nproperty uchar red\nproperty list uchar int vertex_indices\nproperty list uchar float t\n{VERTICES}"
        );
        let faces = QUADS.iter().map(|quad| format!("9 4 {} 2 0 0\n", quad.map(|k| k.to_string()).join(" ")));
        let vertices = (0..8).map(|k| corner(k).map(|x| x.to_string()).join(" ") + "\n");
        let body: String = ["5 2 0.5 0.5\n".to_owned()].into_iter().chain(faces).chain(vertices).collect();
        is_cube(ply(file("ascii", &elements, body)), &[]);
    }

    #[test]
    fn keeps_normals_and_uvs_with_a_texture() {
        let normals = "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n";
        let scene = ply(triangle(normals, "0 0 4 0.25 0.5", "3 0 1 2")).unwrap();
        assert_eq!(scene.meshes[0].normals.as_deref().unwrap(), [[0.0, 0.0, 1.0]; 3]);
        assert_eq!(scene.meshes[0].uvs, None);

        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b.png"), encoded(::image::ImageFormat::Png)).unwrap();
        let named = |name: &str| {
            let properties = format!("comment TextureFile {name}\n{normals}");
            parse(&folder.path().join("model.ply"), &triangle(&properties, "0 0 4 0.25 0.5", "3 0 1 2")).unwrap()
        };
        let scene = named("a b.png");
        assert_eq!(scene.meshes[0].uvs.as_deref().unwrap(), [[0.25, 0.5]; 3]);
        assert_eq!(scene.materials[0].base_color_texture, Some(TextureRef::new(TextureId(0))));
        assert_eq!(
            named("../a.png").warnings,
            ["skipping texture '../a.png': the path is outside the folder of the scene"]
        );
    }

    #[test]
    fn repairs_are_reported() {
        let lists = "element face 5\nproperty list uchar int vertex_indices\n";
        let body = |faces: &str| ascii_cube().lines().take(8).collect::<Vec<_>>().join("\n") + "\n" + faces;
        let scene =
            ply(file("ascii", &format!("{VERTICES}{lists}"), body("2 0 1\n4 0 3 2 1\n3 4 5 6\n0\n1 7\n"))).unwrap();
        assert_eq!(scene.warnings, ["skipping faces with fewer than 3 vertices: 3"]);
        assert_eq!(scene.n_placed_triangles(), 3);

        let elements = format!("{VERTICES}{}", FACES.replace('6', "4"));
        for (format, body) in [("ascii", ascii_cube().into_bytes()), ("binary_little_endian", little_endian_cube())] {
            let scene = ply(file(format, &elements, body)).unwrap();
            assert_eq!(scene.warnings, ["ignoring bytes after the last declared element"]);
            assert_eq!(scene.n_placed_triangles(), 8);
        }

        let nan = ascii_cube().replacen("1 1 1", "nan 1 1", 1);
        let scene = ply(file("ascii", &format!("{VERTICES}{FACES}"), nan)).unwrap();
        assert_eq!(scene.warnings, ["skipping triangles with a non-finite vertex: 6"]);
        assert_eq!(scene.n_placed_triangles(), 6);
    }

    #[test]
    fn errors_contain_location_and_value() {
        let cube = |elements: &str| file("ascii", elements, ascii_cube());
        let face = |face: &str| triangle("", "", face);
        for (bytes, message) in [
            (b"".to_vec(), "header: missing 'end_header'"),
            (b"plx\n".to_vec(), "header line 1: expected 'ply', found 'plx'"),
            (b"ply\nformat ascii 1.0\nelement vertex 3\n".to_vec(), "header: missing 'end_header'"),
            (b"ply\nend_header\n".to_vec(), "header line 2: missing 'format' line"),
            (b"ply\nformat ascii 2.0\n".to_vec(), "header line 2: invalid statement 'format ascii 2.0'"),
            (cube("property float x\n"), "header line 3: 'property' before the first 'element'"),
            (cube("element vertex -1\n"), "header line 3: invalid element count '-1'"),
            (cube("element a 1\nproperty quux x\n"), "header line 4: unknown property type 'quux'"),
            (cube("element a 1\nproperty list float int x\n"), "header line 4: a list length needs an integer type"),
            (cube("element a 1\nelement a 1\n"), "header line 4: duplicate element 'a'"),
            (cube("element vertex 1\nproperty float x\n"), "element 'vertex': missing property 'y'"),
            (cube("element face 1\nproperty int x\n"), "element 'face': missing property 'vertex_indices'"),
            (
                cube("element face 1\nproperty list int float vertex_index\n"),
                "element 'face': 'vertex_indices' must be a list of integers",
            ),
            (
                cube(&VERTICES.replace('8', "4294967295")),
                "element 'vertex': 4294967295 rows declared, but the remaining data holds at most 18",
            ),
            (cube(&format!("{VERTICES}{}", FACES.replace('6', "7"))), "face 6: unexpected end of file"),
            (face("3 0 1"), "face 0: list of 3 values, but the remaining data holds at most 2"),
            (face("3 0 1 3"), "face 0: vertex index 3 out of range (3 vertices)"),
            (face("3 0 1 -2"), "face 0: invalid vertex index -2"),
            (face("3 0 1 1.5"), "face 0: expected an integer, found '1.5'"),
            (face("-3 0 1 2"), "face 0: list of -3 values, but the remaining data holds at most 3"),
            (face("255 0 1 2"), "face 0: list of 255 values, but the remaining data holds at most 3"),
            (
                file("ascii", &format!("{VERTICES}{FACES}"), ascii_cube().replace("0 1 0", "0 1,5 0")),
                "vertex 2: expected a number, found '1,5'",
            ),
        ] {
            let got = ply(bytes).unwrap_err().to_string();
            assert_eq!(got, format!("model.ply: {message}"));
        }
        let points = file("ascii", VERTICES, ascii_cube());
        assert_eq!(ply(points).unwrap_err().to_string(), "model.ply: nothing to draw: no faces");
    }

    #[test]
    fn rejects_every_truncation_of_a_binary_file() {
        let full = file("binary_little_endian", &format!("{VERTICES}{FACES}"), little_endian_cube());
        rejects_truncations(&full, full.len(), ply);
    }
}
