//! A cube in both encodings, malformed files, and an oracle without welding.

use proptest::prelude::*;

use super::*;

/// Corners of the triangles of a unit cube.
fn cube() -> Vec<[[f32; 3]; 3]> {
    let corner = |k: u8| [0, 1, 2].map(|axis| f32::from(k >> axis & 1));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c].map(corner), [a, c, d].map(corner)]).collect()
}

fn binary(header: &[u8], triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn ascii(triangles: &[[[f32; 3]; 3]]) -> String {
    let facet = |triangle: &[[f32; 3]; 3]| {
        let vertices: String = triangle.iter().map(|[x, y, z]| format!("      vertex {x:e} {y:e} {z:e}\n")).collect();
        format!("  facet normal 0 0 0\n    outer loop\n{vertices}    endloop\n  endfacet\n")
    };
    format!("solid a facet\n{}endsolid a\n", triangles.iter().map(facet).collect::<String>())
}

fn stl(bytes: impl AsRef<[u8]>) -> Result<Scene, ReadError> {
    parse(Path::new("model.stl"), bytes.as_ref())
}

/// Bits of the corners of all triangles of the mesh.
fn corners(scene: &Scene) -> Vec<[[u32; 3]; 3]> {
    let mesh = &scene.meshes[0];
    mesh.triangles.iter().map(|t| t.map(|k| mesh.positions[k as usize].map(f32::to_bits))).collect()
}

#[track_caller]
fn is_cube(scene: Result<Scene, ReadError>, warnings: &[&str]) {
    let scene = scene.unwrap();
    assert_eq!(scene.warnings, warnings);
    assert_eq!(scene.meshes[0].positions.len(), 8, "vertices are welded");
    assert_eq!(corners(&scene), cube().iter().map(|t| t.map(|p| p.map(f32::to_bits))).collect::<Vec<_>>());
    assert_eq!(scene.meshes[0].name, "model");
}

#[test]
fn both_encodings_agree() {
    is_cube(stl(ascii(&cube())), &[]);
    is_cube(stl(binary(b"", &cube())), &[]);
    is_cube(stl(binary(b"solid but binary\nfacet", &cube())), &[]);
    is_cube(stl(ascii(&cube()).replace('\n', "\r\n")), &[]);
    is_cube(stl(ascii(&cube()).to_uppercase()), &[]);
    is_cube(stl(format!("\u{feff}\n{}", ascii(&cube()))), &[]);
    let text = ascii(&cube());
    let (name, rest) = text.split_once('\n').unwrap();
    is_cube(stl(format!("{name}\n{}", rest.split_whitespace().collect::<Vec<_>>().join("\t"))), &[]);
}

#[test]
fn repairs_are_reported() {
    let text = ascii(&cube());
    is_cube(stl(text.trim_end().trim_end_matches("endsolid a")), &["missing 'endsolid': line 85"]);
    is_cube(
        stl(text.replace("vertex 0e0 0e0 1e0\n", "vertex 0e0 0e0 1e0 7\n")),
        &["ignoring surplus numbers: line 18"],
    );
    is_cube(stl([binary(b"", &cube()), vec![1]].concat()), &["ignoring bytes after the last declared triangle"]);
    let mut colored = binary(b"COLOR=", &cube());
    colored[84 + 48] = 1;
    is_cube(stl(colored), &["ignoring attributes of triangles (colors): 1"]);

    let mut bad = cube();
    bad[3][1][2] = f32::NAN;
    bad[5][0] = bad[5][1];
    for bytes in [ascii(&bad).replace("NaN", "nan").into_bytes(), binary(b"", &bad)] {
        let scene = stl(bytes).unwrap();
        assert_eq!(
            scene.warnings,
            ["skipping triangles with a non-finite vertex: 1", "degenerate triangles (zero area): 1"]
        );
        assert_eq!(scene.n_placed_triangles(), 11);
    }
}

#[test]
fn several_solids_and_polygons_form_one_mesh() {
    let square = "solid b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 5\nvertex 1 0 5\nvertex 1 1 5\nvertex 0 1 5\n\
                  endloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 5\nendloop\nendfacet\nendsolid\n";
    let scene = stl(ascii(&cube()) + square).unwrap();
    assert_eq!(scene.warnings, ["skipping faces with fewer than 3 vertices: 1"]);
    assert_eq!((scene.n_placed_triangles(), scene.meshes[0].positions.len()), (14, 12));
}

#[test]
fn errors_contain_location_and_value() {
    let text = |from: &str, to: &str| ascii(&cube()).replacen(from, to, 1).into_bytes();
    let mut long = binary(b"", &cube());
    long[80] = 13;
    for (bytes, message) in [
        (b"".to_vec(), "header: 0 bytes, but a binary STL file has at least 84"),
        (b"cube".to_vec(), "header: 4 bytes, but a binary STL file has at least 84"),
        (long, "header: 13 triangles declared, but the remaining data holds 12"),
        (b"solid a\nendsolid a\n".to_vec(), "nothing to draw: no triangles"),
        (binary(b"", &[]), "nothing to draw: no triangles"),
        (text("vertex 0e0", "vertex 0,5"), "line 4: vertex: expected a number, found '0,5'"),
        (text("vertex", "vertx"), "line 4: unknown statement 'vertx'"),
        (text("    endloop\n", ""), "line 7: expected 'endloop', found 'endfacet'"),
        (text("    endloop\n  endfacet\n", ""), "line 7: expected 'endloop', found 'facet'"),
        (b"solid\nfacet normal 0 0 1\nouter loop\nvertex 1 2".to_vec(), "line 4: unexpected end of file in a vertex"),
        (b"solid\nfacet normal 0 0 1\nouter loop\n".to_vec(), "line 3: unexpected end of file in a facet"),
    ] {
        assert_eq!(stl(bytes).unwrap_err().to_string(), format!("model.stl: {message}"));
    }
}

#[test]
fn rejects_every_truncation_of_a_binary_file() {
    let full = binary(b"", &cube());
    for length in 0..full.len() {
        assert!(stl(&full[..length]).is_err(), "{length} bytes");
    }
}

#[test]
fn no_truncation_of_an_ascii_file_is_silent() {
    let full = ascii(&cube());
    let end = full.trim_end().len() - "endsolid a".len();
    for length in 0..end {
        assert!(stl(&full[..length]).map_or(true, |scene| !scene.warnings.is_empty()), "{length} bytes");
    }
}

/// Bit patterns of all kinds, and few enough values for vertices to repeat.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        prop::sample::select(vec![0.0, -0.0, 1.0, 1e7, -1e7, 1e-30, 3e38, f32::NAN, f32::INFINITY]),
    ]
}

fn triangle() -> impl Strategy<Value = [[f32; 3]; 3]> {
    prop::array::uniform3(prop::array::uniform3(coordinate()))
}

proptest! {
    /// Welding changes no corner, and no two vertices have equal bits.
    #[test]
    fn corners_are_those_of_the_file(triangles in prop::collection::vec(triangle(), 1..40), text: bool) {
        let bytes = if text { ascii(&triangles).into_bytes() } else { binary(b"", &triangles) };
        let is_finite = |t: &&[[f32; 3]; 3]| t.iter().flatten().all(|x| x.is_finite());
        let want: Vec<_> = triangles.iter().filter(is_finite).map(|t| t.map(|p| p.map(f32::to_bits))).collect();
        match stl(bytes) {
            Ok(scene) => {
                prop_assert_eq!(corners(&scene), want);
                let mut positions: Vec<_> = scene.meshes[0].positions.iter().map(|p| p.map(f32::to_bits)).collect();
                let n = positions.len();
                positions.sort_unstable();
                positions.dedup();
                prop_assert_eq!(positions.len(), n);
            }
            Err(error) => prop_assert!(matches!(error, ReadError::Empty { .. }), "{}", error),
        }
    }
}
