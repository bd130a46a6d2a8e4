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

use std::error::Error;
use std::fmt;

use canted_obb::Affine;
use canted_trace::{InstanceId, Intersect, SaveBlas};

use crate::{Instance, InstanceError, Tlas, TopConfig};

const MAGIC: [u8; 8] = *b"CANTTLAS";
const HEADER_BYTES: usize = 32;
const INSTANCE_BYTES: usize = 3 * 4 + 24 * 4;
const CHECKSUM_BYTES: usize = 8;

impl<B: Intersect + SaveBlas> Tlas<B> {
    /// The instances and the bottom-level BVHs as bytes, for [`Tlas::from_bytes`]: the same bytes on every machine.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas, TopConfig};
    /// use canted_trace::{Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bvh = TriangleBvh::build(&positions, &[[0, 1, 2]])?;
    /// let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY)], TopConfig::default())?;
    /// let bytes = tlas.to_bytes();
    /// let loaded: Tlas<TriangleBvh> = Tlas::from_bytes(&bytes, TopConfig::default())?;
    /// let ray = Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]);
    /// assert_eq!(loaded.closest_hit(&ray), tlas.closest_hit(&ray));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + self.n_numbers() * INSTANCE_BYTES + CHECKSUM_BYTES);
        bytes.extend(MAGIC);
        bytes.extend([VERSION, 0].map(u32::to_le_bytes).as_flattened());
        for count in [self.blas.len(), self.n_numbers()] {
            bytes.extend((count as u64).to_le_bytes());
        }
        for instance in (0..self.n_numbers() as u32).filter_map(|i| self.instance(InstanceId(i))) {
            write_instance(&instance, &mut bytes);
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

/// Changes with the meaning of the bytes.
const VERSION: u32 = 1;

/// Little-endian fields, one after the other.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The next `n` bytes; `None` if there are fewer.
    fn bytes(&mut self, n: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(bytes)
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    fn word(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// A number of records of at least `n_bytes` each; `None` if the rest cannot hold as many.
    fn count(&mut self, n_bytes: usize) -> Option<usize> {
        let count = usize::try_from(u64::from_le_bytes(self.take()?)).ok()?;
        (count <= self.0.len() / n_bytes).then_some(count)
    }

    fn affine(&mut self) -> Option<Affine> {
        let mut affine = Affine::IDENTITY;
        for number in affine.columns.as_flattened_mut() {
            *number = f32::from_le_bytes(self.take()?);
        }
        Some(affine)
    }
}

/// FNV-1a with 64 bits: each step is a bijection of the sum, so every change of a single byte is found.
/// Source: Fowler, Noll & Vo, RFC 9923.
fn checksum(bytes: &[u8]) -> u64 {
    let step = |sum: u64, &byte: &u8| (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, step)
}

/// Why bytes are not a TLAS. `E` is the error of a bottom-level BVH.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TlasLoadError<E> {
    /// The bytes are not a saved TLAS.
    Magic {
        /// The first bytes.
        found: [u8; 8],
    },
    /// Saved by a release with another format.
    Version {
        /// The version of the format.
        found: u32,
    },
    /// Fewer or more bytes than the counts in them require.
    Length {
        /// Number of bytes.
        n_bytes: usize,
    },
    /// The contents do not match the checksum in the file: it is damaged.
    Checksum {
        /// Checksum in the file.
        stored: u64,
        /// Checksum of the contents.
        computed: u64,
    },
    /// An unused word of the header is not zero.
    Header {
        /// The word.
        found: u32,
    },
    /// An instance is neither static nor moving.
    Motion {
        /// The instance.
        instance: usize,
    },
    /// An instance cannot be placed.
    Instance(InstanceError),
    /// A bottom-level BVH cannot be loaded.
    Blas {
        /// Index of the bottom-level BVH.
        blas: usize,
        /// Why it cannot be loaded.
        error: E,
    },
}

impl<E> From<InstanceError> for TlasLoadError<E> {
    fn from(error: InstanceError) -> Self {
        Self::Instance(error)
    }
}

impl<E: fmt::Display> fmt::Display for TlasLoadError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Magic { found } => write!(f, "not a TLAS file: it begins with \"{}\"", found.escape_ascii()),
            Self::Version { found } => {
                write!(f, "unsupported version {found} of the TLAS format; this release reads version {VERSION}")
            }
            Self::Length { n_bytes } => write!(f, "{n_bytes} bytes do not match the counts in the file"),
            Self::Checksum { stored, computed } => {
                write!(f, "checksum mismatch: the file says {stored:#018x}, its contents give {computed:#018x}")
            }
            Self::Header { found } => write!(f, "the unused word of the header is {found}, not 0"),
            Self::Motion { instance } => write!(f, "instance {instance} is neither static nor moving"),
            Self::Instance(error) => error.fmt(f),
            Self::Blas { blas, error } => write!(f, "bottom-level BVH {blas}: {error}"),
        }
    }
}

impl<E: Error + 'static> Error for TlasLoadError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Instance(error) => Some(error),
            Self::Blas { error, .. } => Some(error),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use canted_bvh2::Bvh2Boxes;
    use canted_lbvh::VolumeConfig;
    use canted_trace::Ray;
    use canted_wide::{LoadError, TriangleBvh};

    use super::*;
    use crate::InstanceError;

    type Saved = Tlas<TriangleBvh>;

    fn triangle(z: f32) -> TriangleBvh {
        let positions = [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        TriangleBvh::build(&positions, &[[0, 1, 2]]).unwrap()
    }

    fn at(x: f32) -> Affine {
        let mut affine = Affine::IDENTITY;
        affine.columns[3][0] = x;
        affine
    }

    /// Two BVHs; a static, a moving and a masked instance.
    fn tlas() -> Saved {
        let instances =
            [Instance::new(1, at(0.0)), Instance::moving(0, at(2.0), at(4.0)), Instance::new(0, at(-3.0)).with_mask(6)];
        Tlas::new(vec![triangle(0.0), triangle(-0.0)], &instances, TopConfig::default()).unwrap()
    }

    fn load(bytes: &[u8]) -> Result<Saved, TlasLoadError<LoadError>> {
        Tlas::from_bytes(bytes, TopConfig::default())
    }

    fn with_checksum(mut content: Vec<u8>) -> Vec<u8> {
        let sum = checksum(&content);
        content.extend(sum.to_le_bytes());
        content
    }

    #[test]
    fn a_loaded_tlas_saves_the_same_bytes() {
        let bytes = tlas().to_bytes();
        for config in [TopConfig::default(), TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()))] {
            let loaded = Saved::from_bytes(&bytes, config.clone()).unwrap();
            assert_eq!((loaded.instances(), loaded.config()), (tlas().instances(), &config));
            assert_eq!(loaded.to_bytes(), bytes);
            for x in [0.2, 2.2, 4.2, -2.8, 9.0] {
                let ray = Ray::new([x, 0.2, 1.0], [0.0, 0.0, -1.0]);
                assert_eq!(loaded.closest_hit(&ray), tlas().closest_hit(&ray));
            }
        }
        let empty = Saved::new(vec![], &[], TopConfig::default()).unwrap().to_bytes();
        assert_eq!((empty.len(), load(&empty).unwrap().n_instances()), (HEADER_BYTES + CHECKSUM_BYTES, 0));
    }

    /// A byte changed at any position is found, and so is one lost or added.
    #[test]
    fn damage_is_reported() {
        let bytes = tlas().to_bytes();
        for position in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[position] ^= 1 << bit;
                assert!(load(&damaged).is_err(), "bit {bit} of byte {position}");
            }
            assert!(load(&bytes[..position]).is_err(), "{position} bytes");
        }
        assert!(load(&[&bytes[..], &[0]].concat()).is_err());
        let mut changed = bytes;
        let stored = changed.last_chunk_mut().unwrap();
        let expected = u64::from_le_bytes(*stored);
        *stored = 7u64.to_le_bytes();
        assert_eq!(
            load(&changed).map(|_| ()).unwrap_err().to_string(),
            format!("checksum mismatch: the file says 0x0000000000000007, its contents give {expected:#018x}")
        );
    }

    /// With a valid checksum, every change is either found or makes another valid TLAS; none panics.
    #[test]
    fn changed_bytes_with_a_valid_checksum_never_panic() {
        let bytes = tlas().to_bytes();
        let content = &bytes[..bytes.len() - CHECKSUM_BYTES];
        let mut n_loaded = 0;
        for position in 0..content.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut changed = content.to_vec();
                changed[position] = value;
                if let Ok(loaded) = load(&with_checksum(changed.clone())) {
                    n_loaded += 1;
                    let saved = loaded.to_bytes();
                    assert_eq!(saved[..saved.len() - CHECKSUM_BYTES], changed, "{value} at {position}");
                    let _ = loaded.closest_hit(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]));
                }
            }
            let _ = load(&with_checksum(content[..position].to_vec()));
        }
        assert!(n_loaded > 100, "{n_loaded}");
    }

    #[test]
    fn each_flaw_has_its_error() {
        let content = {
            let bytes = tlas().to_bytes();
            bytes[..bytes.len() - CHECKSUM_BYTES].to_vec()
        };
        let changed = |position: usize, value: &[u8]| {
            let mut content = content.clone();
            content[position..position + value.len()].copy_from_slice(value);
            load(&with_checksum(content)).map(|_| ()).unwrap_err()
        };
        let [first, moves] = [HEADER_BYTES, HEADER_BYTES + 8];
        assert!(matches!(changed(0, b"X"), TlasLoadError::Magic { found } if found == *b"XANTTLAS"));
        assert!(matches!(changed(8, &[2]), TlasLoadError::Version { found: 2 }));
        assert!(matches!(changed(12, &[5]), TlasLoadError::Header { found: 5 }));
        assert!(matches!(changed(16, &[0xff; 8]), TlasLoadError::Length { .. }));
        assert!(matches!(changed(24, &[0xff; 8]), TlasLoadError::Length { .. }));
        assert!(matches!(changed(16, &[1]), TlasLoadError::Length { .. }));
        assert!(matches!(
            changed(first, &[9]),
            TlasLoadError::Instance(InstanceError::NoSuchBlas { instance: 0, blas: 9 })
        ));
        assert!(matches!(changed(moves, &[2]), TlasLoadError::Motion { instance: 0 }));
        assert!(matches!(changed(moves + INSTANCE_BYTES, &[0]), TlasLoadError::Motion { instance: 1 }));
        let nan = f32::NAN.to_le_bytes();
        assert!(matches!(changed(first + 12, &nan), TlasLoadError::Instance(InstanceError::NotFinite { instance: 0 })));
        let blas = HEADER_BYTES + 3 * INSTANCE_BYTES + 8;
        let error = changed(blas, b"X");
        assert!(matches!(error, TlasLoadError::Blas { blas: 0, error: LoadError::Magic { .. } }), "{error}");
        assert!(error.to_string().starts_with("bottom-level BVH 0: "), "{error}");
    }
}
