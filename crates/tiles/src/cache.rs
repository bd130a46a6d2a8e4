//! Tiles in memory: mapped when they are needed, the least recently used forgotten first.

use std::fs::{self, File, Metadata};
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use canted_obb::PrimId;
use canted_tlas::{Instance, Tlas};
use canted_trace::{Hit, InstanceId, Intersect};
use canted_wide::{KnownFile, MapError, TriangleBvh, checksum};

use crate::error::{Named as _, TileError};
use crate::manifest::{Manifest, TileEntry, hex};

/// A tile in memory.
pub(crate) struct Tile {
    bvh: Arc<TriangleBvh>,
    /// Numbers of the triangles in their mesh, ascending.
    numbers: Vec<u32>,
    /// All placements of the mesh; none of a plain store.
    placed: Option<Placed>,
}

struct Placed {
    tlas: Tlas<Arc<TriangleBvh>>,
    /// The number of each instance among all placements.
    placements: Vec<u32>,
}

impl Tile {
    /// What rays hit, in the space of the store.
    pub(crate) fn target(&self) -> &dyn Intersect {
        match &self.placed {
            Some(placed) => &placed.tlas,
            None => &*self.bvh,
        }
    }

    /// The triangles, in the space of their mesh.
    pub(crate) fn bvh(&self) -> &TriangleBvh {
        &self.bvh
    }

    /// The number in its mesh of a triangle of the tile.
    pub(crate) fn number(&self, primitive: PrimId) -> PrimId {
        PrimId(self.numbers[primitive.index()])
    }

    /// All placements; none of a plain store.
    pub(crate) fn placed(&self) -> Option<&Tlas<Arc<TriangleBvh>>> {
        self.placed.as_ref().map(|placed| &placed.tlas)
    }

    /// The placement that an instance of the tile is.
    pub(crate) fn placement(&self, instance: InstanceId) -> InstanceId {
        self.placed.as_ref().map_or(InstanceId(0), |placed| InstanceId(placed.placements[instance.index()]))
    }

    /// A hit of [`Self::target`] with its numbers in the whole.
    pub(crate) fn in_whole(&self, hit: Hit) -> Hit {
        Hit { primitive: self.number(hit.primitive), instance: self.placement(hit.instance), ..hit }
    }

    fn n_bytes(&self) -> u64 {
        let placed =
            self.placed.as_ref().map_or(0, |placed| placed.tlas.n_bytes() + size_of_val(&placed.placements[..]));
        (self.bvh.n_bytes() + size_of_val(&self.numbers[..]) + placed) as u64
    }
}

/// What was read so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileCounts {
    /// Tiles that were read, those that were read again included.
    pub reads: u64,
    /// Tiles in memory.
    pub held: usize,
    /// Bytes of these.
    pub held_bytes: u64,
    /// The most bytes that were held.
    pub most_bytes: u64,
}

/// What tells whether a file was written: its length, when it was written, and, on Unix, when its entry was changed, and which one it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp {
    n_bytes: u64,
    written: Option<SystemTime>,
    entry: [i64; 4],
}

impl Stamp {
    fn of(found: &Metadata) -> Self {
        #[cfg(unix)]
        let entry = {
            use std::os::unix::fs::MetadataExt as _;
            [found.dev() as i64, found.ino() as i64, found.ctime(), found.ctime_nsec()]
        };
        #[cfg(not(unix))]
        let entry = [0; 4];
        Self { n_bytes: found.len(), written: found.modified().ok(), entry }
    }
}

/// A tile that passed all checks: its files as they were then, and what mapping it again needs.
#[derive(Clone)]
struct Known {
    stamps: [Stamp; 2],
    bvh: Arc<KnownFile>,
}

/// The order of use, and the memory.
#[derive(Default)]
struct Use {
    clock: u64,
    /// Of each tile when it was last used, and its bytes; 0 where it is not held.
    last: Vec<u64>,
    bytes: Vec<u64>,
    /// Those that passed all checks.
    known: Vec<Option<Known>>,
    counts: TileCounts,
}

/// The tiles of a store.
pub(crate) struct Cache {
    folder: PathBuf,
    entries: Vec<TileEntry>,
    /// The placements of each mesh, and the mesh of each tile; none of a plain store.
    placements: Vec<Vec<(u32, Instance)>>,
    mesh_of: Vec<u32>,
    limit: u64,
    slots: Vec<Mutex<Option<Arc<Tile>>>>,
    used: Mutex<Use>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Cache {
    pub(crate) fn new(folder: &Path, manifest: &Manifest, limit: u64) -> Self {
        let n = manifest.tiles.len();
        let mut mesh_of = vec![0; n];
        let mut placements = vec![];
        for (i, mesh) in (0..).zip(&manifest.meshes) {
            let [first, n] = mesh.tiles.map(|x| x as usize);
            mesh_of[first..first + n].fill(i);
        }
        if !manifest.is_plain() {
            placements.resize_with(manifest.meshes.len(), Vec::new);
            for (i, placement) in (0..).zip(&manifest.placements) {
                placements[placement.mesh as usize].push((i, Instance::new(0, placement.affine())));
            }
        }
        Self {
            folder: folder.to_owned(),
            entries: manifest.tiles.clone(),
            placements,
            mesh_of,
            limit,
            slots: (0..n).map(|_| Mutex::new(None)).collect(),
            used: Mutex::new(Use { last: vec![0; n], bytes: vec![0; n], known: vec![None; n], ..Use::default() }),
        }
    }

    pub(crate) fn n_tiles(&self) -> usize {
        self.entries.len()
    }

    pub(crate) fn counts(&self) -> TileCounts {
        locked(&self.used).counts
    }

    /// Which tiles are in memory.
    pub(crate) fn held(&self) -> Vec<bool> {
        locked(&self.used).bytes.iter().map(|&n| n > 0).collect()
    }

    /// Whether a tile would fit besides those that were used last, of which one is `with`.
    pub(crate) fn fits_with(&self, tile: u32, with: u32) -> bool {
        let bytes = |tile: u32| file_bytes(&self.entries[tile as usize]);
        bytes(tile) + bytes(with) <= self.limit
    }

    /// The tile, from memory or from its file.
    pub(crate) fn get(&self, tile: u32) -> Result<Arc<Tile>, TileError> {
        let index = tile as usize;
        let mut slot = locked(&self.slots[index]);
        if let Some(held) = &*slot {
            let held = Arc::clone(held);
            let mut used = locked(&self.used);
            used.clock += 1;
            used.last[index] = used.clock;
            return Ok(held);
        }
        self.make_room(file_bytes(&self.entries[index]), index);
        let read = Arc::new(self.read(index)?);
        let n_bytes = read.n_bytes().max(1);
        *slot = Some(Arc::clone(&read));
        {
            let mut used = locked(&self.used);
            used.clock += 1;
            used.last[index] = used.clock;
            used.bytes[index] = n_bytes;
            let counts = &mut used.counts;
            counts.reads += 1;
            counts.held += 1;
            counts.held_bytes += n_bytes;
            counts.most_bytes = counts.most_bytes.max(counts.held_bytes);
        }
        self.make_room(0, index);
        Ok(read)
    }

    /// Forgets tiles until `n_bytes` more fit, but not `kept`, whose slot is locked, nor those that another thread is reading.
    fn make_room(&self, n_bytes: u64, kept: usize) {
        let mut passed = vec![];
        loop {
            let oldest = {
                let used = locked(&self.used);
                if used.counts.held_bytes + n_bytes <= self.limit {
                    return;
                }
                let held = (0..used.last.len()).filter(|i| used.bytes[*i] > 0 && *i != kept && !passed.contains(i));
                held.min_by_key(|&i| used.last[i])
            };
            let Some(oldest) = oldest else { return };
            let Ok(mut slot) = self.slots[oldest].try_lock() else {
                passed.push(oldest);
                continue;
            };
            *slot = None;
            let mut used = locked(&self.used);
            let freed = std::mem::take(&mut used.bytes[oldest]);
            used.counts.held_bytes -= freed;
            used.counts.held -= usize::from(freed > 0);
        }
    }

    /// Maps a tile. Its content is checked, unless it was before and its files were not written since.
    fn read(&self, index: usize) -> Result<Tile, TileError> {
        let entry = &self.entries[index];
        let path = self.folder.join(&entry.bvh);
        let stamps = self.stamps(index)?;
        let known = locked(&self.used).known[index].clone().filter(|known| known.stamps == stamps);
        let bvh = match &known {
            Some(known) => TriangleBvh::map_known(&path, &known.bvh),
            None => {
                self.check_bvh_sum(index)?;
                TriangleBvh::map(&path)
            }
        };
        let bvh = bvh.map_err(|error| match error {
            MapError::System(error) => TileError::system(&path, "read", &error),
            error => TileError::damaged(&path, error),
        })?;
        if bvh.n_primitives() != entry.triangles as usize || bvh.aabb() != entry.aabb() {
            return Err(TileError::damaged(
                &path,
                "the tile of another store: triangles or bounds are not those of the manifest",
            ));
        }
        let numbers = self.numbers(index as u32)?;
        if known.is_none() {
            let bvh = Arc::new(bvh.known_file());
            locked(&self.used).known[index] = Some(Known { stamps, bvh });
        }
        let bvh = Arc::new(bvh);
        let placed = match self.placements.get(self.mesh_of[index] as usize) {
            None => None,
            Some(own) => {
                let instances: Vec<Instance> = own.iter().map(|(_, instance)| *instance).collect();
                let tlas = Tlas::new(vec![Arc::clone(&bvh)], &instances, Default::default());
                let tlas = tlas.map_err(|error| TileError::damaged(&path, error))?;
                // Now, so that they count as memory of the tile.
                tlas.find_bounds();
                Some(Placed { tlas, placements: own.iter().map(|(i, _)| *i).collect() })
            }
        };
        Ok(Tile { bvh, numbers, placed })
    }

    /// Of both files of a tile, whose lengths are those of the manifest.
    fn stamps(&self, index: usize) -> Result<[Stamp; 2], TileError> {
        let stamp = |is_bvh: bool| {
            let (path, n_expected) = self.file(&self.entries[index], is_bvh);
            let found = match fs::metadata(&path) {
                Ok(found) => found,
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                    return Err(TileError::damaged(&path, "the file of a tile is missing"));
                }
                found => found.named("read", &path)?,
            };
            if found.len() != n_expected {
                return Err(TileError::damaged(&path, format!("{} bytes, expected {n_expected}", found.len())));
            }
            Ok(Stamp::of(&found))
        };
        Ok([stamp(true)?, stamp(false)?])
    }

    /// An error if a file of a tile that is held was written since the tile was checked.
    pub(crate) fn check_unchanged(&self, tile: u32) -> Result<(), TileError> {
        let index = tile as usize;
        let stamps = self.stamps(index)?;
        if locked(&self.used).known[index].as_ref().is_some_and(|known| known.stamps != stamps) {
            let path = self.folder.join(&self.entries[index].bvh);
            return Err(TileError::damaged(
                &path,
                "a file of the tile was written while the store is open; open it again",
            ));
        }
        Ok(())
    }

    /// Whether the checksum at the end of a BVH is that of the manifest. It is compared with the content where that is read.
    fn check_bvh_sum(&self, index: usize) -> Result<(), TileError> {
        let entry = &self.entries[index];
        let path = self.folder.join(&entry.bvh);
        let mut sum = [0; 8];
        let mut file = File::open(&path).named("read", &path)?;
        file.seek(SeekFrom::End(-8)).and_then(|_| file.read_exact(&mut sum)).named("read", &path)?;
        if hex(u64::from_le_bytes(sum)) != entry.bvh_sum {
            return Err(TileError::damaged(&path, "checksum mismatch: the file is damaged or of another store"));
        }
        Ok(())
    }

    /// The numbers of the triangles of a tile, ascending, from its file.
    pub(crate) fn numbers(&self, tile: u32) -> Result<Vec<u32>, TileError> {
        let bytes = self.check_file(tile as usize, false)?;
        let numbers: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        if !numbers.is_sorted_by(|a, b| a < b) {
            let path = self.folder.join(&self.entries[tile as usize].numbers);
            return Err(TileError::damaged(&path, "numbers are not ascending"));
        }
        Ok(numbers)
    }

    /// The bytes of a file of a tile, whose length and checksum are those of the manifest.
    fn check_file(&self, index: usize, is_bvh: bool) -> Result<Vec<u8>, TileError> {
        let entry = &self.entries[index];
        let (path, n_expected) = self.file(entry, is_bvh);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(TileError::damaged(&path, "the file of a tile is missing"));
            }
            Err(error) => return Err(TileError::system(&path, "read", &error)),
        };
        if bytes.len() as u64 != n_expected {
            return Err(TileError::damaged(&path, format!("{} bytes, expected {n_expected}", bytes.len())));
        }
        // That of a BVH is at its end, and is compared with its content when it is read.
        let (sum, expected) = if is_bvh {
            (bytes.last_chunk().map_or(0, |sum| u64::from_le_bytes(*sum)), &entry.bvh_sum)
        } else {
            (checksum(&bytes), &entry.numbers_sum)
        };
        if hex(sum) != *expected {
            return Err(TileError::damaged(&path, "checksum mismatch: the file is damaged or of another store"));
        }
        Ok(bytes)
    }

    fn file(&self, entry: &TileEntry, is_bvh: bool) -> (PathBuf, u64) {
        match is_bvh {
            true => (self.folder.join(&entry.bvh), entry.bytes),
            false => (self.folder.join(&entry.numbers), 4 * u64::from(entry.triangles)),
        }
    }

    /// Whether all files are there, with their lengths.
    pub(crate) fn check_lengths(&self) -> Result<(), TileError> {
        (0..self.entries.len()).try_for_each(|index| self.stamps(index).map(drop))
    }

    /// Bytes of all files.
    pub(crate) fn n_file_bytes(&self) -> u64 {
        self.entries.iter().map(file_bytes).sum()
    }

    /// Whether the content of all files is that of the manifest: reads everything, and holds nothing.
    pub(crate) fn check_content(&self) -> Result<(), TileError> {
        for index in 0..self.entries.len() {
            let bytes = self.check_file(index, true)?;
            let (content, stored) = bytes.split_last_chunk::<8>().unwrap_or((&bytes, &[0; 8]));
            if checksum(content) != u64::from_le_bytes(*stored) {
                let path = self.folder.join(&self.entries[index].bvh);
                return Err(TileError::damaged(&path, "checksum mismatch: the file is damaged"));
            }
            self.check_file(index, false)?;
        }
        Ok(())
    }
}

/// About as many as the tile takes in memory.
fn file_bytes(entry: &TileEntry) -> u64 {
    entry.bytes + 4 * u64::from(entry.triangles)
}
