//! What a store contains: `manifest.json`.
//!
//! Tiles are numbered through the whole store. Triangles of a mesh are numbered in the order in which they were given; a placement numbers the
//! triangles of its mesh on from those of the placements before. What a scene calls them is in the table of instances.

use std::fs;
use std::path::Path;

use canted_obb::{Aabb, Affine};
use canted_wide::checksum;
use serde::{Deserialize, Serialize};

use crate::error::{Named as _, TileError};

/// The file of a store that says what is in it.
pub(crate) const MANIFEST: &str = "manifest.json";

/// The first member of every manifest.
const FORMAT: &str = "canted tiles";

/// Changes with what the files mean.
const VERSION: u32 = 1;

/// The manifest of a store.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Manifest {
    format: String,
    version: u32,
    /// What was subtracted from the coordinates of the caller; as texts, which are read without an error.
    #[serde(with = "exact")]
    pub(crate) origin: [f64; 3],
    /// Whether that was chosen near the triangles, by which a caller decides how it answers.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) is_near: bool,
    pub(crate) meshes: Vec<MeshEntry>,
    pub(crate) placements: Vec<PlacementEntry>,
    /// Of each instance, of which a placement may hold several, the place of its first triangle among those of all placements, and the number
    /// in the whole that it has.
    pub(crate) instances: Vec<[u64; 2]>,
    pub(crate) tiles: Vec<TileEntry>,
    /// Checksum of the manifest with an empty one.
    sum: String,
}

/// Numbers as texts: a reader of JSON may round what is written as a number once more.
mod exact {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer, de::Error as _};

    pub(super) fn serialize<S: Serializer>(numbers: &[f64; 3], serializer: S) -> Result<S::Ok, S::Error> {
        numbers.map(|number| number.to_string()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
        let mut numbers = [0.0; 3];
        for (number, text) in numbers.iter_mut().zip(<[String; 3]>::deserialize(deserializer)?) {
            *number = text.parse().map_err(D::Error::custom)?;
        }
        Ok(numbers)
    }
}

/// A mesh in its own space.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshEntry {
    pub(crate) triangles: u64,
    /// The first tile, and the number of tiles.
    pub(crate) tiles: [u32; 2],
}

/// A mesh in the space of the store.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlacementEntry {
    pub(crate) mesh: u32,
    /// The place of triangle 0 among those of all placements.
    pub(crate) first: u64,
    /// Columns of the transform.
    pub(crate) world_from_object: [[f32; 3]; 4],
}

impl PlacementEntry {
    pub(crate) fn affine(&self) -> Affine {
        Affine::from_columns(self.world_from_object)
    }
}

/// A tile: a BVH, and the numbers of its triangles in its mesh.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TileEntry {
    /// The files, in the folder of the store.
    pub(crate) bvh: String,
    pub(crate) numbers: String,
    pub(crate) triangles: u32,
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
    /// Length of the BVH.
    pub(crate) bytes: u64,
    /// Checksums of both files.
    pub(crate) bvh_sum: String,
    pub(crate) numbers_sum: String,
}

impl TileEntry {
    pub(crate) fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }
}

/// A checksum as text.
pub(crate) fn hex(sum: u64) -> String {
    format!("{sum:016x}")
}

impl Manifest {
    pub(crate) fn new(
        (origin, is_near): ([f64; 3], bool),
        meshes: Vec<MeshEntry>,
        placements: Vec<PlacementEntry>,
        instances: Vec<[u64; 2]>,
        tiles: Vec<TileEntry>,
    ) -> Self {
        let (format, version) = (FORMAT.to_owned(), VERSION);
        let sum = String::new();
        let mut manifest = Self { format, version, origin, is_near, meshes, placements, instances, tiles, sum };
        manifest.sum = manifest.own_sum();
        manifest
    }

    fn own_sum(&self) -> String {
        let unsigned = Self { sum: String::new(), ..self.clone() };
        hex(checksum(serde_json::to_string(&unsigned).unwrap_or_default().as_bytes()))
    }

    /// The text of the file.
    pub(crate) fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Reads the manifest of a folder.
    pub(crate) fn read(folder: &Path) -> Result<Self, TileError> {
        let path = folder.join(MANIFEST);
        if !path.is_file() {
            return Err(TileError::of_path(folder, format!("not a store of tiles: it has no {MANIFEST}")));
        }
        let text = fs::read_to_string(&path).named("read", &path)?;
        let manifest: Self = serde_json::from_str(&text).map_err(|error| {
            let is_foreign = !text.contains(FORMAT);
            let what = if is_foreign { "not the manifest of a store of tiles" } else { "a damaged manifest" };
            TileError::damaged(&path, format!("{what}: {error}"))
        })?;
        if manifest.format != FORMAT {
            return Err(TileError::damaged(&path, format!("format '{}'; expected '{FORMAT}'", manifest.format)));
        }
        if manifest.version != VERSION {
            let found = manifest.version;
            return Err(TileError::damaged(&path, format!("unsupported version {found}; expected {VERSION}")));
        }
        if manifest.sum != manifest.own_sum() {
            return Err(TileError::damaged(&path, "checksum mismatch: the manifest is damaged"));
        }
        manifest.check().map_err(|reason| TileError::damaged(&path, reason))?;
        Ok(manifest)
    }

    /// Whether all indices are within their tables and no file is outside of the folder.
    fn check(&self) -> Result<(), String> {
        let n_tiles = self.tiles.len() as u64;
        let mut next = 0;
        for (i, mesh) in self.meshes.iter().enumerate() {
            let [first, n] = mesh.tiles.map(u64::from);
            if first != next || first + n > n_tiles {
                return Err(format!("mesh {i} has tiles from {first}, {n} of them, of {n_tiles}"));
            }
            next = first + n;
            let own = &self.tiles[first as usize..(first + n) as usize];
            let n_triangles: u64 = own.iter().map(|tile| u64::from(tile.triangles)).sum();
            if n_triangles != mesh.triangles {
                return Err(format!("mesh {i} has {} triangles, its tiles {n_triangles}", mesh.triangles));
            }
        }
        if next != n_tiles {
            return Err(format!("meshes have {next} tiles of {n_tiles}"));
        }
        let mut first = 0_u64;
        for (i, placement) in self.placements.iter().enumerate() {
            let Some(mesh) = self.meshes.get(placement.mesh as usize) else {
                return Err(format!("placement {i} is of mesh {} of {}", placement.mesh, self.meshes.len()));
            };
            if placement.first != first {
                return Err(format!("placement {i} starts at {}, expected {first}", placement.first));
            }
            first = first.checked_add(mesh.triangles).ok_or("too many triangles")?;
        }
        if !self.instances.is_sorted_by(|a, b| a[0] <= b[0]) {
            return Err("instances are not in order".to_owned());
        }
        let is_name = |name: &str| !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\', ':']);
        match self.tiles.iter().find(|tile| !is_name(&tile.bvh) || !is_name(&tile.numbers)) {
            Some(tile) => Err(format!("file names '{}' and '{}'", tile.bvh, tile.numbers)),
            None => Ok(()),
        }
    }

    /// Triangles of all placements.
    pub(crate) fn n_placed(&self) -> u64 {
        let of = |placement: &PlacementEntry| self.meshes[placement.mesh as usize].triangles;
        self.placements.iter().map(of).sum()
    }

    /// Whether the store is one mesh in its own space.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(&self.placements[..], [placement] if placement.affine() == Affine::IDENTITY) && self.meshes.len() == 1
    }
}
