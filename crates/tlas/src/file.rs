//! A TLAS as bytes, and back.
//!
//! ```text
//! offset  bytes          content
//! 0       8              "CANTTLAS"
//! 8       4, 4           version, 1; zero
//! 16      8, 8           number of bottom-level BVHs; number of instances
//! 32      108 each       instances: BVH, mask, 1 if it moves; both transforms by columns, the second zero if it does not
//!         8 and n each   bottom-level BVHs: number of bytes n; the bytes
//!         8              checksum of all before, FNV-1a with 64 bits
//! ```
//!
//! Integers and floats are little-endian. The top level is not stored: it is built again from the instances.

mod error;
mod fields;

use canted_obb::Affine;
use canted_wide::{LoadError, SavedLeaves, WideBvh};

use crate::{Blas, Instance, Tlas, TopConfig};
pub use error::TlasLoadError;
use fields::{Fields, VERSION, checksum};

const MAGIC: [u8; 8] = *b"CANTTLAS";
const HEADER_BYTES: usize = 32;
const INSTANCE_BYTES: usize = 3 * 4 + 24 * 4;
const CHECKSUM_BYTES: usize = 8;

/// A bottom-level BVH that can be saved and loaded.
///
/// An enum of several kinds writes a byte for the kind, then the bytes of the BVH.
pub trait SaveBlas: Blas + Sized {
    /// Why bytes are not such a BVH.
    type Error;

    /// The BVH as bytes.
    fn to_bytes(&self) -> Vec<u8>;

    /// The BVH that [`SaveBlas::to_bytes`] wrote.
    ///
    /// # Errors
    /// Bytes that it did not write: they may come from anywhere.
    fn from_bytes(bytes: &[u8]) -> Result<Self, Self::Error>;
}

impl<P: SavedLeaves> SaveBlas for WideBvh<P> {
    type Error = LoadError;

    fn to_bytes(&self) -> Vec<u8> {
        Self::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        Self::from_bytes(bytes)
    }
}

impl<B: SaveBlas> SaveBlas for Box<B> {
    type Error = B::Error;

    fn to_bytes(&self) -> Vec<u8> {
        B::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, B::Error> {
        B::from_bytes(bytes).map(Self::new)
    }
}

impl<B: SaveBlas> SaveBlas for std::sync::Arc<B> {
    type Error = B::Error;

    fn to_bytes(&self) -> Vec<u8> {
        B::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, B::Error> {
        B::from_bytes(bytes).map(Self::new)
    }
}

impl<B: SaveBlas> Tlas<B> {
    /// The instances and the bottom-level BVHs as bytes, for [`Tlas::from_bytes`]: the same bytes on every machine.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas, TopConfig};
    /// use canted_trace::Ray;
    /// use canted_wide::{Config, TriangleBvh};
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bvh: TriangleBvh = TriangleBvh::build(&positions, &[[0, 1, 2]], &Config::default())?;
    /// let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY)], TopConfig::default())?;
    /// let bytes = tlas.to_bytes();
    /// let loaded: Tlas<TriangleBvh> = Tlas::from_bytes(&bytes, TopConfig::default())?;
    /// let ray = Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]);
    /// assert_eq!(loaded.closest_hit(&ray), tlas.closest_hit(&ray));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + self.instances.len() * INSTANCE_BYTES + CHECKSUM_BYTES);
        bytes.extend(MAGIC);
        bytes.extend([VERSION, 0].map(u32::to_le_bytes).as_flattened());
        for count in [self.blas.len(), self.instances.len()] {
            bytes.extend((count as u64).to_le_bytes());
        }
        for instance in &self.instances {
            write_instance(instance, &mut bytes);
        }
        for blas in &self.blas {
            let of_blas = blas.to_bytes();
            bytes.extend((of_blas.len() as u64).to_le_bytes());
            bytes.extend(of_blas);
        }
        let sum = checksum(&bytes);
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    /// The TLAS that [`Tlas::to_bytes`] wrote, with a top level built by `config`.
    ///
    /// Every byte is checked, so `bytes` may come from anywhere: a TLAS that loads cannot panic or lose a hit, as far as
    /// the same is true of its bottom-level BVHs. Takes memory in proportion to `bytes`.
    ///
    /// # Errors
    /// The first flaw in `bytes`.
    pub fn from_bytes(bytes: &[u8], config: TopConfig) -> Result<Self, TlasLoadError<B::Error>> {
        let n_bytes = bytes.len();
        let Some((content, stored)) = bytes.split_last_chunk().filter(|(content, _)| content.len() >= HEADER_BYTES)
        else {
            return Err(TlasLoadError::Length { n_bytes });
        };
        let mut fields = Fields::new(content);
        // The header is complete: its length was checked.
        let magic = fields.take().unwrap_or_default();
        if magic != MAGIC {
            return Err(TlasLoadError::Magic { found: magic });
        }
        let [version, unused] = [(); 2].map(|()| fields.word().unwrap_or_default());
        if version != VERSION {
            return Err(TlasLoadError::Version { found: version });
        }
        let (stored, computed) = (u64::from_le_bytes(*stored), checksum(content));
        if stored != computed {
            return Err(TlasLoadError::Checksum { stored, computed });
        }
        if unused != 0 {
            return Err(TlasLoadError::Header { found: unused });
        }
        let too_short = || TlasLoadError::Length { n_bytes };
        let n_blas = fields.count(8).ok_or_else(too_short)?;
        let n_instances = fields.count(INSTANCE_BYTES).ok_or_else(too_short)?;
        let mut instances = Vec::with_capacity(n_instances);
        for instance in 0..n_instances {
            let read = read_instance(&mut fields).ok_or(TlasLoadError::Motion { instance })?;
            instances.push(read);
        }
        let mut blas = Vec::new();
        for index in 0..n_blas {
            let n_bytes_of_blas = fields.count(1).ok_or_else(too_short)?;
            let bytes_of_blas = fields.bytes(n_bytes_of_blas).ok_or_else(too_short)?;
            blas.push(B::from_bytes(bytes_of_blas).map_err(|error| TlasLoadError::Blas { blas: index, error })?);
        }
        if !fields.is_empty() {
            return Err(too_short());
        }
        Ok(Self::new(blas, &instances, config)?)
    }
}

fn write_instance(instance: &Instance, out: &mut Vec<u8>) {
    let Instance { blas, world_from_object, world_from_object_close, mask } = instance;
    let moves = u32::from(world_from_object_close.is_some());
    out.extend([*blas, *mask, moves].map(u32::to_le_bytes).as_flattened());
    let close = world_from_object_close.unwrap_or(Affine { columns: [[0.0; 3]; 4] });
    for number in [world_from_object, &close].into_iter().flat_map(|affine| affine.columns.as_flattened()) {
        out.extend(number.to_le_bytes());
    }
}

/// `None` if a motion is neither there nor absent: a flag other than 0 and 1, or the transform of a static instance.
fn read_instance(fields: &mut Fields<'_>) -> Option<Instance> {
    let [blas, mask, moves] = [fields.word()?, fields.word()?, fields.word()?];
    let [world_from_object, close] = [fields.affine()?, fields.affine()?];
    let is_zero = close.columns.as_flattened().iter().all(|x| x.to_bits() == 0);
    let world_from_object_close = match moves {
        0 if is_zero => None,
        1 => Some(close),
        _ => return None,
    };
    Some(Instance { blas, world_from_object, world_from_object_close, mask })
}

#[cfg(test)]
mod tests;
