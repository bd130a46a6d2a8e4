//! Environment maps in Radiance HDR and OpenEXR format, distinguished by signature.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use exr::io::Tracking;
use exr::prelude::{AnyChannels, Error, FlatSamples, MetaData, ReadChannels as _, ReadLayers as _, Vec2, read};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};

use super::error::ReadError;
use crate::EnvironmentImage;

/// Largest number of texels: 16384 x 8192, 1.5 GiB as `f32`.
const MAX_TEXELS: u64 = 1 << 27;

/// Decoded texels, unchecked.
struct Texels {
    width: u32,
    height: u32,
    list: Vec<[f32; 3]>,
}

/// Reads an equirectangular environment map (`.hdr`, `.exr`) of linear RGB radiance, with scale 1 and rotation 0.
///
/// EXR files use the first layer with `R`, `G` and `B`, or only `Y`. Non-finite and negative texels become black with a
/// warning.
///
/// # Errors
/// [`ReadError`] if the format is unknown, the data is truncated, or the size exceeds what the data can hold.
pub fn read_environment(path: &Path, warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    parse(path, &fs::read(path).map_err(ReadError::io(path))?, warnings)
}

/// Parses `bytes`; `path` is used in messages.
pub(super) fn parse(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<EnvironmentImage, ReadError> {
    let Texels { width, height, list: mut texels } = match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => decode_exr(bytes),
        [b'#', b'?', ..] => decode_hdr(bytes),
        _ => Err("unsupported format (expected Radiance HDR or OpenEXR)".to_owned()),
    }
    .map_err(|message| ReadError::malformed(path, "environment map", message))?;
    let n_bad = texels.iter_mut().filter_map(blacken).count();
    if n_bad > 0 {
        warnings.push(format!("{}: replacing non-finite or negative texels by black: {n_bad}", path.display()));
    }
    let name = path.display().to_string();
    Ok(EnvironmentImage { name, width, height, texels, scale: [1.0; 3], turn_degrees: 0.0 })
}

/// Sets a non-finite or negative texel to zero; `None` for valid ones.
fn blacken(texel: &mut [f32; 3]) -> Option<()> {
    let is_bad = !texel.iter().all(|x| x.is_finite() && *x >= 0.0);
    is_bad.then(|| *texel = [0.0; 3])
}

/// Upper bound of texels, and of samples of EXR, per byte of file: deflate, the strongest compression, expands at most 1032 times.
const MAX_PER_BYTE: u64 = 1032;

/// Checks the sizes of all layers of an EXR against the data before anything is allocated.
fn check_exr_size(bytes: &[u8]) -> Result<(), String> {
    /// Channels of the largest supported image: color and alpha.
    const N_CHANNELS: u64 = 4;
    // The type of reader that `read` makes, too, so that the parser of headers is compiled once.
    let metadata = MetaData::read_from_buffered(Tracking::new(Cursor::new(bytes)), false).map_err(exr_error)?;
    let mut n_samples = 0_u64;
    for header in &metadata.headers {
        let Vec2(width, height) = header.layer_size;
        let n_texels = (width as u64).saturating_mul(height as u64);
        n_samples = n_samples.saturating_add(n_texels.saturating_mul(header.channels.list.len() as u64));
        if n_texels == 0 || n_samples > MAX_PER_BYTE.saturating_mul(bytes.len() as u64) {
            return Err(format!("invalid image size {width} x {height} for {} bytes of data", bytes.len()));
        }
    }
    if n_samples > N_CHANNELS * MAX_TEXELS {
        return Err(format!("{n_samples} samples (limit: {})", N_CHANNELS * MAX_TEXELS));
    }
    Ok(())
}

/// A sentence for an error of the decoder.
fn exr_error(error: Error) -> String {
    match error {
        // The decoder's message for data that ends early.
        Error::Invalid(what) if what == "reference to missing bytes" => "unexpected end of OpenEXR data".to_owned(),
        Error::Invalid(what) => format!("invalid OpenEXR data: {what}"),
        Error::NotSupported(what) => format!("unsupported OpenEXR feature: {what}"),
        Error::Io(_) | Error::Aborted => format!("cannot decode OpenEXR data: {error}"),
    }
}

/// Decodes the first layer with color.
fn decode_exr(bytes: &[u8]) -> Result<Texels, String> {
    check_exr_size(bytes)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(exr_error)?;
    let mut layers = image.layer_data.iter();
    layers
        .find_map(|layer| texels(layer.size, &layer.channel_data))
        .ok_or_else(|| "no layer has the channels R, G and B, or only Y".to_owned())
}

/// The texels of a layer; `None` without full-resolution color.
fn texels(Vec2(width, height): Vec2<usize>, channels: &AnyChannels<FlatSamples>) -> Option<Texels> {
    let n_texels = width * height;
    let find = |name: &str| {
        let channel = channels.list.iter().find(|channel| channel.name.eq(name))?;
        (channel.sample_data.len() == n_texels).then_some(&channel.sample_data)
    };
    let rgb = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        // Luminance with subsampled chroma is not supported.
        (None, None, None, Some(y)) if !channels.list.iter().any(|channel| channel.name.eq("RY")) => [y; 3],
        _ => return None,
    };
    let mut list = vec![[0.0; 3]; n_texels];
    for (k, samples) in rgb.into_iter().enumerate() {
        list.iter_mut().zip(samples.values_as_f32()).for_each(|(texel, value)| texel[k] = value);
    }
    Some(Texels { width: u32::try_from(width).ok()?, height: u32::try_from(height).ok()?, list })
}

/// Decodes the image.
fn decode_hdr(bytes: &[u8]) -> Result<Texels, String> {
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    let max = MAX_TEXELS.min(MAX_PER_BYTE.saturating_mul(bytes.len() as u64));
    if !(1..=max).contains(&(u64::from(width) * u64::from(height))) {
        return Err(format!("invalid image size {width} x {height} for {} bytes of data", bytes.len()));
    }
    let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
    let list = image.into_rgb32f().into_raw().as_chunks().0.to_vec();
    Ok(Texels { width, height, list })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, WritableImage as _};
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
