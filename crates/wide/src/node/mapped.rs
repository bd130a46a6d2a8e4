//! Records in files, without a copy; and where records are, found once.
#![expect(
    unsafe_code,
    reason = "the call that maps a file, and slices of memory that does not move; each block says why it is sound"
)]

use std::fs::File;
use std::io;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use bytemuck::Pod;

#[cfg(any(unix, windows))]
type Bytes = memmap2::Mmap;
/// Systems without maps read the file.
#[cfg(not(any(unix, windows)))]
type Bytes = Vec<u8>;

/// A file in memory; several records share it.
#[derive(Clone)]
pub(crate) struct Map(Arc<Bytes>);

impl Map {
    /// `None` where records in memory are not those of files.
    pub(crate) fn open(path: &Path) -> io::Result<Option<Self>> {
        if cfg!(target_endian = "big") {
            return Ok(None);
        }
        let file = File::open(path)?;
        if file.metadata()?.len() == 0 {
            // Nothing to map; the check of the empty file reports it.
            return Ok(None);
        }
        Ok(Some(Self(Arc::new(bytes_of(file)?))))
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Tells the system that all of it will be read soon.
    pub(crate) fn read_ahead(&self) {
        // No answer depends on it.
        #[cfg(unix)]
        let _ = self.0.advise(memmap2::Advice::WillNeed);
    }

    /// Records in a range of bytes; `None` where it does not start at a multiple of their alignment, as maps start on a page.
    pub(crate) fn records<T: Pod>(&self, bytes: Range<usize>) -> Option<MappedRecords<T>> {
        bytemuck::try_cast_slice::<u8, T>(&self.0[bytes.clone()]).ok()?;
        Some(MappedRecords { map: self.clone(), bytes, records: PhantomData })
    }
}

#[cfg(any(unix, windows))]
fn bytes_of(file: File) -> io::Result<Bytes> {
    // SAFETY: The map is private and only read, and every bit pattern is a record. It is sound while no process writes or truncates the
    // file, which `TriangleBvh::map` demands of its caller; no system has maps without that condition.
    unsafe { memmap2::MmapOptions::new().map_copy_read_only(&file) }
}

#[cfg(not(any(unix, windows)))]
fn bytes_of(mut file: File) -> io::Result<Bytes> {
    let mut bytes = vec![];
    io::Read::read_to_end(&mut file, &mut bytes)?;
    Ok(bytes)
}

/// Records in a file.
pub(crate) struct MappedRecords<T> {
    map: Map,
    bytes: Range<usize>,
    records: PhantomData<T>,
}

impl<T: Pod> MappedRecords<T> {
    #[inline]
    pub(super) fn records(&self) -> &[T] {
        bytemuck::cast_slice(&self.map.0[self.bytes.clone()])
    }
}
