//! Lines with a thickness: what files hold, and files that are wrong. Bytes are written here after the documents that the readers name.

use canted_fixtures::SplitMix64;
use canted_scene::{Lines, ReadError, ReadOptions, is_lines, read_lines};

fn read(name: &str, bytes: &[u8], line_radius: Option<f32>) -> Result<Lines, ReadError> {
    read_with(name, bytes, [line_radius, None])
}

/// With radii of lines and of points.
fn read_with(name: &str, bytes: &[u8], [line_radius, point_radius]: [Option<f32>; 2]) -> Result<Lines, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_lines(&path, &ReadOptions { line_radius, point_radius, ..ReadOptions::default() })
}

/// The ends and radii of a segment.
fn segment(lines: &Lines, number: usize) -> [([f32; 3], f32); 2] {
    lines.segments[number].map(|i| (lines.points[i as usize], lines.radii[i as usize]))
}

/// The ends of all segments.
fn ends(lines: &Lines) -> Vec<[[f32; 3]; 2]> {
    lines.segments.iter().map(|ends| ends.map(|i| lines.points[i as usize])).collect()
}

#[track_caller]
fn is_error(name: &str, bytes: &[u8], want: &str) {
    let error = read(name, bytes, None).unwrap_err().to_string();
    assert!(error.ends_with(want), "{error}");
}

/// A `.hair` file with a usual thickness of 0.5 and two usual segments a strand.
fn hair(flags: u32, n_strands: u32, points: &[[f32; 3]], counts: &[u16], thickness: &[f32]) -> Vec<u8> {
    let mut bytes = b"HAIR".to_vec();
    for number in [n_strands, points.len() as u32, flags, 2, 0.5_f32.to_bits(), 0, 0, 0, 0] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.resize(128, b'x');
    bytes.extend(counts.iter().flat_map(|count| count.to_le_bytes()));
    bytes.extend(points.as_flattened().iter().chain(thickness).flat_map(|x| x.to_le_bytes()));
    bytes
}

const POINTS: [[f32; 3]; 6] =
    [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.5], [0.0, 3.0, 0.0], [0.0, 4.0, 0.0], [0.0, 5.0, 1.0]];

#[test]
fn thickness_of_hair_is_a_diameter() {
    let usual = read("a.hair", &hair(2, 2, &POINTS, &[], &[]), Some(9.0)).unwrap();
    assert_eq!(usual.points, POINTS);
    assert_eq!(usual.segments, [[0, 1], [1, 2], [3, 4], [4, 5]]);
    assert_eq!(usual.radii, [0.25; 6], "the file states it, so an option does not");
    let own = hair(1 | 2 | 4, 2, &POINTS, &[1, 3], &[0.1, 0.2, 0.4, 0.8, 1.0, 0.0]);
    let own = read("a.HAIR", &own, None).unwrap();
    assert_eq!(own.segments, [[0, 1], [2, 3], [3, 4], [4, 5]]);
    assert_eq!(own.radii, [0.05, 0.1, 0.2, 0.4, 0.5, 0.0]);
    // Transparency follows, and is not read; then colors.
    let mut more = hair(2 | 8 | 16, 2, &POINTS, &[], &[0.5; 6]);
    more.extend([0.25_f32, 0.5, 2.0].repeat(6).iter().flat_map(|x| x.to_le_bytes()));
    let more = read("a.hair", &more, None).unwrap();
    assert_eq!((more.segments.len(), more.colors.unwrap()), (4, vec![[0.25, 0.5, 1.0]; 6]));
}

#[test]
fn hair_that_is_wrong_is_an_error_that_names_the_value() {
    is_error("a.hair", b"HAIX", "header: the file does not begin with HAIR");
    is_error("a.hair", &hair(0, 2, &POINTS, &[], &[]), "header: the flags say that there are no points");
    is_error("a.hair", &hair(2, 3, &POINTS, &[], &[]), "strand 2: 2 segments from point 6, but the file has 6 points");
    is_error(
        "a.hair",
        &hair(2, 2, &POINTS, &[], &[])[..150],
        "byte 128: the array of points has 72 bytes, 22 are left",
    );
    let negative = hair(2 | 4, 2, &POINTS, &[], &[0.1, -0.2, 0.1, 0.1, 0.1, 0.1]);
    is_error("a.hair", &negative, "point 1: the radius -0.1 is not a length");
    let mut huge = hair(2, u32::MAX, &POINTS, &[], &[]);
    huge[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
    is_error("a.hair", &huge, "byte 128: the array of points has 51539607540 bytes, 72 are left");
}

#[test]
fn points_that_are_not_finite_take_their_segments_with_them() {
    let mut points = POINTS;
    points[4][1] = f32::NAN;
    let lines = read("a.hair", &hair(2, 2, &points, &[], &[]), None).unwrap();
    assert_eq!(lines.segments, [[0, 1], [1, 2]]);
    assert_eq!(lines.warnings, ["skipping segments with points that are not finite: 2"]);
    is_error("a.hair", &hair(2, 1, &[[f32::NAN; 3]; 3], &[], &[]), "all 2 segments have points that are not finite");
}

fn tck(data_type: &str, numbers: &[f32]) -> Vec<u8> {
    let mut bytes = format!("mrtrix tracks\ncount: 2\ndatatype: {data_type}\nfile: . 100\nEND\n").into_bytes();
    bytes.resize(100, 0);
    for &x in numbers {
        match data_type {
            "Float32LE" => bytes.extend(x.to_le_bytes()),
            "Float32BE" => bytes.extend(x.to_be_bytes()),
            "Float64LE" => bytes.extend(f64::from(x).to_le_bytes()),
            _ => bytes.extend(f64::from(x).to_be_bytes()),
        }
    }
    bytes
}

/// Two tracks, of three and two points.
fn tracks() -> Vec<f32> {
    let (end, last) = ([f32::NAN; 3], [f32::INFINITY; 3]);
    [POINTS[0], POINTS[1], POINTS[2], end, POINTS[3], POINTS[4], end, last].concat()
}

#[test]
fn tracks_of_mrtrix_have_four_types_of_numbers() {
    for data_type in ["Float32LE", "Float32BE", "Float64LE", "Float64BE"] {
        let lines = read("a.tck", &tck(data_type, &tracks()), Some(0.125)).unwrap();
        assert_eq!(lines.points, POINTS[..5], "{data_type}");
        assert_eq!(lines.segments, [[0, 1], [1, 2], [3, 4]], "{data_type}");
        assert_eq!(lines.radii, [0.125; 5]);
        assert!(lines.warnings.is_empty());
    }
    let cut = read("a.tck", &tck("Float32LE", &tracks()[..9]), Some(1.0)).unwrap();
    assert_eq!((cut.segments.len(), &cut.warnings[0][..]), (2, "the file has no end mark: it may be cut off"));
    is_error("a.tck", &tck("Int8", &tracks()), "datatype 'Int8' is not supported");
    is_error("a.tck", b"mrtrix tracks\ndatatype: Float32LE\nEND\n", "header: there is no usable line 'file: . OFFSET'");
    is_error("a.tck", b"mrtrix tracks\nfile: . 99\n", "header: there is no line END");
    is_error("a.tck", &tck("Float32LE", &[]), "nothing to draw: no lines");
}

#[test]
fn without_a_thickness_lines_are_thin_relative_to_their_extent() {
    let lines = read("a.tck", &tck("Float32LE", &tracks()), None).unwrap();
    // The box around 0..2, 0..4, 0..0.5.
    let radius = (4.0_f64 + 16.0 + 0.25).sqrt() / 2000.0;
    assert!((f64::from(lines.radii[0]) - radius).abs() < 1e-9);
    assert!(lines.warnings[0].starts_with("the file states no thickness of lines: using a radius of 0.00225"));
}

/// A `.trk` file of one track with a scalar a point and two properties.
fn trk(matrix: Option<[[f32; 4]; 4]>, points: &[[f32; 3]]) -> Vec<u8> {
    let mut header = vec![0; 1000];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"TRACK");
    for k in 0..3 {
        put(12 + 4 * k, &2.0_f32.to_le_bytes());
    }
    put(36, &1_i16.to_le_bytes());
    put(238, &2_i16.to_le_bytes());
    for (k, x) in matrix.unwrap_or_default().as_flattened().iter().enumerate() {
        put(440 + 4 * k, &x.to_le_bytes());
    }
    put(996, &1000_i32.to_le_bytes());
    header.extend((points.len() as i32).to_le_bytes());
    for [x, y, z] in points {
        header.extend([*x, *y, *z, 77.0].iter().flat_map(|x| x.to_le_bytes()));
    }
    header.extend([8.0_f32, 9.0].iter().flat_map(|x| x.to_le_bytes()));
    header
}

#[test]
fn tracks_of_trackvis_are_in_the_space_of_their_matrix() {
    let plain = read("a.trk", &trk(None, &POINTS[..3]), Some(1.0)).unwrap();
    assert_eq!((&plain.points[..], plain.segments.len()), (&POINTS[..3], 2));
    assert!(plain.warnings[0].starts_with("the header has no matrix"));
    // Voxels of 2 mm: half a voxel less, then twice as large again, mirrored in x, and moved.
    let matrix = [[-2.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, 20.0], [0.0, 0.0, 2.0, 30.0], [0.0, 0.0, 0.0, 1.0]];
    let placed = read("a.trk", &trk(Some(matrix), &POINTS[..3]), Some(1.0)).unwrap();
    let want = POINTS[..3].iter().map(|[x, y, z]| [11.0 - x, 19.0 + y, 29.0 + z]).collect::<Vec<_>>();
    assert_eq!(placed.points, want);
    let mut negative = trk(None, &POINTS[..3]);
    negative[1000..1004].copy_from_slice(&(-1_i32).to_le_bytes());
    is_error("a.trk", &negative, "track 0: the number of points is -1");
    is_error("a.trk", &trk(None, &POINTS[..3])[..1010], "byte 1004: a track has 48 bytes, 6 are left");
}

#[test]
fn lines_of_obj_are_numbered_in_their_order() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nv 5 5 5\nl -1 1/7\nf 1 2 3\nl 4\n";
    let lines = read("a.obj", text.as_bytes(), Some(0.5)).unwrap();
    assert_eq!(lines.segments, [[0, 1], [1, 2], [3, 0]]);
    assert_eq!(lines.warnings, ["skipping faces, as lines are read: 1"]);
    is_error("a.obj", b"v 0 0 0\nl 1 2\n", "line 2: there is no vertex 2, the file has 1");
    is_error("a.obj", b"v 0 0 0\nl 1 0\n", "line 2: there is no vertex 0");
    is_error("a.obj", b"v 0 0\n", "line 1: a vertex has three coordinates");
    is_error("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 1\n", "nothing to draw: no lines");
}

const GRAPH: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nelement edge 2\nproperty int vertex1\nproperty int vertex2\n\
    end_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n1 2 0 0 0 255\n0 1\n2 1\n";

#[test]
fn points_of_ply_come_before_its_edges() {
    let edges = read_with("a.ply", GRAPH.as_bytes(), [Some(0.1), None]).unwrap();
    assert_eq!((&edges.segments[..], &edges.radii[..]), (&[[0, 1], [2, 1]][..], &[0.1; 3][..]));
    assert_eq!(edges.colors.as_ref().unwrap()[1], [0.0, 1.0, 0.0]);
    let both = read_with("a.ply", GRAPH.as_bytes(), [None, Some(0.3)]).unwrap();
    assert_eq!(both.segments, [[0, 0], [1, 1], [2, 2], [0, 1], [2, 1]]);
    assert_eq!(both.radii, [0.3; 3]);
    let different = read_with("a.ply", GRAPH.as_bytes(), [Some(0.1), Some(0.3)]).unwrap();
    assert_eq!(segment(&different, 1), [([1.0, 0.0, 0.0], 0.3); 2]);
    assert_eq!(segment(&different, 4), [([1.0, 2.0, 0.0], 0.1), ([1.0, 0.0, 0.0], 0.1)]);
    let cloud =
        GRAPH.replace("element edge 2\nproperty int vertex1\nproperty int vertex2\n", "").replace("0 1\n2 1\n", "");
    let own = cloud.replace("uchar red", "float radius").replace("255 0 0", "0.5 0 0").replace("0 0 255", "2.5 0 255");
    assert_eq!(read_with("a.ply", own.as_bytes(), [None, Some(0.3)]).unwrap().radii, [0.5, 0.0, 2.5]);
    let error = read_with("a.ply", cloud.as_bytes(), [Some(0.1), None]).unwrap_err().to_string();
    assert!(error.ends_with("nothing to draw: no lines"), "{error}");
    is_error(
        "a.ply",
        GRAPH.replace("2 1\n", "2 3\n").as_bytes(),
        "edge 1: there are no vertices 2 and 3, the file has 3",
    );
    is_error("a.ply", GRAPH.replace("vertex2", "other").as_bytes(), "element 'edge': missing property 'vertex2'");
}

/// Two nodes: the second moves by (0, 10, 0) and doubles; lines of every mode, points, and a triangle.
const MODES: &str = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"mesh": 0}, {"mesh": 1, "translation": [0, 10, 0], "scale": [2, 2, 2]}],
    "meshes": [
        {"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}, {"attributes": {"POSITION": 0}, "mode": 2},
                        {"attributes": {"POSITION": 0}, "mode": 4}]},
        {"primitives": [{"attributes": {"POSITION": 0}, "mode": 3}, {"attributes": {"POSITION": 0}, "mode": 0}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36,
        "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAA"}]}"#;

#[test]
fn lines_of_gltf_are_in_world_space_with_the_radius_of_the_option() {
    let [a, b, c] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
    let [d, e, f] = [[0.0, 10.0, 0.0], [2.0, 10.0, 0.0], [2.0, 12.0, 0.0]];
    let lines = read_with("a.gltf", MODES.as_bytes(), [Some(0.1), None]).unwrap();
    let want = [[a, b], [a, b], [b, c], [c, a], [d, e], [e, f]];
    assert_eq!(ends(&lines), want);
    assert!(lines.radii.iter().all(|&radius| radius == 0.1));
    assert_eq!(
        lines.warnings,
        [
            "skipping triangles, as lines are read: mesh 0 primitive 2",
            "skipping points, which --point-radius makes balls: mesh 1 primitive 1"
        ]
    );
    let both = read_with("a.gltf", MODES.as_bytes(), [Some(0.1), Some(0.4)]).unwrap();
    assert_eq!(ends(&both)[6..], [[d, d], [e, e], [f, f]]);
    assert_eq!(segment(&both, 8), [(f, 0.4); 2]);
    assert_eq!(segment(&both, 5), [(e, 0.1), (f, 0.1)]);
}

/// An ethylene fragment and an ion, with the columns of PDB.
const MOLECULE: &str = "\
HETATM    1  C1  LIG A   1       0.000   0.000   0.000  1.00  0.00           C
HETATM    2  C2  LIG A   1       1.340   0.000   0.000  1.00  0.00           C
HETATM    3  H1  LIG A   1      -0.600   0.900   0.000  1.00  0.00           H
HETATM    4 NA    NA A   2       9.000   9.000   9.000
";

#[test]
fn molecules_are_balls_then_sticks() {
    let lines = read("a.pdb", MOLECULE.as_bytes(), None).unwrap();
    assert_eq!(lines.segments.len(), 6);
    // Half the covalent radii of Cordero et al. 2008.
    let radii: Vec<f32> = (0..4).map(|atom| segment(&lines, atom)[1].1).collect();
    assert_eq!(radii, [0.38, 0.38, 0.155, 0.83]);
    let [c1, c2, h, _] = [0, 1, 2, 3].map(|atom| segment(&lines, atom)[0].0);
    assert_eq!(ends(&lines)[4..], [[c1, c2], [c1, h]]);
    assert_eq!(segment(&lines, 4).map(|end| end.1), [0.1; 2]);
    let given = read_with("a.pdb", MOLECULE.as_bytes(), [Some(0.2), Some(0.5)]).unwrap();
    assert_eq!((segment(&given, 3)[0].1, segment(&given, 5)[0].1), (0.5, 0.2));
    // Each bond is stated twice; hydrogen has no record, so its bond is one by distance.
    let stated = format!("{MOLECULE}CONECT    1    4    2    2\nCONECT    2    1\nCONECT    4    1    9\nEND\n");
    let stated = read("a.ent", stated.as_bytes(), None).unwrap();
    assert_eq!(ends(&stated)[4..].iter().map(|[_, to]| *to).collect::<Vec<_>>(), [[9.0; 3], c2, h]);
    assert_eq!(stated.warnings, ["skipping bonds of atoms that the file has not: 1"]);
    let xyz = "3\nwater\nO 0 0 0\n\nH1 0.757 0.586 0\n1 -0.757 0.586 0\n";
    let xyz = read("a.xyz", xyz.as_bytes(), None).unwrap();
    assert_eq!((xyz.segments.len(), segment(&xyz, 2)[0].1), (5, 0.155));
}

#[test]
fn models_and_alternatives_after_the_first_are_skipped() {
    let model = "MODEL        1\nATOM      1  CA AALA A   1       0.000   0.000   0.000\n\
                 ATOM      2  CA BALA A   1       0.100   0.000   0.000\nATOM      3 HG11 ALA A   1       5.0     0.0     0.0\nENDMDL\n";
    let lines = read("a.pdb", format!("{model}{}", model.replace("  1\n", "  2\n")).as_bytes(), None).unwrap();
    assert_eq!((0..2).map(|atom| segment(&lines, atom)[0].1).collect::<Vec<_>>(), [0.38, 0.155]);
    let skipped = ["skipping models after the first: 1", "skipping alternative places of atoms: 1"];
    assert_eq!((lines.segments.len(), &lines.warnings[..]), (2, &skipped.map(str::to_owned)[..]));
    is_error("a.pdb", model.replace("5.0  ", "x.0  ").as_bytes(), "line 4: 'x.0' is not a coordinate");
    is_error("a.pdb", b"END\n", "nothing to draw: no atoms");
    is_error("a.xyz", b"2\n\nC 0 0 0\n", "atoms: the file has 1 atoms, its first line says 2");
    is_error("a.xyz", b"1\n\nC 0 0\n", "line 3: an atom has three coordinates");
    is_error("a.xyz", b"C 0 0 0\n", "line 1: 'C 0 0 0' is not a number of atoms");
    is_error("a.xyz", b"9999999999\n\n", "atoms: the file has 0 atoms, its first line says 9999999999");
}

/// Atoms in one place have no end of bonds.
#[test]
fn atoms_that_are_too_dense_have_no_bonds_by_distance() {
    let atoms: String = (0..3000).map(|i| format!("C 0.{:03} 0.{:03} {}\n", i % 10, i / 10, i % 2)).collect();
    let lines = read("a.xyz", format!("3000\n\n{atoms}").as_bytes(), None).unwrap();
    assert_eq!((lines.segments.len(), &lines.warnings[0][..]), (3000, "atoms are too dense to find bonds by distance"));
}

#[test]
fn moves_that_extrude_are_paths() {
    let text = "; a test\nM82\nG92 E0\nN3 G0 X1 Y0 Z0.2 ; travel\nG1X2 E1*77\ng1 Y1 E2 F1200\nG1 E1 (retract)\nG1 X5 E1\nG1 E2\n\
                M83\nG1 X6 E0.5\nG1 X7\nG91\nG1 X1 Y1 E.25\nG90\nM82\nG92 E0 X0\nG1 X1 E1\nM117 Hello G1 X9 E99\nG1 X2 E0.5\n";
    let lines = read("a.gcode", text.as_bytes(), None).unwrap();
    let z = 0.2;
    let want = [
        [[1.0, 0.0, z], [2.0, 0.0, z]],
        [[2.0, 0.0, z], [2.0, 1.0, z]],
        [[5.0, 1.0, z], [6.0, 1.0, z]],
        [[7.0, 1.0, z], [8.0, 2.0, z]],
        // The place is x = 0 now.
        [[8.0, 2.0, z], [9.0, 2.0, z]],
    ];
    assert_eq!(ends(&lines), want);
    assert!(lines.radii.iter().all(|&radius| radius == 0.2));
    // A quarter of a circle around (0, 0), counter-clockwise, in inches.
    let arc = read("a.gcode", b"G20\nG0 X1 Y0\nG3 X0 Y1 I-1 J0 E1\n", Some(0.5)).unwrap();
    assert_eq!((arc.segments.len(), arc.radii[0]), (9, 0.5));
    assert!(arc.points.iter().all(|[x, y, _]| (x.hypot(*y) - 25.4).abs() < 1e-5));
    assert_eq!(arc.points[9], [0.0, 25.4, 0.0]);
    let clockwise = read("a.gcode", b"G0 X1 Y0\nG2 X0 Y1 I-1 J0 E1\n", None).unwrap();
    assert_eq!(clockwise.segments.len(), 27);
    // By the radius: a quarter of the circle around zero, then, with a negative one, three quarters around (1, 1), clockwise and counter-clockwise.
    let quarter = read("a.gcode", b"G0 X1 Y0\nG3 X0 Y1 R1 E1\n", None).unwrap();
    assert_eq!(quarter.segments.len(), 9);
    assert!(quarter.points.iter().all(|p| (p[0].hypot(p[1]) - 1.0).abs() < 1e-6), "{:?}", quarter.points);
    let long = read("a.gcode", b"G0 X1 Y0\nG2 X0 Y1 R-1 E1\n", None).unwrap();
    assert!(long.segments.len() == 27 && long.points.iter().all(|p| (p[0].hypot(p[1]) - 1.0).abs() < 1e-6));
    let other = read("a.gcode", b"G0 X1 Y0\nG3 X0 Y1 R-1 E1\n", None).unwrap();
    assert!(
        other.segments.len() == 27 && other.points.iter().all(|p| ((p[0] - 1.0).hypot(p[1] - 1.0) - 1.0).abs() < 1e-6)
    );
    is_error("a.gcode", b"G28\nG1 X1\n", "nothing to draw: no moves that extrude");
    let wrong = read("a.gcode", b"G1 X1 Y=1 E1\nG1 X1 E1\n", None).unwrap();
    assert_eq!(wrong.warnings, ["skipping commands that are not numbers, as '=1 E1' in line 1"]);
    is_error("a.gcode", format!("G1 X1{} E1\n", "0".repeat(400)).as_bytes(), "is not finite");
}

#[test]
fn points_of_obj_are_balls() {
    let text = b"v 0 0 0\nv 1 0 0\np 2\nl 1 2\n";
    let lines = read_with("a.obj", text, [Some(0.1), Some(0.5)]).unwrap();
    assert_eq!(ends(&lines), [[[1.0, 0.0, 0.0]; 2], [[0.0; 3], [1.0, 0.0, 0.0]]]);
    assert_eq!((segment(&lines, 0)[0].1, segment(&lines, 1)[1].1), (0.5, 0.1));
    assert_eq!(read("a.obj", text, None).unwrap().warnings[0], "skipping points, which --point-radius makes balls: 1");
}

#[test]
fn formats_are_known_by_their_extensions() {
    let names =
        [("a.hair", true), ("a.TCK", true), ("a.trk", true), ("a.Xyz", true), ("a.gcode", true), ("a.pdb", true)];
    for (name, want) in names.into_iter().chain([("a.obj", false), ("a.ply", false), ("hair", false)]) {
        assert_eq!(is_lines(name.as_ref()), want, "{name}");
    }
    is_error(
        "a.abcd",
        b"",
        "unsupported scene format; use OBJ, PLY, STL, OFF, glTF, GLB, .hair, .tck, .trk, .pdb, .xyz or .gcode",
    );
    let stl = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    is_error("a.stl", stl, "nothing to draw: no lines, as files of this format have faces alone");
}

/// Files with bytes overwritten, removed or repeated are read or rejected; what is read is valid.
#[cfg(feature = "gzip")]
#[test]
fn compressed_files_are_those_in_them() {
    use std::io::Write as _;

    let compressed = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    let gcode = b"G1 X1 E1\nG1 X1 Y2 E2\n".to_vec();
    for (name, bytes) in
        [("a.hair", hair(2, 2, &POINTS, &[], &[])), ("a.tck", tck("Float32LE", &tracks())), ("a.GCODE", gcode)]
    {
        let plain = read(name, &bytes, None).unwrap();
        for other in [format!("{name}.gz"), format!("{name}.GZ"), name.to_owned()] {
            assert_eq!(read(&other, &compressed(&bytes), None).unwrap(), plain, "{other}");
            assert!(is_lines(other.as_ref()));
        }
    }
    is_error("a.xyz.gz", b"1\nx\nC 0 0 0\n", "a.xyz.gz: header: not a gzip file");
    assert!(!is_lines("a.ply.gz".as_ref()) && !is_lines("gz".as_ref()));
}

#[test]
fn mutated_files_are_read_or_rejected() {
    let files = [
        ("a.hair", hair(1 | 2 | 4, 2, &POINTS, &[1, 3], &[0.1; 6])),
        ("a.tck", tck("Float32LE", &tracks())),
        ("a.trk", trk(None, &POINTS[..3])),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nl -1 1/7\np 2\n".to_vec()),
        ("a.ply", GRAPH.as_bytes().to_vec()),
        ("a.gltf", MODES.as_bytes().to_vec()),
        ("a.pdb", format!("{MOLECULE}CONECT    1    2\n").into_bytes()),
        ("a.xyz", b"3\nwater\nO 0 0 0\nH 0.757 0.586 0\nH -0.757 0.586 0\n".to_vec()),
        ("a.gcode", b"G92 E0\nG1 X1.5 Y2 E1\nG91\nG3 X0 Y1 I-1 J0 E1\nM83\nG1 Z2 E.1\nG28 X\n".to_vec()),
    ];
    let mut rng = SplitMix64::new(9);
    let (mut n_read, mut n_rejected) = (0, 0);
    for round in 0..6000 {
        let (name, bytes) = &files[round % files.len()];
        let mut bytes = bytes.clone();
        for _ in 0..1 + rng.below(4) {
            let at = rng.below(bytes.len());
            match rng.below(3) {
                0 => bytes[at] = rng.below(256) as u8,
                1 => bytes.truncate(at.max(1)),
                _ => {
                    let part = bytes[at..bytes.len().min(at + 8)].to_vec();
                    bytes.splice(at..at, part);
                }
            }
        }
        match read_with(name, &bytes, [Some(0.5), Some(0.7).filter(|_| round % 2 == 0)]) {
            Ok(lines) => {
                n_read += 1;
                assert_eq!(lines.points.len(), lines.radii.len());
                for &i in lines.segments.as_flattened() {
                    assert!(lines.points[i as usize].iter().all(|x| x.is_finite()) && lines.radii[i as usize] >= 0.0);
                }
            }
            Err(_) => n_rejected += 1,
        }
    }
    assert!(n_read > 300 && n_rejected > 300, "{n_read} {n_rejected}");
}

fn scene_file(text: &str) -> Result<canted_scene::Scene, ReadError> {
    canted_scene::SceneFile::parse(text.as_bytes(), "a.toml".as_ref())?.load()
}

/// Control points of the first segment of each basis, after the textbook formulas, and the number of segments.
#[test]
fn curves_of_scene_files_have_five_bases() {
    let straight = "points = [[0, 0, 0], [3, 0, 0], [6, 0, 0], [9, 0, 0]]";
    for (basis, text, want, n) in [
        ("bezier", straight, [0.0, 3.0, 6.0, 9.0], 1),
        ("bspline", straight, [3.0, 4.0, 5.0, 6.0], 1),
        ("catmull-rom", "points = [[0, 0, 0], [3, 0, 0], [6, 0, 0], [9, 0, 0], [12, 0, 0]]", [3.0, 4.0, 5.0, 6.0], 2),
        ("hermite", "points = [[0, 0, 0], [3, 0, 0], [9, 0, 0], [6, 0, 0]]", [0.0, 1.0, 7.0, 9.0], 1),
    ] {
        let file = format!("[[curves]]\nbasis = \"{basis}\"\n{text}\nradii = 0.5\n");
        let scene = scene_file(&file).unwrap();
        let curves = scene.meshes[0].curves.as_ref().unwrap();
        let canted_scene::CurveSegments::Cubic(segments) = &curves.segments else { panic!("{basis} is cubic") };
        let xs = segments[0].map(|i| scene.meshes[0].positions[i as usize][0]);
        assert_eq!((xs, segments.len(), curves.radii[0]), (want, n, 0.5), "{basis}");
        let again = canted_scene::SceneFile::parse(file.as_bytes(), "a.toml".as_ref()).unwrap().to_toml();
        assert_eq!(scene_file(&again).unwrap().meshes[0].positions, scene.meshes[0].positions, "{again}");
    }
    let scene = scene_file(
        "[[curves]]\nname = \"a\"\npoints = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]\nradii = [0.1, 0.2, 0.3]\ncolor = [1, 0, 0]\n\
         [[curves]]\npoints = [[0, 0, 0], [1, 0, 0]]\nradii = [0.1, 0]\nmaterial = \"m\"\ncolors = [[1, 0, 0], [0, 1, 0]]\n\
         [[materials]]\nname = \"m\"\nbase_color = [0, 1, 0]\n",
    );
    let scene = scene.unwrap();
    assert_eq!(scene.instances.iter().map(|instance| instance.first_primitive).collect::<Vec<_>>(), [0, 2]);
    let color = |mesh: usize| scene.materials[scene.meshes[mesh].material_of(0).0 as usize].base_color;
    assert_eq!([color(0), color(1)], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(scene.meshes[0].curves.as_ref().unwrap().radii, [0.1, 0.2, 0.3]);
    assert_eq!((scene.bounds_world().min, scene.n_placed_segments()), ([-0.1, -0.2, -0.3], 3));
}

/// Tubes by default; ribbons are written as such, of both kinds of segments.
#[test]
fn curves_of_scene_files_have_two_shapes() {
    let file =
        |keys: &str| format!("[[curves]]\n{keys}points = [[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 1, 0]]\nradii = 0.1\n");
    for (keys, want) in [
        ("", canted_scene::CurveShape::Tube),
        ("shape = \"tube\"\n", canted_scene::CurveShape::Tube),
        ("shape = \"ribbon\"\n", canted_scene::CurveShape::Ribbon),
        ("basis = \"bezier\"\nshape = \"ribbon\"\n", canted_scene::CurveShape::Ribbon),
    ] {
        let shape = |text: &str| scene_file(text).unwrap().meshes[0].curves.as_ref().unwrap().shape;
        let text = file(keys);
        let again = canted_scene::SceneFile::parse(text.as_bytes(), "a.toml".as_ref()).unwrap().to_toml();
        assert_eq!([shape(&text), shape(&again)], [want; 2], "{keys}");
    }
}

#[test]
fn curves_of_scene_files_that_are_wrong_are_errors() {
    for (keys, want) in [
        ("points = [[0, 0, 0]]\nradii = 1", "line 2: 1 points in [[curves]] of the basis linear: expected at least 2"),
        (
            "basis = \"bezier\"\npoints = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\nradii = 1",
            "line 3: 3 points in [[curves]] of the basis bezier: expected 4, 7, 10 and so on",
        ),
        (
            "points = [[0, 0, 0], [1, 0, 0]]\nradii = [1, 2, 3]",
            "line 3: 3 radii for 2 points in [[curves]]: expected one number, or one for each point",
        ),
        (
            "points = [[0, 0, 0], [1, 0, 0]]\nradii = [1, -2]",
            "line 3: radius 1 in [[curves]] is -2: expected 0 or more",
        ),
        ("points = [[0, 0, 0], [1, 0, 0]]", "line 1: missing key 'radii' in [[curves]]"),
        (
            "points = [[0, 0, 0], [1, 0, 0]]\nradii = 1\nmaterial = \"none\"",
            "line 1: unknown material 'none'; none is defined",
        ),
    ] {
        let error = scene_file(&format!("[[curves]]\n{keys}\n")).unwrap_err().to_string();
        assert!(error.ends_with(want), "{error}");
    }
    let error = scene_file("[[curves]]\nshape = \"tape\"\npoints = [[0, 0, 0], [1, 0, 0]]\nradii = 1\n")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("line 2") && error.ends_with("\"tape\" for 'shape' in [[curves]]: expected one of tube, ribbon"),
        "{error}"
    );
    let error = scene_file("[[curves]]\nbasis = \"nurbs\"\npoints = []\nradii = 1\n").unwrap_err().to_string();
    assert!(
        error.contains("line 2") && error.contains("expected one of linear, bezier, bspline, catmull-rom, hermite"),
        "{error}"
    );
}

/// Points and radii at shutter close make the same segments, in every basis, and are written as read.
#[test]
fn curves_of_scene_files_move() {
    let points = |x: f32| format!("[[{x}, 0, 0], [3, 0, 0], [6, 0, 0], [9, 0, 0]]");
    for basis in ["linear", "bezier", "bspline", "catmull-rom", "hermite"] {
        let table = |keys: &str| format!("[[curves]]\nbasis = \"{basis}\"\n{keys}");
        let moving = table(&format!(
            "points = {}\nradii = 0.5\nclose_points = {}\nclose_radii = [1, 1, 1, 0.25]\n",
            points(0.0),
            points(-3.0)
        ));
        let scene = scene_file(&moving).unwrap();
        let at_close = scene_file(&table(&format!("points = {}\nradii = [1, 1, 1, 0.25]\n", points(-3.0)))).unwrap();
        let close = scene.meshes[0].close.as_ref().expect("it moves");
        assert_eq!(close.positions, at_close.meshes[0].positions, "{basis}");
        assert_eq!(close.radii.as_ref(), Some(&at_close.meshes[0].curves.as_ref().unwrap().radii), "{basis}");
        let again = canted_scene::SceneFile::parse(moving.as_bytes(), "a.toml".as_ref()).unwrap().to_toml();
        assert_eq!(scene_file(&again).unwrap().meshes[0].close, scene.meshes[0].close, "{again}");
        assert!(scene.bounds_world().max[0] >= 6.0 && scene.has_motion());
    }
    // One of both; and what is wrong.
    let two = "[[curves]]\npoints = [[0, 0, 0], [1, 0, 0]]\nradii = 0.5\n";
    let close = |key: &str| scene_file(&format!("{two}{key}")).map(|scene| scene.meshes[0].close.clone());
    let radii_alone = close("close_radii = 1").unwrap().unwrap();
    assert_eq!((radii_alone.positions[1], radii_alone.radii), ([1.0, 0.0, 0.0], Some(vec![1.0; 2])));
    let points_alone = close("close_points = [[0, 0, 1], [1, 0, 1]]").unwrap().unwrap();
    assert_eq!((points_alone.positions[1], points_alone.radii), ([1.0, 0.0, 1.0], Some(vec![0.5; 2])));
    assert_eq!(close("").unwrap(), None);
    for (key, words) in [
        ("close_points = [[0, 0, 1]]", "1 close_points for 2 points in [[curves]]: expected as many"),
        ("close_radii = [1, 2, 3]", "3 close_radii for 2 points"),
        ("close_radii = -1", "radius 0 in [[curves]] is -1: expected 0 or more"),
    ] {
        let message = close(key).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}
