//! Wavefront OBJ with its MTL.
//!
//! ```text
//! bytes -> statements -> materials -> meshes (equal ones become instances)
//! ```
//!
//! Triangles are numbered in file order; a polygon counts as its triangles. Dropped triangles (non-finite vertices) and
//! faces with fewer than three corners have no number.

pub(super) mod materials;
mod statements;

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::Path;

use canted_obb::Affine;
use canted_obb::vector::{sub, to_f32, to_f64};
use statements::{ABSENT, Corner, Statements, parse_statements};

use super::error::ReadError;
use super::input::ReadOptions;
use super::mesh::{MeshChecks, linear_colors, unit_normal, usable_uv};
use crate::{Instance, MaterialId, Mesh, MeshId, Part, Scene};

/// Parses an OBJ file. Consecutive faces with equal object, group and material form a mesh with one instance.
///
/// `path` gives the folder of the material libraries and is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Scene, ReadError> {
    let mut statements = parse_statements(path, bytes)?;
    if statements.face_ends.is_empty() {
        let reason = if bytes.contains(&0) { "not a text file".to_owned() } else { no_faces(&statements) };
        return Err(ReadError::empty(path, reason));
    }
    let (warnings, notes) = (std::mem::take(&mut statements.warnings), std::mem::take(&mut statements.notes));
    let mut scene = Scene { warnings, notes, ..Scene::default() };
    materials::materials(path, options, &statements.libraries, &statements.materials, &mut scene)?;
    let colors = colors(&mut statements, &mut scene);
    let mut checks = MeshChecks::default();
    checks.n_small_faces = statements.n_small_faces;
    meshes(path, &statements, colors.as_deref(), &mut scene, &mut checks)?;
    checks.finish(path, &mut scene)?;
    Ok(scene)
}

/// Why a file without faces is empty: what it has instead.
fn no_faces(statements: &Statements) -> String {
    statements.skipped().map_or_else(|| "no faces".to_owned(), |others| format!("no faces ({others})"))
}

/// Linear vertex colors, if the file has usable ones. Faces without a material are white under them.
fn colors(statements: &mut Statements, scene: &mut Scene) -> Option<Vec<[f32; 4]>> {
    let colors = std::mem::take(&mut statements.colors);
    if colors.is_empty() {
        return None;
    }
    let linear =
        linear_colors("vertex", colors, statements.max_color).map_err(|warning| scene.warnings.push(warning)).ok()?;
    for (material, name) in scene.materials.iter_mut().zip(&statements.materials) {
        if name.is_none() {
            material.base_color = [1.0; 3];
        }
    }
    Some(linear)
}

/// Adds an instance for each nonempty run, with a new mesh unless an equal one exists.
fn meshes(
    path: &Path,
    statements: &Statements,
    colors: Option<&[[f32; 4]]>,
    scene: &mut Scene,
    checks: &mut MeshChecks,
) -> Result<(), ReadError> {
    let mut dedup = MeshDedup::default();
    let mut first_primitive = 0_u32;
    for (k, run) in statements.runs.iter().enumerate() {
        let end = statements.runs.get(k + 1).map_or(statements.face_ends.len(), |next| next.first_face);
        let material = &scene.materials[run.material];
        let is_textured = material.textures().next().is_some();
        let faces = triangles(statements, run.first_face..end, is_textured, checks);
        let too_many = || ReadError::unsupported(path, "more than 2^32 triangles, vertices or materials");
        let material = u32::try_from(run.material).map(MaterialId).map_err(|_| too_many())?;
        let name = String::from_utf8_lossy(run.name).into_owned();
        let mesh = mesh(name, material, &faces, statements, colors).ok_or_else(too_many)?;
        let n_triangles = u32::try_from(faces.len()).map_err(|_| too_many())?;
        if n_triangles > 0 {
            dedup.add(mesh, first_primitive, scene).ok_or_else(too_many)?;
        }
        first_primitive = first_primitive.checked_add(n_triangles).ok_or_else(too_many)?;
    }
    Ok(())
}

/// Triangles of a range of faces. Texture coordinates are dropped if the material has no texture.
fn triangles(
    statements: &Statements,
    faces: Range<usize>,
    is_textured: bool,
    checks: &mut MeshChecks,
) -> Vec<[Corner; 3]> {
    let mut kept = Vec::with_capacity(faces.len());
    for face in faces {
        checks.cut(statements.face(face), |corner| statements.positions[corner.position as usize], &mut kept);
    }
    if !is_textured {
        kept.as_flattened_mut().iter_mut().for_each(|corner: &mut Corner| corner.uv = ABSENT);
    }
    kept
}

/// The mesh of these triangles, with vertices numbered by first use; `None` for more than 2^32 vertices.
fn mesh(
    name: String,
    material: MaterialId,
    triangles: &[[Corner; 3]],
    statements: &Statements,
    colors: Option<&[[f32; 4]]>,
) -> Option<Mesh> {
    let mut mesh = Mesh { name, parts: vec![Part { first_triangle: 0, material }], ..Mesh::default() };
    mesh.triangles.reserve_exact(triangles.len());
    let mut vertices = Vec::new();
    let mut numbers = HashMap::new();
    for corners in triangles {
        let mut triangle = [0; 3];
        for (&corner, vertex) in corners.iter().zip(&mut triangle) {
            let next = u32::try_from(vertices.len()).ok()?;
            *vertex = *numbers.entry(corner).or_insert(next);
            if *vertex == next {
                vertices.push(corner);
            }
        }
        mesh.triangles.push(triangle);
    }
    mesh.positions = vertices.iter().map(|vertex| statements.positions[vertex.position as usize]).collect();
    if vertices.iter().any(|vertex| vertex.uv != ABSENT) {
        let uv = |vertex: &Corner| statements.uvs.get(vertex.uv as usize).map_or([0.0; 2], |&uv| usable_uv(uv));
        mesh.uvs = Some(vertices.iter().map(uv).collect());
    }
    if vertices.iter().any(|vertex| vertex.normal != ABSENT) {
        let normal =
            |vertex: &Corner| statements.normals.get(vertex.normal as usize).map_or([0.0; 3], |&n| unit_normal(n));
        mesh.normals = Some(vertices.iter().map(normal).collect());
    }
    // White changes nothing.
    let colors = colors.map(|all| vertices.iter().map(|vertex| all[vertex.position as usize]).collect::<Vec<_>>());
    mesh.colors = colors.filter(|colors| colors.iter().any(|&color| color != [1.0; 4]));
    Some(mesh)
}

/// The first mesh of each shape hash.
#[derive(Default)]
struct MeshDedup {
    first: HashMap<u64, MeshId>,
}

impl MeshDedup {
    /// Adds an instance to the scene, and the mesh unless it is an exact translation of the first mesh with its hash.
    ///
    /// `None` for more than 2^32 meshes.
    fn add(&mut self, mesh: Mesh, first_primitive: u32, scene: &mut Scene) -> Option<()> {
        let next = MeshId(u32::try_from(scene.meshes.len()).ok()?);
        let first = *self.first.entry(shape_hash(&mesh)).or_insert(next);
        let copied = scene.meshes.get(first.0 as usize).and_then(|original| translation(original, &mesh));
        let mut world_from_object = Affine::IDENTITY;
        let id = if let Some(translation) = copied {
            world_from_object.columns[3] = translation;
            first
        } else {
            scene.meshes.push(mesh);
            next
        };
        scene.instances.push(Instance { mesh: id, world_from_object, world_from_object_close: None, first_primitive });
        Some(())
    }
}

/// Vertices relative to the first one; equal for exactly translated meshes, as `f64` differences are exact there.
fn relative(mesh: &Mesh) -> impl Iterator<Item = [f64; 3]> {
    let first = to_f64(mesh.positions.first().copied().unwrap_or_default());
    mesh.positions.iter().map(move |&position| sub(to_f64(position), first))
}

/// A translation-invariant hash.
fn shape_hash(mesh: &Mesh) -> u64 {
    let mut hasher = DefaultHasher::new();
    mesh.triangles.hash(&mut hasher);
    for part in &mesh.parts {
        part.material.hash(&mut hasher);
    }
    for position in relative(mesh) {
        // -0.0 and 0.0 are equal and must have equal hashes.
        position.map(|x| (x + 0.0).to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

/// The exact `f32` translation from `original` to `copy`, if there is one.
fn translation(original: &Mesh, copy: &Mesh) -> Option<[f32; 3]> {
    let same_surface = original.triangles == copy.triangles
        && original.parts == copy.parts
        && original.normals == copy.normals
        && original.uvs == copy.uvs
        && original.colors == copy.colors;
    if !same_surface || !relative(original).eq(relative(copy)) {
        return None;
    }
    let mut pairs = original.positions.iter().zip(&copy.positions);
    let (&from, &to) = pairs.next()?;
    let moved = sub(to_f64(to), to_f64(from));
    let translation = to_f32(moved);
    let is_exact = to_f64(translation) == moved && pairs.all(|(&from, &to)| sub(to_f64(to), to_f64(from)) == moved);
    is_exact.then_some(translation)
}

#[cfg(test)]
mod tests {
    //! Scenes, warnings and error messages of small files; copies of meshes.

    mod against_tobj;

    use canted_obb::vector::{cross, length};

    use super::*;

    fn obj(text: impl AsRef<[u8]>) -> Result<Scene, ReadError> {
        parse(Path::new("model.obj"), text.as_ref(), &ReadOptions::default())
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
        assert_eq!((scene.meshes.len(), scene.instances.len(), scene.meshes[0].positions.len()), (1, 2, 4));
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
        loads(square("s off\ncstype bezier\nparm u 0 1\nend\nfoo bar\nf 1 2 3"), 1);
        loads(obj(format!("{SQUARE}f 1 \\\n2 3\n# \\\nf 2 3 4\n").replace('\n', "\r")), 2);
        loads(obj([b"# \xff\xfe\n", SQUARE.as_bytes(), b"g gr\xfcn\nf 1 2 3"].concat()), 1);
        loads(square(&format!("#{}\nf 1 2 3", "x".repeat(70_000))), 1);
    }

    #[test]
    fn elements_that_are_not_faces_are_noted_once() {
        let notes = |text: &str, note: &str| assert_eq!(loads(square(text), 1).notes, [note]);
        let others =
            "l 1 2\nl 2 3\np 1\ncstype bezier\ncurv 0 1 1 2 3 4\ncurv2 1 2\nsurf 0 1 0 1 1 2 3 4\ncall a.obj\nend\n";
        let counted = "2 lines, 1 point, 3 curves and surfaces, 1 call of another file";
        notes(&format!("{others}f 1 2 3"), &format!("skipping elements that are not faces: {counted}"));
        fails(square(others), &format!("model.obj: nothing to draw: no faces ({counted})"));
        notes("l 1 2\nf 1 2 3", "skipping elements that are not faces: 1 line");
    }

    #[test]
    fn painted_colors_are_read() {
        let colors = |scene: &Scene| scene.meshes[0].colors.clone().unwrap();
        let (red, white) = ([1.0, 0.0, 0.0, 1.0], [1.0; 4]);
        let face = "f 1 2 4 3\n";
        let scene = loads(square(&format!("#MRGB ffff0000ffff0000ffff0000ffff0000\n{face}")), 2);
        assert_eq!((colors(&scene), scene.materials[0].base_color), (vec![red; 4], [1.0; 3]));
        // Over several lines, in the order of the vertices: the fourth is the third of the face. 1 of 255 is nearly black.
        let scene = loads(square(&format!("{face}#MRGB 00FF000000000000\n#MRGB 00010101\n#MRGB 000000ff\n")), 2);
        let nearly = 1.0 / 255.0 / 12.92;
        let want = [red, [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [nearly, nearly, nearly, 1.0]];
        for (got, want) in colors(&scene).iter().zip(want) {
            assert!(got.iter().zip(want).all(|(x, y)| (x - y).abs() < 1e-6), "{got:?} {want:?}");
        }
        let short = warns(square(&format!("{face}#MRGB ffff0000\n")), 2, "1 colors of #MRGB for 4 vertices");
        assert_eq!(colors(&short), [red, white, white, white]);
        let digits = "white for 1 colors of #MRGB that are not 8 hexadecimal digits, such as 'ffff00' in line 6";
        let text = format!("{face}#MRGB ffff0000ffff0000ffff0000ffff00\n");
        assert_eq!(colors(&warns(square(&text), 2, digits)), [red, red, white, red]);
        let other = obj("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\n#MRGB ff00ff00\nf 1 2 3\n");
        assert_eq!(colors(&loads(other, 1)), [red; 3]);
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

    fn triangle(positions: [[f32; 3]; 3], material: u32) -> Mesh {
        Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2]],
            parts: vec![Part { first_triangle: 0, material: MaterialId(material) }],
            ..Mesh::default()
        }
    }

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[track_caller]
    fn adds(meshes: Vec<Mesh>, want: &[(u32, [f32; 3])]) {
        let (mut scene, mut dedup) = (Scene::default(), MeshDedup::default());
        for (k, mesh) in (0..).zip(meshes) {
            dedup.add(mesh, 10 * k, &mut scene).unwrap();
        }
        let got: Vec<_> = scene.instances.iter().map(|i| (i.mesh.0, i.world_from_object.columns[3])).collect();
        assert_eq!(got, want);
        assert!(scene.instances.iter().zip(0..).all(|(instance, k)| instance.first_primitive == 10 * k));
    }

    #[test]
    fn exact_copies_become_instances() {
        let moved = CORNERS.map(|[x, y, z]| [x + 3.0, y - 4.5, z - 0.0]);
        adds(vec![triangle(CORNERS, 0), triangle(moved, 0)], &[(0, [0.0; 3]), (0, [3.0, -4.5, 0.0])]);
    }

    #[test]
    fn other_shapes_materials_and_inexact_copies_stay_meshes() {
        let bent = [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.0, 1.0, 1e-6]];
        adds(vec![triangle(CORNERS, 0), triangle(CORNERS, 1)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        adds(vec![triangle(CORNERS, 0), triangle(bent, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
        // The translation 2^25 + 1 is not representable in `f32`.
        let (far, farther) = (-1.0, 33_554_432.0);
        let at = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        adds(vec![triangle(at(far), 0), triangle(at(farther), 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn copies_that_lose_detail_by_rounding_stay_meshes() {
        // All differences to the far triangle round to the same number, but only one triangle has an area.
        let near = [[1e-10, 0.0, 0.0], [2e-10, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let far = [[1e10, 0.0, 0.0], [1e10, 0.0, 0.0], [1e10, 1.0, 0.0]];
        adds(vec![triangle(near, 0), triangle(far, 0)], &[(0, [0.0; 3]), (1, [0.0; 3])]);
    }

    #[test]
    fn negative_zero_equals_zero() {
        let mut negative = CORNERS;
        negative[0] = [-0.0, 0.0, -0.0];
        adds(vec![triangle(CORNERS, 0), triangle(negative, 0)], &[(0, [0.0; 3]), (0, [0.0; 3])]);
    }
}
