//! `canted compare` on pictures with known differences.

use canted_film::{Picture, write_exr};
use image::{Rgb, RgbImage};

use crate::support::Folder;

/// The documented floor of squared references.
const FLOOR: f64 = 1e-2;

/// Largest relMSE of rounding to 8 bits of sRGB: half a step of 255, at most 2.4 times that in linear light (the slope of
/// the curve at white), squared, over the floor.
const EIGHT_BITS: f64 = (2.4 * 0.5 / 255.0) * (2.4 * 0.5 / 255.0) / FLOOR;

/// A folder with pictures of four pixels: `black.png`, `white.png` and `half.png` with two white pixels; and a smaller one.
fn folder() -> Folder {
    let folder = Folder::new();
    let save = |name: &str, width: u32, n_white: u32| {
        let image = RgbImage::from_fn(width, 2, |x, y| Rgb([if width * y + x < n_white { 255 } else { 0 }; 3]));
        image.save(folder.path(name)).unwrap();
    };
    save("black.png", 2, 0);
    save("half.png", 2, 2);
    save("white.png", 2, 4);
    save("small.png", 1, 2);
    folder
}

#[track_caller]
fn assert_numbers(folder: &Folder, pair: &str, want: [f64; 3]) {
    let json = folder.run(&format!("compare {pair} --json")).done().json();
    for (key, want) in ["mean_ratio", "rmse", "relmse"].into_iter().zip(want) {
        let got = json[key].as_f64().unwrap();
        assert!((got - want).abs() <= 1e-12 * want.max(1.0), "{pair}: {key} is {got}, not {want}");
    }
}

#[test]
fn equal_pictures_do_not_differ() {
    let folder = folder();
    for name in ["black.png", "half.png", "white.png"] {
        assert_numbers(&folder, &format!("{name} {name}"), [1.0, 0.0, 0.0]);
        folder.run(&format!("compare {name} {name} --max 0")).done();
    }
}

#[test]
fn differences_follow_their_definition() {
    let folder = folder();
    assert_numbers(&folder, "half.png white.png", [0.5, 0.5f64.sqrt(), 0.5 / (1.0 + FLOOR)]);
    assert_numbers(&folder, "black.png white.png", [0.0, 1.0, 1.0 / (1.0 + FLOOR)]);
    // The second picture is the reference.
    assert_numbers(&folder, "white.png half.png", [2.0, 0.5f64.sqrt(), 0.5 / FLOOR]);
}

#[test]
fn a_limit_determines_the_exit_code() {
    let folder = folder();
    let run = folder.run("compare half.png white.png --max 0.4");
    assert_eq!(run.code, Some(1));
    assert!(run.stdout.contains("relMSE"), "the numbers are printed too: {}", run.stdout);
    folder.run("compare half.png white.png --max 0.5").done();
    folder.run("compare half.png white.png").done();
}

#[test]
fn mean_errors_and_flip_are_reported() {
    let folder = folder();
    let json = folder.run("compare half.png white.png --json --errors errors.png").done().json();
    for key in ["mse", "mae"] {
        assert_eq!(json[key].as_f64().unwrap(), 0.5, "{key}");
    }
    // Two of four pixels are black instead of white, and the filters of FLIP spread the error.
    let flip = json["flip"].as_f64().unwrap();
    assert!((0.5..1.0).contains(&flip), "{flip}");
    assert_eq!(image::open(folder.path("errors.png")).unwrap().to_rgb8().dimensions(), (2, 2));
    let far = folder.run("compare half.png white.png --pixels-per-degree 1 --json").done().json();
    assert_ne!(far["flip"], json["flip"]);
    let json = folder.run("compare half.png half.png --flip hdr --json").done().json();
    assert_eq!((json["hdr_flip"].as_f64(), json["flip"].as_f64()), (Some(0.0), None));
    for wrong in [
        "--pixels-per-degree 0",
        "--pixels-per-degree -1",
        "--pixels-per-degree nan",
        "--flip sdr",
        "--errors missing/errors.png",
        "--errors errors.exr",
    ] {
        let value = wrong.split(' ').next_back().unwrap();
        folder.run(&format!("compare half.png white.png {wrong}")).refused(&[value]);
    }
}

/// A pixel that is not finite exceeds every limit.
#[test]
fn pixels_that_are_not_finite_are_reported() {
    let folder = folder();
    for (name, x) in [("one.exr", 1.0), ("nan.exr", f32::NAN)] {
        let picture = Picture { width: 2, height: 1, pixels: vec![[x; 3], [1.0; 3]] };
        write_exr(&folder.path(name), &picture).unwrap();
    }
    for pair in ["nan.exr one.exr", "one.exr nan.exr"] {
        let run = folder.run(&format!("compare {pair} --max 1 --json"));
        assert_eq!((run.code, run.n_warnings()), (Some(1), 1), "{pair}: {}", run.stderr);
        assert_eq!((run.json()["not_finite"].as_u64(), run.json()["mse"].as_f64()), (Some(1), Some(0.0)));
    }
    let run = folder.run("compare one.exr one.exr --max 0").done();
    assert_eq!(run.n_warnings(), 0);
}

#[test]
fn pictures_that_cannot_be_compared_are_rejected() {
    let folder = folder();
    folder.run("compare small.png white.png").refused(&["small.png", "white.png", "1 x 2", "2 x 2"]);
    folder.run("compare small.png white.png --max 9").refused(&["1 x 2"]);
    folder.run("compare white.png missing.png").refused(&["missing.png"]);
    folder.write("text.png", "no picture");
    folder.run("compare text.png white.png").refused(&["text.png"]);
    let png = folder.bytes("white.png");
    folder.write("short.png", &png[..png.len() / 2]);
    folder.run("compare white.png short.png").refused(&["short.png"]);
}

#[test]
fn both_formats_of_one_render_agree_within_eight_bits() {
    let folder = Folder::with_small();
    for format in ["png", "exr"] {
        // Dim, so that no pixel exceeds the white of a PNG.
        folder.run(&format!("render small.obj -o out.{format} --size 24x16 --spp 2 --env 0.4,0.3,0.2")).done();
    }
    folder.run(&format!("compare out.png out.exr --max {EIGHT_BITS}")).done();
    let run = folder.run("compare out.png out.exr --max 0");
    assert_eq!(run.code, Some(1), "rounding is detected: {}", run.stdout);
}

/// Every format that `render` writes can be compared: JPEG loses most, HDR has seven bits of mantissa.
#[test]
fn every_format_of_render_is_read() {
    let folder = Folder::with_small();
    for format in ["png", "jpg", "webp", "hdr", "exr"] {
        folder.run(&format!("render small.obj -o out.{format} --size 24x16 --spp 16 --env 4,3,2")).done();
        let json = folder.run(&format!("compare out.{format} out.{format} --json --max 0")).done().json();
        assert_eq!(json["rmse"].as_f64(), Some(0.0), "{format}");
    }
    // Linear formats keep what is brighter than white.
    let json = folder.run("compare out.hdr out.exr --json").done().json();
    assert!(json["relmse"].as_f64().unwrap() < (1.0f64 / 128.0).powi(2), "{json}");
    let json = folder.run("compare out.jpg out.png --json").done().json();
    assert!(json["relmse"].as_f64().unwrap() < 0.02, "{json}");
}
