//! Environment maps in Radiance HDR and OpenEXR format, distinguished by signature.
//!
//! ```text
//! bytes -> hdr, or chroma | layers -> primaries, cube -> texels of longitude and latitude, Rec. 709
//! ```

mod chroma;
mod cube;
mod hdr;
mod layers;
mod primaries;

use std::fs;
use std::path::Path;

use super::error::ReadError;
use crate::EnvironmentImage;

/// Largest number of texels: 16384 x 8192, 1.5 GiB as `f32`.
const MAX_TEXELS: u64 = 1 << 27;

/// Upper bound of texels, and of samples of EXR, per byte of file: deflate, the strongest compression, expands at most 1032 times.
const MAX_PER_BYTE: u64 = 1032;

/// Decoded texels, unchecked.
struct Texels {
    width: u32,
    height: u32,
    list: Vec<[f32; 3]>,
}

/// Texels, their primaries where the file says them, and whether they are the sides of a cube.
type Decoded = (Texels, Option<primaries::Primaries>, bool);

/// Reads an equirectangular environment map (`.hdr`, `.exr`) as linear RGB radiance of Rec. 709, with scale 1 and rotation 0.
///
/// Radiance files are divided by their `EXPOSURE` and `COLORCORR`. EXR files use the layer that is the image, by the names that programs
/// give it: `R`, `G` and `B`, luminance and chroma, or only `Y`. Colors of other primaries are converted, the sides of a cube map are
/// placed where their axes point to. Negative channels and those that are not a number become 0, infinite ones 65504, with a warning.
///
/// # Errors
/// [`ReadError`] if the format is unknown, the data is truncated, or the size exceeds what the data can hold.
pub fn read_environment(path: &Path, warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    parse(path, &fs::read(path).map_err(ReadError::io(path))?, warnings)
}

/// Parses `bytes`; `path` is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    let mut own = Vec::new();
    let Texels { width, height, list: mut texels } = match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => layers::decode(bytes, &mut own),
        [b'#', b'?', ..] => hdr::decode(bytes, &mut own),
        _ => Err("unsupported format (expected Radiance HDR or OpenEXR)".to_owned()),
    }
    .map_err(|message| ReadError::malformed(path, "environment map", message))?;
    make_finite(&mut texels, &mut own);
    let n_clamped = texels.as_flattened_mut().iter_mut().filter_map(clamp).count();
    if n_clamped > 0 {
        own.push(format!("replacing negative channels by 0: {n_clamped}"));
    }
    let name = path.display().to_string();
    warnings.extend(own.into_iter().map(|warning| format!("{name}: {warning}")));
    Ok(EnvironmentImage { name, width, height, texels, scale: [1.0; 3], turn_degrees: 0.0 })
}

/// Largest number of half precision, which replaces infinity: most EXR files are of half precision, where brighter suns are infinite.
const LARGEST: f32 = 65_504.0;

/// Replaces channels that are not finite, with a warning; the other channels of their texels are sound.
fn make_finite(texels: &mut [[f32; 3]], warnings: &mut Vec<String>) {
    let mut n = 0;
    for channel in texels.as_flattened_mut().iter_mut().filter(|channel| !channel.is_finite()) {
        *channel = if *channel == f32::INFINITY { LARGEST } else { 0.0 };
        n += 1;
    }
    if n > 0 {
        warnings.push(format!("replacing channels that are not finite by {LARGEST} or 0: {n}"));
    }
}

/// Sets a negative channel to 0; `None` for others. Filters and conversions of colors make them, and the other channels are sound.
fn clamp(channel: &mut f32) -> Option<()> {
    let is_negative = *channel < 0.0;
    if *channel <= 0.0 {
        *channel = 0.0;
    }
    is_negative.then_some(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use exr::meta::attribute::{Chromaticities, EnvironmentMap};
    use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Vec2, WritableImage as _};
    use proptest::prelude::*;

    use super::*;
    use crate::read::testing::{damage, damaged, rejects_truncations};

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
        rejected(&exr_of(&[y.clone(), ("RY", plane(|_, _| 1.0))], Encoding::UNCOMPRESSED), "missing channel BY");
        rejected(&exr_of(&[y, ("X", plane(|_, _| 1.0))], Encoding::UNCOMPRESSED), "no layer has the channels");
    }

    /// Channels `R`, `G` and `B` of each layer are all of one value.
    fn layers(values: &[(&str, f32)]) -> Vec<u8> {
        let names: Vec<String> =
            values.iter().flat_map(|(layer, _)| ["R", "G", "B"].map(|c| layer.to_string() + c)).collect();
        let planes = names.iter().enumerate().map(|(k, name)| (&name[..], plane(|_, _| values[k / 3].1)));
        exr_of(&planes.collect::<Vec<_>>(), Encoding::UNCOMPRESSED)
    }

    #[test]
    fn the_layer_of_the_image_is_read() {
        for layer in ["", "Layer 1.", "ViewLayer.Combined.", "beauty.", "rgba.", "Background."] {
            let (image, warnings) = read_bytes(&layers(&[(layer, 2.0)]));
            assert_eq!((image.unwrap().texels[3], warnings), ([2.0; 3], vec![]), "{layer}");
        }
        for (values, warning) in [
            (&[("albedo.", 1.0), ("", 2.0), ("normal.", 3.0)][..], ""),
            (
                &[("ViewLayer.Albedo.", 1.0), ("ViewLayer.Combined.", 2.0), ("ViewLayer.Normal.", 3.0)],
                "sky.hdr: reading the layer 'ViewLayer.Combined' of 3: ViewLayer.Albedo, ViewLayer.Combined, ViewLayer.Normal",
            ),
            (&[("b.", 3.0), ("a.", 2.0)], "sky.hdr: reading the layer 'a' of 2: a, b"),
        ] {
            let (image, warnings) = read_bytes(&layers(values));
            assert_eq!((image.unwrap().texels[3], warnings.join("\n")), ([2.0; 3], warning.to_owned()), "{values:?}");
        }
        let lower = ["light.red", "light.Green", "light.BLUE"].map(|name| (name, plane(|_, _| 2.0)));
        assert_eq!(read_bytes(&exr_of(&lower, Encoding::UNCOMPRESSED)).0.unwrap().texels[0], [2.0; 3]);
    }

    /// An image with attributes.
    fn exr_with(rgb: [f32; 3], size: [usize; 2], chromaticities: Option<Chromaticities>, is_cube: bool) -> Vec<u8> {
        let n = size[0] * size[1];
        let channel = |(name, value): (&str, f32)| AnyChannel::new(name, FlatSamples::F32(vec![value; n]));
        let channels =
            AnyChannels::sort(["B", "G", "R"].into_iter().zip([rgb[2], rgb[1], rgb[0]]).map(channel).collect());
        let mut image = Image::from_encoded_channels((size[0], size[1]), Encoding::UNCOMPRESSED, channels);
        image.attributes.chromaticities = chromaticities;
        image.layer_data.attributes.environment_map = is_cube.then_some(EnvironmentMap::Cube);
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn primaries_are_converted() {
        let named = |[red, green, blue, white]: [[f32; 2]; 4]| {
            let at = |[x, y]: [f32; 2]| Vec2(x, y);
            Some(Chromaticities { red: at(red), green: at(green), blue: at(blue), white: at(white) })
        };
        let color = |rgb, chromaticities| {
            let (image, warnings) = read_bytes(&exr_with(rgb, [4, 2], chromaticities, false));
            (image.unwrap().texels[0], warnings.join("\n"))
        };
        let rec_709 = named([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]]);
        assert_eq!(color([0.6, 0.3, 0.1], rec_709), ([0.6, 0.3, 0.1], String::new()));
        // Red of ACEScg (AP1) in Rec. 709 by Bradford, of the OpenColorIO configuration of ACES; its blue and green are outside.
        let ap1 = named([[0.713, 0.293], [0.165, 0.83], [0.128, 0.044], [0.32168, 0.33767]]);
        let (red, warning) = color([1.0, 0.0, 0.0], ap1);
        assert!((red[0] - 1.70505).abs() < 1e-4 && red[1..] == [0.0; 2], "{red:?}");
        assert_eq!(warning, "sky.hdr: replacing negative channels by 0: 16");
        // An infinite channel is replaced before it meets the negative numbers of the matrix.
        let (sun, warning) = color([f32::INFINITY; 3], ap1);
        assert!(sun.iter().all(|x| (x - 65504.0).abs() < 1.0), "{sun:?}");
        assert_eq!(warning, "sky.hdr: replacing channels that are not finite by 65504 or 0: 24");
        let (gray, _) = color([0.5; 3], ap1);
        assert!(gray.iter().all(|x| (x - 0.5).abs() < 1e-6), "{gray:?}");
        let (unchanged, warning) = color([0.5, 0.25, 0.125], named([[0.3, 0.3]; 4]));
        assert_eq!(unchanged, [0.5, 0.25, 0.125]);
        assert!(warning.starts_with("sky.hdr: ignoring chromaticities [["), "{warning}");
    }

    #[test]
    fn cube_maps_are_unfolded() {
        let (image, warnings) = read_bytes(&exr_with([1.0, 2.0, 3.0], [4, 24], None, true));
        let image = image.unwrap();
        assert_eq!((image.width, image.height, image.texels[77]), (16, 8, [1.0, 2.0, 3.0]));
        assert_eq!(warnings, ["sky.hdr: placing the sides of the cube map (envmap) where their axes point to"]);
    }

    #[test]
    fn radiance_headers_are_understood() {
        // RGBE 1 1/2 1/4: mantissas 128, 64, 32 and the exponent 128 + 1.
        let color = |header: &str, size: &str| {
            let text = format!("{header}\n\n{size}\n");
            let (image, warnings) = read_bytes(&[text.as_bytes(), &[128, 64, 32, 129].repeat(32)].concat());
            let image = image.unwrap_or_else(|error| panic!("{header}: {error}"));
            (image.texels[5], [image.width, image.height], warnings.join("\n"))
        };
        let plain = ([1.0, 0.5, 0.25], [8, 4], String::new());
        let rgbe = "FORMAT=32-bit_rle_rgbe";
        for header in [
            format!("#?RADIANCE\n{rgbe}"),
            format!("#?RGBE\n{rgbe}"),
            format!("#?RADIANCE\r\n# a comment\r\n{rgbe}\r"),
            format!("#?RADIANCE\noconv a = b\nGAMMA=1\n{rgbe}"),
            "#?RGBE".to_owned(),
        ] {
            assert_eq!(color(&header, "-Y 4 +X 8"), plain, "{header:?}");
        }
        for (lines, want) in [
            ("EXPOSURE=2.0", [0.5, 0.25, 0.125]),
            ("EXPOSURE= 2\nEXPOSURE=0.25", [2.0, 1.0, 0.5]),
            ("COLORCORR=2 1 0.5", [0.5, 0.5, 0.5]),
            ("exposure=4\nCOLORCORR= 1 0.5 0.25", [0.25, 0.25, 0.25]),
        ] {
            let (got, _, warnings) = color(&format!("#?RADIANCE\n{lines}\n{rgbe}"), "-Y 4 +X 8");
            assert_eq!((got, warnings), (want, String::new()), "{lines}");
        }
        for line in ["EXPOSURE=0", "EXPOSURE=x", "COLORCORR=1 2", "EXPOSURE=-1", "EXPOSURE=nan", "PRIMARIES=1"] {
            let (got, _, warnings) = color(&format!("#?RADIANCE\n{line}\n{rgbe}"), "-Y 4 +X 8");
            assert_eq!((got, warnings), (plain.0, format!("sky.hdr: ignoring '{line}': its value is not valid")));
        }
        let cr = [b"#?RGBE\rFORMAT=32-bit_rle_rgbe\r\r-Y 1 +X 2\r".to_vec(), vec![10, 10, 10, 136, 128, 64, 32, 129]]
            .concat();
        assert_eq!(read_bytes(&cr).0.unwrap().texels, [[10.0; 3], [1.0, 0.5, 0.25]]);
        // White of Radiance in XYZ is white.
        let xyz = "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n";
        let white = read_bytes(&[xyz.as_bytes(), &[128, 128, 128, 129]].concat()).0.unwrap().texels[0];
        assert!(white.iter().all(|x| (x - 1.0).abs() < 1e-6), "{white:?}");
        rejected(b"#?RADIANCE\nFORMAT=64-bit\n\n-Y 1 +X 1\n0000", "unsupported format '64-bit'");
        rejected(b"#?RADIANCE\n\n-Y one +X 1\n0000", "invalid image size '-Y one +X 1'");
    }

    #[test]
    fn radiance_scan_lines_have_eight_orders() {
        // Two columns, three rows; by rows from the top 0 1 / 2 3 / 4 5.
        for (size, order) in [
            ("-Y 3 +X 2", [0, 1, 2, 3, 4, 5]),
            ("-Y 3 -X 2", [1, 0, 3, 2, 5, 4]),
            ("+Y 3 +X 2", [4, 5, 2, 3, 0, 1]),
            ("+Y 3 -X 2", [5, 4, 3, 2, 1, 0]),
            ("+X 2 -Y 3", [0, 2, 4, 1, 3, 5]),
            ("+X 2 +Y 3", [4, 2, 0, 5, 3, 1]),
            ("-X 2 -Y 3", [1, 3, 5, 0, 2, 4]),
            ("-X 2 +Y 3", [5, 3, 1, 4, 2, 0]),
        ] {
            let pixels: Vec<u8> = order.iter().flat_map(|&number| [2 + number, 0, 0, 136]).collect();
            let image = read_bytes(&[format!("#?RGBE\n\n{size}\n").as_bytes(), &pixels].concat()).0.unwrap();
            assert_eq!((image.width, image.height), (2, 3), "{size}");
            let numbers: Vec<f32> = image.texels.iter().map(|texel| texel[0]).collect();
            assert_eq!(numbers, [2.0, 3.0, 4.0, 5.0, 6.0, 7.0], "{size}");
        }
    }

    #[test]
    fn radiance_run_lengths_of_both_kinds() {
        let file = |size: &str, data: &[u8]| [format!("#?RGBE\n\n{size}\n").as_bytes(), data].concat();
        let red = |bytes: &[u8]| -> Vec<f32> { read_bytes(bytes).0.unwrap().texels.iter().map(|t| t[0]).collect() };
        // Channels: a run of 6, then 3 bytes; runs of 9 for the others.
        let line = [&[2, 2, 0, 9, 134, 5, 3, 1, 2, 3][..], &[137, 7], &[137, 7], &[137, 136]].concat();
        let want = [5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 1.0, 2.0, 3.0];
        assert_eq!(red(&file("-Y 2 +X 9", &line.repeat(2))), want.repeat(2));
        // Pixels: 4 + 256 repetitions of the first.
        let old = [4, 4, 4, 136, 1, 1, 1, 4, 1, 1, 1, 1, 9, 9, 9, 136];
        let mut want = vec![4.0; 261];
        want.push(9.0);
        assert_eq!(red(&file("-Y 1 +X 262", &old)), want);
        for (size, data) in [
            ("-Y 1 +X 9", &[2, 2, 0, 8][..]),
            ("-Y 1 +X 9", &[2, 2, 0, 9, 138, 5]),
            ("-Y 1 +X 9", &[2, 2, 0, 9, 0, 5]),
            ("-Y 1 +X 9", &[1, 1, 1, 9]),
            ("-Y 1 +X 2", &[4, 4, 4, 136, 1, 1, 1, 2]),
        ] {
            assert!(read_bytes(&file(size, data)).0.is_err(), "{data:?}");
        }
    }

    #[test]
    fn channels_that_are_not_finite_or_negative_are_replaced() {
        let mut red = plane(|_, _| 2.0);
        (red[0], red[1], red[2], red[3]) = (f32::NAN, f32::INFINITY, -1.0, -0.0);
        let ones = plane(|_, _| 1.0);
        let (image, warnings) =
            read_bytes(&exr_of(&[("R", red), ("G", ones.clone()), ("B", ones)], Encoding::UNCOMPRESSED));
        let image = image.unwrap();
        assert_eq!(
            image.texels[..5],
            [[0.0, 1.0, 1.0], [65504.0, 1.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0], [2.0, 1.0, 1.0]]
        );
        assert!(image.texels[3][0].is_sign_positive());
        let finite = "sky.hdr: replacing channels that are not finite by 65504 or 0: 2";
        assert_eq!(warnings, [finite, "sky.hdr: replacing negative channels by 0: 1"]);
    }

    #[test]
    fn rejects_every_truncation() {
        for full in [hdr_bytes(), exr_bytes(Encoding::UNCOMPRESSED), exr_bytes(Encoding::SMALL_LOSSLESS)] {
            rejects_truncations(&full, full.len(), |bytes| read_bytes(bytes).0);
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
        fn mutated_images_never_panic(kind in 0..3_usize, change in damage()) {
            let file = match kind {
                0 => hdr_bytes(),
                1 => exr_bytes(Encoding::UNCOMPRESSED),
                _ => exr_bytes(Encoding::SMALL_LOSSLESS),
            };
            if let Ok(image) = read_bytes(&damaged(file, &change)).0 {
                prop_assert_eq!(image.texels.len() as u64, u64::from(image.width) * u64::from(image.height));
                prop_assert!(image.texels.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0));
            }
        }
    }
}
