//! `--checkpoint`: a file of finished tiles that an interrupted render continues from.

use std::{
    fs,
    path::PathBuf,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Checkpoint, Record, Tile};

use crate::output;

/// Collects finished tiles and writes them at intervals.
pub(super) struct CheckpointWriter {
    path: PathBuf,
    interval: Duration,
    state: Mutex<State>,
}

struct State {
    tiles: Checkpoint,
    written: Instant,
    has_failed: bool,
}

impl CheckpointWriter {
    /// Opens the checkpoint of the render that `record` describes, and returns its finished tiles.
    ///
    /// # Errors
    /// The file cannot be written, is damaged, or belongs to another render.
    pub(super) fn open(path: PathBuf, interval: Duration, record: &Record) -> Result<(Self, Vec<Tile>)> {
        output::probe(&path)?;
        let mut done = Vec::new();
        if path.exists() {
            let (found, tiles) = Checkpoint::read(&path)?;
            if let Some((name, theirs, ours)) = difference(&found, record) {
                let path = path.display();
                return Err(anyhow!(
                    "{path}: checkpoint of another picture: {name} is {theirs}, not {ours}; use another file"
                ));
            }
            done = tiles;
        }
        let mut tiles = Checkpoint::new(record);
        done.iter().for_each(|tile| tiles.add(tile));
        let state = State { tiles, written: Instant::now(), has_failed: false };
        Ok((Self { path, interval, state: Mutex::new(state) }, done))
    }

    /// Adds a tile. Writes the file if the interval has passed.
    pub(super) fn add(&self, tile: &Tile) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.tiles.add(tile);
        if state.written.elapsed() >= self.interval {
            self.write(&mut state);
        }
    }

    /// Writes the file now.
    pub(super) fn save(&self) {
        self.write(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// A failure, such as a full disk, does not stop the render. It is reported once.
    fn write(&self, state: &mut State) {
        if let Err(error) = state.tiles.write(&self.path)
            && !state.has_failed
        {
            state.has_failed = true;
            output::warn(&error.to_string());
        }
        state.written = Instant::now();
    }

    /// Removes the file of a complete picture.
    pub(super) fn remove(self) -> Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(anyhow!("cannot remove {}: {error}", self.path.display()))
            }
            _ => Ok(()),
        }
    }
}

/// The first difference of two records: name and both values.
pub(crate) fn difference(a: &Record, b: &Record) -> Option<(String, String, String)> {
    let value = |record: &Record, name: &str| {
        let found = record.iter().find(|(known, _)| known == name).map(|(_, value)| value.clone());
        // Only sums on a device are recorded.
        found.unwrap_or_else(|| if name == "sums" { "host" } else { "missing" }.to_owned())
    };
    let names = a.iter().chain(b).map(|(name, _)| name);
    names.map(|name| (name.clone(), value(a, name), value(b, name))).find(|(_, a, b)| a != b)
}
