//! A cube in all variants, and malformed files.

use super::*;

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

#[track_caller]
fn is_cube(scene: Result<Scene, ReadError>, warnings: &[&str]) -> Scene {
    let scene = scene.unwrap();
    assert_eq!(scene.warnings, warnings);
    let mesh = &scene.meshes[0];
    let corner = |k: u8| [0, 1, 2].map(|axis| f32::from(k >> axis & 1));
    assert_eq!(mesh.positions, [0, 1, 2, 3, 4, 5, 6, 7].map(corner));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    assert_eq!(mesh.triangles, quads.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).as_flattened());
    scene
}

#[test]
fn reads_all_syntax_variants() {
    is_cube(off(format!("OFF\n{CUBE}")), &[]);
    is_cube(off(format!("OFF {CUBE}")), &[]);
    is_cube(off(format!("OFF{CUBE}")), &[]);
    is_cube(off(CUBE), &[]);
    is_cube(off(format!("# c\n\nOFF # d\n# e\n{CUBE}\n# f\n")), &[]);
    is_cube(off(format!("OFF\n{}", CUBE.replacen(" 12", "", 1)).replace('\n', "\r\n")), &[]);
}

#[test]
fn reads_attributes() {
    let red = Some(vec![[1.0, 0.0, 0.0, 1.0]; 8]);
    for (keyword, attributes) in
        [("COFF", " 255 0 0 255"), ("COFF", " 1 0 0"), ("CNOFF", " 0 0 2 1.0 0 0 1"), ("STCOFF", " 1 0 0 1 0.5 0.5")]
    {
        let scene = is_cube(cube(keyword, attributes), &[]);
        assert_eq!(scene.meshes[0].colors, red, "{keyword}");
        assert_eq!(scene.materials[0].base_color, [1.0; 3]);
    }
    assert_eq!(is_cube(cube("NOFF", " 0 0 2"), &[]).meshes[0].normals, Some(vec![[0.0, 0.0, 1.0]; 8]));
}

#[test]
fn repairs_are_reported() {
    is_cube(cube("OFF", " 7"), &["ignoring surplus numbers after a vertex: line 3 and 7 more"]);
    is_cube(cube("COFF", ""), &["vertices without a color of 3 or 4 numbers: line 3 and 7 more"]);
    is_cube(cube("NOFF", " 1"), &["vertices without a normal: line 3 and 7 more"]);
    is_cube(cube("COFF", " 0 -1 0"), &["ignoring vertex colors: negative value at vertex 0: 0 -1 0"]);
    is_cube(off(CUBE.replace("7 6\n", "7 6 255 0 0\n")), &["ignoring colors of faces: line 11"]);
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
    for length in 0..full.trim_end().len() {
        assert!(off(&full[..length]).is_err(), "{length} bytes");
    }
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
