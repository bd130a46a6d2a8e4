//! Changes of files: bytes, pieces, numbers in text, pieces of other files.

use crate::corpus::{Corpus, Entry, Kind};
use crate::structure;

/// Random numbers by SplitMix64 (Steele et al. 2014).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// A number below `n`, and 0 where `n` is.
    #[expect(clippy::cast_possible_truncation, reason = "below a length")]
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % (n as u64).max(1)) as usize
    }

    fn byte(&mut self) -> u8 {
        self.next().to_le_bytes()[0]
    }
}

/// A number that two files rarely share (FNV-1a).
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Bytes that readers meet rarely: all ones, NaN, infinity, the largest and the least.
const UGLY_BYTES: [[u8; 4]; 8] = [
    [0xff; 4],
    [0; 4],
    [0, 0, 0xc0, 0x7f],
    [0, 0, 0x80, 0xff],
    [0xff, 0xff, 0x7f, 0x7f],
    [0xff, 0xff, 0xff, 0x7f],
    [1, 0, 0, 0x80],
    [0x7f, 0xff, 0xff, 0xff],
];

/// Numbers that texts have rarely.
pub(crate) const UGLY_NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1",
    "2",
    "7",
    "255",
    "65536",
    "4294967295",
    "18446744073709551615",
    "1e39",
    "-1e-45",
    "0.5",
    "nan",
    "null",
];

/// Longest piece that is cut out, doubled or taken from another file.
const MOST_PIECE: usize = 64;

/// The file with one to four changes: of what the parser makes of it, where it is JSON or TOML, in half of the cases.
pub(crate) fn mutated(entry: &Entry, corpus: &Corpus, random: &mut Random) -> Vec<u8> {
    if random.below(2) == 0
        && let Some(bytes) = well_formed(entry, random)
    {
        return bytes;
    }
    if entry.kind == Kind::Glb
        && let Some((json, bin)) = parts(&entry.bytes)
        && random.below(4) > 0
    {
        // In a container whose lengths are right, changes get further.
        let (mut json, mut bin) = (json.to_vec(), bin.to_vec());
        let part = if random.below(3) > 0 { &mut json } else { &mut bin };
        change_often(part, corpus, random);
        return joined(&json, &bin);
    }
    let mut bytes = entry.bytes.clone();
    change_often(&mut bytes, corpus, random);
    bytes
}

/// The file with changes that leave it well-formed; `None` where it has no such structure.
fn well_formed(entry: &Entry, random: &mut Random) -> Option<Vec<u8>> {
    match entry.kind {
        Kind::Gltf => structure::json(&entry.bytes, random),
        Kind::Glb => {
            let (json, bin) = parts(&entry.bytes)?;
            Some(joined(&structure::json(json, random)?, bin))
        }
        Kind::SceneFile => Some(structure::toml(&entry.bytes, random)),
        _ => None,
    }
}

fn change_often(bytes: &mut Vec<u8>, corpus: &Corpus, random: &mut Random) {
    for _ in 0..=random.below(4) {
        change(bytes, corpus, random);
    }
}

fn change(bytes: &mut Vec<u8>, corpus: &Corpus, random: &mut Random) {
    let at = random.below(bytes.len() + 1);
    let end = (at + 1 + random.below(MOST_PIECE)).min(bytes.len());
    match random.below(10) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end)),
        2 => {
            let piece = bytes[at..end].to_vec();
            insert(bytes, at, &piece);
        }
        3 => {
            let other = &corpus.entries[random.below(corpus.entries.len())].bytes;
            let start = random.below(other.len());
            let piece = &other[start..(start + MOST_PIECE).min(other.len())];
            insert(bytes, at, piece);
        }
        4 | 5 => overwrite(bytes, at, &UGLY_BYTES[random.below(UGLY_BYTES.len())]),
        6 | 7 => overwrite(bytes, at, &[random.byte()]),
        _ => change_number(bytes, at, UGLY_NUMBERS[random.below(UGLY_NUMBERS.len())]),
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, piece: &[u8]) {
    bytes.splice(at..at, piece.iter().copied());
}

fn overwrite(bytes: &mut [u8], at: usize, piece: &[u8]) {
    bytes[at..].iter_mut().zip(piece).for_each(|(byte, new)| *byte = *new);
}

/// Puts another number in the place of the next one in a text.
fn change_number(bytes: &mut Vec<u8>, at: usize, number: &str) {
    let is_digit = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|offset| at + offset) else { return };
    let end = start + bytes[start..].iter().position(|byte| !is_digit(byte)).unwrap_or(bytes.len() - start);
    bytes.splice(start..end, number.bytes());
}

/// JSON and binary chunk of a whole GLB.
fn parts(glb: &[u8]) -> Option<(&[u8], &[u8])> {
    let length = |at: usize| Some(u32::from_le_bytes(glb.get(at..at + 4)?.try_into().ok()?) as usize);
    let json_end = 20_usize.checked_add(length(12)?)?;
    let json = glb.get(20..json_end)?;
    let bin = glb.get(json_end + 8..).unwrap_or_default();
    Some((json, bin))
}

fn joined(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let word = |length: usize| u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes();
    let chunk = |kind: &[u8], content: &[u8]| [&word(content.len())[..], kind, content].concat();
    let chunks = [chunk(b"JSON", json), chunk(b"BIN\0", bin)].concat();
    [b"glTF\x02\0\0\0", &word(12 + chunks.len())[..], &chunks].concat()
}
