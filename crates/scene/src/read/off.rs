//! OFF in ASCII, with normals (`NOFF`), colors (`COFF`) and texture coordinates (`STOFF`).
//!
//! ```text
//! lines -> header -> vertices -> faces -> mesh
//! ```
//!
//! Gives one mesh with one instance, in the file's order. Each vertex and each face is a line. Texture coordinates are
//! skipped, as no texture goes with them. A vertex whose faces have other colors becomes one of each color.
//!
//! Source: Geomview manual, section "OFF Files".

use std::path::Path;

use super::error::{ReadError, WarningGroups};
use super::mesh::{Corner, MeshChecks, NO_COLOR, Split, linear_colors, single_mesh, unit_normal};
use super::text::{self, quoted};
use crate::{Material, Mesh, Scene};

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
    let bytes = text::after_mark(bytes);
    let line = |(line, number): (_, usize)| Line { number, words: text::words(line).collect() };
    text::physical_lines(bytes).zip(1..).map(line).filter(|line| !line.words.is_empty())
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
    let header = read_header(path, &mut lines)?;
    let mut next = |what: &str, k: u64, n: u64| {
        let missing = || ReadError::malformed(path, "end of file", format!("{what} {k} of {n} is missing"));
        lines.next().ok_or_else(missing)
    };
    let mut vertices = Vertices::default();
    for k in 0..header.n_vertices {
        vertices.add(path, &header, &next("vertex", k, header.n_vertices)?, &mut grouped)?;
    }
    let (mut checks, mut triangles) = (MeshChecks::default(), Vec::new());
    let (mut corners, mut colors) = (Vec::new(), FaceColors::default());
    for k in 0..header.n_faces {
        let line = next("face", k, header.n_faces)?;
        colors.add(face(path, &line, vertices.positions.len(), &mut corners)?);
        let face = u32::try_from(k).map_err(|_| ReadError::unsupported(path, "more than 2^32 faces"))?;
        corners.iter_mut().for_each(|corner: &mut Corner| corner.face = face);
        checks.cut(&corners, |corner| vertices.positions[corner.vertex as usize], &mut triangles);
    }
    if let Some(line) = lines.next() {
        grouped.add("ignoring lines after the last declared face", &format!("line {}", line.number));
    }
    grouped.finish(&mut scene.warnings);
    let (mesh, material) = vertices.into_mesh(path, triangles, colors, &mut scene.warnings)?;
    single_mesh(path, mesh, vec![material], checks, scene)
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
                    NO_COLOR
                }
            };
            self.colors.push(color);
        } else if !rest.is_empty() {
            grouped.add("ignoring surplus numbers after a vertex", &location);
        }
        Ok(())
    }

    /// The mesh, and a material that is white under colors.
    fn into_mesh(
        self,
        path: &Path,
        triangles: Vec<[Corner; 3]>,
        of_faces: FaceColors,
        warnings: &mut Vec<String>,
    ) -> Result<(Mesh, Material), ReadError> {
        let Self { positions, normals, colors } = self;
        let has_colors = !colors.is_empty();
        let colors = linear_colors("vertex", colors, None).map_err(|warning| warnings.push(warning)).ok();
        let colors = colors.filter(|_| has_colors);
        let normals: Vec<[f32; 3]> = normals.into_iter().map(unit_normal).collect();
        let normals = Some(normals).filter(|normals| !normals.is_empty());
        let mut of_faces = of_faces.linear(warnings);
        if colors.is_some() && of_faces.take().is_some() {
            warnings.push("ignoring colors of faces, as vertices have colors".to_owned());
        }
        let mesh = match of_faces {
            None => {
                let triangles = triangles.into_iter().map(|corners| corners.map(|corner| corner.vertex)).collect();
                Mesh { positions, triangles, normals, colors, ..Mesh::default() }
            }
            Some(of_faces) => {
                let mut split = Split::default();
                let triangles = split.triangles(&triangles, None, Some(&of_faces));
                let triangles = triangles.ok_or_else(|| ReadError::unsupported(path, "more than 2^32 vertices"))?;
                let of_vertex = |all: Vec<[f32; 3]>| {
                    split.corners.iter().map(|corner| all[corner.vertex as usize]).collect::<Vec<_>>()
                };
                let (positions, normals) = (of_vertex(positions), normals.map(of_vertex));
                let colors = split.corners.iter().map(|corner| of_faces[corner.face as usize]).collect();
                Mesh { positions, triangles, normals, colors: Some(colors), ..Mesh::default() }
            }
        };
        let mut material = Material::default();
        if mesh.colors.is_some() {
            material.base_color = [1.0; 3];
        }
        Ok((mesh, material))
    }
}

/// Reads a face, a count and that many indices; gives the words after them, which are a color.
fn face<'a>(
    path: &Path,
    line: &'a Line,
    n_vertices: usize,
    face: &mut Vec<Corner>,
) -> Result<&'a [&'a [u8]], ReadError> {
    face.clear();
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
        let vertex = in_range.ok_or_else(|| {
            line.malformed(path, format!("vertex index {index} out of range ({n_vertices} vertices)"))
        })?;
        face.push(Corner { vertex, number: 0, face: 0 });
    }
    Ok(rest)
}

/// Colors of faces, which any of them may have.
#[derive(Default)]
struct FaceColors {
    /// One per face; [`NO_COLOR`] for one without.
    list: Vec<[f32; 3]>,
    /// Whether words follow the corners of any face.
    is_used: bool,
}

impl FaceColors {
    /// Adds the color of a face: `r g b` or `r g b a`. A single number would be an index into a color map that is not in the file.
    fn add(&mut self, words: &[&[u8]]) {
        let color = match *words {
            [r, g, b] | [r, g, b, _] => [r, g, b].map(|word| text::float(word).unwrap_or(f32::NAN)),
            _ => NO_COLOR,
        };
        self.list.push(color);
        self.is_used |= !words.is_empty();
    }

    /// The linear colors, if the file has usable ones.
    fn linear(self, warnings: &mut Vec<String>) -> Option<Vec<[f32; 4]>> {
        let n_without = self.list.iter().filter(|color| color.iter().any(|x| x.is_nan())).count();
        if self.is_used && n_without > 0 {
            warnings.push(format!("faces without a color of 3 or 4 numbers: {n_without}"));
        }
        if n_without == self.list.len() {
            return None;
        }
        linear_colors("face", self.list, None).map_err(|warning| warnings.push(warning)).ok()
    }
}

/// What each vertex has, and the declared counts.
#[derive(Debug, Default, PartialEq, Eq)]
struct Header {
    has_normals: bool,
    has_colors: bool,
    has_uvs: bool,
    /// `4OFF` or `nOFF`.
    has_other_dimension: bool,
    n_vertices: u64,
    n_faces: u64,
}

/// Whether the first word of a file is a keyword of OFF.
pub(super) fn is_off(head: &[u8]) -> bool {
    let head = text::after_mark(head).trim_ascii_start();
    let word = head.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    keyword(word).is_some()
}

/// Splits `[ST][C][N][4][n]OFF`, and a number that some files append to it without a space.
fn keyword(word: &[u8]) -> Option<(Header, &[u8])> {
    let mut header = Header::default();
    let mut rest = word;
    let mut takes = |prefix: &[u8]| {
        let after = rest.strip_prefix(prefix);
        rest = after.unwrap_or(rest);
        after.is_some()
    };
    header.has_uvs = takes(b"ST");
    header.has_colors = takes(b"C");
    header.has_normals = takes(b"N");
    header.has_other_dimension = takes(b"4") | takes(b"n");
    (takes(b"OFF") && rest.iter().all(u8::is_ascii_digit)).then_some((header, rest))
}

/// Reads the keyword, which may be absent, and the counts of vertices, faces and edges.
fn read_header<'a>(path: &Path, lines: &mut impl Iterator<Item = Line<'a>>) -> Result<Header, ReadError> {
    let ends_early = || ReadError::malformed(path, "header", "missing the numbers of vertices and faces");
    let mut line = lines.next().ok_or_else(ends_early)?;
    let (mut header, mut words) = match keyword(line.words[0]) {
        Some((header, b"")) => (header, line.words.split_off(1)),
        Some((header, number)) => (header, [vec![number], line.words.split_off(1)].concat()),
        None => (Header::default(), std::mem::take(&mut line.words)),
    };
    if header.has_other_dimension {
        return Err(ReadError::unsupported(path, "OFF with another number of coordinates than 3"));
    }
    if words.first().is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
        return Err(ReadError::unsupported(path, "binary OFF"));
    }
    while words.len() < 2 {
        line = lines.next().ok_or_else(ends_early)?;
        words.extend(&line.words);
    }
    let count = |word: &[u8]| {
        let count = text::integer(word).and_then(|count| u64::try_from(count).ok());
        count.ok_or_else(|| line.malformed(path, format!("invalid number of vertices or faces {}", quoted(word))))
    };
    (header.n_vertices, header.n_faces) = (count(words[0])?, count(words[1])?);
    Ok(header)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::testing::{is_cube, rejects_truncations};

    const CUBE: &str = "8 6 12\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n\
                        4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";

    fn off(text: impl AsRef<[u8]>) -> Result<Scene, ReadError> {
        parse(Path::new("model.off"), text.as_ref())
    }

    /// The cube with `attributes` after each vertex.
    fn cube(keyword: &str, attributes: &str) -> Result<Scene, ReadError> {
        let line = |(k, line): (usize, &str)| format!("{line}{}\n", if (1..9).contains(&k) { attributes } else { "" });
        off(format!("{keyword}\n{}", CUBE.lines().enumerate().map(line).collect::<String>()))
    }

    #[test]
    fn reads_all_syntax_variants() {
        is_cube(off(format!("OFF\n{CUBE}")), &[]);
        is_cube(off(format!("OFF {CUBE}")), &[]);
        is_cube(off(format!("OFF{CUBE}")), &[]);
        is_cube(off(CUBE), &[]);
        is_cube(off(format!("# c\n\nOFF # d\n# e\n{CUBE}\n# f\n")), &[]);
        is_cube(off(format!("OFF\n{}", CUBE.replacen(" 12", "", 1)).replace('\n', "\r\n")), &[]);
        is_cube(off(format!("OFF # d\n# e\n{CUBE}").replace('\n', "\r")), &[]);
    }

    #[test]
    fn reads_attributes() {
        let red = Some(vec![[1.0, 0.0, 0.0, 1.0]; 8]);
        for (keyword, attributes) in [
            ("COFF", " 255 0 0 255"),
            ("COFF", " 1 0 0"),
            ("CNOFF", " 0 0 2 1.0 0 0 1"),
            ("STCOFF", " 1 0 0 1 0.5 0.5"),
        ] {
            let scene = is_cube(cube(keyword, attributes), &[]);
            assert_eq!(scene.meshes[0].colors, red, "{keyword}");
            assert_eq!(scene.materials[0].base_color, [1.0; 3]);
        }
        assert_eq!(is_cube(cube("NOFF", " 0 0 2"), &[]).meshes[0].normals, Some(vec![[0.0, 0.0, 1.0]; 8]));
    }

    #[test]
    fn faces_have_colors() {
        let (red, white) = ([1.0, 0.0, 0.0, 1.0], [1.0; 4]);
        let colors = |scene: &Scene| -> Vec<[f32; 4]> {
            let mesh = &scene.meshes[0];
            mesh.triangles.iter().map(|t| mesh.colors.as_ref().unwrap()[t[0] as usize]).collect()
        };
        let square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
        for color in ["255 0 0", "1 0 0", "1.0 0.0 0.0 0.5", "255 0 0 255 # red"] {
            let scene = off(format!("OFF\n4 2 0\n{square}3 0 1 2 {color}\n3 0 2 3 {color}\n")).unwrap();
            assert_eq!((colors(&scene), &scene.warnings[..]), (vec![red, red], &[][..]), "{color}");
            assert_eq!((scene.meshes[0].positions.len(), scene.materials[0].base_color), (4, [1.0; 3]));
        }
        let scene =
            off(format!("NOFF\n4 2 0\n{}3 0 1 2 255 0 0\n3 0 2 3\n", square.replace('\n', " 0 0 2\n"))).unwrap();
        assert_eq!(colors(&scene), [red, white]);
        assert_eq!(scene.warnings, ["faces without a color of 3 or 4 numbers: 1"]);
        let mesh = &scene.meshes[0];
        assert_eq!((mesh.positions.len(), mesh.normals.as_ref().unwrap()), (6, &vec![[0.0, 0.0, 1.0]; 6]));
        // A polygon has the same color in all its triangles.
        let scene = off(CUBE.replace("4 4 5 7 6\n", "4 4 5 7 6 0 0 255\n").replace("5 4\n", "5 4 255 0 0\n")).unwrap();
        assert_eq!(colors(&scene)[..6], [white, white, [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0], red, red]);
    }

    #[test]
    fn repairs_are_reported() {
        is_cube(cube("OFF", " 7"), &["ignoring surplus numbers after a vertex: line 3 and 7 more"]);
        is_cube(cube("COFF", ""), &["vertices without a color of 3 or 4 numbers: line 3 and 7 more"]);
        is_cube(cube("NOFF", " 1"), &["vertices without a normal: line 3 and 7 more"]);
        is_cube(cube("COFF", " 0 -1 0"), &["ignoring vertex colors: negative value at vertex 0: 0 -1 0"]);
        let unused = "faces without a color of 3 or 4 numbers: 6";
        is_cube(off(CUBE.replace("7 6\n", "7 6 255\n")), &[unused]);
        let both = format!("COFF\n{CUBE}").replace(" 1\n1 1 1\n", " 1 1 1 1\n1 1 1 1 1 1\n");
        let both = off(both.replace("7 6\n", "7 6 255 0 0\n")).unwrap();
        assert_eq!(both.warnings.last().unwrap(), "ignoring colors of faces, as vertices have colors");
        is_cube(off(format!("{CUBE}1 2\n")), &["ignoring lines after the last declared face: line 16"]);
        let scene = off(CUBE.replace("4 0 2 3 1", "2 0 1")).unwrap();
        assert_eq!(scene.warnings, ["skipping faces with fewer than 3 vertices: 1"]);
    }

    #[test]
    fn errors_contain_location_and_value() {
        for (text, message) in [
            (String::new(), "header: missing the numbers of vertices and faces"),
            ("OFF\n8".to_owned(), "header: missing the numbers of vertices and faces"),
            ("OFF\n8 x 0".to_owned(), "line 2: invalid number of vertices or faces 'x'"),
            ("OFF\n-8 6 0".to_owned(), "line 2: invalid number of vertices or faces '-8'"),
            ("OFF BINARY\n".to_owned(), "binary OFF is not supported"),
            (format!("4OFF\n{CUBE}"), "OFF with another number of coordinates than 3 is not supported"),
            // The first face is taken for a vertex with a surplus number.
            (CUBE.replace("8 6", "9 6"), "end of file: face 5 of 6 is missing"),
            (CUBE.replace("8 6", "8 7"), "end of file: face 6 of 7 is missing"),
            (CUBE.replace("8 6", "99999999999 6"), "end of file: vertex 14 of 99999999999 is missing"),
            (CUBE.replace("1 1 1", "1 1"), "line 9: vertex has 2 coordinates (expected 3)"),
            (CUBE.replace("1 1 1", "1 1,5 1"), "line 9: vertex: expected a number, found '1,5'"),
            (CUBE.replace("4 0 2 3 1", "4 0 2 3 8"), "line 10: vertex index 8 out of range (8 vertices)"),
            (CUBE.replace("4 0 2 3 1", "4 0 2 3 -1"), "line 10: vertex index -1 out of range (8 vertices)"),
            (CUBE.replace("4 0 2 3 1", "4 0 2 3 x"), "line 10: invalid vertex index 'x'"),
            (CUBE.replace("4 0 2 3 1", "5 0 2 3 1"), "line 10: face of 5 corners, but the line has 4"),
            (CUBE.replace("4 0 2 3 1", "-4 0 2 3 1"), "line 10: invalid number of corners '-4'"),
            ("OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n".to_owned(), "nothing to draw: no triangles"),
        ] {
            assert_eq!(off(text).unwrap_err().to_string(), format!("model.off: {message}"));
        }
    }

    #[test]
    fn rejects_every_truncation_up_to_the_last_corner() {
        let full = format!("OFF\n{CUBE}");
        rejects_truncations(full.as_bytes(), full.trim_end().len(), off);
    }

    #[test]
    fn recognizes_keywords() {
        for text in ["OFF\n", "COFF 8", "  NOFF\r\n", "STCNOFF\n", "OFF490 518 0", "\u{feff}OFF"] {
            assert!(is_off(text.as_bytes()), "{text}");
        }
        for text in ["", "off\n", "o OFF\n", "OFFSET 1", "v 1 2 3", "COFFEE"] {
            assert!(!is_off(text.as_bytes()), "{text}");
        }
    }
}
