//! The file that a render goes on from.

use std::{
    fs,
    path::PathBuf,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Checkpoint, Record, Tile};

use crate::output;

/// Keeps finished tiles, and writes them from time to time.
pub(super) struct Keeper {
    path: PathBuf,
    interval: Duration,
    state: Mutex<State>,
}

struct State {
    tiles: Checkpoint,
    written: Instant,
    has_failed: bool,
}

impl Keeper {
    /// Opens the checkpoint of the render that `record` describes, and takes the tiles that it holds.
    ///
    /// # Errors
    /// Where the place cannot be written, or what is there is damaged or of another render.
    pub(super) fn open(path: PathBuf, interval: Duration, record: &Record) -> Result<(Self, Vec<Tile>)> {
        output::probe(&path)?;
        let mut done = Vec::new();
        if path.exists() {
            let (found, tiles) = Checkpoint::read(&path)?;
            if let Some((name, theirs, ours)) = difference(&found, record) {
                let path = path.display();
                return Err(anyhow!("{path}: a checkpoint of another picture, whose {name} is {theirs}, not {ours}"));
            }
            done = tiles;
        }
        let mut tiles = Checkpoint::new(record);
        done.iter().for_each(|tile| tiles.add(tile));
        let state = State { tiles, written: Instant::now(), has_failed: false };
        Ok((Self { path, interval, state: Mutex::new(state) }, done))
    }

    /// Adds a tile; writes the file where it is time to.
    pub(super) fn add(&self, tile: &Tile) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.tiles.add(tile);
        if state.written.elapsed() >= self.interval {
            self.write(&mut state);
        }
    }

    /// Writes what there is, for a render that ends before its time.
    pub(super) fn save(&self) {
        self.write(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// A full disk is no reason to stop rendering: it is told once.
    fn write(&self, state: &mut State) {
        if let Err(error) = state.tiles.write(&self.path)
            && !state.has_failed
        {
            state.has_failed = true;
            output::to_stderr(&format!("warning: {error}"));
        }
        state.written = Instant::now();
    }

    /// Removes the file: the picture is complete.
    pub(super) fn remove(self) -> Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(anyhow!("cannot remove {}: {error}", self.path.display()))
            }
            _ => Ok(()),
        }
    }
}

/// The first entry in which two records differ: its name, and both values.
pub(crate) fn difference(a: &Record, b: &Record) -> Option<(String, String, String)> {
    let value = |record: &Record, name: &str| {
        record.iter().find(|(known, _)| known == name).map_or_else(|| "not said".to_owned(), |(_, value)| value.clone())
    };
    let names = a.iter().chain(b).map(|(name, _)| name);
    names.map(|name| (name.clone(), value(a, name), value(b, name))).find(|(_, a, b)| a != b)
}
