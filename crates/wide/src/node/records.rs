//! Memory of nodes and leaves, in huge pages where the system offers them, or in a mapped file.
//!
//! A ray jumps through memory. With pages of 4 KiB nearly every jump in a large BVH misses the cache of page addresses; one
//! page of 2 MiB replaces 512 of them.

use std::fmt;
use std::ops::{Deref, DerefMut};

use bytemuck::Pod;

use super::mapped::MappedRecords;

/// Records of a BVH: a slice that may lie in huge pages.
pub(crate) struct Records<T>(Memory<T>);

enum Memory<T> {
    Heap(Vec<T>),
    #[cfg(target_os = "linux")]
    Huge(huge::Pages<T>),
    File(MappedRecords<T>),
}

impl<T: Pod> From<Vec<T>> for Records<T> {
    fn from(records: Vec<T>) -> Self {
        #[cfg(target_os = "linux")]
        if let Some(pages) = huge::Pages::copy_of(&records) {
            return Self(Memory::Huge(pages));
        }
        Self(Memory::Heap(records))
    }
}

impl<T: Pod> Records<T> {
    /// Records in a file, which are copied before they are changed.
    pub(crate) fn mapped(records: MappedRecords<T>) -> Self {
        Self(Memory::File(records))
    }

    /// `n` records of zeros. In huge pages the system clears them, by whichever thread writes to a page first.
    pub(crate) fn zeroed(n: usize) -> Self {
        #[cfg(target_os = "linux")]
        if let Some(pages) = huge::Pages::zeroed(n) {
            return Self(Memory::Huge(pages));
        }
        Self(Memory::Heap(vec![T::zeroed(); n]))
    }

    /// These records and zeros, `n` in all.
    pub(crate) fn grown(&self, n: usize) -> Self {
        let mut records = Self::zeroed(n);
        records[..self.len()].copy_from_slice(self);
        records
    }
}

impl<T: Pod> Deref for Records<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Memory::Heap(records) => records,
            #[cfg(target_os = "linux")]
            Memory::Huge(pages) => pages.records(),
            Memory::File(file) => file.records(),
        }
    }
}

impl<T: Pod> DerefMut for Records<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if let Memory::File(file) = &self.0 {
            *self = file.records().to_vec().into();
        }
        match &mut self.0 {
            Memory::Heap(records) => records,
            #[cfg(target_os = "linux")]
            Memory::Huge(pages) => pages.records_mut(),
            Memory::File(_) => unreachable!("copied above"),
        }
    }
}

impl<T: Pod> Clone for Records<T> {
    fn clone(&self) -> Self {
        self.to_vec().into()
    }
}

impl<T: Pod + PartialEq> PartialEq for Records<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T> fmt::Debug for Records<T>
where
    T: Pod + fmt::Debug,
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(target_os = "linux")]
mod huge {
    use std::marker::PhantomData;
    use std::ops::Range;

    use bytemuck::Pod;
    use memmap2::{Advice, MmapMut};

    /// Bytes of a huge page on x86-64 and on most aarch64 systems. Elsewhere it is only an alignment.
    pub(super) const PAGE: usize = 1 << 21;

    /// Records in anonymous memory for which huge pages were requested.
    pub(super) struct Pages<T> {
        memory: MmapMut,
        bytes: Range<usize>,
        records: PhantomData<T>,
    }

    impl<T: Pod> Pages<T> {
        /// A copy of `records`; `None` as for [`Self::zeroed`].
        pub(super) fn copy_of(records: &[T]) -> Option<Self> {
            let mut pages = Self::zeroed(records.len())?;
            pages.records_mut().copy_from_slice(records);
            Some(pages)
        }

        /// `n` records of zeros; `None` where they fill less than a page, or the system has no memory of this kind.
        pub(super) fn zeroed(n: usize) -> Option<Self> {
            let n_bytes = n.checked_mul(size_of::<T>())?;
            if n_bytes < PAGE {
                return None;
            }
            // One page more, so that the records can start on a page.
            let memory = MmapMut::map_anon(n_bytes.checked_add(PAGE)?).ok()?;
            // Only a hint: without huge pages the memory serves as well.
            let _ = memory.advise(Advice::HugePage);
            let start = memory.as_ptr().addr().next_multiple_of(PAGE) - memory.as_ptr().addr();
            Some(Self { memory, bytes: start..start + n_bytes, records: PhantomData })
        }

        #[inline]
        pub(super) fn records(&self) -> &[T] {
            bytemuck::cast_slice(&self.memory[self.bytes.clone()])
        }

        pub(super) fn records_mut(&mut self) -> &mut [T] {
            bytemuck::cast_slice_mut(&mut self.memory[self.bytes.clone()])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::CacheLine;

    #[test]
    fn records_keep_their_content_in_either_memory() {
        for n in [0, 1, 1000, 32_767, 32_768, 70_001] {
            let lines: Vec<CacheLine> = (0..n).map(|i| CacheLine([i; 16])).collect();
            let mut records = Records::from(lines.clone());
            assert_eq!(*records, *lines);
            assert_eq!(*Records::<CacheLine>::zeroed(lines.len()), *vec![CacheLine([0; 16]); lines.len()]);
            let before = records.clone();
            assert_eq!(before, records);
            if let Some(last) = records.last_mut() {
                last.0[15] ^= 1;
                assert_ne!(before, records);
            }
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn large_records_start_on_a_huge_page() {
        let records = Records::from(vec![CacheLine([7; 16]); 2 * huge::PAGE / size_of::<CacheLine>()]);
        assert!(matches!(records.0, Memory::Huge(_)));
        assert_eq!(records.as_ptr().addr() % huge::PAGE, 0);
        let small = Records::from(vec![CacheLine([7; 16]); huge::PAGE / size_of::<CacheLine>() - 1]);
        assert!(matches!(small.0, Memory::Heap(_)));
    }
}
