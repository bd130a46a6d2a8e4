//! Scenes, warnings and error messages of small files.

mod against_tobj;

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
    let of_triangle = |[a, b, c]: [[f64; 3]; 3]| {
        let (u, v): ([f64; 3], [f64; 3]) = (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        0.5 * n.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
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
    let scene =
        square("o a\nf 1 2 3\nusemtl m\nf 1 2 4 3\ng b\nf 1 2 4\ng b\nusemtl m\nf 2 4 3\nf 1 4 3\no a\ng c\nf 1 2 3\n");
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
