//! OpenEXR (`.exr`) with color or luminance.

use std::io::Cursor;

use exr::prelude::{AnyChannels, FlatSamples, ReadChannels as _, ReadLayers as _, Vec2, read};

use super::{MAX_TEXELS, Texels};
use crate::read::exr::{declared_exr_samples, reason};

/// Decodes the first layer with color.
pub(super) fn decode(bytes: &[u8]) -> Result<Texels, String> {
    /// Channels of the largest supported image: color and alpha.
    const N_CHANNELS: u64 = 4;
    let n_samples = declared_exr_samples(bytes)?;
    if n_samples > N_CHANNELS * MAX_TEXELS {
        return Err(format!("{n_samples} samples (limit: {})", N_CHANNELS * MAX_TEXELS));
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(reason)?;
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
