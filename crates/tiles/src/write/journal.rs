//! Which tiles are finished, for a writer that goes on after another one was killed.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use canted_wide::checksum;

use crate::error::{Named as _, TileError};
use crate::manifest::{TileEntry, hex};

/// The file, in the folder of a store that is not complete.
pub(super) const NAME: &str = "finished";

/// A line for the input and options, then one for each finished tile, in order.
pub(super) struct Journal {
    path: PathBuf,
    file: File,
    /// Those of a writer before, whose files are complete.
    finished: Vec<TileEntry>,
}

impl Journal {
    /// Opens it; without that of a writer with the same `key`, tiles of other writers are removed.
    pub(super) fn open(folder: &Path, key: &str) -> Result<Self, TileError> {
        let path = folder.join(NAME);
        let text = fs::read_to_string(&path).unwrap_or_default();
        let mut lines = text.lines();
        let is_same = lines.next() == Some(key);
        // The last line may be cut off: it is then no tile.
        let entries = lines.take_while(|_| is_same).map_while(|line| serde_json::from_str(line).ok());
        let finished: Vec<TileEntry> = entries.take_while(|entry| is_complete(folder, entry)).collect();
        remove_others(folder, &finished)?;
        let mut file = File::create(&path).named("write", &path)?;
        writeln!(file, "{key}").named("write", &path)?;
        let mut journal = Self { path, file, finished: vec![] };
        for entry in finished {
            journal.add(&entry)?;
            journal.finished.push(entry);
        }
        Ok(journal)
    }

    /// The tile with this number, if a writer before has finished it.
    pub(super) fn finished(&self, index: usize) -> Option<TileEntry> {
        self.finished.get(index).cloned()
    }

    /// Records a finished tile.
    pub(super) fn add(&mut self, entry: &TileEntry) -> Result<(), TileError> {
        // Tiles of the journal before were added when it was opened.
        if self.finished.iter().any(|known| known == entry) {
            return Ok(());
        }
        let line = serde_json::to_string(entry).unwrap_or_default();
        writeln!(self.file, "{line}").named("write", &self.path)
    }

    /// Removes the file: the store is complete.
    pub(super) fn remove(self) -> Result<(), TileError> {
        drop(self.file);
        fs::remove_file(&self.path).named("remove", &self.path)
    }
}

/// Whether the files of a tile are those that were written.
fn is_complete(folder: &Path, entry: &TileEntry) -> bool {
    let read = |name: &str| fs::read(folder.join(name)).unwrap_or_default();
    let (bvh, numbers) = (read(&entry.bvh), read(&entry.numbers));
    let Some((content, stored)) = bvh.split_last_chunk::<8>() else { return false };
    let stored = u64::from_le_bytes(*stored);
    bvh.len() as u64 == entry.bytes
        && checksum(content) == stored
        && hex(stored) == entry.bvh_sum
        && hex(checksum(&numbers)) == entry.numbers_sum
}

/// Removes the files of all tiles but these.
fn remove_others(folder: &Path, kept: &[TileEntry]) -> Result<(), TileError> {
    for entry in fs::read_dir(folder).named("read", folder)? {
        let path = entry.named("read", folder)?.path();
        let is_tile =
            path.extension().is_some_and(|extension| ["bvh", "numbers", "tmp"].iter().any(|e| extension == *e));
        let is_kept = kept.iter().any(|tile| path.ends_with(&tile.bvh) || path.ends_with(&tile.numbers));
        if is_tile && !is_kept {
            fs::remove_file(&path).named("remove", &path)?;
        }
    }
    Ok(())
}
