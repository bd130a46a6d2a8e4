//! Seed files: small files of the scene folder, of `tests/files`, and the example scene files.

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
            Self::Meshopt => cfg!(feature = "meshopt"),
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
