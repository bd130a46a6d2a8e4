//! Stanford PLY, ASCII and binary of both byte orders.
//!
//! ```text
//! bytes -> header -> body (vertices, faces and materials, others are skipped) -> mesh
//! ```
//!
//! Gives one mesh with one instance, in the file's vertex order, or in the order of first use where corners of faces have texture
//! coordinates or faces have colors. Texture coordinates are kept if a comment names a texture, colors always. Triangle strips become
//! triangles.

mod body;
mod colors;
mod faces;
pub(super) mod lines;
pub(super) mod stream;

use std::path::Path;

use body::{Body, Element, Header, Kind, header};
use colors::{Colors, GRAY, MATERIAL, RGB, is_measured};
use faces::{Faces, Layout, TEXTURE};

use super::folder::Folder;
use super::input::ReadOptions;
use super::mesh::{Corner, MeshChecks, Split, single_mesh, unit_normal, usable_uv};
use super::text::{self, quoted};
use super::{error::ReadError, image};
use crate::{Material, MaterialId, Mesh, Part, Scene, TextureId, TextureRef};

/// Parses a PLY file; `path` gives the folder of the textures and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Scene, ReadError> {
    let (header, body) = header(path, bytes)?;
    let count = |name: &[u8]| header.elements.iter().find(|element| element.name == name).map_or(0, |e| e.count);
    let has_no_faces = count(b"face") == 0 && count(b"tristrips") == 0;
    if has_no_faces && let Some(splats) = header.elements.iter().find(|element| is_splats(element)) {
        let what = format!("a cloud of {} Gaussian splats, which has no faces,", splats.count);
        return Err(ReadError::unsupported(path, what));
    }
    let (mut table, is_read_to_end) = table(path, &header, body)?;
    if table.faces.is_empty() {
        let points = match table.positions.len() {
            0 => String::new(),
            n => format!(" (a cloud of {n} points)"),
        };
        return Err(ReadError::empty(path, format!("no faces{points}")));
    }
    let mut scene = Scene { warnings: header.warnings, ..Scene::default() };
    if !is_read_to_end {
        scene.warnings.push("ignoring bytes after the last declared element".into());
    }
    if table.is_measured {
        scene.warnings.push("ignoring 'intensity' of vertices, which as a real number is no color".into());
    }
    let mut materials = materials(path, &header.textures, options, &mut scene);
    let mut checks = MeshChecks::default();
    let mesh = mesh(path, &mut table, &mut materials, &mut checks, &mut scene)?;
    if mesh.colors.is_some() {
        // Colors are reflectances, not factors of the default gray.
        materials.iter_mut().for_each(|material| material.base_color = [1.0; 3]);
    }
    single_mesh(path, mesh, materials, checks, scene)
}

/// Whether vertices are Gaussian splats, as the programs of Kerbl et al. 2023 write them, or compressed as SuperSplat does.
fn is_splats(element: &Element) -> bool {
    let has = |name: &[u8]| element.properties.iter().any(|property| property.name == name);
    element.name == b"vertex" && (has(b"f_dc_0") && has(b"opacity") || has(b"packed_position"))
}

/// A material for each texture of the header, or the default material; at least one.
fn materials(path: &Path, names: &[&[u8]], options: &ReadOptions, scene: &mut Scene) -> Vec<Material> {
    if names.is_empty() {
        return vec![Material::default()];
    }
    let folder = Folder::of(path, options).map_err(|error| error.to_string());
    let mut material = |&name: &&[u8]| {
        let name = String::from_utf8_lossy(text::unquoted(name));
        let bytes = folder.as_ref().map_err(Clone::clone).and_then(|folder| folder.read_image(&name));
        match bytes.and_then(|bytes| image::decode(&name, &bytes)) {
            Ok(texture) => {
                let id = TextureId(scene.textures.len() as u32);
                scene.textures.push(texture);
                let base_color_texture = Some(TextureRef::new(id));
                Material { base_color: [1.0; 3], base_color_texture, ..Material::default() }
            }
            Err(message) => {
                scene.warnings.push(format!("skipping texture {}: {message}", quoted(name.as_bytes())));
                Material::default()
            }
        }
    };
    let materials = names.iter().map(&mut material).collect();
    scene.files = folder.map(|folder| folder.found()).unwrap_or_default();
    materials
}

/// The mesh of all faces. Adds the material of faces without a texture to `materials`, if there are any.
fn mesh(
    path: &Path,
    table: &mut Table,
    materials: &mut Vec<Material>,
    checks: &mut MeshChecks,
    scene: &mut Scene,
) -> Result<Mesh, ReadError> {
    let mut faces = std::mem::take(&mut table.faces);
    let mut attributes = faces.take_attributes();
    if attributes.n_wrong_uvs > 0 {
        let n = attributes.n_wrong_uvs;
        scene.warnings.push(format!("ignoring texture coordinates of faces that are not two per corner: {n}"));
    }
    let is_textured = !scene.textures.is_empty();
    let has_materials = !table.materials.list.is_empty();
    let of_materials =
        |numbers: &[i64]| (has_materials && !numbers.is_empty()).then(|| table.materials.of_rows(numbers));
    let own_or = |own: Colors, numbers: &[i64]| match own.list.is_empty() {
        true => of_materials(numbers).unwrap_or(own),
        false => own,
    };
    let material_of_vertices = table.material_numbers.take().unwrap_or_default();
    if has_materials && attributes.materials.is_empty() && material_of_vertices.is_empty() {
        let warning = "ignoring the element 'material', as neither faces nor vertices have 'material_index'";
        scene.warnings.push(warning.to_owned());
    }
    let of_faces = own_or(std::mem::take(&mut attributes.colors), &attributes.materials);
    let of_faces = of_faces.linear("face", &mut scene.warnings);
    let colors = own_or(std::mem::take(&mut table.colors), &material_of_vertices);
    let colors = colors.linear("vertex", &mut scene.warnings);
    if colors.is_some() && of_faces.is_some() {
        scene.warnings.push("ignoring colors of faces, as vertices have colors".to_owned());
    }
    let of_faces = of_faces.filter(|_| colors.is_none());
    let of_corners = Some(attributes.uvs).filter(|uvs| is_textured && !uvs.is_empty());
    let numbers =
        if attributes.textures.is_empty() { table.textures.as_deref() } else { Some(&attributes.textures[..]) };
    // A single texture is that of all faces whose number is not that of none.
    let has_choice =
        numbers.is_some_and(|all| materials.len() > 1 || is_textured && all.iter().any(|&number| number < 0));
    if materials.len() > 1 && !has_choice {
        let n = materials.len();
        materials.truncate(1);
        scene.warnings.push(format!("using the first of {n} textures, as faces have no 'texnumber'"));
    }
    let normals: Option<Vec<[f32; 3]>> =
        table.normals.take().map(|normals| normals.into_iter().map(unit_normal).collect());
    let uvs = table.uvs.take().filter(|_| is_textured).map(|uvs| uvs.into_iter().map(usable_uv).collect::<Vec<_>>());
    let positions = std::mem::take(&mut table.positions);
    if of_corners.is_none() && of_faces.is_none() && !has_choice {
        let triangles = faces.triangulate(path, &positions, checks)?;
        return Ok(Mesh { positions, triangles, normals, uvs, colors, ..Mesh::default() });
    }

    let corners = faces.triangulate_corners(path, &positions, checks)?;
    let parts = if has_choice {
        let of_face = |corner: Corner| match attributes.textures.get(corner.face as usize) {
            Some(&number) => number,
            None => table.textures.as_ref().map_or(-1, |of_vertices| of_vertices[corner.vertex as usize]),
        };
        parts(&corners, of_face, materials)
    } else {
        Vec::new()
    };
    let mut split = Split::default();
    let triangles = split.triangles(&corners, of_corners.as_deref(), of_faces.as_deref());
    let triangles = triangles.ok_or_else(|| ReadError::unsupported(path, "more than 2^32 vertices"))?;
    Ok(Mesh {
        positions: split.corners.iter().map(|corner| positions[corner.vertex as usize]).collect(),
        triangles,
        normals: normals.map(|all| split.corners.iter().map(|corner| all[corner.vertex as usize]).collect()),
        uvs: match of_corners {
            Some(all) => Some(split.corners.iter().map(|corner| usable_uv(all[corner.number as usize])).collect()),
            None => uvs.map(|all| split.corners.iter().map(|corner| all[corner.vertex as usize]).collect()),
        },
        colors: match of_faces {
            Some(all) => Some(split.corners.iter().map(|corner| all[corner.face as usize]).collect()),
            None => colors.map(|all| split.corners.iter().map(|corner| all[corner.vertex as usize]).collect()),
        },
        parts,
        ..Mesh::default()
    })
}

/// Runs of triangles with the same texture, whose number `of_face` gives. A number of no texture, as MeshLab's -1, is that of a plain
/// material, which is added; a single texture has all others.
fn parts(triangles: &[[Corner; 3]], of_face: impl Fn(Corner) -> i64, materials: &mut Vec<Material>) -> Vec<Part> {
    let n_textures = materials.len();
    let (mut parts, mut is_plain_used) = (Vec::<Part>::new(), false);
    for (first_triangle, &[corner, ..]) in (0..).zip(triangles) {
        let number = usize::try_from(of_face(corner)).ok();
        let number =
            number.map(|number| if n_textures == 1 { 0 } else { number }).filter(|&number| number < n_textures);
        is_plain_used |= number.is_none();
        let material = MaterialId(number.unwrap_or(n_textures) as u32);
        if parts.last().is_none_or(|last| last.material != material) {
            parts.push(Part { first_triangle, material });
        }
    }
    if is_plain_used {
        materials.push(Material::default());
    }
    parts
}

/// Vertices and faces. Vertex indices are unchecked.
#[derive(Debug, Default)]
struct Table {
    positions: Vec<[f32; 3]>,
    /// One per position.
    normals: Option<Vec<[f32; 3]>>,
    /// One per position.
    uvs: Option<Vec<[f32; 2]>>,
    /// One per position, or none.
    colors: Colors,
    /// One per position: the number of a texture.
    textures: Option<Vec<i64>>,
    /// One per position: the number of a row of `materials`.
    material_numbers: Option<Vec<i64>>,
    /// The colors of the element `material`.
    materials: Colors,
    /// Whether the colors of vertices are gray values.
    is_gray: bool,
    /// Whether vertices have an intensity that is no color.
    is_measured: bool,
    faces: Faces,
}

/// Number of entries of [`VERTEX`].
const N_SLOTS: usize = 14;

/// Property names of position, normal, texture coordinates, color, texture, material and gray value.
const VERTEX: [&[&[u8]]; N_SLOTS] = [
    &[b"x"],
    &[b"y"],
    &[b"z"],
    &[b"nx"],
    &[b"ny"],
    &[b"nz"],
    &[b"u", b"s", b"texture_u", b"texture_s", b"texcoord_u", b"texcoord_s", b"tex_u", b"tex_s", b"tu", b"u0"],
    &[b"v", b"t", b"texture_v", b"texture_t", b"texcoord_v", b"texcoord_t", b"tex_v", b"tex_t", b"tv", b"v0"],
    RGB[0],
    RGB[1],
    RGB[2],
    &TEXTURE,
    &MATERIAL,
    &GRAY,
];

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
                table.is_measured = element.properties.iter().any(is_measured);
                let of_slot = |wanted| slots.iter().position(|&slot| slot == Some(wanted));
                let has_color = (8..11).all(|slot| of_slot(slot).is_some());
                table.is_gray = !has_color;
                let color = of_slot(if has_color { 8 } else { 13 });
                table.colors.scalar = color.and_then(|property| element.properties[property].scalar());
                for row in 0..n_rows {
                    table.vertex(&mut body, element, &slots).map_err(|message| of_row(row, message))?;
                }
            }
            b"tristrips" => {
                let layout = Layout::of(element).map_err(of_element)?;
                for row in 0..n_rows {
                    table.faces.read_strips(&mut body, element, &layout).map_err(|message| of_row(row, message))?;
                }
            }
            b"face" => {
                let layout = Layout::of(element).map_err(of_element)?;
                table.faces.reserve(n_rows, &layout);
                for row in 0..n_rows {
                    table.faces.read(&mut body, element, &layout).map_err(|message| of_row(row, message))?;
                }
            }
            b"material" => {
                for row in 0..n_rows {
                    table.materials.read(&mut body, element).map_err(|message| of_row(row, message))?;
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
        let is_used = property.scalar().is_some() && !is_measured(property);
        let slot = VERTEX.iter().position(|names| is_used && property.is_one_of(names));
        slot.filter(|&slot| !std::mem::replace(&mut is_taken[slot], true))
    });
    let slots = slots.collect();
    match is_taken[..3].iter().position(|&taken| !taken) {
        Some(axis) => Err(format!("missing property '{}'", ["x", "y", "z"][axis])),
        None => Ok(slots),
    }
}

impl Table {
    fn reserve_vertices(&mut self, n: usize, slots: &[Option<usize>]) {
        let has = |needed: std::ops::Range<usize>| needed.into_iter().all(|slot| slots.contains(&Some(slot)));
        self.positions.reserve_exact(n);
        self.normals = has(3..6).then(|| Vec::with_capacity(n));
        self.uvs = has(6..8).then(|| Vec::with_capacity(n));
        self.textures = has(11..12).then(|| Vec::with_capacity(n));
        self.material_numbers = has(12..13).then(|| Vec::with_capacity(n));
    }

    fn vertex(&mut self, body: &mut Body, element: &Element, slots: &[Option<usize>]) -> Result<(), String> {
        let mut numbers = [0.0; N_SLOTS];
        for (property, slot) in element.properties.iter().zip(slots) {
            match (property.kind, slot) {
                (Kind::Scalar(scalar), &Some(slot)) => numbers[slot] = body.float(scalar)?,
                (kind, _) => body.skip(kind)?,
            }
        }
        let [x, y, z, nx, ny, nz, u, v, r, g, b, texture, material, gray] = numbers;
        self.positions.push([x, y, z]);
        if let Some(normals) = &mut self.normals {
            normals.push([nx, ny, nz]);
        }
        if let Some(uvs) = &mut self.uvs {
            uvs.push([u, v]);
        }
        if self.colors.scalar.is_some() {
            self.colors.list.push(if self.is_gray { [gray; 3] } else { [r, g, b] });
        }
        if let Some(textures) = &mut self.textures {
            textures.push(texture as i64);
        }
        if let Some(numbers) = &mut self.material_numbers {
            numbers.push(material as i64);
        }
        Ok(())
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
        parse(Path::new("model.ply"), bytes.as_ref(), &ReadOptions::default())
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
        for end in ["\r\n", "\r"] {
            is_cube(ply(String::from_utf8(ascii.clone()).unwrap().replace('\n', end)), &[]);
            let header = String::from_utf8(file("binary_little_endian", &elements, "")).unwrap().replace('\n', end);
            is_cube(ply([header.as_bytes(), &little_endian_cube()].concat()), &[]);
        }
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
            let bytes = triangle(&properties, "0 0 4 0.25 0.5", "3 0 1 2");
            parse(&folder.path().join("model.ply"), &bytes, &ReadOptions::default()).unwrap()
        };
        let scene = named("a b.png");
        assert_eq!(scene.meshes[0].uvs.as_deref().unwrap(), [[0.25, 0.5]; 3]);
        assert_eq!(scene.materials[0].base_color_texture, Some(TextureRef::new(TextureId(0))));
        assert_eq!(
            named("../a.png").warnings,
            ["skipping texture '../a.png': the path is outside the folder of the scene; --allow-parent permits it"]
        );
    }

    /// A folder with textures of 5 x 3 texels.
    fn textured(bytes: &[u8]) -> Scene {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "b.png"] {
            std::fs::write(folder.path().join(name), encoded(::image::ImageFormat::Png)).unwrap();
        }
        parse(&folder.path().join("model.ply"), bytes, &ReadOptions::default()).unwrap()
    }

    /// Two triangles of a square, or a quadrilateral, as ASCII and as binary, with what follows the indices of each.
    fn square(comments: &str, properties: &str, faces: &[&str], types: &str) -> [Vec<u8>; 2] {
        let elements = format!(
            "{comments}element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar int vertex_indices\n{properties}",
            faces.len()
        );
        let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
        let lines: String = corners.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
        let ascii = file("ascii", &elements, lines + &faces.join("\n"));
        let mut body: Vec<u8> = corners.as_flattened().iter().flat_map(|&x| f32::from(x as i8).to_le_bytes()).collect();
        for face in faces {
            let mut words = face.split(' ');
            let mut number = || -> f32 { words.next().unwrap().parse().unwrap() };
            let list = |n: f32, number: &mut dyn FnMut() -> f32, body: &mut Vec<u8>, is_float: bool| {
                body.push(n as u8);
                for _ in 0..n as usize {
                    let x = number();
                    body.extend(if is_float { x.to_le_bytes() } else { (x as i32).to_le_bytes() });
                }
            };
            let n = number();
            list(n, &mut number, &mut body, false);
            for kind in types.chars() {
                match kind {
                    'l' => {
                        let n = number();
                        list(n, &mut number, &mut body, true);
                    }
                    'b' => body.push(number() as u8),
                    'f' => body.extend(number().to_le_bytes()),
                    _ => body.extend((number() as i32).to_le_bytes()),
                }
            }
        }
        [ascii, file("binary_little_endian", &elements, body)]
    }

    /// Texture coordinates of the corners of all triangles.
    fn corner_uvs(scene: &Scene) -> Vec<[f32; 2]> {
        let mesh = &scene.meshes[0];
        mesh.triangles.as_flattened().iter().map(|&vertex| mesh.uvs.as_ref().unwrap()[vertex as usize]).collect()
    }

    #[test]
    fn corners_of_faces_have_texture_coordinates() {
        let a = "comment TextureFile a.png\n";
        for name in ["texcoord", "texcoords", "uv", "texture_coordinates"] {
            let property = format!("property list uchar float {name}\n");
            for bytes in square(a, &property, &["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0.5 0 1 1 0 1"], "l") {
                let scene = textured(&bytes);
                assert_eq!(scene.warnings, [""; 0], "{name}");
                assert_eq!(
                    corner_uvs(&scene),
                    [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.0], [1.0, 1.0], [0.0, 1.0]]
                );
                // The corner that has two pairs of coordinates is two vertices.
                assert_eq!((scene.meshes[0].positions.len(), scene.materials.len()), (5, 1));
            }
        }
        let property = "property list uchar float texcoord\n";
        for bytes in square(a, property, &["4 0 1 2 3 8 0 0 1 0 1 1 0 1"], "l") {
            assert_eq!(
                corner_uvs(&textured(&bytes)),
                [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
            );
        }
        let [short, _] = square(a, property, &["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 4 1 1 1 1"], "l");
        let scene = textured(&short);
        assert_eq!(scene.warnings, ["ignoring texture coordinates of faces that are not two per corner: 1"]);
        assert_eq!(corner_uvs(&scene)[3..], [[0.0; 2]; 3]);
        let [untextured, _] = square("", property, &["3 0 1 2 6 0 0 1 0 1 1"], "l");
        assert_eq!(ply(untextured).unwrap().meshes[0].uvs, None);
    }

    #[test]
    fn faces_choose_their_texture() {
        let both = "comment TextureFile a.png\ncomment texturefile \"b.png\"\n";
        for name in ["texnumber", "texture_number"] {
            let properties = format!("property list uchar float texcoord\nproperty int {name}\n");
            let faces = [
                "3 0 1 2 6 0 0 1 0 1 1 1",
                "3 0 2 3 6 0 0 1 1 0 1 0",
                "3 0 1 3 6 0 0 1 1 0 1 0",
                "3 1 2 3 6 0 0 1 1 0 1 -1",
            ];
            for bytes in square(both, &properties, &faces, "li") {
                let scene = textured(&bytes);
                assert_eq!((scene.textures.len(), scene.materials.len(), &scene.warnings[..]), (2, 3, &[][..]));
                let mesh = &scene.meshes[0];
                assert_eq!([0, 1, 2, 3].map(|triangle| mesh.material_of(triangle).0), [1, 0, 0, 2], "{name}");
                assert!(scene.materials[2].base_color_texture.is_none());
                assert_eq!(mesh.parts.len(), 3);
            }
        }
        for (numbers, want) in [([-1, -1], [1, 1]), ([0, -1], [0, 1]), ([0, 1], [0, 0])] {
            let faces = ["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0 0 1 1 0 1"];
            let faces = [0, 1].map(|k| format!("{} {}", faces[k], numbers[k]));
            let properties = "property list uchar float texcoord\nproperty int texnumber\n";
            let single = square("comment TextureFile a.png\n", properties, &[&faces[0], &faces[1]], "li");
            let scene = textured(&single[0]);
            assert_eq!([0, 1].map(|triangle| scene.meshes[0].material_of(triangle).0), want, "{numbers:?}");
            assert!(scene.materials.get(1).is_none_or(|plain| plain.base_color_texture.is_none()));
        }
        let [unnumbered, _] = square(both, "property list uchar float texcoord\n", &["3 0 1 2 6 0 0 1 0 1 1"], "l");
        let scene = textured(&unnumbered);
        assert_eq!(scene.warnings, ["using the first of 2 textures, as faces have no 'texnumber'"]);
        let vertices = "comment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 3\nproperty float x\nproperty float y\n\
                        property float z\nproperty float s\nproperty float t\nproperty int texnumber\n\
                        element face 1\nproperty list uchar int vertex_indices\n";
        let scene = textured(&file("ascii", vertices, "0 0 0 0 0 1\n1 0 0 1 0 1\n0 1 0 0 1 1\n3 0 1 2\n"));
        assert_eq!(scene.meshes[0].material_of(0).0, 1);
        assert_eq!(corner_uvs(&scene), [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    }

    #[test]
    fn faces_have_colors() {
        let (red, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        let bytes = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        let floats = "property float diffuse_red\nproperty float diffuse_green\nproperty float diffuse_blue\n";
        for (properties, faces, types) in [
            (bytes, ["3 0 1 2 255 0 0", "3 0 2 3 0 0 255"], "bbb"),
            (floats, ["3 0 1 2 1 0 0", "3 0 2 3 0 0 1"], "fff"),
        ] {
            for bytes in square("", properties, &faces, types) {
                let scene = ply(bytes).unwrap();
                let mesh = &scene.meshes[0];
                let colors =
                    mesh.triangles.as_flattened().iter().map(|&vertex| mesh.colors.as_ref().unwrap()[vertex as usize]);
                assert_eq!(colors.collect::<Vec<_>>(), [red, red, red, blue, blue, blue]);
                assert_eq!((scene.materials[0].base_color, scene.warnings), ([1.0; 3], vec![]));
                assert_eq!(mesh.positions.len(), 6, "two corners have two colors");
            }
        }
        let both = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        let vertices = format!("element vertex 3\nproperty float x\nproperty float y\nproperty float z\n{both}");
        let elements = format!("{vertices}element face 1\nproperty list uchar int vertex_indices\n{both}");
        let scene =
            ply(file("ascii", &elements, "0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2 0 0 255\n")).unwrap();
        assert_eq!(scene.meshes[0].colors.as_deref(), Some(&[red; 3][..]));
        assert_eq!(scene.warnings, ["ignoring colors of faces, as vertices have colors"]);
        let [negative, _] = square("", floats, &["3 0 1 2 1 0 0", "3 0 2 3 0 -1 1"], "fff");
        assert_eq!(ply(negative).unwrap().warnings, ["ignoring face colors: negative value at face 1: 0 -1 1"]);
    }

    #[test]
    fn indices_are_integers_of_any_type() {
        let with = |count: &str, item: &str, face: &[u8]| {
            let elements =
                format!("{VERTICES}element face 1\nproperty list {count} {item} vertex_indices\n").replace('8', "3");
            let body: Vec<u8> = [0, 1, 2].into_iter().flat_map(corner).flat_map(f32::to_le_bytes).collect();
            ply(file("binary_little_endian", &elements, [&body, face].concat()))
        };
        let triangle = |bytes: [&[u8]; 4]| bytes.concat();
        for (count, item, face) in [
            ("uchar", "int64", triangle([&[3], &2_i64.to_le_bytes(), &0_i64.to_le_bytes(), &1_i64.to_le_bytes()])),
            ("uchar", "ulong", triangle([&[3], &2_u64.to_le_bytes(), &0_u64.to_le_bytes(), &1_u64.to_le_bytes()])),
            ("uchar", "float", triangle([&[3], &2_f32.to_le_bytes(), &0_f32.to_le_bytes(), &1_f32.to_le_bytes()])),
            ("uchar", "double", triangle([&[3], &2_f64.to_le_bytes(), &0_f64.to_le_bytes(), &1_f64.to_le_bytes()])),
            ("uint64", "uchar", triangle([&3_u64.to_le_bytes(), &[2], &[0], &[1]])),
            ("float", "uchar", triangle([&3_f32.to_le_bytes(), &[2], &[0], &[1]])),
        ] {
            assert_eq!(with(count, item, &face).unwrap().meshes[0].triangles, [[2, 0, 1]], "{count} {item}");
        }
        for (item, third, message) in [
            ("float", 1.5_f32.to_le_bytes().to_vec(), "expected an integer, found '1.5'"),
            ("float", f32::NAN.to_le_bytes().to_vec(), "expected an integer, found 'NaN'"),
            ("float", (-1_f32).to_le_bytes().to_vec(), "invalid vertex index -1"),
            ("uint64", u64::MAX.to_le_bytes().to_vec(), "integer 18446744073709551615 exceeds 63 bits"),
            ("int64", (1_i64 << 40).to_le_bytes().to_vec(), "invalid vertex index 1099511627776"),
        ] {
            let zero = vec![0; third.len()];
            let error = with("uchar", item, &[vec![3], zero.clone(), zero, third].concat()).unwrap_err().to_string();
            assert_eq!(error, format!("model.ply: face 0: {message}"));
        }
        let ascii = self::triangle("", "", "3.0 0 1e0 2.000");
        assert_eq!(ply(ascii).unwrap().meshes[0].triangles, [[0, 1, 2]]);
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
            (cube("element a 1\nelement a 1\n"), "header line 4: duplicate element 'a'"),
            (cube("element vertex 1\nproperty float x\n"), "element 'vertex': missing property 'y'"),
            (cube("element face 1\nproperty int x\n"), "element 'face': missing property 'vertex_indices'"),
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
        assert_eq!(ply(points).unwrap_err().to_string(), "model.ply: nothing to draw: no faces (a cloud of 8 points)");
        let splats = "element vertex 2\nproperty float x\nproperty float f_dc_0\nproperty float opacity\n";
        let splats = ply(file("ascii", splats, "0 1 2\n3 4 5\n")).unwrap_err().to_string();
        assert_eq!(splats, "model.ply: a cloud of 2 Gaussian splats, which has no faces, is not supported");
    }

    #[test]
    fn rejects_every_truncation_of_a_binary_file() {
        let full = file("binary_little_endian", &format!("{VERTICES}{FACES}"), little_endian_cube());
        rejects_truncations(&full, full.len(), ply);
    }
}
