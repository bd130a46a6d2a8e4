//! What is wrong is told by file, line, key and value.

use super::*;
use crate::Material;

/// [`FULL`] with its first `from` replaced is refused with all of `words`.
#[track_caller]
fn refused(from: &str, to: &str, words: &[&str]) {
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
    // The line is one of those changed; where a name is at fault, that of the table.
    let line: usize = message["scene.toml: line ".len()..].split(':').next().unwrap().parse().unwrap();
    let of_table = ["lacks", "two assets", "no asset", "no new material"].iter().any(|word| message.contains(word));
    let last = first + to.matches('\n').count();
    assert!((first..=last).contains(&line) || of_table, "{first}..={last}: {message}");
}

#[test]
fn the_full_file_is_legal() {
    parse(FULL).unwrap();
}

#[test]
fn unknown_keys_name_the_nearest() {
    refused("[camera]", "[kamera]", &["the file has no key `kamera`", "`camera`"]);
    refused("eye =", "eyes =", &["[camera] has no key `eyes`", "`eye`"]);
    refused("radius = 0.5", "raduis = 0.5", &["a light of type sphere has no key `raduis`", "`radius`"]);
    refused("direction = [0, -2, 0]", "direction = [0, -2, 0]\nradius = 1", &["of type sun has no key `radius`"]);
    refused("ior = 1.33", "oir = 1.33", &["[[materials]] has no key `oir`", "`ior`"]);
    refused("angle_degrees = 91", "angel_degrees = 91", &["[instances.close] has no key `angel_degrees`"]);
    refused("builtin = true", "built_in = true", &["`built_in`", "`builtin`"]);
}

#[test]
fn wrong_types_and_values_are_quoted() {
    refused("eye = [1, 2, 3.5]", "eye = [1, 2]", &["`eye` of [camera] is [1, 2], not 3 numbers"]);
    refused("eye = [1, 2, 3.5]", "eye = [1, 2, nan]", &["[1, 2, nan]", "finite"]);
    refused("eye = [1, 2, 3.5]", "eye = \"here\"", &["\"here\""]);
    refused("eye = [1, 2, 3.5]", "eye = { x = 1 }", &["{ x = 1 }"]);
    refused("fov_degrees = 40", "fov_degrees = 180", &["`fov_degrees`", "180", "between 0 and 180"]);
    refused("fov_degrees = 40", "fov_degrees = 40\nheight = 2", &["`height`", "`fov_degrees`"]);
    refused("target = [0.0, 1e-3, 0]", "target = [1, 2, 3.5]", &["`target`", "other than `eye`"]);
    refused("up = [0, 1, 0]", "up = [0, 0, 0]", &["`up`", "across the view"]);
    refused("aperture_radius = 0.1", "aperture_radius = -0.1", &["`aperture_radius`", "-0.1", "0 or more"]);
    refused("focus_distance = 3", "focus_distance = 0", &["`focus_distance`", "above 0"]);
    refused("focus_distance = 3", "focus_distance = 1e39", &["1e39"]);
    refused("radius = 0.5", "radius = -0.5", &["`radius`", "-0.5", "above 0"]);
    refused("direction = [0, -2, 0]", "direction = [0, 0, 0]", &["`direction`", "length is 0"]);
    refused("irradiance = [3, 3, 3]", "irradiance = [3, -3, 3]", &["`irradiance`", "[3, -3, 3]", "0 or more"]);
    refused("outer_degrees = 90", "outer_degrees = 20", &["`outer_degrees`", "20", "more than `inner_degrees`"]);
    for narrow in ["0.01", "0.0139"] {
        let cone = format!("outer_degrees = {narrow}");
        let told = ["`outer_degrees`", narrow, "tells from that of `inner_degrees`, 0;", "0.014 and more"];
        refused("inner_degrees = 20\nouter_degrees = 90", &cone, &told);
    }
    parse(&FULL.replacen("inner_degrees = 20\nouter_degrees = 90", "outer_degrees = 0.014", 1)).unwrap();
    let upright = FULL.replacen("up = [0, 1, 0]\n", "", 1).replacen("eye = [1, 2, 3.5]", "eye = [0.0, 2, 0]", 1);
    assert!(parse(&upright).unwrap_err().to_string().ends_with("[camera] needs `up`, a direction across the view"));
    refused("file = \"a.obj\"", "file = \"\"", &["`file` of [[assets]] is \"\", not the name of a file"]);
    refused("type = \"sun\"", "type = \"son\"", &["`type`", "\"son\"", "the nearest is sun"]);
    refused("constant = [0.1, 0.2, 0.3]", "constant = [0.1, 0.2, -0.3]", &["`constant`", "-0.3"]);
    refused("constant =", "turn_degrees = 3\nconstant =", &["`turn_degrees`", "`image`"]);
    refused("constant =", "image = \"a.exr\"\nconstant =", &["`image`", "`constant`"]);
    refused("scale = [1, 2, -3]", "scale = [1, 0, 1]", &["`scale`", "[1, 0, 1]"]);
    refused("axis = [0, 0, 5]", "axis = [0, 0, 0]", &["`axis`"]);
    refused("matrix = [[1, 0, 0, 7], [0", "matrix = [[0, 0, 0, 7], [0", &["`matrix`", "determinant"]);
    refused("matrix = [[1, 0, 0, 7], [0", "matrix = [[1, 0, 7], [0", &["`matrix`", "3 rows of 4"]);
    refused("matrix = [[1, 0, 0, 8], [0, 1, 0, 8], [0, 0.5, 1, 9]]", "scale = [1, 1, 1]", &["`scale`", "`matrix`"]);
    refused("asset = \"b\"", "asset = \"b\"\nscale = [1, 1, 1]", &["`scale`", "`matrix`"]);
    refused("ior = 1.33", "ior = 0.9", &["`ior`", "0.9", "from 1 to 1000"]);
    refused("ior = 1.33", "ior = 1e20", &["`ior`", "1e20", &format!("from 1 to {}", Material::MAX_IOR)]);
    refused("thin_walled = false", "thin_walled = 0", &["`thin_walled`", "true or false"]);
    refused("base_color = [1, 0, 0]", "base_color = [2, 0, 0]", &["`base_color`", "from 0 to 1"]);
    refused("alpha_mode = \"mask\"", "alpha_mode = \"masked\"", &["`alpha_mode`", "nearest is mask"]);
    refused("spp = 4", "spp = 2020-01-01", &["`spp`", "2020-01-01"]);
}

#[test]
fn names_must_be_known_and_single() {
    refused("name = \"b\"", "name = \"a\"", &["two assets", "\"a\""]);
    refused("asset = \"b\"", "asset = \"bb\"", &["no asset", "\"bb\"", "the nearest is \"b\""]);
    refused("asset = \"a\"\nbase", "asset = \"c\"\nbase", &["no asset", "\"c\""]);
    refused("material = \"glass\"", "material = \"gloss\"", &["no new material", "\"gloss\"", "\"glass\""]);
    refused("name = \"a\"\n", "", &["[[assets]] lacks `name`"]);
    refused("file = \"a.obj\"\n", "", &["lacks `file`"]);
    refused("builtin = true", "builtin = true\nfile = \"x\"", &["`file`", "`builtin`"]);
}

#[test]
fn what_is_no_toml_is_told_by_line() {
    refused("[camera]", "[camera", &["line 9"]);
    refused("spp = 4", "spp = 4\nspp = 5", &["duplicate key `spp`"]);
    let message = SceneFile::parse(b"# a\n# \xff", Path::new("x")).unwrap_err().to_string();
    assert_eq!(message, "x: line 2: the bytes are not UTF-8");
    assert!(parse(&format!("a = {}", "[".repeat(100_000))).is_err());
    assert!(parse("camera = 3").unwrap_err().to_string().contains("`camera` of the file is 3, not a table"));
    assert!(parse("lights = [3]").unwrap_err().to_string().contains("`lights` of the file is [3], not a list"));
}
