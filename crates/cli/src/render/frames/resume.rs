//! The list of finished frames: what each picture of a sequence was rendered with, by which `--resume` keeps or rejects it.
//!
//! A text file beside the pictures of an unfinished sequence, with a line of JSON for each: its name, a hash of its bytes, and a record of
//! everything that determines its pixels. A line is added once the picture is whole. A line that cannot be read is no line.

use std::{
    collections::BTreeMap,
    fs::{self, OpenOptions},
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use anyhow::{Result, anyhow};
use canted_film::{AtomicFile, Hash, Record, read_picture};
use canted_renderer::{geometry_hash, light_hash, material_hash};
use canted_scene::Scene;
use serde_json::{Value, json};

use super::Job;
use crate::{output, render::difference, settings::Plan};

/// Whether a frame exists as a whole picture of this size. Warns about a file that is no whole picture: it is rendered again.
///
/// # Errors
/// A picture of another size, which belongs to another sequence.
pub(super) fn is_whole(path: &Path, [width, height]: [u32; 2]) -> Result<bool> {
    if !path.exists() {
        return Ok(false);
    }
    match read_picture(path) {
        Ok(picture) if [picture.width, picture.height] == [width, height] => Ok(true),
        Ok(picture) => Err(anyhow!(
            "{}: the picture is {} x {}, not {width} x {height}; remove it, or render without --resume",
            path.display(),
            picture.width,
            picture.height
        )),
        Err(error) => {
            output::warn(&format!("rendering the frame again: {error}"));
            Ok(false)
        }
    }
}

const REMEDY: &str = "remove the picture, or render without --resume";

/// Rejects a whole picture that differs from what was rendered now.
pub(super) fn check_same(path: &Path, rendered: &Path) -> Result<()> {
    if hash(path)? == hash(rendered)? {
        return Ok(());
    }
    Err(anyhow!("{}: differs from the picture of these options and this scene; {REMEDY}", path.display()))
}

/// Rejects a whole picture that was not rendered with this record.
pub(super) fn check(path: &Path, list: &FrameList, ours: &Record) -> Result<()> {
    let (name, remedy) = (path.display(), REMEDY);
    let Some(theirs) = list.record_of(path) else {
        let list = list.path().display();
        return Err(anyhow!("{name}: {list} does not state what this picture was rendered with; {remedy}"));
    };
    match difference(theirs, ours) {
        Some((what, theirs, ours)) => {
            Err(anyhow!("{name}: rendered with another {what}: {theirs}, not {ours}; {remedy}"))
        }
        None => Ok(()),
    }
}

/// What all frames share.
pub(super) fn shared(job: &Job, scene: &mut Scene, device: String) -> Record {
    // Without `..`, so that a new option cannot be forgotten.
    let Job { plan, output, sequence: _, run: _, boxes, passes: _, checkpoint: _, chooses_sums: _ } = job;
    let Plan {
        source: _, camera, light, structure, look, heatmap, settings, integrator, first_hit: _, options, ..
    } = plan;
    // Lights differ between frames.
    let lights = std::mem::take(&mut scene.lights);
    let environment = light_hash(scene);
    scene.lights = lights;
    let own = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("device", device),
        ("range of samples", format!("{:?}", settings.range())),
        ("noise", settings.noise.map_or_else(|| "none".to_owned(), |noise| noise.to_string())),
        ("list of channels", output.aovs.to_string()),
        ("heat map", format!("{heatmap:?}")),
        ("use of --denoise", output.denoising.name().to_owned()),
        ("boxes", format!("{boxes:?}")),
        ("output format", format!("{:?}", output.format)),
        ("crop", format!("{:?}", output.crop)),
        ("look", format!("{look:?}")),
        ("choice of integrator", integrator.map_or_else(|| "by the scene".to_owned(), |given| format!("{given:?}"))),
        ("acceleration structure", format!("{structure:?}")),
        ("camera", format!("{camera:?} {:?}", options.picture.up_axis)),
        ("light", format!("{light:?} {:?} {environment:016x}", options.picture.stage)),
        ("material", format!("{:016x}", material_hash(scene))),
    ];
    own.map(|(name, value)| (name.to_owned(), value)).into_iter().chain(settings.record()).collect()
}

/// The record of a frame whose pose `scene` has.
pub(super) fn of_frame(shared: &Record, job: &Job, frame: u32, scene: &Scene) -> Record {
    let mut lights = Hash::default();
    lights.debug(&scene.lights);
    lights.debug(&scene.cameras);
    let own = [
        ("pose", format!("{:016x}", geometry_hash(scene))),
        ("light or camera of the file", format!("{:016x}", lights.finish())),
        ("turn in degrees", job.sequence.degrees(frame).to_string()),
    ];
    shared.iter().cloned().chain(own.map(|(name, value)| (name.to_owned(), value))).collect()
}

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

    /// Removes the file.
    pub(super) fn remove(&self) -> Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(anyhow!("{}: cannot remove file: {error}", self.path.display()))
            }
            _ => Ok(()),
        }
    }

    /// Removes the lines of pictures that are about to be rendered.
    pub(super) fn forget<'a>(&mut self, pictures: impl Iterator<Item = &'a Path>) -> Result<()> {
        pictures.for_each(|picture| drop(self.lines.remove(&name(picture))));
        if self.lines.is_empty() {
            return self.remove();
        }
        let text: String = self.lines.iter().map(|(name, line)| line.text(name)).collect();
        let mut file = AtomicFile::create(&self.path)?;
        file.write(|out| out.write_all(text.as_bytes()))?;
        Ok(file.finish()?)
    }

    /// Adds the line of a picture that is whole.
    pub(super) fn add(&mut self, picture: &Path, record: Record) -> Result<()> {
        let line = Line { bytes: hash(picture)?, record };
        let text = line.text(&name(picture));
        let is_new = !self.path.exists();
        let file = OpenOptions::new().append(true).create(true).open(&self.path);
        file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(|error| {
            if is_new {
                // Without a line it states nothing.
                let _ = self.remove();
            }
            anyhow!("{}: cannot write file: {error}", self.path.display())
        })
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
