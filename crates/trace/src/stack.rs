//! Memory for subtrees that wait, for one ray after another.

#[cfg(feature = "std")]
use std::cell::Cell;

#[cfg(feature = "std")]
use alloc::vec::Vec;

/// Entries without allocation for one level of twelve nodes' depth; a scaffold of 58,320 triangles has 7.
const ONE_LEVEL: usize = 92;

/// Entries without allocation for two such levels.
const TWO_LEVELS: usize = 2 * ONE_LEVEL;

/// Calls `run` with at least `n` entries, whose content means nothing.
///
/// Single rays need it to be cheap: up to 1.5 KiB are zeroed where they are used, because an allocation would take longer. Memory
/// for deeper BVHs is allocated and kept for the next ray of the thread.
#[inline(always)]
pub fn with_stack<R>(n: usize, run: impl FnOnce(&mut [u64]) -> R) -> R {
    if n <= ONE_LEVEL {
        return run(&mut [0; ONE_LEVEL]);
    }
    if n <= TWO_LEVELS {
        return run(&mut [0; TWO_LEVELS]);
    }
    with_allocated(n, run)
}

#[cfg(feature = "std")]
std::thread_local! {
    /// The memory of the last deep BVH.
    static SPARE: Cell<Vec<u64>> = const { Cell::new(Vec::new()) };
}

#[cfg(feature = "std")]
#[cold]
fn with_allocated<R>(n: usize, run: impl FnOnce(&mut [u64]) -> R) -> R {
    // A query within another finds none to use again, and allocates. An error only while the thread ends.
    let mut entries = SPARE.try_with(Cell::take).unwrap_or_default();
    if entries.len() < n {
        entries.resize(n, 0);
    }
    let result = run(&mut entries);
    let _ = SPARE.try_with(|spare| spare.set(entries));
    result
}

#[cfg(not(feature = "std"))]
#[cold]
fn with_allocated<R>(n: usize, run: impl FnOnce(&mut [u64]) -> R) -> R {
    run(&mut alloc::vec![0; n])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_an_entry_for_each_that_waits() {
        for n in [0, 1, 91, 92, 93, 184, 185, 1408, 93] {
            assert!(with_stack(n, |entries| entries.len()) >= n, "{n}");
        }
    }

    #[test]
    fn nested_stacks_share_no_memory() {
        with_stack(200, |outer| {
            outer.fill(1);
            with_stack(300, |inner| inner.fill(2));
            assert!(outer.iter().all(|&entry| entry == 1));
        });
        assert!(with_stack(1408, |entries| entries.len()) >= 1408);
    }
}
