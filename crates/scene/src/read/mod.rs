//! Readers for OBJ, PLY, STL, OFF, glTF and environment maps.

mod animated;
mod environment;
mod error;
mod folder;
mod gltf;
mod image;
mod input;
#[cfg(feature = "ktx2")]
mod ktx2;
mod lines;
mod mesh;
mod obj;
#[cfg(feature = "off")]
mod off;
mod ply;
mod polygon;
#[cfg(feature = "stl")]
mod stl;
mod strands;
mod stream;
#[cfg(test)]
mod testing;
mod text;

use std::path::Path;

use input::{Format, Input, open};

use crate::Scene;

pub use animated::AnimatedScene;
pub use environment::read_environment;
pub use error::ReadError;
pub(crate) use image::decode;
pub use input::ReadOptions;
pub use lines::{is_lines, read_lines};
pub use strands::Lines;
pub use stream::stream_triangles;
pub(crate) use text::{quoted, with_line_feeds};

/// Reads an OBJ (with MTL), PLY, STL, OFF, glTF or GLB file with the buffers and images it references, or the curves of
/// a file of lines, as [`read_lines`] reads it.
///
/// The format is determined by the content (PLY, GLB, STL, OFF), else by the extension. Files compressed by gzip are
/// decompressed first, and text in UTF-16 is read as in UTF-8. Referenced files are only read from the
/// folder of `path` and below, unless [`ReadOptions`] permit more. Repairs and skipped elements are reported in [`Scene::warnings`]. Coordinates keep the file's
/// unit.
///
/// # Errors
/// [`ReadError`] with file, location and value.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    read_with(path, &ReadOptions::default())
}

/// As [`read`], with options.
///
/// # Errors
/// As [`read`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    if is_lines(path) || options.reads_lines() {
        return lines::scene(path, options);
    }
    let Input { format, bytes } = open(path, options)?;
    if format == Format::Gltf {
        return gltf::read(path, &bytes, options);
    }
    let mut scene = read_static(path, format, &bytes, options)?;
    if let Some(time) = options.time {
        scene.warnings.push(format!("ignoring time {time}: {} files have no animation", format.name()));
    }
    Ok(scene)
}

/// Parses a file of a format without animations.
fn read_static(path: &Path, format: Format, bytes: &[u8], options: &ReadOptions) -> Result<Scene, ReadError> {
    if let Some(wanted) = &options.animation {
        return Err(ReadError::UnknownAnimation { path: path.to_owned(), wanted: wanted.clone(), known: Vec::new() });
    }
    if let Some(wanted) = &options.variant {
        return Err(ReadError::UnknownVariant { path: path.to_owned(), wanted: wanted.clone(), known: Vec::new() });
    }
    match format {
        Format::Obj => obj::parse(path, bytes, options),
        Format::Ply => ply::parse(path, bytes, options),
        #[cfg(feature = "stl")]
        Format::Stl => stl::parse(path, bytes),
        #[cfg(not(feature = "stl"))]
        Format::Stl => Err(ReadError::missing_feature(path, "STL", "stl")),
        #[cfg(feature = "off")]
        Format::Off => off::parse(path, bytes),
        #[cfg(not(feature = "off"))]
        Format::Off => Err(ReadError::missing_feature(path, "OFF", "off")),
        Format::Gltf => gltf::read(path, bytes, options),
    }
}

#[cfg(test)]
mod tests {
    //! Arbitrary input to the OBJ, MTL and PLY readers gives an error or a valid scene.

    use std::path::Path;

    use proptest::prelude::*;

    use super::obj::materials::parse_library;
    use super::{ReadError, ReadOptions, obj, ply, read};
    use crate::Scene;
    use crate::flaw::is_numbered;

    /// The first error in a scene of one format.
    fn flaw(scene: &Scene) -> Option<String> {
        crate::flaw::flaw(scene).or_else(|| (!is_numbered(scene)).then(|| "wrong numbers".to_owned()))
    }

    const OBJ: &str = "mtllib a.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 1\nvn 0 0 1\ng b\nusemtl c\nf 1 2 3 4\nf -1/1/1 -2/1 -3//1\n";
    const MTL: &str =
        "newmtl a\nKd 1 0.5 0\nKe 1 1 1\nmap_Kd -s 1 1 1 a.png\nd 0.5\nnewmtl b\nmap_d -o 0 b.png\nTr 1\n";
    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
                       property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    /// A file with bytes overwritten, removed or duplicated.
    fn mutated(text: &'static str) -> impl Strategy<Value = Vec<u8>> {
        let edit = (any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0..4_u8, any::<u8>());
        prop::collection::vec(edit, 1..6).prop_map(move |edits| {
            let mut bytes = text.as_bytes().to_vec();
            for (a, b, kind, byte) in edits {
                let (a, b) = (a.index(bytes.len() + 1), b.index(bytes.len() + 1));
                let range = a.min(b)..a.max(b).min(a.min(b) + 8);
                match kind {
                    0 => drop(bytes.splice(range, [byte])),
                    1 => drop(bytes.splice(range, [])),
                    2 => bytes.splice(range.end..range.end, bytes[range].to_vec()).for_each(drop),
                    _ => drop(bytes.splice(a..a, *b"-9")),
                }
            }
            bytes
        })
    }

    /// Plausible statements with small numbers, so that indices are often valid.
    fn obj_lines() -> impl Strategy<Value = Vec<u8>> {
        let number = prop_oneof![
            (-2..7_i32).prop_map(|x| x.to_string()),
            Just("nan".into()),
            Just("1e39".into()),
            Just("-0.0".into())
        ];
        let line = (
            prop::sample::select(vec!["v", "v", "v", "vt", "vn", "f", "f", "f", "g", "usemtl"]),
            prop::collection::vec(number, 0..7),
        );
        prop::collection::vec(line, 0..40).prop_map(|lines| {
            lines
                .into_iter()
                .flat_map(|(keyword, numbers)| format!("{keyword} {}\n", numbers.join(" ")).into_bytes())
                .collect()
        })
    }

    proptest! {
        #[test]
        fn obj_gives_an_error_or_a_valid_scene(bytes in prop_oneof![prop::collection::vec(any::<u8>(), 0..300), mutated(OBJ), obj_lines()]) {
            if let Ok(scene) = obj::parse(Path::new("a.obj"), &bytes, &ReadOptions::default()) {
                prop_assert_eq!(flaw(&scene), None);
            }
        }

        #[test]
        fn mtl_gives_valid_materials(bytes in prop_oneof![prop::collection::vec(any::<u8>(), 0..300), mutated(MTL)]) {
            let mut warnings = Vec::new();
            for material in parse_library("a.mtl", &bytes, &mut warnings).values() {
                prop_assert!(material.base_color.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
                prop_assert!(material.emission.iter().flatten().all(|x| *x >= 0.0 && x.is_finite()));
            }
        }

        #[test]
        fn ply_gives_an_error_or_a_valid_scene(bytes in prop_oneof![prop::collection::vec(any::<u8>(), 0..300), mutated(PLY)]) {
            if let Ok(scene) = ply::parse(Path::new("a.ply"), &bytes, &ReadOptions::default()) {
                prop_assert_eq!(flaw(&scene), None);
            }
        }
    }

    #[cfg(feature = "stl")]
    const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    #[cfg(feature = "off")]
    const OFF: &str = "CNOFF\n4 2 0\n0 0 0 0 0 1 255 0 0\n1 0 0 0 0 1 0 9 0\n1 1 0 0 0 1 0 0 9\n0 1 0 0 0 1 1 1 1\n3 0 1 2\n4 0 1 2 3 9\n";

    /// Checks every file that differs in one byte, for some values of it.
    #[cfg(any(feature = "stl", feature = "off"))]
    fn every_changed_byte(file: &[u8], parse: impl Fn(&Path, &[u8]) -> Result<Scene, ReadError>) {
        assert_eq!(flaw(&parse(Path::new("a"), file).unwrap()), None);
        for at in 0..file.len() {
            for byte in [0, b' ', b'\n', b'-', b'.', b'9', b'e', 0x7f, 0xff] {
                let mut bytes = file.to_vec();
                bytes[at] = byte;
                if let Ok(scene) = parse(Path::new("a"), &bytes) {
                    assert_eq!(flaw(&scene), None, "byte {at} = {byte}");
                }
            }
        }
    }

    #[cfg(feature = "stl")]
    #[test]
    fn changed_stl_files_give_an_error_or_a_valid_scene() {
        every_changed_byte(STL.as_bytes(), super::stl::parse);
        let mut binary = [vec![0; 80], vec![1, 0, 0, 0], vec![0; 12]].concat();
        binary.extend([0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()));
        binary.extend([0; 2]);
        every_changed_byte(&binary, super::stl::parse);
    }

    #[cfg(feature = "off")]
    #[test]
    fn changed_off_files_give_an_error_or_a_valid_scene() {
        every_changed_byte(OFF.as_bytes(), super::off::parse);
    }

    /// Reads a file of this name in a folder of its own.
    fn file(name: &str, bytes: &[u8]) -> Result<Scene, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    }

    #[cfg(all(feature = "stl", feature = "off"))]
    #[test]
    fn stl_and_off_are_recognized_by_content_and_by_extension() {
        let file = |name: &str, text: &str| file(name, text.as_bytes()).map(|scene| scene.n_placed_triangles());
        for name in ["a.stl", "a.STL", "a.obj", "a"] {
            assert_eq!(file(name, STL).unwrap(), 1, "{name}");
        }
        for name in ["a.off", "a.OFF", "a.obj", "a"] {
            assert_eq!(file(name, OFF).unwrap(), 3, "{name}");
        }
        assert_eq!(file("b.off", &OFF["CNOFF\n".len()..]).unwrap(), 3);
        assert!(matches!(file("c.stl", ""), Err(ReadError::Malformed { .. })));
        assert!(matches!(file("c.off", ""), Err(ReadError::Malformed { .. })));
    }

    #[test]
    fn format_is_determined_by_content_then_extension() {
        let file = |name: &str, text: &str| file(name, text.as_bytes());
        let obj = &OBJ["mtllib a.mtl\n".len()..];
        assert_eq!(file("a.OBJ", obj).unwrap().n_placed_triangles(), 3);
        assert_eq!(file("a.ply", PLY).unwrap().n_placed_triangles(), 1);
        assert_eq!(file("a.obj", PLY).unwrap().n_placed_triangles(), 1);
        assert_eq!(file("a", &PLY.replace('\n', "\r\n")).unwrap().n_placed_triangles(), 1);
        assert!(matches!(file("b.ply", obj), Err(ReadError::Malformed { .. })));
        assert!(matches!(file("b.gltf", obj), Err(ReadError::Malformed { .. })));
        assert!(matches!(file("b", obj), Err(ReadError::UnknownFormat { .. })));
        assert!(matches!(file("c.3ds", ""), Err(ReadError::UnknownFormat { .. })));
        for (name, words) in [
            ("c.FBX", "FBX is not supported; convert it with FBX2glTF"),
            ("c.usdz", "USD is not supported; import it in Blender and export glTF"),
            ("c.dae", "COLLADA is not supported; convert it with `assimp"),
            ("c.3mf", "3MF is not supported; convert it to STL with `prusa-slicer"),
            ("c.blend", "a Blender file is not supported; open it in Blender"),
            ("c.xml", "a Mitsuba scene is not supported; import it in Blender"),
            ("c.pbrt", "a pbrt scene is not supported; write its meshes as PLY"),
            ("c.drc", "Draco data without glTF is not supported; convert it to PLY with `draco_decoder"),
            ("c.splat", "a cloud of Gaussian splats is not supported; it has no faces"),
            ("c.spz", "a cloud of Gaussian splats is not supported; it has no faces"),
            ("c.dxf", "DXF is not supported; import it in"),
            ("c.ifc", "IFC is not supported; convert it with `IfcConvert in.ifc out.glb`"),
            ("c.skp", "a SketchUp file is not supported; open it in SketchUp"),
            ("c.max", "a 3ds Max file is not supported; open it in 3ds Max"),
            ("c.3dm", "a Rhino file is not supported; open it in Rhino"),
            ("c.zip", "an archive is not supported; unpack it"),
            ("c.abcd", "unsupported scene format; use OBJ"),
        ] {
            let error = file(name, "").unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    /// What people find in place of a file, whatever its name.
    #[test]
    fn other_content_is_named() {
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
        for (content, words) in [
            (pointer.as_bytes(), "content: a pointer of Git LFS in place of the file"),
            ("\u{feff}\n<!DOCTYPE HTML>\n<html>".as_bytes(), "content: a web page in place of the file"),
            (b"PK\x03\x04\x14\0\0\0", "content: a ZIP archive"),
            (b"\x89PNG\r\n\x1a\n", "content: an image in place of a model"),
        ] {
            for name in ["a.obj", "a.ply", "a.stl", "a.off", "a.gltf", "a.glb"] {
                let error = file(name, content).unwrap_err().to_string();
                assert!(error.contains(words), "{name}: {error}");
            }
            assert!(matches!(file("a", content), Err(ReadError::UnknownFormat { .. })));
        }
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("a.png", pointer);
        write("a.mtl", "newmtl c\nmap_Kd a.png\n");
        write("a.obj", "mtllib a.mtl\nusemtl c\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
        let warnings = read(&folder.path().join("a.obj")).unwrap().warnings;
        assert!(warnings.len() == 1 && warnings[0].contains("a pointer of Git LFS"), "{warnings:?}");
        for empty in ["a.obj", "a.gltf"] {
            let error = file(empty, b"").unwrap_err().to_string();
            assert!(error.ends_with(": the file is empty"), "{error}");
        }
    }

    #[test]
    fn io_errors_contain_path_and_source() {
        let error = read(Path::new("absent/model.obj")).unwrap_err();
        assert!(error.to_string().starts_with("absent/model.obj: cannot read file: "), "{error}");
        assert!(std::error::Error::source(&error).is_some());
        assert_eq!(error.path(), Path::new("absent/model.obj"));
        assert!(matches!(read(Path::new(".")), Err(ReadError::Io { .. })));
    }

    #[test]
    fn text_may_be_utf16() {
        let folder = tempfile::tempdir().unwrap();
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            let encoded = |text: &str| text.encode_utf16().flat_map(order).collect::<Vec<u8>>();
            for mark in ["\u{feff}", ""] {
                let write = |name: &str, text: &str| {
                    let path = folder.path().join(name);
                    std::fs::write(&path, encoded(&format!("{mark}{text}"))).unwrap();
                    path
                };
                write("a.mtl", "newmtl c\nKd 1 0 0\n");
                let scene = read(&write("a.obj", OBJ)).unwrap();
                assert_eq!((scene.n_placed_triangles(), scene.materials[0].base_color), (3, [1.0, 0.0, 0.0]));
                assert_eq!(scene.warnings, [""; 0]);
                assert_eq!(read(&write("a.ply", PLY)).unwrap().n_placed_triangles(), 1);
                #[cfg(feature = "stl")]
                for name in ["a.stl", "b"] {
                    assert_eq!(read(&write(name, STL)).unwrap().n_placed_triangles(), 1);
                }
                #[cfg(feature = "off")]
                assert_eq!(read(&write("a.off", OFF)).unwrap().n_placed_triangles(), 3);
            }
        }
    }

    #[cfg(feature = "gzip")]
    #[test]
    fn gzip_files_are_decompressed() {
        use std::io::Write;

        let compressed = |bytes: &[u8]| {
            let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
            encoder.write_all(bytes).unwrap();
            encoder.finish().unwrap()
        };
        let obj = &OBJ.as_bytes()["mtllib a.mtl\n".len()..];
        assert_eq!(file("a.obj.gz", &compressed(obj)).unwrap().n_placed_triangles(), 3);
        assert_eq!(file("a.OBJ.GZ", &compressed(obj)).unwrap().n_placed_triangles(), 3);
        assert_eq!(file("a.obj", &compressed(obj)).unwrap().n_placed_triangles(), 3);
        assert_eq!(file("a.gz", &compressed(PLY.as_bytes())).unwrap().n_placed_triangles(), 1);
        assert!(file("f.obj.gz", obj).unwrap_err().to_string().ends_with("f.obj.gz: header: not a gzip file"));
        let (a, b) = PLY.as_bytes().split_at(40);
        assert_eq!(file("b.gz", &[compressed(a), compressed(b)].concat()).unwrap().n_placed_triangles(), 1);
        assert!(matches!(file("c.gz", &compressed(obj)), Err(ReadError::UnknownFormat { .. })));
        let full = compressed(PLY.as_bytes());
        for length in 2..full.len() {
            assert!(file("d.ply.gz", &full[..length]).is_err(), "{length} bytes");
        }
        for at in 2..full.len() {
            let mut bytes = full.clone();
            bytes[at] ^= 0x55;
            // Bytes of the header such as the time do not matter; the checksum covers the content.
            if let Ok(scene) = file("e.ply.gz", &bytes) {
                assert_eq!(scene.n_placed_triangles(), 1);
            }
        }
    }
}
