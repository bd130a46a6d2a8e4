//! Round trips of generated images, and damaged files.

use std::path::Path;

use ::exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, WritableImage as _};
use proptest::prelude::*;

use super::*;

/// Channel `k` of texel `(x, y)`; exact in RGBE.
fn value(x: usize, y: usize, k: usize) -> f32 {
    [0.5, 1.0, 96.0][(x + y + k) % 3]
}

const WIDTH: usize = 5;
const HEIGHT: usize = 3;

/// An EXR with these channels.
fn exr_of(channels: &[(&str, Vec<f32>)], encoding: Encoding) -> Vec<u8> {
    let channel = |(name, values): &(&str, Vec<f32>)| AnyChannel::new(*name, FlatSamples::F32(values.clone()));
    let channels = AnyChannels::sort(channels.iter().map(channel).collect());
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = Image::from_encoded_channels((WIDTH, HEIGHT), encoding, channels);
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn plane(value: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect()
}

fn exr_bytes(encoding: Encoding) -> Vec<u8> {
    let channels = ["R", "G", "B"].into_iter().enumerate();
    let channels: Vec<_> = channels.map(|(k, name)| (name, plane(|x, y| value(x, y, k)))).collect();
    exr_of(&channels, encoding)
}

/// The same image as uncompressed RGBE.
fn hdr_bytes() -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n").into_bytes();
    for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
        // Exponent 128 + 7: a mantissa m means m / 2.
        let mantissa = |k: usize| [1, 2, 192][[0.5, 1.0, 96.0].iter().position(|v| *v == value(x, y, k)).unwrap()];
        bytes.extend([mantissa(0), mantissa(1), mantissa(2), 135]);
    }
    bytes
}

fn read_bytes(bytes: &[u8]) -> (Result<EnvironmentImage, ReadError>, Vec<String>) {
    let mut warnings = Vec::new();
    (parse(Path::new("sky.hdr"), bytes, &mut warnings), warnings)
}

#[track_caller]
fn rejected(bytes: &[u8], thing: &str) {
    let error = read_bytes(bytes).0.expect_err(thing).to_string();
    assert!(error.starts_with("sky.hdr: ") && error.contains(thing), "{error}");
}

#[test]
fn all_formats_and_compressions_give_the_same_texels() {
    let files = [hdr_bytes(), exr_bytes(Encoding::UNCOMPRESSED), exr_bytes(Encoding::FAST_LOSSLESS)];
    for bytes in files.into_iter().chain([exr_bytes(Encoding::SMALL_LOSSLESS)]) {
        let (image, warnings) = read_bytes(&bytes);
        let image = image.unwrap();
        assert_eq!(warnings, [""; 0]);
        assert_eq!((&image.name[..], image.width, image.height), ("sky.hdr", 5, 3));
        assert_eq!((image.scale, image.turn_degrees), ([1.0; 3], 0.0));
        for (k, texel) in image.texels.iter().enumerate() {
            assert_eq!(*texel, [0, 1, 2].map(|channel| value(k % WIDTH, k / WIDTH, channel)), "texel {k}");
        }
    }
}

#[test]
fn luminance_gives_gray_and_other_channels_are_rejected() {
    let y = ("Y", plane(|x, y| value(x, y, 0)));
    let image = read_bytes(&exr_of(std::slice::from_ref(&y), Encoding::UNCOMPRESSED)).0.unwrap();
    assert_eq!(image.texels[1], [1.0; 3]);
    rejected(&exr_of(&[("Z", plane(|_, _| 1.0))], Encoding::UNCOMPRESSED), "no layer has the channels");
    rejected(&exr_of(&[y, ("RY", plane(|_, _| 1.0))], Encoding::UNCOMPRESSED), "no layer has the channels");
}

#[test]
fn invalid_texels_become_black() {
    let mut red = plane(|_, _| 2.0);
    (red[0], red[1], red[2]) = (f32::NAN, f32::INFINITY, -1.0);
    let ones = plane(|_, _| 1.0);
    let (image, warnings) =
        read_bytes(&exr_of(&[("R", red), ("G", ones.clone()), ("B", ones)], Encoding::UNCOMPRESSED));
    let image = image.unwrap();
    assert_eq!(image.texels[..4], [[0.0; 3], [0.0; 3], [0.0; 3], [2.0, 1.0, 1.0]]);
    assert_eq!(warnings, ["sky.hdr: replacing non-finite or negative texels by black: 3"]);
}

#[test]
fn rejects_every_truncation() {
    for full in [hdr_bytes(), exr_bytes(Encoding::UNCOMPRESSED), exr_bytes(Encoding::SMALL_LOSSLESS)] {
        for length in 0..full.len() {
            assert!(read_bytes(&full[..length]).0.is_err(), "{length} of {} bytes", full.len());
        }
    }
}

/// Offset of an attribute's value, after name, type and length.
fn value_of(bytes: &[u8], name_and_type: &[u8]) -> usize {
    bytes.windows(name_and_type.len()).position(|window| window == name_and_type).unwrap() + name_and_type.len() + 4
}

#[test]
fn exr_errors_are_readable() {
    let full = exr_bytes(Encoding::UNCOMPRESSED);
    rejected(&full[..full.len() - 8], "environment map: unexpected end of OpenEXR data");
    let mut damaged = full.clone();
    // The last column of the data window is before the first.
    let window = value_of(&full, b"dataWindow\0box2i\0");
    damaged[window + 8..window + 12].copy_from_slice(&(-7_i32).to_le_bytes());
    rejected(&damaged, "environment map: invalid OpenEXR data: ");
    let mut newer = full;
    newer[4] = 3;
    rejected(&newer, "environment map: unsupported OpenEXR feature: file versions other than 2.0");
}

#[test]
fn sizes_are_checked_before_allocating() {
    rejected(b"#?RADIANCE\n\n-Y 100000 +X 100000\n", "invalid image size 100000 x 100000");
    rejected(b"#?RADIANCE\n\n-Y 0 +X 5\n", "invalid image size 5 x 0");
    let mut exr = exr_bytes(Encoding::SMALL_LOSSLESS);
    let window = value_of(&exr, b"dataWindow\0box2i\0");
    exr[window + 8..window + 12].copy_from_slice(&8191_i32.to_le_bytes());
    exr[window + 12..window + 16].copy_from_slice(&8191_i32.to_le_bytes());
    rejected(&exr, "invalid image size 8192 x 8192");
    rejected(b"", "expected Radiance HDR or OpenEXR");
    rejected(b"\x89PNG", "expected Radiance HDR or OpenEXR");
}

proptest! {
    #[test]
    fn mutated_images_never_panic(
        kind in 0..3_usize,
        patches in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = match kind {
            0 => hdr_bytes(),
            1 => exr_bytes(Encoding::UNCOMPRESSED),
            _ => exr_bytes(Encoding::SMALL_LOSSLESS),
        };
        for (at, byte) in patches {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(image) = read_bytes(&bytes).0 {
            prop_assert_eq!(image.texels.len() as u64, u64::from(image.width) * u64::from(image.height));
            prop_assert!(image.texels.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0));
        }
    }
}
