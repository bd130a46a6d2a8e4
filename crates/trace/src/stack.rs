//! Memory for subtrees that wait, for one ray after another.

#[cfg(feature = "std")]
use std::cell::{Cell, RefCell};

#[cfg(feature = "std")]
use alloc::vec::Vec;

/// Entries without allocation, for two levels of twelve nodes' depth each; a scaffold of 58,320 triangles has 7.
const TWO_LEVELS: usize = 184;

/// Calls `run` with at least `n` entries, whose content means nothing.
///
/// Single rays need it to be cheap: an allocation takes as long as a ray through a few nodes, and clearing a kilobyte as long as one. So
/// each thread keeps its memory for the next ray.
#[inline(always)]
pub fn with_stack<R>(n: usize, run: impl FnOnce(&mut [u64]) -> R) -> R {
    if n <= TWO_LEVELS { with_kept(run) } else { with_allocated(n, run) }
}

#[cfg(feature = "std")]
std::thread_local! {
    /// Memory for BVHs that are not deep.
    static KEPT: RefCell<[u64; TWO_LEVELS]> = const { RefCell::new([0; TWO_LEVELS]) };
}

#[cfg(feature = "std")]
#[inline(always)]
fn with_kept<R>(run: impl FnOnce(&mut [u64]) -> R) -> R {
    KEPT.with(|kept| {
        let mut own;
        let mut kept = kept.try_borrow_mut();
        let entries: &mut [u64] = match &mut kept {
            Ok(kept) => &mut kept[..],
            // A query within another.
            Err(_) => {
                own = [0; TWO_LEVELS];
                &mut own
            }
        };
        run(entries)
    })
}

#[cfg(not(feature = "std"))]
fn with_kept<R>(run: impl FnOnce(&mut [u64]) -> R) -> R {
    run(&mut [0; TWO_LEVELS])
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
        for [n_outer, n_inner] in [[200, 300], [92, 92], [184, 20], [92, 300], [300, 92]] {
            with_stack(n_outer, |outer| {
                outer.fill(1);
                with_stack(n_inner, |inner| inner.fill(2));
                assert!(outer.iter().all(|&entry| entry == 1));
            });
        }
        assert!(with_stack(1408, |entries| entries.len()) >= 1408);
    }
}
