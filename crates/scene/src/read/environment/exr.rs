//! OpenEXR (`.exr`), colour or luminance alone.

use std::io::Cursor;

use exr::prelude::{AnyChannels, Error, FlatSamples, MetaData, ReadChannels as _, ReadLayers as _, Vec2, read};

use super::{MAX_TEXELS, MAX_TEXELS_PER_BYTE, Texels};

/// Decodes the first layer that has a colour.
pub(super) fn decode(bytes: &[u8]) -> Result<Texels, String> {
    let metadata = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(reason)?;
    check_sizes(&metadata, bytes.len())?;
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
        .ok_or_else(|| "no layer has the channels R, G and B, or Y alone".to_owned())
}

/// What is wrong with a file, for those who did not write its decoder.
fn reason(error: Error) -> String {
    match error {
        // What the decoder says where it wants bytes behind the last.
        Error::Invalid(what) if what == "reference to missing bytes" => "the OpenEXR ends early".to_owned(),
        Error::Invalid(what) => format!("the OpenEXR is damaged: {what}"),
        Error::NotSupported(what) => format!("the OpenEXR is of a kind that is not read: {what}"),
        Error::Io(_) | Error::Aborted => format!("the OpenEXR cannot be decoded: {error}"),
    }
}

/// Refuses layers that together promise more samples than the file can hold, before anything is allocated for them.
fn check_sizes(metadata: &MetaData, n_bytes: usize) -> Result<(), String> {
    /// Channels that the largest picture may have: colour and alpha.
    const N_CHANNELS: u64 = 4;
    let max = (N_CHANNELS * MAX_TEXELS).min(MAX_TEXELS_PER_BYTE.saturating_mul(n_bytes as u64));
    let mut n_samples = 0_u64;
    for header in &metadata.headers {
        let Vec2(width, height) = header.layer_size;
        let n_texels = (width as u64).saturating_mul(height as u64);
        n_samples = n_samples.saturating_add(n_texels.saturating_mul(header.channels.list.len() as u64));
        if n_texels == 0 || n_samples > max {
            return Err(format!("its header promises {width} x {height} texels in {n_bytes} bytes"));
        }
    }
    Ok(())
}

/// The texels of a layer; `None` where it has no colour, or not as many samples of it as texels.
fn texels(Vec2(width, height): Vec2<usize>, channels: &AnyChannels<FlatSamples>) -> Option<Texels> {
    let n_texels = width * height;
    let find = |name: &str| {
        let channel = channels.list.iter().find(|channel| channel.name.eq(name))?;
        (channel.sample_data.len() == n_texels).then_some(&channel.sample_data)
    };
    let rgb = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        // Luminance with chroma at half of the places is a colour that is not read.
        (None, None, None, Some(y)) if !channels.list.iter().any(|channel| channel.name.eq("RY")) => [y; 3],
        _ => return None,
    };
    let mut list = vec![[0.0; 3]; n_texels];
    for (k, samples) in rgb.into_iter().enumerate() {
        list.iter_mut().zip(samples.values_as_f32()).for_each(|(texel, value)| texel[k] = value);
    }
    Some(Texels { width: u32::try_from(width).ok()?, height: u32::try_from(height).ok()?, list })
}
