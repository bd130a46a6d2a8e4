//! Writing a store: triangles are read once, spooled to disk, and divided until they fit into memory.

mod journal;
mod split;

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use canted_obb::Affine;
use canted_wide::{Config, TriangleBvh, checksum};

use crate::error::{Named as _, TileError};
use crate::manifest::{MANIFEST, Manifest, MeshEntry, PlacementEntry, TileEntry, hex};
use journal::Journal;
use split::{Record, Spool};

/// How a store is written.
#[derive(Clone, Debug)]
pub struct WriteOptions {
    /// The most triangles of a tile. 2^18 by default, which take about 16 MiB.
    pub tile_triangles: usize,
    /// Bytes of memory that the writer takes, about. 2 GiB by default.
    pub memory: u64,
    /// How tiles are built; the triangle test is the watertight one.
    pub config: Config,
    /// What the caller has subtracted from coordinates: recorded only.
    pub origin: [f64; 3],
    /// Whether the caller chose it near the triangles: recorded only.
    pub is_near: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { tile_triangles: 1 << 18, memory: 2 << 30, config: Config::default(), origin: [0.0; 3], is_near: false }
    }
}

/// Bytes that building a tile takes for each triangle, at most; measured with oriented nodes.
const BUILD_BYTES: u64 = 640;

/// Most triangles of a mesh.
const MAX_TRIANGLES: u64 = u32::MAX as u64;

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Number of tiles.
    pub tiles: usize,
    /// Of these, those that a writer before had finished.
    pub resumed: usize,
    /// Triangles of all meshes.
    pub triangles: u64,
    /// Bytes of all tiles.
    pub bytes: u64,
}

/// Writes a store of tiles: [`Self::push`] triangles, then [`Self::finish`].
///
/// Several meshes, each ended by [`Self::end_mesh`], are placed by [`Self::place`]. Without a placement, the one mesh is the store.
#[derive(Debug)]
pub struct TileWriter {
    target: PathBuf,
    folder: PathBuf,
    options: WriteOptions,
    /// Held until the store is complete, so that no other process writes it.
    _lock: File,
    spool: Option<Spool>,
    meshes: Vec<(PathBuf, u64)>,
    placements: Vec<PlacementEntry>,
    instances: Vec<[u64; 2]>,
    sum: u64,
}

/// A writer that did not start to build leaves nothing.
impl Drop for TileWriter {
    fn drop(&mut self) {
        if !self.folder.join(journal::NAME).exists() && self.folder.join("lock").exists() {
            let _ = fs::remove_dir_all(&self.folder);
        }
    }
}

/// The folder of a store that is not complete.
fn partial(target: &Path) -> PathBuf {
    let mut name = target.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

impl TileWriter {
    /// Starts a store that [`Self::finish`] gives the name `target`. A store of that name is then replaced.
    ///
    /// # Errors
    /// Options out of range; a `target` that is something else than a store or an empty folder; a folder that cannot be written, or that
    /// another process writes.
    pub fn create(target: impl AsRef<Path>, options: WriteOptions) -> Result<Self, TileError> {
        let target = target.as_ref().components().collect::<PathBuf>();
        if target.file_name().is_none() {
            return Err(TileError::of_path(&target, "not the name of a folder"));
        }
        if options.tile_triangles == 0 || options.tile_triangles > canted_wide::MAX_TRIANGLES {
            let most = canted_wide::MAX_TRIANGLES;
            return Err(TileError::input(format!(
                "a tile of {} triangles is not supported; use 1 to {most}",
                options.tile_triangles
            )));
        }
        let needed = 2 * BUILD_BYTES * options.tile_triangles as u64;
        if needed > options.memory {
            let most = options.memory / (2 * BUILD_BYTES);
            let remedy = if most > 0 { format!("tiles of at most {most} triangles") } else { "more memory".to_owned() };
            return Err(TileError::input(format!(
                "tiles of {} triangles take about {} MiB of memory to build, {} MiB are allowed; use {remedy}",
                options.tile_triangles,
                needed.div_ceil(1 << 20),
                options.memory >> 20
            )));
        }
        check_target(&target)?;
        let folder = partial(&target);
        fs::create_dir_all(&folder).named("create", &folder)?;
        let path = folder.join("lock");
        let lock = File::create(&path).named("write", &path)?;
        if lock.try_lock().is_err() {
            return Err(TileError::of_path(&folder, "another process writes this store"));
        }
        let writer = Self {
            target,
            folder,
            options,
            _lock: lock,
            spool: None,
            meshes: vec![],
            placements: vec![],
            instances: vec![],
            sum: checksum(b""),
        };
        writer.remove_spools()?;
        Ok(writer)
    }

    /// Removes the triangles that a writer before had spooled.
    fn remove_spools(&self) -> Result<(), TileError> {
        for entry in fs::read_dir(&self.folder).named("read", &self.folder)? {
            let path = entry.named("read", &self.folder)?.path();
            if path.extension().is_some_and(|extension| extension == "spool") {
                fs::remove_file(&path).named("remove", &path)?;
            }
        }
        Ok(())
    }

    /// Adds triangles to the mesh; they are numbered in order.
    ///
    /// # Errors
    /// The first triangle with a vertex that is not finite, by its number; too many triangles; a file that cannot be written.
    pub fn push(&mut self, triangles: &[[[f32; 3]; 3]]) -> Result<(), TileError> {
        if self.spool.is_none() {
            let path = self.folder.join(format!("mesh-{}.spool", self.meshes.len()));
            self.spool = Some(Spool::create(path)?);
        }
        let Some(spool) = &mut self.spool else { return Ok(()) };
        let first = spool.n();
        if first + triangles.len() as u64 > MAX_TRIANGLES {
            return Err(TileError::input(format!("a store holds at most {MAX_TRIANGLES} triangles of a mesh")));
        }
        let is_finite = |triangle: &[[f32; 3]; 3]| triangle.as_flattened().iter().all(|x| x.is_finite());
        if let Some(i) = triangles.iter().position(|triangle| !is_finite(triangle)) {
            let number = first + i as u64;
            return Err(TileError::input(format!("triangle {number} has a vertex that is not finite")));
        }
        let bytes: &[u8] = bytemuck::cast_slice(triangles);
        // A chain, so that the order counts; a part at a time, as callers give parts of any size.
        for part in bytes.chunks(size_of::<[[f32; 3]; 3]>()) {
            self.sum = self.sum.rotate_left(5) ^ word_sum(part);
        }
        spool.write_flat(bytes)
    }

    /// Ends the mesh; its number, for [`Self::place`].
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn end_mesh(&mut self) -> Result<u32, TileError> {
        if self.spool.is_none() {
            self.push(&[])?;
        }
        if let Some(spool) = self.spool.take() {
            self.meshes.push(spool.finish()?);
        }
        Ok(self.meshes.len() as u32 - 1)
    }

    /// Places a mesh that was ended. `instances` are those that the placement consists of: of each, its first triangle in the mesh, and the
    /// number that this one has in the whole.
    ///
    /// # Errors
    /// A mesh that does not exist.
    pub fn place(&mut self, mesh: u32, world_from_object: Affine, instances: &[[u64; 2]]) -> Result<(), TileError> {
        if mesh as usize >= self.meshes.len() {
            return Err(TileError::input(format!("mesh {mesh} of {} is placed", self.meshes.len())));
        }
        let end = |placement: &PlacementEntry| placement.first + self.meshes[placement.mesh as usize].1;
        let first = self.placements.last().map_or(0, end);
        self.placements.push(PlacementEntry { mesh, first, world_from_object: world_from_object.columns });
        self.instances.extend(instances.iter().map(|&[start, number]| [first + start, number]));
        Ok(())
    }

    /// Builds all tiles and gives the store its name. `progress` gets the finished fraction.
    ///
    /// # Errors
    /// A file that cannot be written; what was finished stays in `DIR.partial`, for a writer with the same input and options.
    pub fn finish(mut self, progress: &mut dyn FnMut(f64)) -> Result<Written, TileError> {
        if self.spool.is_some() || self.meshes.is_empty() {
            self.end_mesh()?;
        }
        if self.placements.is_empty() {
            let mut number = 0;
            for mesh in 0..self.meshes.len() as u32 {
                self.place(mesh, Affine::IDENTITY, &[[0, number]])?;
                number += self.meshes[mesh as usize].1;
            }
        }
        let mut journal = Journal::open(&self.folder, &self.key())?;
        let all: u64 = self.meshes.iter().map(|(_, n)| n).sum();
        let (mut tiles, mut meshes, mut n_resumed, mut n_done) = (vec![], vec![], 0, 0_u64);
        progress(0.0);
        for (path, n) in std::mem::take(&mut self.meshes) {
            let first = tiles.len() as u32;
            let (options, folder) = (self.options.clone(), self.folder.clone());
            // Half for the triangles that are divided in memory, half for the build.
            let most = (options.memory / 2 / size_of::<Record>() as u64).max(options.tile_triangles as u64) as usize;
            split::divide(path, n, most, options.tile_triangles, &mut |records| {
                let index = tiles.len();
                n_done += records.len() as u64;
                let entry = match journal.finished(index) {
                    Some(entry) if entry.triangles as usize == records.len() => {
                        n_resumed += 1;
                        entry
                    }
                    _ => {
                        let entry = write_tile(&folder, index, records, options.config)?;
                        journal.add(&entry)?;
                        entry
                    }
                };
                tiles.push(entry);
                progress(n_done as f64 / all.max(1) as f64);
                Ok(())
            })?;
            meshes.push(MeshEntry { triangles: n, tiles: [first, tiles.len() as u32 - first] });
        }
        let written = Written {
            tiles: tiles.len(),
            resumed: n_resumed,
            triangles: all,
            bytes: tiles.iter().map(|tile| tile.bytes + 4 * u64::from(tile.triangles)).sum(),
        };
        let (placements, instances) = (std::mem::take(&mut self.placements), std::mem::take(&mut self.instances));
        let manifest = Manifest::new((self.options.origin, self.options.is_near), meshes, placements, instances, tiles);
        journal.remove()?;
        self.complete(&manifest)?;
        progress(1.0);
        Ok(written)
    }

    /// What the tiles depend on.
    fn key(&self) -> String {
        let Self { options: WriteOptions { tile_triangles, memory, config, origin, .. }, meshes, placements, .. } =
            self;
        let counts: Vec<u64> = meshes.iter().map(|(_, n)| *n).collect();
        let text = format!("{tile_triangles} {memory} {config:?} {origin:?} {counts:?} {placements:?} {}", self.sum);
        hex(checksum(text.as_bytes()))
    }

    /// Writes the manifest and renames the folder.
    fn complete(&self, manifest: &Manifest) -> Result<(), TileError> {
        let path = self.folder.join(MANIFEST);
        let mut file = File::create(&path).named("write", &path)?;
        file.write_all(manifest.to_text().as_bytes()).and_then(|()| file.sync_all()).named("write", &path)?;
        let lock = self.folder.join("lock");
        fs::remove_file(&lock).named("remove", &lock)?;
        check_target(&self.target)?;
        let mut old = self.target.as_os_str().to_owned();
        old.push(".replaced");
        let old = PathBuf::from(old);
        let is_replaced = self.target.join(MANIFEST).is_file();
        if is_replaced {
            fs::rename(&self.target, &old).named("rename", &self.target)?;
        } else if self.target.is_dir() {
            fs::remove_dir(&self.target).named("replace", &self.target)?;
        }
        fs::rename(&self.folder, &self.target).named("rename", &self.folder)?;
        if is_replaced {
            fs::remove_dir_all(&old).named("remove", &old)?;
        }
        Ok(())
    }
}

/// A checksum of a few bytes.
fn word_sum(bytes: &[u8]) -> u64 {
    let words = bytes.as_chunks::<4>().0.iter().map(|word| u64::from(u32::from_le_bytes(*word)));
    words.fold(0xcbf2_9ce4_8422_2325, |sum: u64, word| (sum ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29))
}

/// Whether a store may get this name.
fn check_target(target: &Path) -> Result<(), TileError> {
    let Ok(found) = fs::symlink_metadata(target) else { return Ok(()) };
    if !found.is_dir() {
        return Err(TileError::of_path(target, "it exists and is not a folder"));
    }
    let is_empty = fs::read_dir(target).named("read", target)?.next().is_none();
    if is_empty || target.join(MANIFEST).is_file() {
        return Ok(());
    }
    Err(TileError::of_path(target, "the folder exists and is not a store of tiles; use another name"))
}

/// Builds and writes a tile; its records are in order of their numbers.
fn write_tile(folder: &Path, index: usize, records: &[Record], config: Config) -> Result<TileEntry, TileError> {
    let corners: Vec<[[f32; 3]; 3]> = records.iter().map(|record| record.corners).collect();
    let triangles: Vec<[u32; 3]> = (0..records.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let bvh = TriangleBvh::build_with(corners.as_flattened(), &triangles, config);
    let bvh = bvh.map_err(|error| TileError::input(format!("tile {index}: {error}")))?;
    drop((corners, triangles));
    let (bytes, aabb) = (bvh.to_bytes(), bvh.aabb());
    drop(bvh);
    let numbers: Vec<u8> = records.iter().flat_map(|record| record.number.to_le_bytes()).collect();
    let names = ["bvh", "numbers"].map(|extension| format!("{index:06}.{extension}"));
    for (name, bytes) in names.iter().zip([&bytes, &numbers]) {
        let path = folder.join(name);
        let temporary = folder.join(format!("{name}.tmp"));
        let write = || -> std::io::Result<()> {
            let mut file = BufWriter::new(File::create(&temporary)?);
            file.write_all(bytes)?;
            file.flush()?;
            fs::rename(&temporary, &path)
        };
        write().named("write", &path)?;
    }
    let [bvh, numbers_name] = names;
    Ok(TileEntry {
        bvh,
        numbers: numbers_name,
        triangles: records.len() as u32,
        min: aabb.min,
        max: aabb.max,
        bytes: bytes.len() as u64,
        bvh_sum: hex(bytes.last_chunk().map_or(0, |sum| u64::from_le_bytes(*sum))),
        numbers_sum: hex(checksum(&numbers)),
    })
}
