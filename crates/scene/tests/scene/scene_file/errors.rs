//! Errors contain file, line, key and value.

use super::*;
use canted_scene::Material;

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
fn full_file_is_valid() {
    parse(FULL).unwrap();
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
    assert!(
        parse("camera = 3")
            .unwrap_err()
            .to_string()
            .contains("invalid value 3 for 'camera' in the file: expected a table")
    );
    assert!(
        parse("lights = [3]")
            .unwrap_err()
            .to_string()
            .contains("invalid value [3] for 'lights' in the file: expected an array")
    );
}
