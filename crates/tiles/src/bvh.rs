use std::path::{Path, PathBuf};

use canted_obb::{Aabb, PrimId};
use canted_trace::InstanceId;

use crate::broad::Broad;
use crate::cache::{Cache, TileCounts};
use crate::error::TileError;
use crate::manifest::{MANIFEST, Manifest};

/// How a store is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenOptions {
    /// Bytes of tiles that are held; at least one tile is. 2 GiB by default.
    pub memory: u64,
    /// Stores of at most as many bytes are read whole when they are opened, to check them; of larger ones, lengths are checked, and each tile when it is
    /// read. 256 MiB by default.
    pub check_up_to: u64,
    /// The first tile of those that answer, and their number: hits are those on their triangles. All tiles by default.
    pub part: Option<[u32; 2]>,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { memory: 2 << 30, check_up_to: 256 << 20, part: None }
    }
}

/// A store of tiles that answers as one BVH over all its triangles.
///
/// The queries of [`Intersect`](canted_trace::Intersect) and [`Crossings`](canted_trace::Crossings) panic where a tile cannot be read; the
/// methods of its own return the error.
///
/// Hits have the numbers of the whole: `primitive` is the number in the mesh, `instance` that of the placement, 0 of a store without placements.
pub struct TiledBvh {
    pub(crate) folder: PathBuf,
    pub(crate) manifest: Manifest,
    pub(crate) broad: Broad,
    pub(crate) cache: Cache,
    pub(crate) is_plain: bool,
}

/// Whether a path is the folder of a store.
#[must_use]
pub fn is_store(path: &Path) -> bool {
    path.is_dir() && path.join(MANIFEST).is_file()
}

impl TiledBvh {
    /// Opens a store that [`TileWriter`](crate::TileWriter) wrote.
    ///
    /// # Errors
    /// A folder that is not a store; a manifest or a tile that is missing, damaged or of another store, with its file.
    pub fn open(folder: impl AsRef<Path>, options: OpenOptions) -> Result<Self, TileError> {
        let folder = folder.as_ref();
        let manifest = Manifest::read(folder)?;
        let [first, n] = options.part.unwrap_or([0, u32::MAX]);
        let broad = Broad::new(&manifest, first..first.saturating_add(n))
            .map_err(|reason| TileError::damaged(&folder.join(MANIFEST), reason))?;
        let cache = Cache::new(folder, &manifest, options.memory);
        cache.check_lengths()?;
        if cache.n_file_bytes() <= options.check_up_to {
            cache.check_content()?;
        }
        let is_plain = manifest.is_plain();
        Ok(Self { folder: folder.to_owned(), manifest, broad, cache, is_plain })
    }

    /// Reads all files and compares them with the manifest.
    ///
    /// # Errors
    /// The first file that is missing, damaged or of another store.
    pub fn check(&self) -> Result<(), TileError> {
        self.cache.check_content()
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Number of tiles.
    #[must_use]
    pub fn n_tiles(&self) -> usize {
        self.cache.n_tiles()
    }

    /// Number of triangles of all placements.
    #[must_use]
    pub fn n_primitives(&self) -> u64 {
        self.manifest.n_placed()
    }

    /// Number of placements; 1 of a store without them.
    #[must_use]
    pub fn n_placements(&self) -> usize {
        self.manifest.placements.len()
    }

    /// Bytes of all files of tiles.
    #[must_use]
    pub fn n_file_bytes(&self) -> u64 {
        self.cache.n_file_bytes()
    }

    /// What was read so far.
    #[must_use]
    pub fn counts(&self) -> TileCounts {
        self.cache.counts()
    }

    /// What the writer subtracted from the coordinates of its caller.
    #[must_use]
    pub fn origin(&self) -> [f64; 3] {
        self.manifest.origin
    }

    /// Whether the writer's caller chose the origin near the triangles.
    #[must_use]
    pub fn is_near(&self) -> bool {
        self.manifest.is_near
    }

    /// Axis-aligned box around everything; empty for none. Exact for a store without placements, else around the bounds of the tiles.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        if self.is_plain {
            return self.manifest.tiles.iter().fold(Aabb::EMPTY, |all, tile| all.union(tile.aabb()));
        }
        self.broad.aabb()
    }

    /// The number in the whole of a triangle that was hit, and the instance it is of, as the scene numbered both.
    ///
    /// # Panics
    /// If there is no such placement.
    #[must_use]
    pub fn in_whole(&self, placement: InstanceId, primitive: PrimId) -> (u64, u32) {
        let place = self.manifest.placements[placement.index()].first + u64::from(primitive.0);
        let instance = self.manifest.instances.partition_point(|[first, _]| *first <= place).saturating_sub(1);
        let number = self.manifest.instances.get(instance).map_or(place, |[first, number]| number + (place - first));
        (number, instance as u32)
    }

    /// Whether the store is one mesh in its own space, as distances and crossings require.
    #[must_use]
    pub fn is_one_mesh(&self) -> bool {
        self.is_plain
    }

    /// An error where the store has placements.
    pub(crate) fn one_mesh(&self, what: &str) -> Result<(), TileError> {
        if self.is_plain {
            return Ok(());
        }
        let n = self.n_placements();
        Err(TileError::of_path(
            &self.folder,
            format!("{what} require a store of one mesh; this one has {n} placements"),
        ))
    }
}

impl std::fmt::Debug for TiledBvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TiledBvh")
            .field("folder", &self.folder)
            .field("tiles", &self.n_tiles())
            .field("triangles", &self.n_primitives())
            .finish_non_exhaustive()
    }
}
