//! OpenEXR: the layer that shows the image, with its primaries, and cube maps.

use std::io::Cursor;

use exr::io::Tracking;
use exr::meta::attribute::EnvironmentMap;
use exr::prelude::{AnyChannel, Error, FlatSamples, MetaData, ReadChannels as _, ReadLayers as _, Vec2, read};

use super::primaries::{self, Primaries};
use super::{Decoded, MAX_PER_BYTE, MAX_TEXELS, Texels, chroma, cube, make_finite};

/// Checks the sizes of all layers against the data before anything is allocated.
fn check_size(bytes: &[u8]) -> Result<(), String> {
    /// Channels of the largest supported image: color and alpha.
    const N_CHANNELS: u64 = 4;
    // The type of reader that `read` makes, too, so that the parser of headers is compiled once.
    let metadata = MetaData::read_from_buffered(Tracking::new(Cursor::new(bytes)), false).map_err(sentence)?;
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
fn sentence(error: Error) -> String {
    match error {
        // The decoder's message for data that ends early.
        Error::Invalid(what) if what == "reference to missing bytes" => "unexpected end of OpenEXR data".to_owned(),
        Error::Invalid(what) => format!("invalid OpenEXR data: {what}"),
        Error::NotSupported(what) => format!("unsupported OpenEXR feature: {what}"),
        Error::Io(_) | Error::Aborted => format!("cannot decode OpenEXR data: {error}"),
    }
}

/// Decodes a file; what is chosen or ignored becomes a warning.
pub(super) fn decode(bytes: &[u8], warnings: &mut Vec<String>) -> Result<Texels, String> {
    let (mut texels, primaries, is_cube) = match chroma::decode(bytes) {
        Some(image) => image?,
        None => decode_layers(bytes, warnings)?,
    };
    make_finite(&mut texels.list, warnings);
    match primaries.map(Primaries::to_rec_709).transpose() {
        Ok(Some(Some(matrix))) => primaries::apply(&matrix, &mut texels.list),
        Ok(_) => {}
        Err(why) => warnings.push(format!("ignoring {why}")),
    }
    if is_cube {
        warnings.push("placing the sides of the cube map (envmap) where their axes point to".to_owned());
        return cube::unfolded(&texels);
    }
    Ok(texels)
}

/// The colors of the best layer, their primaries, and whether they are a cube map.
fn decode_layers(bytes: &[u8], warnings: &mut Vec<String>) -> Result<Decoded, String> {
    check_size(bytes)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(sentence)?;
    let mut candidates = Vec::new();
    for (part, layer) in image.layer_data.iter().enumerate() {
        let name = layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
        let n_texels = layer.size.area();
        candidates.extend(colors(&name, n_texels, &layer.channel_data.list).into_iter().map(|colors| (part, colors)));
    }
    // The first of the best.
    let best = candidates.iter().min_by_key(|(_, colors)| colors.rank);
    let (part, best) = best.ok_or_else(|| "no layer has the channels R, G and B, or only Y".to_owned())?;
    if candidates.len() > 1 && best.rank > 0 {
        let names: Vec<&str> = candidates.iter().map(|(_, colors)| &colors.name[..]).collect();
        warnings.push(format!("reading the layer '{}' of {}: {}", best.name, names.len(), names.join(", ")));
    }
    let layer = &image.layer_data[*part];
    let Vec2(width, height) = layer.size;
    let mut list = vec![[0.0; 3]; width * height];
    for (k, samples) in best.rgb.into_iter().enumerate() {
        list.iter_mut().zip(samples.values_as_f32()).for_each(|(texel, value)| texel[k] = value);
    }
    let too_large = |_| "more than 2^32 columns or rows".to_owned();
    let (width, height) = (u32::try_from(width).map_err(too_large)?, u32::try_from(height).map_err(too_large)?);
    let of_file = image
        .attributes
        .chromaticities
        .map(|all| Primaries([all.red, all.green, all.blue, all.white].map(|Vec2(x, y)| [f64::from(x), f64::from(y)])));
    let is_cube = layer.attributes.environment_map == Some(EnvironmentMap::Cube);
    Ok((Texels { width, height, list }, of_file, is_cube))
}

/// The channels of a layer that are a color.
struct Colors<'a> {
    /// Name of the layer; empty for channels without one.
    name: String,
    rgb: [&'a FlatSamples; 3],
    /// How far the layer is from the image itself; 0 for plain channels of the only or unnamed part.
    rank: usize,
}

/// Names of layers that are the whole image, in the programs that write several.
const WHOLE: [&str; 12] =
    ["combined", "beauty", "rgba", "rgb", "color", "colour", "c", "composite", "final", "main", "image", "default"];

/// The colors of a part, in the order of its channels, which is that of their names.
fn colors<'a>(part: &str, n_texels: usize, channels: &'a [AnyChannel<FlatSamples>]) -> Vec<Colors<'a>> {
    let mut layers: Vec<(String, Vec<(String, &FlatSamples)>)> = Vec::new();
    for channel in channels.iter().filter(|channel| channel.sample_data.len() == n_texels) {
        let name = channel.name.to_string();
        let (layer, channel_name) = name.rsplit_once('.').unwrap_or(("", &name));
        let entry = (channel_name.to_lowercase(), &channel.sample_data);
        match layers.iter_mut().find(|(known, _)| known == layer) {
            Some((_, list)) => list.push(entry),
            None => layers.push((layer.to_owned(), vec![entry])),
        }
    }
    let colors = layers.into_iter().filter_map(|(layer, list)| {
        let find =
            |names: [&str; 2]| list.iter().find(|(name, _)| names.contains(&&name[..])).map(|&(_, samples)| samples);
        let [r, g, b, y, x] = [["r", "red"], ["g", "green"], ["b", "blue"], ["y", "l"], ["x", "x"]].map(find);
        let (rgb, of_kind) = match (r, g, b, y) {
            (Some(r), Some(g), Some(b), _) => ([r, g, b], 0),
            // With x, it is a position or a normal.
            (None, None, None, Some(y)) if x.is_none() => ([y; 3], 2 * WHOLE.len() + 2),
            _ => return None,
        };
        let name = [part, &layer].into_iter().filter(|name| !name.is_empty()).collect::<Vec<_>>().join(".");
        let own = if layer.is_empty() { part } else { &layer };
        let own = own.rsplit('.').next().unwrap_or_default().trim().to_lowercase();
        let of_name = match (own.is_empty(), WHOLE.iter().position(|known| *known == own)) {
            (true, _) => 0,
            (false, Some(at)) => 1 + at,
            // Parts have names of any kind, so plain channels of one come before layers.
            (false, None) => WHOLE.len() + if layer.is_empty() { 1 } else { 2 },
        };
        Some(Colors { name, rgb, rank: of_name + of_kind })
    });
    colors.collect()
}
