//! Seed files (small files of the scene folder, of `tests/files`, and the example scene files) and their mutations: bytes, ranges, numbers
//! in text, ranges of other files, and for JSON and TOML changes that keep the syntax valid.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{fs, io};

use serde_json::Value;

/// Larger files are skipped, because they are slow.
pub(crate) const MAX_BYTES: u64 = 1 << 18;

/// The reader of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Obj,
    Mtl,
    Ply,
    Gltf,
    Glb,
    Texture,
    Hdr,
    Exr,
    SceneFile,
    Stl,
    Off,
    Gzip,
    Bmp,
    Tga,
    Tiff,
    Webp,
    Ktx2,
    /// glTF compressed by `meshopt`.
    Meshopt,
    /// glTF compressed by Draco.
    Draco,
}

impl Kind {
    /// Whether this build reads the format.
    fn is_read(self) -> bool {
        match self {
            Self::Stl => cfg!(feature = "stl"),
            Self::Off => cfg!(feature = "off"),
            Self::Gzip => cfg!(feature = "gzip"),
            Self::Bmp => cfg!(feature = "bmp"),
            Self::Tga => cfg!(feature = "tga"),
            Self::Tiff => cfg!(feature = "tiff"),
            Self::Webp => cfg!(feature = "webp"),
            Self::Ktx2 => cfg!(feature = "ktx2"),
            Self::Draco => cfg!(feature = "draco"),
            _ => true,
        }
    }
}

/// A seed file.
pub(crate) struct Entry {
    /// Path relative to the scene or example folder.
    pub(crate) file: PathBuf,
    pub(crate) kind: Kind,
    /// The scene that references it, or itself.
    pub(crate) read_through: PathBuf,
    pub(crate) bytes: Vec<u8>,
}

/// All seed files.
pub(crate) struct Corpus {
    pub(crate) entries: Vec<Entry>,
    /// Files that scenes reference but that are not mutated.
    others: Vec<(PathBuf, Vec<u8>)>,
}

impl Corpus {
    /// Reads the folder `CANTED_SCENES`, else `../shared/scenes` next to the workspace; `None` if absent or empty.
    pub(crate) fn load() -> Option<Self> {
        let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
        let root = std::env::var_os("CANTED_SCENES").map_or_else(|| PathBuf::from(default), PathBuf::from);
        let mut corpus = Self { entries: Vec::new(), others: Vec::new() };
        corpus.add(&root).ok()?;
        let is_empty = corpus.entries.is_empty();
        for folder in ["/../../examples", "/../../tests/files"] {
            corpus.add(&Path::new(env!("CARGO_MANIFEST_DIR")).join(&folder[1..])).ok()?;
        }
        (!is_empty).then_some(corpus)
    }

    /// A random file: first draws a kind, so that all readers are tested equally often.
    pub(crate) fn draw(&self, random: &mut Random) -> &Entry {
        let kinds: BTreeSet<Kind> = self.entries.iter().map(|entry| entry.kind).collect();
        let kinds: Vec<Kind> = kinds.into_iter().collect();
        let kind = kinds[random.below(kinds.len())];
        let of_kind: Vec<&Entry> = self.entries.iter().filter(|entry| entry.kind == kind).collect();
        of_kind[random.below(of_kind.len())]
    }

    /// Adds the small files of a folder.
    fn add(&mut self, root: &Path) -> io::Result<()> {
        let mut files = Vec::new();
        list(root, &mut files)?;
        // Directory order depends on the system.
        files.sort();
        for path in files {
            let (Ok(bytes), Ok(file)) = (fs::read(&path), path.strip_prefix(root)) else { continue };
            match kind(file) {
                Some((kind, read_through)) if kind.is_read() && root.join(&read_through).is_file() => {
                    self.entries.push(Entry { file: file.to_owned(), kind, read_through, bytes });
                }
                Some((kind, read_through)) if kind.is_read() && kind >= Kind::Bmp => {
                    self.add_material(&read_through, file);
                    self.entries.push(Entry { file: file.to_owned(), kind, read_through, bytes });
                }
                _ => self.others.push((file.to_owned(), bytes)),
            }
        }
        Ok(())
    }

    /// Adds a triangle at `object` whose material has a texture.
    fn add_material(&mut self, object: &Path, texture: &Path) {
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let library = object.with_extension("mtl");
        let text = format!("newmtl a\nmap_Kd {}\nmap_d {0}\n", name(texture));
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n";
        let mesh = format!("mtllib {}\n{triangle}", name(&library));
        self.others.extend([(library, text.into_bytes()), (object.to_owned(), mesh.into_bytes())]);
    }

    /// Writes all files below a folder.
    pub(crate) fn write(&self, folder: &Path) -> io::Result<()> {
        let others = self.others.iter().map(|(file, bytes)| (file, bytes));
        for (file, bytes) in self.entries.iter().map(|entry| (&entry.file, &entry.bytes)).chain(others) {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap_or(folder))?;
            fs::write(path, bytes)?;
        }
        Ok(())
    }
}

/// Lists all small files below a folder.
fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            list(&entry.path(), files)?;
        } else if entry.metadata()?.len() <= MAX_BYTES {
            files.push(entry.path());
        }
    }
    Ok(())
}

/// The mesh through which a texture is read.
fn through(texture: &Path) -> PathBuf {
    let name = texture.file_name().unwrap_or_default().to_string_lossy();
    texture.with_file_name(format!("{name}-read.obj"))
}

/// The reader of a file, and the scene to read it through.
fn kind(file: &Path) -> Option<(Kind, PathBuf)> {
    let ending = file.extension()?.to_str()?;
    let kind = match ending {
        "obj" => Kind::Obj,
        "stl" => Kind::Stl,
        "off" => Kind::Off,
        "gz" => Kind::Gzip,
        "bmp" => return Some((Kind::Bmp, through(file))),
        "tga" => return Some((Kind::Tga, through(file))),
        "tiff" => return Some((Kind::Tiff, through(file))),
        "webp" => return Some((Kind::Webp, through(file))),
        "ktx2" => return Some((Kind::Ktx2, through(file))),
        "gltf" if file.starts_with("meshopt") => Kind::Meshopt,
        "gltf" if file.starts_with("draco") => Kind::Draco,
        "ply" => Kind::Ply,
        "gltf" => Kind::Gltf,
        "glb" => Kind::Glb,
        "hdr" => Kind::Hdr,
        "exr" => Kind::Exr,
        "toml" => Kind::SceneFile,
        "mtl" => return Some((Kind::Mtl, file.with_extension("obj"))),
        "png" | "jpg" => return Some((Kind::Texture, file.with_file_name("images.obj"))),
        _ => return None,
    };
    Some((kind, file.to_owned()))
}

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
        Kind::Gltf => mutated_json(&entry.bytes, random),
        Kind::Glb => {
            let (json, bin) = parts(&entry.bytes)?;
            Some(joined(&mutated_json(json, random)?, bin))
        }
        Kind::SceneFile => Some(mutated_toml(&entry.bytes, random)),
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

/// JSON with one to four mutations; `None` for invalid JSON.
fn mutated_json(bytes: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let mut root: Value = serde_json::from_slice(bytes).ok()?;
    for _ in 0..=random.below(4) {
        change_json(&mut root, random);
    }
    serde_json::to_vec(&root).ok()
}

/// Mutates a random value, each with equal probability.
fn change_json(root: &mut Value, random: &mut Random) {
    let mut at = random.below(n_values(root));
    if let Some(value) = nth(root, &mut at) {
        change_value(value, random);
    }
}

/// Number of values including nested ones.
fn n_values(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(n_values).sum(),
        Value::Object(members) => members.values().map(n_values).sum(),
        _ => 0,
    }
}

/// The value with index `at` in depth-first order.
fn nth<'a>(value: &'a mut Value, at: &mut usize) -> Option<&'a mut Value> {
    if *at == 0 {
        return Some(value);
    }
    *at -= 1;
    match value {
        Value::Array(items) => items.iter_mut().find_map(|item| nth(item, at)),
        Value::Object(members) => members.values_mut().find_map(|member| nth(member, at)),
        _ => None,
    }
}

fn change_value(value: &mut Value, random: &mut Random) {
    match value {
        Value::Number(number) => {
            // Small steps give off-by-one errors.
            let near = number.as_i64().map(|n| n.saturating_add([-1, 1, 2][random.below(3)]).into());
            let unusual = serde_json::from_str(UNUSUAL_NUMBERS[random.below(UNUSUAL_NUMBERS.len())]).ok();
            let new = if random.below(2) == 0 { near } else { unusual };
            *value = new.unwrap_or(Value::from(random.below(6)));
        }
        Value::Array(items) if !items.is_empty() => {
            let [a, b] = [0; 2].map(|_| random.below(items.len()));
            match random.below(4) {
                0 => drop(items.remove(a)),
                1 => items.insert(b, items[a].clone()),
                2 => items.swap(a, b),
                _ => items.truncate(a),
            }
        }
        Value::Object(members) if !members.is_empty() => {
            let keys: Vec<String> = members.keys().cloned().collect();
            let [a, b] = [0; 2].map(|_| &keys[random.below(keys.len())]);
            match (random.below(2), members.get(a).cloned()) {
                (0, Some(other)) => drop(members.insert(b.clone(), other)),
                _ => drop(members.remove(a)),
            }
        }
        Value::Bool(flag) => *flag = !*flag,
        Value::String(text) => {
            let other = ["", "VEC3", "VEC4", "SCALAR", "MASK", "BLEND", "STEP", "CUBICSPLINE", "weights", "scale"];
            *text = other[random.below(other.len())].to_owned();
        }
        Value::Null | Value::Array(_) | Value::Object(_) => *value = Value::from(random.below(6)),
    }
}

/// A scene file with one to four mutations of lines and tables.
fn mutated_toml(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=random.below(4) {
        change_line(&mut lines, random);
    }
    lines.join("\n").into_bytes()
}

fn change_line(lines: &mut Vec<String>, random: &mut Random) {
    if lines.is_empty() {
        return;
    }
    let [a, b] = [0; 2].map(|_| random.below(lines.len()));
    let value_of = |line: &String| Some(line.split_once('=')?.1.split('#').next()?.trim().to_owned());
    match random.below(5) {
        0 => drop(lines.remove(a)),
        1 => {
            let table = table_of(lines, a);
            let copy = lines[table.clone()].to_vec();
            lines.splice(table.end..table.end, copy);
        }
        2 => drop(lines.drain(table_of(lines, a))),
        // Replaces the value by that of another key, or by an unusual number.
        kind => {
            let number = UNUSUAL_NUMBERS[random.below(UNUSUAL_NUMBERS.len())].to_owned();
            let new = if kind == 3 { value_of(&lines[b]) } else { Some(number) };
            if let (Some((key, _)), Some(new)) = (lines[a].clone().split_once('='), new) {
                lines[a] = format!("{key}= {new}");
            }
        }
    }
}

/// The lines of the table around a line, including its header.
fn table_of(lines: &[String], at: usize) -> std::ops::Range<usize> {
    let is_heading = |line: &String| line.starts_with('[');
    let start = lines[..=at].iter().rposition(is_heading).unwrap_or(0);
    let end = lines[at + 1..].iter().position(is_heading).map_or(lines.len(), |n| at + 1 + n);
    start..end
}
