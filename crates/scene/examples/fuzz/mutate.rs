//! Mutations: bytes, ranges, numbers in text, ranges of other files.

use crate::corpus::{Corpus, Entry, Kind};
use crate::structure;

/// SplitMix64 (Steele et al. 2014).
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

    /// A number below `n`; 0 for `n` = 0.
    #[expect(clippy::cast_possible_truncation, reason = "below a length")]
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % (n as u64).max(1)) as usize
    }

    fn byte(&mut self) -> u8 {
        self.next().to_le_bytes()[0]
    }
}

/// FNV-1a hash.
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Unusual words: all ones, NaN, infinity, extreme values.
const UNUSUAL_BYTES: [[u8; 4]; 8] = [
    [0xff; 4],
    [0; 4],
    [0, 0, 0xc0, 0x7f],
    [0, 0, 0x80, 0xff],
    [0xff, 0xff, 0x7f, 0x7f],
    [0xff, 0xff, 0xff, 0x7f],
    [1, 0, 0, 0x80],
    [0x7f, 0xff, 0xff, 0xff],
];

/// Unusual numbers in text.
pub(crate) const UNUSUAL_NUMBERS: [&str; 14] = [
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

/// Longest range that is removed, duplicated or copied from another file.
const MAX_RANGE: usize = 64;

/// The file with one to four mutations; for JSON and TOML half of them keep the syntax valid.
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
        // Keeps the container lengths consistent.
        let (mut json, mut bin) = (json.to_vec(), bin.to_vec());
        let part = if random.below(3) > 0 { &mut json } else { &mut bin };
        change_often(part, corpus, random);
        return joined(&json, &bin);
    }
    let mut bytes = entry.bytes.clone();
    change_often(&mut bytes, corpus, random);
    bytes
}

/// Mutations that keep the syntax valid; `None` for formats without syntax.
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
    let end = (at + 1 + random.below(MAX_RANGE)).min(bytes.len());
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
            let piece = &other[start..(start + MAX_RANGE).min(other.len())];
            insert(bytes, at, piece);
        }
        4 | 5 => overwrite(bytes, at, &UNUSUAL_BYTES[random.below(UNUSUAL_BYTES.len())]),
        6 | 7 => overwrite(bytes, at, &[random.byte()]),
        _ => change_number(bytes, at, UNUSUAL_NUMBERS[random.below(UNUSUAL_NUMBERS.len())]),
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, piece: &[u8]) {
    bytes.splice(at..at, piece.iter().copied());
}

fn overwrite(bytes: &mut [u8], at: usize, piece: &[u8]) {
    bytes[at..].iter_mut().zip(piece).for_each(|(byte, new)| *byte = *new);
}

/// Replaces the next number in a text.
fn change_number(bytes: &mut Vec<u8>, at: usize, number: &str) {
    let is_digit = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|offset| at + offset) else { return };
    let end = start + bytes[start..].iter().position(|byte| !is_digit(byte)).unwrap_or(bytes.len() - start);
    bytes.splice(start..end, number.bytes());
}

/// JSON and binary chunk of a GLB.
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
