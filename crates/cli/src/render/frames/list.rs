//! The list of frames: what each picture of a sequence was rendered with, by which `--resume` keeps or rejects it.
//!
//! A text file beside the pictures, with a line of JSON for each: its name, a hash of its bytes, and a record of everything
//! that determines its pixels. A line is added once the picture is whole. A line that cannot be read is no line.

use std::{
    collections::BTreeMap,
    fs::{self, OpenOptions},
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::{AtomicFile, Hash, Record};
use serde_json::{Value, json};

/// The list of a sequence.
pub(super) struct FrameList {
    path: PathBuf,
    /// The last line of each picture, by name.
    lines: BTreeMap<String, Line>,
}

struct Line {
    /// Hash of the file.
    bytes: String,
    record: Record,
}

impl FrameList {
    /// Reads the list, if there is one.
    pub(super) fn read(path: PathBuf) -> Self {
        let text = fs::read_to_string(&path).unwrap_or_default();
        Self { path, lines: text.lines().filter_map(parse).collect() }
    }

    /// The record of a picture; `None` where the list has no line about the file as it is.
    pub(super) fn record_of(&self, picture: &Path) -> Option<&Record> {
        let line = self.lines.get(&name(picture))?;
        (hash(picture).ok()? == line.bytes).then_some(&line.record)
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the lines of pictures that are about to be rendered.
    pub(super) fn forget<'a>(&mut self, pictures: impl Iterator<Item = &'a Path>) -> Result<()> {
        pictures.for_each(|picture| drop(self.lines.remove(&name(picture))));
        let text: String = self.lines.iter().map(|(name, line)| line.text(name)).collect();
        let mut file = AtomicFile::create(&self.path)?;
        file.write(|out| out.write_all(text.as_bytes()))?;
        Ok(file.finish()?)
    }

    /// Adds the line of a picture that is whole.
    pub(super) fn add(&mut self, picture: &Path, record: Record) -> Result<()> {
        let line = Line { bytes: hash(picture)?, record };
        let text = line.text(&name(picture));
        let file = OpenOptions::new().append(true).open(&self.path);
        let written = file.and_then(|mut file| file.write_all(text.as_bytes()));
        written.map_err(|error| anyhow!("{}: cannot write file: {error}", self.path.display()))
    }
}

impl Line {
    fn text(&self, name: &str) -> String {
        format!("{}\n", json!({ "picture": name, "bytes": self.bytes, "record": self.record }))
    }
}

fn parse(line: &str) -> Option<(String, Line)> {
    let line: Value = serde_json::from_str(line).ok()?;
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let entry = |pair: &Value| Some((text(pair.get(0)?)?, text(pair.get(1)?)?));
    let record = line["record"].as_array()?.iter().map(entry).collect::<Option<Record>>()?;
    Some((text(&line["picture"])?, Line { bytes: text(&line["bytes"])?, record }))
}

/// The name of a picture in its folder.
fn name(picture: &Path) -> String {
    picture.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A hash of a file.
fn hash(path: &Path) -> Result<String> {
    let bytes = fs::read(path).map_err(|error| anyhow!("{}: cannot read file: {error}", path.display()))?;
    let mut hash = Hash::default();
    hash.bytes(&bytes);
    Ok(format!("{:016x}", hash.finish()))
}
