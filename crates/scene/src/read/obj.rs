//! Wavefront OBJ with its MTL.
//!
//! ```text
//! bytes -> statements -> materials -> meshes (equal ones become instances)
//! ```
//!
//! Triangles are numbered in file order; a polygon counts as its triangles. Dropped triangles (non-finite vertices) and
//! faces with fewer than three corners have no number.

pub(super) mod materials;
mod meshes;

use std::collections::HashMap;
use std::path::Path;

use super::ReadError;
use super::mesh::{MeshChecks, NO_COLOR, linear_colors};
use super::text::{self, Line};
use crate::Scene;

/// Parses an OBJ file. Consecutive faces with equal object, group and material form a mesh with one instance.
///
/// `path` gives the folder of the material libraries and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Scene, ReadError> {
    let mut statements = parse_statements(path, bytes)?;
    if statements.face_ends.is_empty() {
        let reason = if bytes.contains(&0) { "not a text file" } else { "no faces" };
        return Err(ReadError::empty(path, reason));
    }
    let mut scene = Scene { warnings: std::mem::take(&mut statements.warnings), ..Scene::default() };
    materials::materials(path, &statements.libraries, &statements.materials, &mut scene)?;
    let colors = colors(&mut statements, &mut scene);
    let mut checks = MeshChecks::default();
    checks.n_small_faces = statements.n_small_faces;
    meshes::meshes(path, &statements, colors.as_deref(), &mut scene, &mut checks)?;
    checks.finish(path, &mut scene)?;
    Ok(scene)
}

/// Linear vertex colors, if the file has usable ones. Faces without a material are white under them.
fn colors(statements: &mut Statements, scene: &mut Scene) -> Option<Vec<[f32; 4]>> {
    let colors = std::mem::take(&mut statements.colors);
    if colors.is_empty() {
        return None;
    }
    let linear = linear_colors(colors, None).map_err(|warning| scene.warnings.push(warning)).ok()?;
    for (material, name) in scene.materials.iter_mut().zip(&statements.materials) {
        if name.is_none() {
            material.base_color = [1.0; 3];
        }
    }
    Some(linear)
}

/// Missing index in a [`Corner`].
const ABSENT: u32 = u32::MAX;

/// A corner of a face: zero-based indices into the arrays of [`Statements`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Corner {
    position: u32,
    /// Or [`ABSENT`].
    uv: u32,
    /// Or [`ABSENT`].
    normal: u32,
}

/// Consecutive faces with equal object, group and material.
#[derive(Debug)]
struct Run<'a> {
    /// Name of the group, else of the object.
    name: &'a [u8],
    /// Index into [`Statements::materials`].
    material: usize,
    /// First face; the run ends where the next one starts.
    first_face: usize,
}

/// Contents of an OBJ file.
#[derive(Debug, Default)]
struct Statements<'a> {
    /// Positions; may be NaN or infinite.
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    /// The color of each position after its coordinates; empty if no position has one.
    colors: Vec<[f32; 3]>,
    /// Normals of any length.
    normals: Vec<[f32; 3]>,
    /// Corners of all faces, concatenated.
    corners: Vec<Corner>,
    /// End of each face in `corners`.
    face_ends: Vec<usize>,
    runs: Vec<Run<'a>>,
    /// Names of used materials in order of first use; `None` for faces without `usemtl`.
    materials: Vec<Option<&'a [u8]>>,
    /// Arguments of `mtllib` statements.
    libraries: Vec<&'a [u8]>,
    /// Skipped faces with fewer than three corners.
    n_small_faces: usize,
    /// What was ignored.
    warnings: Vec<String>,
}

impl Statements<'_> {
    /// Corners of a face.
    fn face(&self, face: usize) -> &[Corner] {
        let start = if face == 0 { 0 } else { self.face_ends[face - 1] };
        &self.corners[start..self.face_ends[face]]
    }
}

/// Parses all statements. Ignores lines, points, free-form surfaces, smoothing groups and unknown statements.
fn parse_statements<'a>(path: &Path, bytes: &'a [u8]) -> Result<Statements<'a>, ReadError> {
    let mut parser = Parser::default();
    for line in text::lines(bytes) {
        parser.line(&line).map_err(|message| malformed(path, line.number, message))?;
    }
    parser.check_indices(path)?;
    parser.drop_unusable_indices();
    let n = parser.statements.positions.len();
    if !parser.statements.colors.is_empty() {
        parser.statements.colors.resize(n, NO_COLOR);
    }
    Ok(parser.statements)
}

fn malformed(path: &Path, line: usize, message: String) -> ReadError {
    ReadError::malformed(path, format!("line {line}"), message)
}

/// The largest index used by a face, and its line. Vertices may be defined after use, so it is checked at the end.
#[derive(Clone, Copy, Default)]
struct MaxIndex {
    index: i64,
    line: usize,
}

/// The three kinds of vertex data, for messages.
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// State for the next face.
#[derive(Clone, Copy, Default, PartialEq)]
struct State<'a> {
    object: &'a [u8],
    group: &'a [u8],
    material: Option<&'a [u8]>,
}

/// Parser state.
#[derive(Default)]
struct Parser<'a> {
    statements: Statements<'a>,
    state: State<'a>,
    last: Option<State<'a>>,
    material_indices: HashMap<Option<&'a [u8]>, usize>,
    max_indices: [MaxIndex; 3],
    /// Indices of texture coordinates and of normals that are out of range: how many, and the first.
    unusable: [(usize, String); 3],
    /// Face corners with more than three indices: how many, and the first.
    surplus: (usize, String),
}

impl<'a> Parser<'a> {
    fn line(&mut self, line: &Line<'a>) -> Result<(), String> {
        match line.keyword {
            b"v" => {
                self.statements.positions.push(coordinates(line.rest, 3, "vertex")?);
                self.color(line.rest);
            }
            b"vt" => self.statements.uvs.push(coordinates(line.rest, 1, "texture coordinate")?),
            b"vn" => self.statements.normals.push(coordinates(line.rest, 3, "normal")?),
            b"f" => self.face(line)?,
            b"o" => self.state.object = line.rest,
            b"g" => self.state.group = line.rest,
            b"usemtl" => self.state.material = Some(line.rest).filter(|name| !name.is_empty()),
            b"mtllib" => self.statements.libraries.push(line.rest),
            _ => {}
        }
        Ok(())
    }

    /// The color of the last position: three numbers after its coordinates.
    fn color(&mut self, rest: &[u8]) {
        let mut words = text::words(rest).skip(3).map(text::float);
        if let (Some(Some(r)), Some(Some(g)), Some(Some(b))) = (words.next(), words.next(), words.next()) {
            let colors = &mut self.statements.colors;
            colors.resize(self.statements.positions.len() - 1, NO_COLOR);
            colors.push([r, g, b]);
        }
    }

    fn face(&mut self, line: &Line) -> Result<(), String> {
        let start = self.statements.corners.len();
        for word in text::words(line.rest) {
            let corner = self.corner(word, line.number)?;
            self.statements.corners.push(corner);
        }
        if self.statements.corners.len() - start < 3 {
            self.statements.corners.truncate(start);
            self.statements.n_small_faces += 1;
            return Ok(());
        }
        self.open_run();
        self.statements.face_ends.push(self.statements.corners.len());
        Ok(())
    }

    /// Starts a new run if object, group or material has changed.
    fn open_run(&mut self) {
        if self.last == Some(self.state) {
            return;
        }
        let State { object, group, material: name } = self.state;
        let materials = &mut self.statements.materials;
        let material = *self.material_indices.entry(name).or_insert_with(|| {
            materials.push(name);
            materials.len() - 1
        });
        let name = if group.is_empty() { object } else { group };
        self.statements.runs.push(Run { name, material, first_face: self.statements.face_ends.len() });
        self.last = Some(self.state);
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &[u8], line: usize) -> Result<Corner, String> {
        let mut parts = word.split(|&byte| byte == b'/');
        let counts = [self.statements.positions.len(), self.statements.uvs.len(), self.statements.normals.len()];
        let mut indices = [ABSENT; 3];
        for (k, index) in indices.iter_mut().enumerate() {
            let part = parts.next().unwrap_or_default();
            if k == 0 || !part.is_empty() {
                *index = self.index(k, part, counts[k], line)?;
            }
        }
        if parts.next().is_some() {
            count(&mut self.surplus, || format!("line {line}: {}", text::quoted(word)));
        }
        let [position, uv, normal] = indices;
        Ok(Corner { position, uv, normal })
    }

    /// Resolves a one-based index, or a negative one relative to the end of `count` elements.
    fn index(&mut self, kind: usize, part: &[u8], count: usize, line: usize) -> Result<u32, String> {
        let what = KINDS[kind];
        let value = text::integer(part).ok_or_else(|| format!("invalid {what} index {}", text::quoted(part)))?;
        let from_one = match value {
            0 if kind > 0 => 0,
            0 => return Err(format!("invalid {what} index 0 (indices start at 1)")),
            1.. => value,
            _ => i64::try_from(count).map_or(0, |count| count + value + 1),
        };
        if from_one < 1 && kind > 0 {
            count_unusable(&mut self.unusable[kind], line, value);
            return Ok(ABSENT);
        }
        if from_one < 1 {
            return Err(format!("relative {what} index {value} out of range ({count} defined so far)"));
        }
        if from_one > self.max_indices[kind].index {
            self.max_indices[kind] = MaxIndex { index: from_one, line };
        }
        match u32::try_from(from_one - 1) {
            Ok(index) if index != ABSENT => Ok(index),
            // Beyond all arrays; found to be unusable at the end.
            _ if kind > 0 => Ok(ABSENT - 1),
            _ => Err(format!("{what} index {value} exceeds 32 bits")),
        }
    }

    /// Checks the vertex indices against the complete array.
    fn check_indices(&self, path: &Path) -> Result<(), ReadError> {
        let (max, n) = (self.max_indices[0], self.statements.positions.len());
        match usize::try_from(max.index) {
            Ok(index) if index > n => {
                Err(malformed(path, max.line, format!("vertex index {} out of range ({n} defined)", max.index)))
            }
            _ => Ok(()),
        }
    }

    /// Drops texture coordinates and normals of corners whose indices are out of range: the geometry is sound without.
    fn drop_unusable_indices(&mut self) {
        let counts = [0, self.statements.uvs.len(), self.statements.normals.len()];
        for kind in [1, 2] {
            let (n, max) = (counts[kind], self.max_indices[kind]);
            if usize::try_from(max.index).is_ok_and(|index| index > n) {
                for corner in &mut self.statements.corners {
                    let index = if kind == 1 { &mut corner.uv } else { &mut corner.normal };
                    if *index != ABSENT && *index as usize >= n {
                        *index = ABSENT;
                        count_unusable(&mut self.unusable[kind], max.line, max.index);
                    }
                }
            }
            let (n_unusable, first) = &self.unusable[kind];
            if *n_unusable > 0 {
                let what = KINDS[kind];
                self.statements.warnings.push(format!(
                    "ignoring {n_unusable} {what} indices that are out of range ({n} defined), such as {first}"
                ));
            }
        }
        if self.surplus.0 > 0 {
            let (n, first) = &self.surplus;
            self.statements.warnings.push(format!("ignoring a fourth index of {n} face corners, such as {first}"));
        }
    }
}

/// Counts an event; the first one is described.
fn count((n, first): &mut (usize, String), describe: impl FnOnce() -> String) {
    if *n == 0 {
        *first = describe();
    }
    *n += 1;
}

fn count_unusable(unusable: &mut (usize, String), line: usize, value: i64) {
    count(unusable, || format!("{value} in line {line}"));
}

/// The first `N` numbers of a statement; the first `n_needed` are required, the others default to 0.
fn coordinates<const N: usize>(rest: &[u8], n_needed: usize, what: &str) -> Result<[f32; N], String> {
    let mut numbers = [0.0; N];
    let mut words = text::words(rest);
    for (k, number) in numbers.iter_mut().enumerate() {
        match words.next() {
            Some(word) => {
                *number = text::float(word)
                    .ok_or_else(|| format!("{what}: expected a number, found {}", text::quoted(word)))?;
            }
            None if k >= n_needed => break,
            None => return Err(format!("{what} has {k} coordinates (expected {n_needed})")),
        }
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    //! Scenes, warnings and error messages of small files.

    mod against_tobj;

    use canted_obb::vector::{cross, length, sub};

    use super::*;
    use crate::SceneStats;

    fn obj(text: impl AsRef<[u8]>) -> Result<Scene, ReadError> {
        parse(Path::new("model.obj"), text.as_ref())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";

    /// A file with the vertices of a square, followed by `rest`.
    fn square(rest: &str) -> Result<Scene, ReadError> {
        obj(format!("{SQUARE}{rest}"))
    }

    /// Area of all triangles in world space.
    fn area(scene: &Scene) -> f64 {
        let of_triangle = |[a, b, c]: [[f64; 3]; 3]| 0.5 * length(cross(sub(b, a), sub(c, a)));
        let of_instance = |instance: &crate::Instance| {
            let mesh = &scene.meshes[instance.mesh.0 as usize];
            let corner = |index: u32| instance.world_from_object.point(mesh.positions[index as usize]).map(f64::from);
            mesh.triangles.iter().map(|triangle| of_triangle(triangle.map(corner))).sum::<f64>()
        };
        scene.instances.iter().map(of_instance).sum()
    }

    #[track_caller]
    fn loads(scene: Result<Scene, ReadError>, n_triangles: usize) -> Scene {
        let scene = scene.unwrap();
        assert_eq!(scene.warnings, [""; 0]);
        assert_eq!(scene.n_placed_triangles(), n_triangles);
        scene
    }

    #[track_caller]
    fn warns(scene: Result<Scene, ReadError>, n_triangles: usize, warning: &str) -> Scene {
        let scene = scene.unwrap();
        assert_eq!(scene.warnings, [warning]);
        assert_eq!(scene.n_placed_triangles(), n_triangles);
        scene
    }

    #[track_caller]
    fn fails(scene: Result<Scene, ReadError>, message: &str) {
        assert_eq!(scene.unwrap_err().to_string(), message);
    }

    #[test]
    fn faces_keep_file_order() {
        let scene = square(
            "o a\nf 1 2 3\nusemtl m\nf 1 2 4 3\ng b\nf 1 2 4\ng b\nusemtl m\nf 2 4 3\nf 1 4 3\no a\ng c\nf 1 2 3\n",
        );
        let scene = scene.unwrap();
        let placed = |i: &crate::Instance| {
            let mesh = &scene.meshes[i.mesh.0 as usize];
            (&mesh.name[..], i.first_primitive, mesh.triangles.len(), mesh.material_of(0).0)
        };
        let placed: Vec<_> = scene.instances.iter().map(placed).collect();
        assert_eq!(placed, [("a", 0, 1, 0), ("a", 1, 2, 1), ("b", 3, 3, 1), ("c", 6, 1, 1)]);
        let names: Vec<_> = scene.materials.iter().map(|material| &material.name[..]).collect();
        assert_eq!(names, ["", "m"]);
        assert_eq!(scene.warnings, ["material 'm' not found in any library; using the default material"]);
    }

    #[test]
    fn equal_groups_become_instances() {
        let moved = "v 5 0 2\nv 6 0 2\nv 5 1 2\nv 6 1 2\n";
        let scene = loads(square(&format!("g a\nf 1 2 4 3\n{moved}g b\nf -4 -3 -1 -2\n")), 4);
        let counts = SceneStats::of(&scene);
        assert_eq!((counts.n_meshes, counts.n_instances, counts.n_vertices), (1, 2, 4));
        assert_eq!(scene.instances[1].first_primitive, 2);
        assert_eq!(scene.instances[1].world_from_object.columns[3], [5.0, 0.0, 2.0]);
        assert_eq!(area(&scene), 2.0);
    }

    #[test]
    fn triangulation_preserves_area() {
        let hexagon = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5 6\n";
        let arrow = "v 5 0 0\nv 7 0 0\nv 6 0.5 0\nv 6 3 0\nf -4 -2 -3 -1\n";
        assert_eq!(area(&loads(obj(format!("{hexagon}{arrow}")), 6)), 5.5);
        loads(obj("v 0 0 0\nv 1 0 1\nv 1 1 0\nv 0 1 1\nf 1 2 3 4"), 2);
    }

    #[test]
    fn triangulates_a_polygon_of_1500_corners() {
        let corner = |k: i32| {
            let angle = std::f64::consts::TAU * f64::from(k) / 1500.0;
            format!("v {} {} 0\n", angle.cos(), angle.sin())
        };
        let face: String = (1..=1500).map(|k| format!(" {k}")).collect();
        let scene = loads(obj((0..1500).map(corner).collect::<String>() + "f" + &face), 1498);
        // The expected area is exact to 2e-8; each coordinate is rounded by at most 2^-25, along a perimeter of about tau.
        let inscribed = 750.0 * (std::f64::consts::TAU / 1500.0).sin();
        assert!((area(&scene) - inscribed).abs() < std::f64::consts::TAU * f64::from(f32::EPSILON));
    }

    #[test]
    fn vertices_split_where_normals_differ_and_uvs_need_a_texture() {
        let rest = "vt 0 0\nvt 1 0\nvn 0 0 2\nvn 0 0 0\nvn nan 0 0\nf 1/1/1 2/1/1 3/2/2\nf 1/2/1 2//3 3\n";
        let scene = loads(square(rest), 2);
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 3, 4]]);
        assert_eq!(mesh.normals.as_deref().unwrap(), [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0; 3]]);
        assert_eq!(mesh.uvs, None);
    }

    #[test]
    fn reads_all_syntax_variants() {
        loads(square("f -4 -3 -2\nf 2/ 4/ 3/\n"), 2);
        loads(square("\u{feff}# c\nf 1 \\\r\n 2\\\n 3 # 4\r\n"), 1);
        loads(obj("f 1 2 3\nv +0 -.0 0. 1\nv 1e0 .0 0E+0 0.5 0.5 0.5\nv 0 1.000000000000000000000000001 -0\n"), 1);
        loads(square("s off\nl 1 2\np 1\ncstype bezier\ncurv 0 1 1 2 3 4\nend\nfoo bar\nf 1 2 3"), 1);
        loads(obj([b"# \xff\xfe\n", SQUARE.as_bytes(), b"g gr\xfcn\nf 1 2 3"].concat()), 1);
        loads(square(&format!("#{}\nf 1 2 3", "x".repeat(70_000))), 1);
    }

    #[test]
    fn invalid_elements_are_reported_once() {
        warns(
            square("v nan 0 0\nv inf -inf 1\nf 1 2 3\nf 2 3 5\nf 2 3 6"),
            1,
            "skipping triangles with a non-finite vertex: 2",
        );
        let scene = loads(square("v nan 0 0\nf 1 2 3"), 1);
        assert!(scene.bounds_world().contains([0.0; 3]) && scene.bounds_world().reach() == 1.0);
        warns(square("v 2 0 0\nf 1 2 3\nf 1 1 2\nf 1 2 5\nf 4 4 4"), 4, "degenerate triangles (zero area): 3");
        warns(square("f 1 2\nf 1 2 3\nf\n"), 1, "skipping faces with fewer than 3 vertices: 2");
        warns(
            square("v 3e38 0 0\nv 0 -3e38 0\nf 1 5 6"),
            1,
            "coordinates up to 3e38: the surface area overflows single precision",
        );
        warns(
            obj("v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nv -3 1 0\nf 1 2 3 4 5"),
            3,
            "faces that intersect themselves or are too complex to triangulate exactly: 1",
        );
    }

    #[test]
    fn errors_name_line_and_value() {
        for (rest, message) in [
            ("f 1 2 9", "5: vertex index 9 out of range (4 defined)"),
            ("f 0 1 2", "5: invalid vertex index 0 (indices start at 1)"),
            ("f 1 2 -5", "5: relative vertex index -5 out of range (4 defined so far)"),
            ("f 1 2 99999999999999999999", "5: invalid vertex index '99999999999999999999'"),
            ("f 1 2 5000000000", "5: vertex index 5000000000 exceeds 32 bits"),
            ("f 1 2 4294967296", "5: vertex index 4294967296 exceeds 32 bits"),
            ("f 1 2 x", "5: invalid vertex index 'x'"),
            ("\n\nv 1 2", "7: vertex has 2 coordinates (expected 3)"),
            ("v 0,5 0 0", "5: vertex: expected a number, found '0,5'"),
            ("v 1 2 # 3", "5: vertex has 2 coordinates (expected 3)"),
        ] {
            fails(square(rest), &format!("model.obj: line {message}"));
        }
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        let none = "model.obj: nothing to draw: ";
        fails(obj(""), &format!("{none}no faces"));
        fails(square(""), &format!("{none}no faces"));
        fails(obj([0x11, 0, 0xff, b'\n', 0x17]), &format!("{none}not a text file"));
        fails(square("v 2 0 0\nf 1 2 5\nf 1 1 1"), &format!("{none}all 2 triangles are degenerate (zero area)"));
        fails(square("v nan 0 0\nf 1 2 5"), &format!("{none}all 1 triangles have a non-finite vertex"));
    }
}
