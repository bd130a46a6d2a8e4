//! Writes and reads picture files.

use std::fs;

use canted_film::{Format, Picture, encode, read_picture, srgb, write_exr, write_picture, write_png};

/// Values that a PNG stores exactly, and some that it clamps.
fn gradient() -> Picture {
    let mut picture = Picture::filled(13, 7, [0.0; 3]);
    for (i, pixel) in (0_u8..).zip(&mut picture.pixels) {
        *pixel = [f32::from(i) / 90.0, f32::from(i).powi(2) * 1e-3, 1.0 / (1.0 + f32::from(i))];
    }
    picture
}

fn names(folder: &std::path::Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort_unstable();
    names
}

#[test]
fn exr_keeps_all_bits_except_the_sign_of_zero() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    let mut picture = gradient();
    picture.pixels[3] = [-0.0, f32::MAX, f32::MIN_POSITIVE / 4.0];
    picture.pixels[4] = [f32::NAN, f32::INFINITY, -1.5];
    write_exr(&path, &picture).unwrap();
    let back = read_picture(&path).unwrap();
    assert_eq!((back.width, back.height), (13, 7));
    for (i, (a, b)) in picture.pixels.iter().flatten().zip(back.pixels.iter().flatten()).enumerate() {
        let expected = if a.is_nan() { f32::NAN } else { a + 0.0 };
        assert_eq!(b.to_bits(), expected.to_bits(), "value {i}");
    }
    assert_eq!(names(folder.path()), ["picture.exr"]);
    // Equal pictures are equal files.
    let again = folder.path().join("again.exr");
    picture.pixels[3][0] = 0.0;
    write_exr(&again, &picture).unwrap();
    assert_eq!(fs::read(&path).unwrap(), fs::read(&again).unwrap());
}

#[test]
fn png_stores_the_nearest_srgb_byte() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    let picture = Picture {
        width: 3,
        height: 2,
        pixels: vec![[0.0, -0.0, f32::NAN], [1.0, 2.0, -1.0], [0.18, 0.5, 0.003], [0.2; 3], [0.05; 3], [0.9; 3]],
    };
    write_png(&path, &picture).unwrap();
    let bytes = image::open(&path).unwrap().to_rgb8().into_raw();
    // 0.18 -> 118, 0.5 -> 188, 0.003 -> 9.88 -> 10; 0.2 -> 124, 0.05 -> 63, 0.9 -> 243 by the standard's formula.
    assert_eq!(bytes, [[0, 0, 0], [255, 255, 0], [118, 188, 10], [124; 3], [63; 3], [243; 3]].as_flattened());
    // The bytes survive the round trip.
    let back = read_picture(&path).unwrap();
    write_png(&path, &back).unwrap();
    assert_eq!(image::open(&path).unwrap().to_rgb8().into_raw(), bytes);
    assert_eq!(names(folder.path()), ["picture.png"]);
}

/// Half of the last digit computed by hand, plus the rounding of numbers below a quarter.
const BY_HAND: f32 = 0.5e-7 + 0.125 * f32::EPSILON;

#[test]
fn gray_and_16_bit_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gray.png");
    image::GrayImage::from_raw(2, 1, vec![0, 128]).unwrap().save(&path).unwrap();
    let gray = read_picture(&path).unwrap();
    assert_eq!(gray.pixels[0], [0.0; 3]);
    assert!((gray.pixels[1][0] - 0.215_860_5).abs() <= BY_HAND && gray.pixels[1][0] == gray.pixels[1][2]);
    image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(1, 1, vec![0_u16, 128 * 257, 65535])
        .unwrap()
        .save(&path)
        .unwrap();
    let deep = read_picture(&path).unwrap().pixels[0];
    assert_eq!(deep, [0.0, gray.pixels[1][0], 1.0]);
}

#[test]
fn errors_name_the_file_and_leave_no_temporary_file() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("no/such/folder/picture.png");
    for error in [write_png(&missing, &gradient()), write_exr(&missing, &gradient())] {
        let error = error.unwrap_err();
        assert_eq!(error.path(), missing);
        assert!(error.to_string().contains("no/such/folder/picture.png: "), "{error}");
    }
    // A folder at the target path: the rename fails after the temporary file was written.
    let taken = folder.path().join("taken.png");
    fs::create_dir(&taken).unwrap();
    fs::write(taken.join("inside"), "x").unwrap();
    assert!(write_png(&taken, &gradient()).is_err());
    assert_eq!(names(folder.path()), ["taken.png"]);
    // The previous picture stays.
    let path = folder.path().join("picture.png");
    write_png(&path, &Picture::filled(2, 2, [1.0; 3])).unwrap();
    assert!(write_png(&path, &Picture::filled(0, 0, [0.0; 3])).is_err());
    assert_eq!(read_picture(&path).unwrap().pixels, vec![[1.0; 3]; 4]);
    assert_eq!(names(folder.path()), ["picture.png", "taken.png"]);
}

#[test]
fn files_that_are_not_pictures_are_rejected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let exr = encode(&gradient(), None, Format::Exr).unwrap();
    let cases: [(&str, Vec<u8>); 5] = [
        ("empty.png", Vec::new()),
        ("text.png", b"not a picture".to_vec()),
        ("cut.exr", exr[..exr.len() / 2].to_vec()),
        ("magic.exr", exr[..4].to_vec()),
        ("cut.png", b"\x89PNG\r\n\x1a\n".to_vec()),
    ];
    for (name, bytes) in cases {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let error = read_picture(&path).unwrap_err();
        assert!(error.to_string().starts_with("cannot read ") && error.to_string().contains(name), "{error}");
    }
    assert!(read_picture(&folder.path().join("absent.png")).is_err());
}

/// Colors that cover a pixel in part: straight in PNG files, multiplied by alpha in EXR files.
#[test]
fn formats_with_alpha_store_it() {
    let folder = tempfile::tempdir().unwrap();
    let picture = Picture::filled(2, 1, [1.0, 0.25, 0.0]);
    let alpha = [0.5, 0.0];
    for (name, format) in Format::ALL {
        let encoded = encode(&picture, Some(&alpha), format);
        if !format.has_alpha() || format == Format::WebP && cfg!(not(feature = "webp")) {
            assert!(encoded.is_err(), "{name}");
            continue;
        }
        let decoded = image::load_from_memory(&encoded.unwrap());
        if format == Format::Exr {
            let path = folder.path().join("a.exr");
            write_picture(&path, &picture, Some(&alpha), format).unwrap();
            assert_eq!(read_picture(&path).unwrap().pixels, [[0.5, 0.125, 0.0], [0.0; 3]]);
            continue;
        }
        let decoded = decoded.unwrap().to_rgba8();
        assert_eq!(decoded.get_pixel(0, 0).0, [255, srgb::encode(0.25), 0, 128], "{name}");
        assert_eq!(decoded.get_pixel(1, 0).0[3], 0, "{name}");
    }
    assert!(encode(&picture, Some(&[1.0]), Format::Png).is_err(), "one pixel has no alpha");
}

/// Each format stores what its bits hold.
#[test]
fn formats_store_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let clamped = |x: f32| x.clamp(0.0, 1.0);
    let picture = gradient();
    for (name, format) in Format::ALL {
        if format == Format::WebP && cfg!(not(feature = "webp")) {
            assert!(encode(&picture, None, format).is_err());
            continue;
        }
        let path = folder.path().join(format!("picture.{}", name.trim_end_matches("16")));
        write_picture(&path, &picture, None, format).unwrap();
        assert_eq!(Format::of_path(&path).unwrap() == format, format != Format::Png16, "{name}");
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes, encode(&picture, None, format).unwrap(), "{name}");
        let image = match format {
            Format::Exr => continue,
            _ => image::load_from_memory(&bytes).unwrap(),
        };
        assert_eq!((image.width(), image.height()), (13, 7), "{name}");
        for (got, want) in image.to_rgb32f().pixels().zip(&picture.pixels) {
            for (&got, &want) in got.0.iter().zip(want) {
                let encoded = |x: f32| f64::from(srgb::encode_16(x)) / 65535.0;
                let (got, want, bound) = match format {
                    // Half a step of the common exponent of a color of at most 8.1.
                    Format::Hdr => (f64::from(got), f64::from(want), 8.1 / 128.0),
                    Format::Jpeg => (f64::from(got), encoded(clamped(want)), 0.25),
                    Format::Png16 => (f64::from(got), encoded(clamped(want)), 1e-6),
                    _ => (f64::from(got), encoded(clamped(want)), 0.51 / 255.0),
                };
                assert!((got - want).abs() <= bound, "{name}: {got} {want}");
            }
        }
    }
}
