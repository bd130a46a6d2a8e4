//! Memory of nodes and leaves, in huge pages where the system offers them, or in a mapped file.
//!
//! A ray jumps through memory. With pages of 4 KiB nearly every jump in a large BVH misses the cache of page addresses; one
//! page of 2 MiB replaces 512 of them.

use std::fmt;
use std::ops::{Deref, DerefMut};

use bytemuck::Pod;

use super::mapped::Memory;

/// Records of a BVH: a slice that may lie in huge pages.
pub(crate) struct Records<T>(Memory<T>);

impl<T: Pod> From<Vec<T>> for Records<T> {
    fn from(records: Vec<T>) -> Self {
        #[cfg(target_os = "linux")]
        if let Some(mut pages) = huge::zeroed(records.len()).map(Self) {
            pages.copy_from_slice(&records);
            return pages;
        }
        Self(Memory::heap(records))
    }
}

impl<T: Pod> Records<T> {
    /// Records in a file, which are copied before they are changed.
    pub(crate) fn mapped(records: Memory<T>) -> Self {
        Self(records)
    }

    /// `n` records of zeros. In huge pages the system clears them, by whichever thread writes to a page first.
    pub(crate) fn zeroed(n: usize) -> Self {
        #[cfg(target_os = "linux")]
        if let Some(pages) = huge::zeroed(n) {
            return Self(pages);
        }
        Self(Memory::heap(vec![T::zeroed(); n]))
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
        self.0.records()
    }
}

impl<T: Pod> DerefMut for Records<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if self.0.records_mut().is_none() {
            *self = self.to_vec().into();
        }
        self.0.records_mut().expect("records in a file were copied")
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
    use bytemuck::Pod;
    use memmap2::{Advice, MmapMut};

    use super::Memory;

    /// Bytes of a huge page on x86-64 and on most aarch64 systems. Elsewhere it is only an alignment.
    pub(super) const PAGE: usize = 1 << 21;

    /// `n` records of zeros in anonymous memory for which huge pages were requested; `None` where they fill less than a page, or the system
    /// has no memory of this kind.
    pub(super) fn zeroed<T: Pod>(n: usize) -> Option<Memory<T>> {
        let n_bytes = n.checked_mul(size_of::<T>())?;
        if n_bytes < PAGE {
            return None;
        }
        // One page more, so that the records can start on a page.
        let map = MmapMut::map_anon(n_bytes.checked_add(PAGE)?).ok()?;
        // Only a hint: without huge pages the memory serves as well.
        let _ = map.advise(Advice::HugePage);
        let start = map.as_ptr().addr().next_multiple_of(PAGE) - map.as_ptr().addr();
        Some(Memory::huge(map, start..start + n_bytes))
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
        assert_eq!(records.as_ptr().addr() % huge::PAGE, 0);
        let n_lines = huge::PAGE / size_of::<CacheLine>();
        assert!(huge::zeroed::<CacheLine>(n_lines).is_some() && huge::zeroed::<CacheLine>(n_lines - 1).is_none());
    }
}
