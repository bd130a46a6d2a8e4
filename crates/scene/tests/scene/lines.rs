//! Lines with a thickness: what files hold, and files that are wrong. Bytes are written here after the documents that the readers name.

use canted_fixtures::SplitMix64;
use canted_scene::{LineOptions, Lines, ReadError, is_lines, read_lines};

fn read(name: &str, bytes: &[u8], line_radius: Option<f32>) -> Result<Lines, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_lines(&path, &LineOptions { line_radius })
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
    // Colors and transparency follow, and are not read.
    let mut more = hair(2 | 8 | 16, 2, &POINTS, &[], &[0.5; 6]);
    more.extend([0; 72]);
    assert_eq!(read("a.hair", &more, None).unwrap().segments.len(), 4);
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

#[test]
fn formats_are_known_by_their_extensions() {
    for (name, want) in [("a.hair", true), ("a.TCK", true), ("a.trk", true), ("a.obj", false), ("hair", false)] {
        assert_eq!(is_lines(name.as_ref()), want, "{name}");
    }
    is_error("a.xyz", b"", "unsupported scene format; use OBJ, PLY, STL, OFF, glTF or GLB");
}

/// Files with bytes overwritten, removed or repeated are read or rejected; what is read is valid.
#[test]
fn mutated_files_are_read_or_rejected() {
    let files = [
        ("a.hair", hair(1 | 2 | 4, 2, &POINTS, &[1, 3], &[0.1; 6])),
        ("a.tck", tck("Float32LE", &tracks())),
        ("a.trk", trk(None, &POINTS[..3])),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nl -1 1/7\n".to_vec()),
    ];
    let mut rng = SplitMix64::new(9);
    let (mut n_read, mut n_rejected) = (0, 0);
    for round in 0..3000 {
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
        match read(name, &bytes, Some(0.5)) {
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
