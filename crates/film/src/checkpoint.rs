//! Stores finished tiles in a file from which the render can resume.
//!
//! ```text
//! reads   finished tiles, and the record of their render
//! writes  a format line, the record, an empty line, then words of 64 bits, little endian; the last is a checksum
//! holds   reading returns what was written, bit for bit; a file with a changed bit is rejected
//! ```

use std::path::Path;

use crate::atomic_file::read_file;
use crate::film_file::{Record, record_from_lines, record_lines};
use crate::{AtomicFile, Components, FileError, Guide, Hash, Pixel, Tile};

const FORMAT: &str = "canted checkpoint 4\n";

/// Words of a pixel, of a guide, and of components, whose first says whether the light at the first surface is stored.
const PIXEL_WORDS: usize = 8;
const GUIDE_WORDS: usize = 14;
const COMPONENT_WORDS: usize = 22;

/// Finished tiles, encoded.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    bytes: Vec<u8>,
}

impl Checkpoint {
    /// An empty checkpoint of the render that `record` describes.
    ///
    /// Names and values must not contain line breaks, names no colons.
    #[must_use]
    pub fn new(record: &[(String, String)]) -> Self {
        Self { bytes: format!("{FORMAT}{}\n", record_lines(record)).into_bytes() }
    }

    /// Adds a finished tile.
    pub fn add(&mut self, tile: &Tile) {
        let numbers = [tile.number, tile.pixels.len(), tile.guides.len(), tile.components.len()].map(|n| n as u64);
        let words = numbers.into_iter().chain([tile.n_rays]);
        let words = words.chain(tile.pixels.iter().flat_map(pixel_words));
        let components = tile.components.iter().flat_map(component_words);
        for word in words.chain(tile.guides.iter().flat_map(guide_words)).chain(components) {
            self.bytes.extend(word.to_le_bytes());
        }
    }

    /// Writes the file atomically.
    ///
    /// # Errors
    /// [`FileError`] with the file and the reason.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let end = checksum(&self.bytes).to_le_bytes();
        let mut file = AtomicFile::create(path)?;
        file.write(|out| out.write_all(&self.bytes).and_then(|()| out.write_all(&end)))?;
        file.finish()
    }

    /// Reads a checkpoint: its record and its tiles.
    ///
    /// # Errors
    /// [`FileError`] where the file cannot be read, is not a checkpoint, or is damaged.
    pub fn read(path: &Path) -> Result<(Record, Vec<Tile>), FileError> {
        read_file(path, decode)
    }
}

fn checksum(bytes: &[u8]) -> u64 {
    let mut hash = Hash::default();
    hash.bytes(bytes);
    hash.finish()
}

fn pixel_words(pixel: &Pixel) -> [u64; PIXEL_WORDS] {
    let [r, g, b] = pixel.sum.map(f64::to_bits);
    let [rr, gg, bb] = pixel.sum_of_squares.map(f64::to_bits);
    [r, g, b, rr, gg, bb, pair([pixel.n_samples, pixel.n_negative]), u64::from(pixel.n_dropped)]
}

fn guide_words(guide: &Guide) -> [u64; GUIDE_WORDS] {
    let sums = guide.sums();
    let ids = guide.first.unwrap_or([u32::MAX; 2]);
    std::array::from_fn(|k| match k {
        0 => u64::from(guide.n_hits),
        1 => pair(ids),
        _ => sums[k - 2].to_bits(),
    })
}

fn component_words(components: &Components) -> impl Iterator<Item = u64> {
    [u64::from(components.first.is_some())].into_iter().chain(components.numbers().map(f64::to_bits))
}

fn pair([high, low]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

fn halves(word: u64) -> [u32; 2] {
    [(word >> 32) as u32, word as u32]
}

fn decode(bytes: &[u8]) -> Result<(Record, Vec<Tile>), String> {
    let damaged = || "it is damaged".to_owned();
    let Some(body) = bytes.strip_prefix(FORMAT.as_bytes()) else {
        return Err("it is not a checkpoint of this version".to_owned());
    };
    let (content, end) = bytes.split_last_chunk::<8>().map(|(content, end)| (content, *end)).ok_or_else(damaged)?;
    if checksum(content) != u64::from_le_bytes(end) {
        return Err(damaged());
    }
    let body = body.strip_suffix(&end).ok_or_else(damaged)?;
    // If the record is empty, the format line ends with the first of the two line breaks.
    let head = &bytes[FORMAT.len() - 1..];
    let at = head.windows(2).position(|pair| pair == b"\n\n").ok_or_else(damaged)?;
    let record = record_from_lines(std::str::from_utf8(&head[..at]).map_err(|_| damaged())?.trim_start());
    let (words, rest) = body.get(at + 1..).ok_or_else(damaged)?.as_chunks::<8>();
    if !rest.is_empty() {
        return Err(damaged());
    }
    let mut words = words.iter().map(|&word| u64::from_le_bytes(word));
    let mut tiles = Vec::new();
    while let Some(number) = words.next() {
        tiles.push(tile(number, &mut words).ok_or_else(damaged)?);
    }
    Ok((record, tiles))
}

/// Decodes a tile after its number; `None` if words are missing.
fn tile(number: u64, words: &mut impl ExactSizeIterator<Item = u64>) -> Option<Tile> {
    let mut count = || usize::try_from(words.next()?).ok();
    let counts @ [n_pixels, n_guides, n_components] = [count()?, count()?, count()?];
    let n_rays = words.next()?;
    let mut n = 0_usize;
    for (count, words) in counts.into_iter().zip([PIXEL_WORDS, GUIDE_WORDS, COMPONENT_WORDS]) {
        n = n.checked_add(count.checked_mul(words)?)?;
    }
    if n > words.len() {
        return None;
    }
    let mut next = || words.next().unwrap_or_default();
    let pixels = (0..n_pixels).map(|_| {
        let sum = std::array::from_fn(|_| f64::from_bits(next()));
        let sum_of_squares = std::array::from_fn(|_| f64::from_bits(next()));
        let [n_samples, n_negative] = halves(next());
        let [_, n_dropped] = halves(next());
        Pixel { sum, sum_of_squares, n_samples, n_negative, n_dropped }
    });
    let pixels = pixels.collect();
    let guides = (0..n_guides).map(|_| {
        let [_, n_hits] = halves(next());
        let ids = halves(next());
        let first = (ids != [u32::MAX; 2]).then_some(ids);
        Guide::from_sums(n_hits, first, std::array::from_fn(|_| f64::from_bits(next())))
    });
    let guides = guides.collect();
    let components = (0..n_components).map(|_| {
        let has_first = next() != 0;
        let numbers: [f64; COMPONENT_WORDS - 1] = std::array::from_fn(|_| f64::from_bits(next()));
        let mut numbers = numbers.into_iter();
        Components::from_numbers(|| numbers.next().unwrap_or_default(), has_first)
    });
    let components = components.collect();
    Some(Tile { number: usize::try_from(number).ok()?, pixels, guides, components, n_rays })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> (Record, Vec<Tile>) {
        let record = vec![("size".to_owned(), "3x1".to_owned()), ("empty".to_owned(), String::new())];
        let pixel = Pixel::of([0.25, -0.0, 1e-30]) + Pixel::of([f32::NAN; 3]);
        let guide = Guide { n_hits: 2, first: Some([7, u32::MAX]), depth: 0.1, tests: [3.0, 4.5], ..Guide::default() };
        let tile = |number: usize| Tile {
            number,
            pixels: vec![pixel; 3],
            guides: vec![guide, Guide::default()],
            components: [None, Some([[0.5, 0.25, 1.0], [-0.0, 3.0, 1e-30], [7.0; 3], [1.0, 2.0, 4.0]])]
                .map(|first| Components::weighted([[0.1, -0.0, 3.0], [1e-30, 7.0, 0.0], [2.0, 4.0, 8.0]], first, 1.0))
                .to_vec(),
            n_rays: u64::MAX,
        };
        (record, vec![tile(1), tile(0)])
    }

    fn bytes() -> Vec<u8> {
        let (record, tiles) = sample();
        let mut checkpoint = Checkpoint::new(&record);
        tiles.iter().for_each(|tile| checkpoint.add(tile));
        let mut bytes = checkpoint.bytes.clone();
        bytes.extend(checksum(&checkpoint.bytes).to_le_bytes());
        bytes
    }

    #[test]
    fn tiles_survive_the_round_trip() {
        assert_eq!(decode(&bytes()), Ok(sample()));
        let empty = Checkpoint::new(&[]).bytes;
        let end = checksum(&empty).to_le_bytes();
        assert_eq!(decode(&[&empty[..], &end].concat()), Ok((Vec::new(), Vec::new())));
    }

    #[test]
    fn changed_and_missing_bytes_are_detected() {
        let bytes = bytes();
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            assert!(decode(&changed).is_err(), "byte {at}");
            assert!(decode(&bytes[..at]).is_err(), "cut at {at}");
        }
    }

    /// Wrong counts with a valid checksum.
    #[test]
    fn counts_that_exceed_the_file_are_rejected() {
        for words in [
            [0, u64::MAX, 0, 0, 0],
            [0, 0, u64::MAX / 14, 0, 0],
            [0, 0, 0, u64::MAX / 22, 0],
            [0, 1, 0, 0, 0],
            [0, 0, 0, 1, 0],
        ] {
            let mut bytes = Checkpoint::new(&[]).bytes;
            bytes.extend(words.iter().flat_map(|word: &u64| word.to_le_bytes()));
            bytes.extend(checksum(&bytes).to_le_bytes());
            assert_eq!(decode(&bytes), Err("it is damaged".to_owned()));
        }
    }
}
