//! Loading scene files.

use super::*;
use canted_scene::{AlphaMode, Placement, Scene};

fn load(text: &str) -> Result<Scene, ReadError> {
    let folder = folder();
    SceneFile::parse(text.as_bytes(), &folder.path().join("scene.toml"))?.load()
}

/// Asserts that loading fails with a message that contains all `words`.
#[track_caller]
fn rejected(text: &str, words: &[&str]) {
    let message = load(text).expect_err(text).to_string();
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
}

#[test]
fn single_asset_equals_its_file() {
    let folder = folder();
    let file = SceneFile::for_scene(Some(&folder.path().join("a.obj")), &folder.path().join("sub/scene.toml")).unwrap();
    let (alone, placed) = (canted_scene::read(&folder.path().join("a.obj")).unwrap(), file.load().unwrap());
    assert_eq!(format!("{placed:?}"), format!("{alone:?}"));
    let builtin = SceneFile::for_scene(None, &folder.path().join("scene.toml")).unwrap().load().unwrap();
    assert_eq!(format!("{builtin:?}"), format!("{:?}", canted_scene::builtin()));
}

#[test]
fn instances_share_meshes_and_are_transformed() {
    // The two materials of `a` make two meshes of it.
    let scene = load("[[assets]]\nname = 'a'\nfile = 'a.obj'\n[[assets]]\nname = 'b'\nfile = 'sub/b.obj'").unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (3, 3), "one instance per asset by default");
    assert_eq!(scene.instances.iter().map(|instance| instance.first_primitive).collect::<Vec<_>>(), [0, 1, 2]);

    let scene = load(FULL).unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (3, 5), "the bridge is not instanced");
    assert_eq!(scene.warnings.len(), 2, "unused asset and missing animation: {:?}", scene.warnings);
    assert_eq!(scene.instances.iter().map(|instance| instance.mesh.0).collect::<Vec<_>>(), [0, 1, 0, 1, 2]);
    // A rotation by 90 degrees about z maps x to y and y to -x.
    assert_eq!(scene.instances[2].world_from_object.point([1.0, 1.0, 1.0]), [-1.0, 3.0, 0.0]);
    assert!(scene.instances[0].world_from_object_close.is_none());
    assert!(scene.instances[3].world_from_object_close.is_some());
    let close = scene.instances[4].world_from_object_close.unwrap();
    assert_eq!(close.point([0.0, 2.0, 0.0]), [8.0, 10.0, 10.0]);
}

#[test]
fn rotations_match_quaternions() {
    let (axis, angle_degrees) = ([2.0_f32 / 7.0, 3.0 / 7.0, 6.0 / 7.0], 200.0_f32);
    let placement = Placement::Parts { translation: [0.0; 3], axis, angle_degrees, scale: [1.0; 3] };
    let affine = placement.affine();
    // v + 2 q × (q × v + w v), the rotation by a unit quaternion.
    let (sin, w) = (0.5 * f64::from(angle_degrees)).to_radians().sin_cos();
    let q = axis.map(|x| f64::from(x) * sin);
    let cross = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    };
    for v in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -2.0, 1.0]] {
        let inner = cross(q, v);
        let rotated = cross(q, std::array::from_fn(|k| inner[k] + w * v[k]));
        for k in 0..3 {
            let difference = affine.vector_f64(v)[k] - (v[k] + 2.0 * rotated[k]);
            // Matrix and axis are rounded to f32; the vectors are shorter than 3.
            assert!(difference.abs() <= 3.0 * 3.0 * f64::from(f32::EPSILON), "{k}: {difference}");
        }
    }
}

#[test]
fn overrides_change_only_named_materials() {
    let scene = load(FULL).unwrap();
    let of = |name: &str| scene.materials.iter().find(|material| material.name == name).unwrap();
    let red = of("red");
    assert_eq!((red.base_color, red.emission), ([1.0, 0.0, 0.0], [2.0, 0.0, 0.0]));
    assert_eq!(red.alpha_mode, AlphaMode::Mask { cutoff: 0.25 });
    assert_eq!((of("green").base_color, of("green").emission), ([0.0, 0.5, 0.0], [0.0; 3]));
    let glass = scene.meshes[2].material_of(0);
    assert_eq!(scene.materials[glass.0 as usize].name, "glass");
    assert_eq!(scene.materials[glass.0 as usize].ior, 1.33);
    assert_eq!(scene.materials.len(), 3, "replaced materials are removed");
}

#[test]
fn scene_file_replaces_lights_and_cameras_of_assets() {
    let bridge = "[[assets]]\nname = 'bridge'\nbuiltin = true\n";
    let scene = load(&format!("lights = []\n{bridge}")).unwrap();
    assert_eq!((scene.lights.len(), scene.cameras.len()), (0, 1));
    let scene = load(&format!("{bridge}[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]")).unwrap();
    assert_eq!((scene.lights.len(), scene.cameras.len(), scene.cameras[0].eye), (1, 1, [0.0, 0.0, 1.0]));
}

#[test]
fn loading_errors_name_the_line() {
    let a = "[[assets]]\nname = 'a'\nfile = 'a.obj'\n";
    rejected(&format!("{a}[[overrides]]\nmaterial = 'rod'"), &["line 4", "unknown material 'rod'", "'red'"]);
    rejected(&format!("{a}[[overrides]]\nmaterial = 'red'\nbase_color_texture = 'a.mtl'"), &["line 4", "a.mtl", "PNG"]);
    rejected(&format!("{a}[[overrides]]\nmaterial = 'red'\nbase_color_texture = 'no.png'"), &["line 4", "no.png"]);
    let of_file = "scene.toml: line 2: 'file' in [[assets]]: ";
    rejected("# a\n[[assets]]\nname = 'a'\nfile = 'no.obj'", &[of_file, "no.obj: cannot read file: "]);
    rejected("# a\n[[assets]]\nname = 'a'\nfile = 'a.mtl'", &[of_file, "a.mtl: unsupported scene format"]);
    let of_image = "scene.toml: line 4: 'image' in [environment]: ";
    rejected(&format!("{a}[environment]\nimage = 'no.hdr'"), &[of_image, "no.hdr: cannot read file: "]);
    rejected(&format!("{a}[environment]\nimage = 'a.obj'"), &[of_image, "a.obj: environment map: unsupported format"]);
    rejected("", &["nothing to draw"]);
}

/// A generated scene file has no lines.
#[test]
fn errors_of_generated_files_only_name_the_asset() {
    let folder = folder();
    std::fs::write(folder.path().join("bad.obj"), "v 0 0\n").unwrap();
    let file = SceneFile::for_scene(Some(&folder.path().join("bad.obj")), &folder.path().join("s.toml")).unwrap();
    let message = file.load().unwrap_err().to_string();
    assert!(message.contains("bad.obj: ") && !message.contains("s.toml"), "{message}");
}

#[test]
fn textures_require_texture_coordinates() {
    let folder = folder();
    image::RgbImage::new(1, 1).save(folder.path().join("t.png")).unwrap();
    let text = "[[assets]]\nname = 'a'\nfile = 'a.obj'\n[[overrides]]\nmaterial = 'red'\nbase_color_texture = 't.png'";
    let message =
        SceneFile::parse(text.as_bytes(), &folder.path().join("s.toml")).unwrap().load().unwrap_err().to_string();
    assert!(message.contains("line 4") && message.contains("no texture coordinates"), "{message}");
}

#[test]
fn examples_load() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut n = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        // The other file of this kind has events of `canted view`.
        if path.extension().is_some_and(|ending| ending == "toml") && !path.ends_with("events.toml") {
            let scene = SceneFile::read(&path).unwrap().load().unwrap();
            assert_eq!(scene.warnings, [""; 0], "{}", path.display());
            n += 1;
        }
    }
    assert_eq!(n, 4);
}
