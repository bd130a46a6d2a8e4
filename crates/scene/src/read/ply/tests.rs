//! A cube in every encoding, and malformed files.

use super::*;

const VERTICES: &str = "element vertex 8\nproperty float x\nproperty float y\nproperty float z\n";
const FACES: &str = "element face 6\nproperty list uchar int vertex_indices\n";
const QUADS: [[u8; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// Corner `k` of the unit cube.
fn corner(k: u8) -> [f32; 3] {
    [0, 1, 2].map(|axis| f32::from(k >> axis & 1))
}

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

#[track_caller]
fn is_cube(scene: Result<Scene, ReadError>) {
    let scene = scene.unwrap();
    assert_eq!(scene.warnings, [""; 0]);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [0, 1, 2, 3, 4, 5, 6, 7].map(corner));
    let fans = QUADS.map(|quad| quad.map(u32::from)).map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    assert_eq!(mesh.triangles, fans.as_flattened());
}

#[test]
fn all_encodings_agree() {
    let elements = format!("{VERTICES}{FACES}");
    is_cube(ply(file("ascii", &elements, ascii_cube())));
    is_cube(ply(String::from_utf8(file("ascii", &elements, ascii_cube())).unwrap().replace('\n', "\r\n")));
    is_cube(ply(file("binary_little_endian", &elements, little_endian_cube())));
    is_cube(ply(file("binary_big_endian", &elements, binary_cube(f32::to_be_bytes, i32::to_be_bytes))));
}

#[test]
fn reads_every_number_type_in_both_byte_orders() {
    let types = ["char", "uint8", "short", "uint16", "int32", "uint", "float32", "double"];
    for (format, order) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let bytes = |value: i8| -> [Vec<u8>; 8] {
            let mut all = [
                value.to_le_bytes().to_vec(),
                value.to_le_bytes().to_vec(),
                i16::from(value).to_le_bytes().to_vec(),
                i16::from(value).to_le_bytes().to_vec(),
                i32::from(value).to_le_bytes().to_vec(),
                i32::from(value).to_le_bytes().to_vec(),
                f32::from(value).to_le_bytes().to_vec(),
                f64::from(value).to_le_bytes().to_vec(),
            ];
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
    is_cube(ply(file(
        "ascii",
        &elements,
        ["5 2 0.5 0.5\n".to_owned()].into_iter().chain(faces).chain(vertices).collect::<String>(),
    )));
}

#[test]
fn keeps_normals_and_uvs_with_a_texture() {
    let normals = "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n";
    let scene = ply(triangle(normals, "0 0 4 0.25 0.5", "3 0 1 2")).unwrap();
    assert_eq!(scene.meshes[0].normals.as_deref().unwrap(), [[0.0, 0.0, 1.0]; 3]);
    assert_eq!(scene.meshes[0].uvs, None);

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b.png"), image::tests::encoded(::image::ImageFormat::Png)).unwrap();
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
    let scene = ply(file("ascii", &format!("{VERTICES}{lists}"), body("2 0 1\n4 0 3 2 1\n3 4 5 6\n0\n1 7\n"))).unwrap();
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
    is_cube(ply(&full));
    for length in 0..full.len() {
        assert!(ply(&full[..length]).is_err(), "{length} bytes");
    }
}
