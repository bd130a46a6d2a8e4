//! EXR files of films: a picture with AOVs and, for a part of the samples, exact sums.
//!
//! ```text
//! reads   a film, or a file that holds a part
//! writes  a layer `picture` of R, G, B and the channels of AOVs; for a part, a layer `sums` of u32 channels
//! holds   reading returns what was written, bit for bit; equal films and records give equal files
//! source  OpenEXR, File Layout; an f64 is two channels, `.high` and `.low` halves of its bits
//! ```

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
};

use crate::atomic_file::{read_file, write_file};
use crate::picture_file::{ENCODING, canonical, check_exr_size};
use crate::{Aov, Aovs, Block, Components, FileError, Film, Guide, Hash, Part, Picture, Pixel};

/// Name of the attribute with the record, and of the lines that describe the film.
const RECORD: &str = "canted";
const SAMPLES: &str = "samples";
const AOVS: &str = "aovs";
const CHECKSUM: &str = "checksum";

/// Names of the `f64` numbers of a pixel.
const LIGHT: [&str; 6] = ["sum.R", "sum.G", "sum.B", "squares.R", "squares.G", "squares.B"];
/// Names of its counts.
const COUNTS: [&str; 3] = ["count.summed", "count.negative", "count.dropped"];

/// Writes a film as an EXR: R, G, B, the channels of those of `aovs` that the film [stores](Film::stored), and for a part its exact sums and `record`.
///
/// Names and values of the record must not contain line breaks, names no colons. The file is written atomically.
///
/// # Errors
/// [`FileError`] with the file and the reason.
pub fn write_film(path: &Path, film: &Film, aovs: Aovs, record: &[(String, String)]) -> Result<(), FileError> {
    write_film_as(path, &film.picture(), None, film, aovs, record)
}

/// [`write_film`] with another picture in R, G, B, such as the denoised one, and alpha as in [`encode`](crate::encode); AOVs and sums are
/// those of the film.
///
/// # Errors
/// [`FileError`] with the file and the reason.
///
/// # Panics
/// If picture and film differ in size.
pub fn write_film_as(
    path: &Path,
    picture: &Picture,
    alpha: Option<&[f32]>,
    film: &Film,
    aovs: Aovs,
    record: &[(String, String)],
) -> Result<(), FileError> {
    assert_eq!([picture.width, picture.height], [film.width(), film.height()], "the picture of this film");
    let aovs = film.stored(aovs);
    let size = Vec2(film.width() as usize, film.height() as usize);
    let named = |name: &str| LayerAttributes { layer_name: Some(Text::from(name)), ..LayerAttributes::default() };
    let picture = AnyChannels::sort(picture_channels(picture, alpha, film, aovs).into_iter().collect());
    let mut layers = vec![Layer::new(size, named("picture"), ENCODING, picture)];
    if let Some(part) = film.part() {
        let numbers = numbers(part);
        let own = [
            (SAMPLES, format!("{:?}", part.range())),
            (AOVS, aovs.to_string()),
            (CHECKSUM, format!("{:016x}", checksum(&numbers))),
        ];
        let text = record_lines(&own.map(|(name, value)| (name.to_owned(), value))) + &record_lines(record);
        // One attribute, because the order of several is not defined.
        let mut attributes = named("sums");
        attributes.other.insert(Text::from(RECORD), AttributeValue::Text(Text::from(text.as_str())));
        let names = Stored::of(part).channel_names(part.blocks().len());
        let channels = names.iter().zip(numbers).map(|(name, words)| channel(name, FlatSamples::U32(words)));
        layers.push(Layer::new(size, attributes, ENCODING, AnyChannels::sort(channels.collect())));
    }
    let window = IntegerBounds::from_dimensions(size);
    let mut file = Cursor::new(Vec::new());
    Image::from_layers(ImageAttributes::new(window), layers)
        .write()
        .non_parallel()
        .to_buffered(&mut file)
        .map_err(|error| FileError::write(path, error))?;
    write_file(path, file.get_ref())
}

fn channel(name: &str, samples: FlatSamples) -> AnyChannel<FlatSamples> {
    AnyChannel::new(Text::from(name), samples)
}

fn picture_channels(picture: &Picture, alpha: Option<&[f32]>, film: &Film, aovs: Aovs) -> Vec<AnyChannel<FlatSamples>> {
    let alpha_of = |i: usize| alpha.map_or(1.0, |alpha| alpha[i]);
    let color = |k: usize| {
        let all = picture.pixels.iter().enumerate();
        FlatSamples::F32(all.map(|(i, pixel)| canonical(pixel[k] * alpha_of(i))).collect())
    };
    let mut channels: Vec<_> = ["R", "G", "B"].iter().enumerate().map(|(k, name)| channel(name, color(k))).collect();
    channels.extend(alpha.map(|alpha| channel("A", FlatSamples::F32(alpha.iter().map(|&x| canonical(x)).collect()))));
    for aov in aovs.iter() {
        for (k, name) in aov.channels().iter().enumerate() {
            let mut samples = aov.values(k, film);
            if let FlatSamples::F32(values) = &mut samples {
                values.iter_mut().for_each(|x| *x = canonical(*x));
            }
            channels.push(channel(name, samples));
        }
    }
    channels
}

/// What is stored of a block besides the radiance.
#[derive(Clone, Copy)]
struct Stored {
    guide: bool,
    components: bool,
    /// Whether the components have the light at the first surface.
    first: bool,
}

impl Stored {
    fn of(part: &Part) -> Self {
        let has_first = |components: &Components| components.first.is_some();
        Self {
            guide: part.guides().next().is_some(),
            components: part.components().next().is_some(),
            first: part.components().flatten().any(has_first),
        }
    }

    /// Names of the channels of sums: for each block the radiance, then the guide, then the components.
    fn channel_names(self, n_blocks: usize) -> Vec<String> {
        let mut numbers = LIGHT.to_vec();
        let mut counts = COUNTS.to_vec();
        if self.guide {
            let guide = [Aov::Depth, Aov::Normal, Aov::ShadingNormal, Aov::Albedo, Aov::Tests];
            numbers.extend(guide.map(Aov::channels).concat());
            counts.extend(["count.hits", "id.instance", "id.primitive"]);
        }
        if self.components {
            numbers.extend(Aov::COMPONENTS.map(Aov::channels).concat());
        }
        if self.first {
            numbers.extend(Aov::FACTORS.map(Aov::channels).concat());
        }
        let of_block = |block: usize| {
            let halves = |name: &&str| ["high", "low"].map(|half| format!("{block:02}.{name}.{half}"));
            let numbers = numbers.iter().flat_map(halves);
            numbers.chain(counts.iter().map(|name| format!("{block:02}.{name}"))).collect::<Vec<_>>()
        };
        (0..n_blocks).flat_map(of_block).collect()
    }

    /// Sums of the components of a pixel and block.
    fn n_of_components(self) -> usize {
        match (self.components, self.first) {
            (false, _) => 0,
            (true, false) => 9,
            (true, true) => 21,
        }
    }

    /// The sums of the words of one pixel and block, in the order of the channels.
    fn decoded(self, words: &[u32]) -> (Pixel, Option<Guide>, Option<Components>) {
        let double = |k: usize| f64::from_bits(u64::from(words[2 * k]) << 32 | u64::from(words[2 * k + 1]));
        let of_components = LIGHT.len() + if self.guide { Guide::default().sums().len() } else { 0 };
        let n_doubles = of_components + self.n_of_components();
        let counts = &words[2 * n_doubles..];
        let pixel = Pixel {
            sum: std::array::from_fn(double),
            sum_of_squares: std::array::from_fn(|k| double(3 + k)),
            n_samples: counts[0],
            n_negative: counts[1],
            n_dropped: counts[2],
        };
        let guide = self.guide.then(|| {
            let ids = [counts[4], counts[5]];
            let first = (ids != [u32::MAX; 2]).then_some(ids);
            Guide::from_sums(counts[3], first, std::array::from_fn(|k| double(LIGHT.len() + k)))
        });
        let mut numbers = (of_components..n_doubles).map(double);
        let components = || Components::from_numbers(|| numbers.next().unwrap_or_default(), self.first);
        (pixel, guide, self.components.then(components))
    }
}

/// The values of the channels of sums.
fn numbers(part: &Part) -> Vec<Vec<u32>> {
    let stored = Stored::of(part);
    let mut channels = vec![Vec::new(); stored.channel_names(part.blocks().len()).len()];
    let (mut guides, mut components) = (part.guides(), part.components());
    for pixels in part.pixels() {
        let guides = guides.next().unwrap_or_default();
        let components = components.next().unwrap_or_default();
        let mut next = channels.iter_mut();
        for (block, pixel) in pixels.iter().enumerate() {
            let words = words(pixel, guides.get(block), components.get(block), stored);
            words.into_iter().zip(&mut next).for_each(|(word, channel)| channel.push(word));
        }
    }
    channels
}

/// The words of one pixel and block, in the order of the channels.
fn words(pixel: &Pixel, guide: Option<&Guide>, components: Option<&Components>, stored: Stored) -> Vec<u32> {
    let light = pixel.sum.into_iter().chain(pixel.sum_of_squares);
    let components = components.into_iter().flat_map(Components::numbers).take(stored.n_of_components());
    let doubles = light.chain(guide.into_iter().flat_map(Guide::sums)).chain(components).map(f64::to_bits);
    let mut words: Vec<u32> = doubles.flat_map(|bits| [(bits >> 32) as u32, bits as u32]).collect();
    words.extend([pixel.n_samples, pixel.n_negative, pixel.n_dropped]);
    if let Some(guide) = guide {
        let [instance, primitive] = guide.first.unwrap_or([u32::MAX; 2]);
        words.extend([guide.n_hits, instance, primitive]);
    }
    words
}

fn checksum(channels: &[Vec<u32>]) -> u64 {
    let mut hash = Hash::default();
    channels.iter().for_each(|words| hash.words(words.iter().copied()));
    hash.finish()
}

/// Reads a part that [`write_film`] wrote: the film, its AOVs and its record.
///
/// # Errors
/// [`FileError`] where the file cannot be read, has no part, or is damaged.
pub fn read_part(path: &Path) -> Result<(Film, Aovs, Record), FileError> {
    read_file(path, decode)
}

fn decode(bytes: &[u8]) -> Result<(Film, Aovs, Record), String> {
    check_exr_size(bytes)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    let attribute = |layer: &Layer<_>| layer.attributes.other.get(&Text::from(RECORD)).cloned();
    let found = image.layer_data.iter().find_map(|layer| Some((layer, attribute(layer)?)));
    let Some((layer, AttributeValue::Text(text))) = found else {
        return Err("it has no sample sums; --samples writes them".to_owned());
    };
    let mut record = record_from_lines(&text.to_string());
    let mut take = |name: &str| {
        let at = record.iter().position(|(known, _)| known == name);
        at.map(|at| record.remove(at).1).ok_or_else(|| format!("its record has no line '{name}'"))
    };
    let (samples, aovs, expected) = (take(SAMPLES)?, take(AOVS)?, take(CHECKSUM)?);
    let range = samples
        .split_once("..")
        .and_then(|(start, end)| Some(start.parse().ok()?..end.parse().ok()?))
        .filter(|range| range.start < range.end)
        .ok_or_else(|| format!("its samples '{samples}' are not a range"))?;
    let aovs: Aovs = aovs.split(',').filter_map(|name| Aov::ALL.into_iter().find(|aov| aov.name() == name)).collect();

    let stored = Stored { guide: !aovs.is_empty(), components: aovs.has_components(), first: aovs.has_factors() };
    let blocks = Block::of(range.clone());
    let names = stored.channel_names(blocks.len());
    let mut channels = Vec::new();
    for name in &names {
        let found = layer.channel_data.list.iter().find(|channel| channel.name == **name);
        match found.map(|channel| &channel.sample_data) {
            Some(FlatSamples::U32(words)) if words.len() == layer.size.area() => channels.push(words.clone()),
            _ => return Err(format!("its channel '{name}' of u32 is missing")),
        }
    }
    let found = format!("{:016x}", checksum(&channels));
    if found != expected {
        return Err(format!("its sums are damaged: their checksum is {found}, not {expected}"));
    }
    let n_words = names.len() / blocks.len();
    let (mut pixels, mut guides, mut components) = (Vec::new(), Vec::new(), Vec::new());
    for at in 0..layer.size.area() {
        let words: Vec<u32> = channels.iter().map(|words| words[at]).collect();
        for (block, words) in blocks.iter().zip(words.chunks(n_words)) {
            let (pixel, guide, of_block) = stored.decoded(words);
            let hits = guide.as_ref().map_or(0, |guide: &Guide| guide.n_hits);
            let Pixel { n_samples, n_negative, n_dropped, .. } = pixel;
            if n_samples.checked_add(n_dropped) != Some(block.len) || n_negative > n_samples || hits > block.len {
                return Err(format!("pixel {at} does not have {} samples from {}", block.len, block.first));
            }
            pixels.push(pixel);
            guides.extend(guide);
            components.extend(of_block);
        }
    }
    let side = |n: usize| u32::try_from(n).map_err(|_| format!("{n} pixels along one side are too many"));
    let part = Part::new(range, pixels, guides, components);
    let film = Film::of_part(side(layer.size.0)?, side(layer.size.1)?, part, 0);
    Ok((film, aovs, record))
}

/// How a picture was rendered: names and values in order.
pub type Record = Vec<(String, String)>;

/// One line per entry.
pub(crate) fn record_lines(record: &[(String, String)]) -> String {
    record.iter().map(|(name, value)| format!("{name}: {value}\n")).collect()
}

/// The entries of lines; lines without a colon are skipped.
pub(crate) fn record_from_lines(text: &str) -> Record {
    let entry = |line: &str| line.split_once(": ").map(|(name, value)| (name.to_owned(), value.to_owned()));
    text.lines().filter_map(entry).collect()
}
