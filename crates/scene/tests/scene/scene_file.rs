//! Scene files: parsing, errors, loading, writing.

use std::path::Path;

use canted_scene::{
    AlphaMode, Camera, CurveSegments, Curves, EnvironmentSource, Lens, Light, Material, Placement, Projection,
    ReadError, Scene, SceneFile,
};
use proptest::prelude::*;

/// A file with every kind of table.
const FULL: &str = r#"
[settings]
size = "64x48"
spp = 4
ao_radius = inf
filter = "tent"
aovs = ["depth", "normal"]

[camera]
eye = [1, 2, 3.5]
target = [0.0, 1e-3, 0]
up = [0, 1, 0]
fov_degrees = 40
aperture_radius = 0.1
focus_distance = 3

[[lights]]
type = "sun"
direction = [0, -2, 0]
irradiance = [3, 3, 3]

[[lights]]
type = "point"
position = [0, 5, 0]
intensity = [1, 0, 0]

[[lights]]
type = "spot"
position = [0, 5, 0]
direction = [0.3, -1, 0.1]
intensity = [9, 9, 9]
inner_degrees = 20
outer_degrees = 90

[[lights]]
type = "sphere"
center = [0, 5, 0]
radius = 0.5
radiance = [1, 1, 1]

[[lights]]
type = "disc"
center = [0, 5, 0]
normal = [0, -1, 0]
radius = 0.5
radiance = [1, 1, 1]

[environment]
constant = [0.1, 0.2, 0.3]

[[assets]]
name = "a"
file = "a.obj"
time = 0.5

[[assets]]
name = "b"
file = "sub/b.obj"
material = "glass"

[[assets]]
name = "bridge"
builtin = true

[[instances]]
asset = "a"

[[instances]]
asset = "a"
translation = [1, 2, 3]
axis = [0, 0, 5]
angle_degrees = 90
scale = [1, 2, -3]
close = { angle_degrees = 91 }

[[instances]]
asset = "b"
matrix = [[1, 0, 0, 7], [0, 1, 0, 8], [0, 0.5, 1, 9]]
[instances.close]
matrix = [[1, 0, 0, 8], [0, 1, 0, 8], [0, 0.5, 1, 9]]

[[materials]]
name = "glass"
transmission = 1
roughness = 0
specular = 1
ior = 1.33
thin_walled = false

[[overrides]]
material = "red"
asset = "a"
base_color = [1, 0, 0]
emission = [2, 0, 0]
alpha_mode = "mask"
alpha_cutoff = 0.25
base_color_texture = "none"
"#;

/// Two triangles, one red and one green.
const TWO: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl green\nf 1 3 4\n";
const TWO_MTL: &str = "newmtl red\nKd 0.5 0 0\nnewmtl green\nKd 0 0.5 0\n";

/// A folder with `a.obj` (two materials) and `sub/b.obj` (one triangle).
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("a.obj"), TWO).unwrap();
    std::fs::write(folder.path().join("a.mtl"), TWO_MTL).unwrap();
    std::fs::write(folder.path().join("sub/b.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    folder
}

fn parse(text: &str) -> Result<SceneFile, ReadError> {
    SceneFile::parse(text.as_bytes(), Path::new("scene.toml"))
}

/// Clears line numbers and comments, which do not round-trip.
fn without_lines(mut file: SceneFile) -> SceneFile {
    file.assets.iter_mut().for_each(|asset| asset.line = 0);
    file.instances.iter_mut().flatten().for_each(|instance| instance.line = 0);
    file.materials.iter_mut().for_each(|material| material.line = 0);
    file.overrides.iter_mut().for_each(|change| change.line = 0);
    if let Some(EnvironmentSource::Image { line, .. }) = &mut file.environment {
        *line = 0;
    }
    for setting in &mut file.settings {
        setting.line = 0;
        setting.comment.clear();
    }
    file
}

// Errors contain file, line, key and value.

/// Asserts that [`FULL`] with `from` replaced by `to` is rejected with a message that contains all `words`.
#[track_caller]
fn rejected(from: &str, to: &str, words: &[&str]) {
    assert!(FULL.contains(from), "{from}");
    let text = FULL.replacen(from, to, 1);
    let changed = FULL.find(from).unwrap();
    let first = 1 + FULL[..changed].matches('\n').count();
    let message = parse(&text).expect_err(to).to_string();
    assert!(!message.contains('\n'), "{message}");
    assert!(message.starts_with("scene.toml: line "), "{message}");
    for word in words {
        assert!(message.contains(word), "{word:?} is not in: {message}");
    }
    // The line is a changed one, or that of the table if a name or key is missing.
    let line: usize = message["scene.toml: line ".len()..].split(':').next().unwrap().parse().unwrap();
    let of_table = ["missing key", "duplicate asset", "unknown asset", "unknown material"]
        .iter()
        .any(|word| message.contains(word));
    let last = first + to.matches('\n').count();
    assert!((first..=last).contains(&line) || of_table, "{first}..={last}: {message}");
}

#[test]
fn every_kind_of_light_is_read() {
    let lights = parse(FULL).unwrap().lights.unwrap();
    for (kind, name) in Light::KINDS.iter().enumerate() {
        assert!(lights.iter().any(|light| light.kind() == kind), "FULL has no light of type {name}");
    }
}

#[test]
fn unknown_keys_suggest_the_closest() {
    rejected("[camera]", "[kamera]", &["unknown key 'kamera' in the file", "'camera'"]);
    rejected("eye =", "eyes =", &["unknown key 'eyes' in [camera]", "'eye'"]);
    rejected("radius = 0.5", "raduis = 0.5", &["unknown key 'raduis' in a light of type sphere", "'radius'"]);
    rejected(
        "direction = [0, -2, 0]",
        "direction = [0, -2, 0]\nradius = 1",
        &["unknown key 'radius' in a light of type sun"],
    );
    rejected("ior = 1.33", "oir = 1.33", &["unknown key 'oir' in [[materials]]", " ior,"]);
    rejected("angle_degrees = 91", "angel_degrees = 91", &["unknown key 'angel_degrees' in [instances.close]"]);
    rejected("builtin = true", "built_in = true", &["'built_in'", "'builtin'"]);
}

#[test]
fn invalid_values_are_quoted() {
    rejected(
        "eye = [1, 2, 3.5]",
        "eye = [1, 2]",
        &["invalid value [1, 2] for 'eye' in [camera]: expected an array of 3 numbers"],
    );
    rejected("eye = [1, 2, 3.5]", "eye = [1, 2, nan]", &["[1, 2, nan]", "finite"]);
    rejected("eye = [1, 2, 3.5]", "eye = \"here\"", &["\"here\""]);
    rejected("eye = [1, 2, 3.5]", "eye = { x = 1 }", &["{ x = 1 }"]);
    rejected("fov_degrees = 40", "fov_degrees = 180", &["'fov_degrees'", "180", "between 0 and 180"]);
    rejected("fov_degrees = 40", "fov_degrees = 40\nheight = 2", &["'height'", "'fov_degrees'"]);
    rejected("target = [0.0, 1e-3, 0]", "target = [1, 2, 3.5]", &["'target'", "other than 'eye'"]);
    rejected("up = [0, 1, 0]", "up = [0, 0, 0]", &["'up'", "parallel to the view"]);
    rejected("aperture_radius = 0.1", "aperture_radius = -0.1", &["'aperture_radius'", "-0.1", "0 or more"]);
    rejected("focus_distance = 3", "focus_distance = 0", &["'focus_distance'", "greater than 0"]);
    rejected("focus_distance = 3", "focus_distance = 1e39", &["1e39"]);
    rejected("radius = 0.5", "radius = -0.5", &["'radius'", "-0.5", "greater than 0"]);
    rejected("direction = [0, -2, 0]", "direction = [0, 0, 0]", &["'direction'", "nonzero length"]);
    rejected("irradiance = [3, 3, 3]", "irradiance = [3, -3, 3]", &["'irradiance'", "[3, -3, 3]", "0 or more"]);
    rejected("outer_degrees = 90", "outer_degrees = 20", &["'outer_degrees'", "20", "greater than 'inner_degrees'"]);
    for narrow in ["0.01", "0.0139"] {
        let cone = format!("outer_degrees = {narrow}");
        let words = ["'outer_degrees'", narrow, "differs from that of 'inner_degrees', 0,", "at least 0.014"];
        rejected("inner_degrees = 20\nouter_degrees = 90", &cone, &words);
    }
    parse(&FULL.replacen("inner_degrees = 20\nouter_degrees = 90", "outer_degrees = 0.014", 1)).unwrap();
    let upright = FULL.replacen("up = [0, 1, 0]\n", "", 1).replacen("eye = [1, 2, 3.5]", "eye = [0.0, 2, 0]", 1);
    assert!(parse(&upright).unwrap_err().to_string().contains("missing key 'up' in [camera]: expected a direction"));
    rejected("file = \"a.obj\"", "file = \"\"", &["invalid value \"\" for 'file' in [[assets]]: expected a file name"]);
    rejected("type = \"sun\"", "type = \"son\"", &["'type'", "\"son\"", "did you mean 'sun'"]);
    rejected("constant = [0.1, 0.2, 0.3]", "constant = [0.1, 0.2, -0.3]", &["'constant'", "-0.3"]);
    rejected("constant =", "turn_degrees = 3\nconstant =", &["'turn_degrees'", "'image'"]);
    rejected("constant =", "image = \"a.exr\"\nconstant =", &["'image'", "'constant'"]);
    rejected("scale = [1, 2, -3]", "scale = [1, 0, 1]", &["'scale'", "[1, 0, 1]"]);
    rejected("axis = [0, 0, 5]", "axis = [0, 0, 0]", &["'axis'"]);
    rejected("matrix = [[1, 0, 0, 7], [0", "matrix = [[0, 0, 0, 7], [0", &["'matrix'", "determinant"]);
    rejected("matrix = [[1, 0, 0, 7], [0", "matrix = [[1, 0, 7], [0", &["'matrix'", "3 rows of 4"]);
    rejected("matrix = [[1, 0, 0, 8], [0, 1, 0, 8], [0, 0.5, 1, 9]]", "scale = [1, 1, 1]", &["'scale'", "'matrix'"]);
    rejected("asset = \"b\"", "asset = \"b\"\nscale = [1, 1, 1]", &["'scale'", "'matrix'"]);
    rejected("ior = 1.33", "ior = 0.9", &["'ior'", "0.9", "from 1 to 1000"]);
    rejected("ior = 1.33", "ior = 1e20", &["'ior'", "1e20", &format!("from 1 to {}", Material::MAX_IOR)]);
    rejected("thin_walled = false", "thin_walled = 0", &["'thin_walled'", "true or false"]);
    rejected("base_color = [1, 0, 0]", "base_color = [2, 0, 0]", &["'base_color'", "from 0 to 1"]);
    rejected("alpha_mode = \"mask\"", "alpha_mode = \"masked\"", &["'alpha_mode'", "did you mean 'mask'"]);
    rejected("spp = 4", "spp = 2020-01-01", &["'spp'", "2020-01-01"]);
}

#[test]
fn names_must_be_known_and_unique() {
    rejected("name = \"b\"", "name = \"a\"", &["duplicate asset", "'a'"]);
    rejected("asset = \"b\"", "asset = \"bb\"", &["unknown asset 'bb'"]);
    rejected("asset = \"a\"\nbase", "asset = \"c\"\nbase", &["unknown asset 'c'"]);
    rejected("material = \"glass\"", "material = \"gloss\"", &["unknown material 'gloss'", "'glass'"]);
    rejected("name = \"a\"\n", "", &["missing key 'name' in [[assets]]"]);
    rejected("file = \"a.obj\"\n", "", &["missing key 'file'"]);
    rejected("builtin = true", "builtin = true\nfile = \"x\"", &["'file'", "'builtin'"]);
}

#[test]
fn invalid_toml_is_reported_with_line() {
    rejected("[camera]", "[camera", &["line 9"]);
    rejected("spp = 4", "spp = 4\nspp = 5", &["duplicate key 'spp'"]);
    let message = SceneFile::parse(b"# a\n# \xff", Path::new("x")).unwrap_err().to_string();
    assert_eq!(message, "x: line 2: invalid UTF-8");
    assert!(parse(&format!("a = {}", "[".repeat(100_000))).is_err());
    for (text, words) in [
        ("camera = 3", "invalid value 3 for 'camera' in the file: expected a table"),
        ("lights = [3]", "invalid value [3] for 'lights' in the file: expected an array"),
    ] {
        let message = parse(text).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

// Loading scene files.

fn load(text: &str) -> Result<Scene, ReadError> {
    let folder = folder();
    SceneFile::parse(text.as_bytes(), &folder.path().join("scene.toml"))?.load()
}

/// Asserts that loading fails with a message that contains all `words`.
#[track_caller]
fn not_loaded(text: &str, words: &[&str]) {
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
    not_loaded(&format!("{a}[[overrides]]\nmaterial = 'rod'"), &["line 4", "unknown material 'rod'", "'red'"]);
    not_loaded(
        &format!("{a}[[overrides]]\nmaterial = 'red'\nbase_color_texture = 'a.mtl'"),
        &["line 4", "a.mtl", "PNG"],
    );
    not_loaded(&format!("{a}[[overrides]]\nmaterial = 'red'\nbase_color_texture = 'no.png'"), &["line 4", "no.png"]);
    let of_file = "scene.toml: line 2: 'file' in [[assets]]: ";
    not_loaded("# a\n[[assets]]\nname = 'a'\nfile = 'no.obj'", &[of_file, "no.obj: cannot read file: "]);
    not_loaded("# a\n[[assets]]\nname = 'a'\nfile = 'a.mtl'", &[of_file, "a.mtl: unsupported scene format"]);
    let of_image = "scene.toml: line 4: 'image' in [environment]: ";
    not_loaded(&format!("{a}[environment]\nimage = 'no.hdr'"), &[of_image, "no.hdr: cannot read file: "]);
    not_loaded(
        &format!("{a}[environment]\nimage = 'a.obj'"),
        &[of_image, "a.obj: environment map: unsupported format"],
    );
    not_loaded("", &["nothing to draw"]);
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

/// A pipe has no end until its writer closes it, and a device may have none.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_by_name() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    assert!(std::process::Command::new("mkfifo").arg(path("p.obj")).status().unwrap().success());
    std::os::unix::fs::symlink("/dev/zero", path("z.obj")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", path("z.toml")).unwrap();
    for name in ["p.obj", "z.obj", "."] {
        for (text, key) in [
            (format!("[[assets]]\nname = 'a'\nfile = '{name}'"), "'file' in [[assets]]: "),
            (
                format!("[environment]\nimage = '{name}'\n[[assets]]\nname = 'a'\nfile = 'a.obj'"),
                "'image' in [environment]: ",
            ),
            (
                format!(
                    "[[overrides]]\nmaterial = 'red'\nbase_color_texture = '{name}'\n[[assets]]\nname = 'a'\nfile = 'a.obj'"
                ),
                "cannot load texture ",
            ),
        ] {
            let error = SceneFile::parse(text.as_bytes(), &path("s.toml")).unwrap().load().unwrap_err().to_string();
            assert!(error.contains("s.toml: line 1: ") && error.contains(key), "{error}");
            assert!(error.contains(name) && error.ends_with("not a regular file"), "{error}");
        }
    }
    let error = SceneFile::read(&path("z.toml")).unwrap_err().to_string();
    assert!(error.contains("z.toml: a scene file of more than 67108864 bytes"), "{error}");
}

#[test]
fn assets_state_where_their_images_are() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(path("models/deep")).unwrap();
    std::fs::create_dir(path("maps")).unwrap();
    image::RgbImage::new(1, 1).save(path("maps/a.png")).unwrap();
    image::RgbImage::new(1, 1).save(path("models/b.png")).unwrap();
    let quad = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
    std::fs::write(path("models/deep/m.obj"), quad).unwrap();
    std::fs::write(path("models/deep/m.mtl"), "newmtl a\nmap_Kd A.png\nnewmtl b\nmap_Kd ../b.png\n").unwrap();
    let read = |keys: &str| {
        let text = format!("[[assets]]\nname = 'm'\nfile = 'models/deep/m.obj'\n{keys}");
        SceneFile::parse(text.as_bytes(), &path("s.toml"))
    };
    let textures = |keys: &str| {
        let scene = read(keys).unwrap().load().unwrap();
        (scene.textures.len(), scene.warnings.len())
    };
    assert_eq!(textures(""), (0, 2));
    assert_eq!(textures("texture_path = 'maps'"), (1, 1));
    assert_eq!(textures("texture_path = ['models', 'maps']"), (2, 0));
    assert_eq!(textures("allow_parent = true"), (1, 1));
    assert_eq!(textures("texture_path = 'maps'\nallow_parent = true"), (2, 0));
    let error = read("texture_path = 'none'").unwrap().load().unwrap_err().to_string();
    assert!(error.contains("'file' in [[assets]]") && error.contains("none: cannot read file"), "{error}");
    let error = read("texture_path = 3").unwrap_err().to_string();
    assert!(
        error.contains("invalid value 3 for 'texture_path'") && error.contains("a folder or a list of folders"),
        "{error}"
    );

    let generated = SceneFile::for_scene(Some(&path("models/deep/m.obj")), &path("models/s.toml")).unwrap();
    let generated = generated.with_texture_paths(&[path("maps")]).unwrap().with_allow_parent(true);
    let reread = SceneFile::parse(generated.to_toml().as_bytes(), generated.path()).unwrap();
    assert_eq!(reread.assets[0].texture_path, ["../maps"]);
    assert!(reread.assets[0].allow_parent);
    let moved = read("texture_path = ['maps', 'models']").unwrap().moved_to(&path("models/t.toml")).unwrap();
    assert_eq!(moved.assets[0].texture_path, ["../maps", "."]);
    let reread = SceneFile::parse(moved.to_toml().as_bytes(), moved.path()).unwrap();
    assert_eq!(reread.assets[0].texture_path, moved.assets[0].texture_path);
}

#[test]
fn lines_may_end_in_any_way() {
    for end in ["\n", "\r\n", "\r", "\r\r\n"] {
        let file = SceneFile::parse(FULL.replace('\n', end).as_bytes(), Path::new("s.toml"));
        assert_eq!(file.unwrap().settings.len(), 5, "{end:?}");
        let wrong = "[[assets]]\n\nname = 3\n".replace('\n', end);
        let error = SceneFile::parse(wrong.as_bytes(), Path::new("s.toml")).unwrap_err().to_string();
        assert!(error.contains("line 3"), "{error}");
    }
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

/// Curves have texture coordinates, but no normal maps.
#[test]
fn curves_have_textures_but_no_normal_maps() {
    let folder = folder();
    image::RgbImage::new(1, 1).save(folder.path().join("t.png")).unwrap();
    let load = |slot: &str| {
        let curves = "[[curves]]\npoints = [[0, 0, 0], [1, 0, 0]]\nradii = 1\nmaterial = 'm'\n";
        let text = format!("{curves}[[materials]]\nname = 'm'\n{slot} = 't.png'");
        SceneFile::parse(text.as_bytes(), &folder.path().join("s.toml")).unwrap().load()
    };
    let scene = load("base_color_texture").unwrap();
    assert!(scene.materials[scene.meshes[0].material_of(0).0 as usize].base_color_texture.is_some());
    let message = load("normal_texture").unwrap_err().to_string();
    assert!(
        message.ends_with(
            "line 5: cannot texture material 'm': mesh 'curves' is made of curves, which have no normal maps"
        ),
        "{message}"
    );
}

/// Sixteen points for each patch; they are instances after those of curves, are written as read, and have textures but no normal maps.
#[test]
fn patches_have_sixteen_points() {
    let points = |n: usize| {
        let all: Vec<String> = (0..n).map(|k| format!("[{}, {}, {}]", k / 4, k % 4, k / 16)).collect();
        format!("points = [{}]\n", all.join(", "))
    };
    let text = format!(
        "[[patches]]\n{}color = [1, 0, 0]\n[[patches]]\nname = \"a\"\nmaterial = \"m\"\n{}[[materials]]\nname = \"m\"\n\
         [[curves]]\npoints = [[0, 0, 0], [1, 0, 0]]\nradii = 1\n",
        points(32),
        points(16)
    );
    let file = parse(&text).unwrap();
    let scene = file.load().unwrap();
    let firsts: Vec<u32> = scene.instances.iter().map(|instance| instance.first_primitive).collect();
    assert_eq!((firsts, scene.n_placed_segments()), (vec![0, 1, 3], 4));
    let Some(Curves { segments: CurveSegments::Patches(list), radii, .. }) = &scene.meshes[1].curves else {
        panic!("patches")
    };
    assert_eq!((list.len(), list[1][5], &radii[..]), (2, 21, &[0.0; 32][..]));
    assert_eq!(scene.meshes[1].positions[21], [5.0, 1.0, 1.0]);
    assert_eq!((scene.meshes[1].strands().len(), scene.meshes[1].strand_coordinates()), (2, vec![[0.0, 1.0]; 2]));
    let color = |mesh: usize| scene.materials[scene.meshes[mesh].material_of(0).0 as usize].base_color;
    assert_eq!(color(1), [1.0, 0.0, 0.0]);
    let again = parse(&file.to_toml()).unwrap().load().unwrap();
    assert_eq!(again.meshes[1].positions, scene.meshes[1].positions);
    assert_eq!(again.meshes[2].curves, scene.meshes[2].curves);
    for (text, words) in [
        (points(15), "15 points in [[patches]]: expected 16 for each patch"),
        (points(0), "0 points"),
        (format!("{}colors = [[1, 0, 0]]", points(16)), "1 colors for 16 points"),
        (format!("{}radii = 1", points(16)), "radii"),
        (format!("{}material = 'x'", points(16)), "unknown material 'x'"),
        (points(16).replace("[1, 1, 0]", "[1, nan, 0]"), "expected an array of 3 numbers (finite)"),
    ] {
        let message = parse(&format!("[[patches]]\n{text}")).unwrap_err().to_string();
        assert!(message.to_lowercase().contains(words), "{message}");
    }
    let folder = folder();
    image::RgbImage::new(1, 1).save(folder.path().join("t.png")).unwrap();
    let text =
        format!("[[patches]]\n{}material = 'm'\n[[materials]]\nname = 'm'\nnormal_texture = 't.png'", points(16));
    let message = SceneFile::parse(text.as_bytes(), &folder.path().join("s.toml")).unwrap().load().unwrap_err();
    assert!(message.to_string().ends_with("mesh 'patches' is made of patches, which have no normal maps"), "{message}");
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

// Mutated files never panic, and accepted files round-trip.

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn mutated_files_are_read_or_rejected(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..4), 1..8)) {
        let mut bytes = FULL.as_bytes().to_vec();
        for (at, byte, kind) in edits {
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => bytes.insert(at, b"[]{}=.\"\n#'-0eE_"[usize::from(byte) % 15]),
                2 => drop(bytes.drain(at..bytes.len().min(at + usize::from(byte)))),
                _ => bytes.truncate(at.max(1)),
            }
            if bytes.is_empty() {
                bytes.push(b'\n');
            }
        }
        match SceneFile::parse(&bytes, Path::new("scene.toml")) {
            Ok(file) => {
                let text = file.to_toml();
                let back = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
                prop_assert_eq!(format!("{:?}", without_lines(back)), format!("{:?}", without_lines(file)));
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n'), "{}", error),
        }
    }
}

// Written scene files parse back to the same values.

#[track_caller]
fn round_trips(file: &SceneFile) {
    let text = file.to_toml();
    let back = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(format!("{:?}", without_lines(back.clone())), format!("{:?}", without_lines(file.clone())), "{text}");
    assert_eq!(back.to_toml().len(), parse(&back.to_toml()).unwrap().to_toml().len());
}

#[test]
fn full_file_round_trips() {
    round_trips(&parse(FULL).unwrap());
}

/// Both spellings are read, and one is written.
#[test]
fn disk_lights_have_one_name_in_written_files() {
    let file = parse(FULL).unwrap();
    let other = parse(&FULL.replace("\"disc\"", "\"disk\"")).unwrap();
    assert_eq!(file.lights, other.lights);
    assert!(file.to_toml().contains("type = \"disk\""));
}

#[test]
fn empty_arrays_round_trip() {
    round_trips(&parse("").unwrap());
    let file = parse("lights = []\ninstances = []").unwrap();
    assert_eq!((file.lights.as_deref(), file.instances.as_deref()), (Some(&[][..]), Some(&[][..])));
    round_trips(&file);
}

#[test]
fn any_string_round_trips() {
    for name in ["", "\"", "\\", "a\nb\t\u{0}\u{7f}", "\u{1f9ca} \u{2028}", "'''", "# no"] {
        let mut file = parse("[[assets]]\nname = 'x'\nbuiltin = true").unwrap();
        name.clone_into(&mut file.assets[0].name);
        round_trips(&file);
    }
}

/// An empty scene file with a change.
fn with(change: impl FnOnce(&mut SceneFile)) -> SceneFile {
    let mut file = parse("").unwrap();
    change(&mut file);
    file
}

/// Any finite number.
fn number() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite())
}

fn positive() -> impl Strategy<Value = f32> {
    number().prop_map(f32::abs).prop_filter("above zero", |&x| x > 0.0)
}

proptest! {
    #[test]
    fn any_camera_round_trips(eye: [i16; 3], target in prop::array::uniform3(number()), fov_degrees in 1e-3_f32..179.9,
                             radius in positive(), focus_distance in positive(), flat: bool) {
        let eye = eye.map(f32::from);
        let mut camera = Camera::pinhole(eye, target, [0.5, 1.0, -0.25], fov_degrees);
        camera.lens = Some(Lens { radius, focus_distance });
        if flat {
            camera.projection = Projection::Orthographic { height: radius };
        }
        round_trips(&with(|file| file.camera = Some(camera)));
    }

    #[test]
    fn any_spot_round_trips(direction in prop::array::uniform3(-1.0_f32..1.0), a in -1.0_f32..=1.0, b in -1.0_f32..=1.0,
                           n in 1_u8..4) {
        // Covers cosines near one, as for narrow cones.
        let [a, b] = [a, b].map(|x| 1.0 - (1.0 - x) / 1000_f32.powi(n.into()));
        prop_assume!(a != b);
        let length = direction.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        prop_assume!(length > 0.0);
        let direction = direction.map(|x| (f64::from(x) / length) as f32);
        let light = Light::Spot {
            position: [0.0; 3], direction, intensity: [1.0; 3], cos_inner: a.max(b), cos_outer: a.min(b),
        };
        round_trips(&with(|file| file.lights = Some(vec![light])));
    }
}

#[test]
fn extreme_cones_round_trip() {
    for (cos_inner, cos_outer) in [(1.0, 0.0), (0.0, -1.0), (1.0, 1.0_f32.next_down()), ((-1_f32).next_up(), -1.0)] {
        let (position, direction, intensity) = ([0.0; 3], [0.0, -1.0, 0.0], [1.0; 3]);
        let light = Light::Spot { position, direction, intensity, cos_inner, cos_outer };
        round_trips(&with(|file| file.lights = Some(vec![light])));
    }
}

#[test]
fn load_explicit_keeps_the_scene_and_is_idempotent() {
    let folder = folder();
    let path = folder.path().join("scene.toml");
    let file = SceneFile::parse(FULL.as_bytes(), &path).unwrap();
    let (scene, full) = file.load_explicit().unwrap();
    // `green` is not in the original file.
    assert!(full.overrides.iter().any(|change| change.material == "green"));
    let text = full.to_toml();
    let back = SceneFile::parse(text.as_bytes(), &path).unwrap();
    let (again, again_full) = back.load_explicit().unwrap();
    let parts = |scene: &Scene| format!("{:?}", (&scene.instances, &scene.materials, &scene.lights, &scene.cameras));
    assert_eq!(parts(&again), parts(&scene));
    assert_eq!(format!("{:?}", without_lines(again_full)), format!("{:?}", without_lines(back)));
}

/// Materials with equal names keep only the fields that the scene file sets.
#[test]
fn overrides_of_ambiguous_names_are_kept() {
    let folder = folder();
    std::fs::write(folder.path().join("a.mtl"), TWO_MTL.replace("green", "red")).unwrap();
    let text = "[[assets]]\nname = \"a\"\nfile = \"a.gltf\"\n\
                [[overrides]]\nmaterial = \"red\"\nbase_color = [0, 0, 1]\n\
                [[overrides]]\nmaterial = \"red\"\nroughness = 0.25\n";
    let gltf = r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "materials": [{ "name": "red" }, { "name": "red", "pbrMetallicRoughness": { "metallicFactor": 0.5 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 },
                                    { "attributes": { "POSITION": 0 }, "material": 1 }] }],
        "accessors": [{ "componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "byteLength": 36, "uri": "a.bin" }] }"#;
    std::fs::write(folder.path().join("a.gltf"), gltf).unwrap();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    std::fs::write(folder.path().join("a.bin"), corners.concat()).unwrap();
    let path = folder.path().join("scene.toml");
    let (scene, full) = SceneFile::parse(text.as_bytes(), &path).unwrap().load_explicit().unwrap();
    assert_eq!(full.overrides.len(), 1);
    let again = SceneFile::parse(full.to_toml().as_bytes(), &path).unwrap().load().unwrap();
    assert!(again.materials.iter().filter(|material| material.base_color == [0.0, 0.0, 1.0]).count() == 2);
    assert_eq!(format!("{:?}", again.materials), format!("{:?}", scene.materials));
}

/// Files referenced by an asset lie next to the link, not next to its target.
#[test]
#[cfg(unix)]
fn links_are_not_followed() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("store")).unwrap();
    std::fs::rename(folder.path().join("a.obj"), folder.path().join("store/1f2e.obj")).unwrap();
    std::os::unix::fs::symlink("store/1f2e.obj", folder.path().join("a.obj")).unwrap();
    let file = SceneFile::parse(FULL.as_bytes(), &folder.path().join("scene.toml")).unwrap();
    let moved = file.moved_to(&folder.path().join("sub/scene.toml")).unwrap();
    assert!(moved.to_toml().contains("\"../a.obj\""), "{}", moved.to_toml());
}

#[test]
fn moved_files_reference_the_same_files() {
    let folder = folder();
    let file = SceneFile::parse(FULL.as_bytes(), &folder.path().join("scene.toml")).unwrap();
    let moved = file.clone().moved_to(&folder.path().join("sub/scene.toml")).unwrap();
    let text = moved.to_toml();
    assert!(text.contains("\"../a.obj\"") && text.contains("\"b.obj\""), "{text}");
    let back = moved.moved_to(&folder.path().join("scene.toml")).unwrap();
    assert_eq!(back.to_toml(), file.to_toml());
}
