//! Records in files, without a copy; and where records are, found once.
#![expect(
    unsafe_code,
    reason = "the call that maps a file, and slices of memory that does not move; each block says why it is sound"
)]

use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::Path;
use std::ptr::NonNull;
use std::slice;
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
    pub(crate) fn records<T: Pod>(&self, bytes: Range<usize>) -> Option<Memory<T>> {
        let records: &[T] = bytemuck::try_cast_slice(&self.0[bytes]).ok()?;
        Some(Memory { first: NonNull::from(records).cast(), n: records.len(), owner: Owner::File(self.clone()) })
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

/// Records, and where they are: a ray through few nodes takes as long as the way from the owner to them.
pub(crate) struct Memory<T> {
    first: NonNull<T>,
    n: usize,
    owner: Owner<T>,
}

/// What holds the records, which stay where they are when it is moved.
enum Owner<T> {
    Heap(#[expect(dead_code, reason = "it is dropped")] Vec<T>),
    #[cfg(target_os = "linux")]
    Huge(#[expect(dead_code, reason = "it is dropped")] memmap2::MmapMut),
    File(#[expect(dead_code, reason = "it is dropped")] Map),
}

// SAFETY: the records belong to the owner alone, or to a file that is only read.
unsafe impl<T: Send> Send for Memory<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Memory<T> {}

impl<T: Pod> Memory<T> {
    pub(super) fn heap(mut records: Vec<T>) -> Self {
        let (first, n) = (NonNull::from(&mut records[..]).cast(), records.len());
        Self { first, n, owner: Owner::Heap(records) }
    }

    /// The records in these bytes of a map.
    #[cfg(target_os = "linux")]
    pub(super) fn huge(mut map: memmap2::MmapMut, bytes: Range<usize>) -> Self {
        let records: &mut [T] = bytemuck::cast_slice_mut(&mut map[bytes]);
        let (first, n) = (NonNull::from(&mut *records).cast(), records.len());
        Self { first, n, owner: Owner::Huge(map) }
    }

    #[inline(always)]
    pub(super) fn records(&self) -> &[T] {
        // SAFETY: the owner holds these records, does not move them, and is neither used nor changed before it is dropped.
        unsafe { slice::from_raw_parts(self.first.as_ptr(), self.n) }
    }

    /// The records, to be changed; `None` of those in a file.
    pub(super) fn records_mut(&mut self) -> Option<&mut [T]> {
        if let Owner::File(_) = self.owner {
            return None;
        }
        // SAFETY: as above; they were found by an exclusive reference, and nothing else refers to them.
        Some(unsafe { slice::from_raw_parts_mut(self.first.as_ptr(), self.n) })
    }
}
