//! Seed files: small files of the scene folder, and the example scene files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{fs, io};

use crate::mutate::Random;

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
        corpus.add(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples"))).ok()?;
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
                Some((kind, read_through)) if root.join(&read_through).is_file() => {
                    self.entries.push(Entry { file: file.to_owned(), kind, read_through, bytes });
                }
                _ => self.others.push((file.to_owned(), bytes)),
            }
        }
        Ok(())
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

/// The reader of a file, and the scene to read it through.
fn kind(file: &Path) -> Option<(Kind, PathBuf)> {
    let ending = file.extension()?.to_str()?;
    let kind = match ending {
        "obj" => Kind::Obj,
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
