//! Tiles shared out between the CPU and a device.
//!
//! The CPU's threads take tiles from the front, the device from the back, until they meet: so each gets as many as its speed
//! allows, and nothing need be known of it beforehand. Whoever then has nothing to begin makes what the other has begun and not
//! finished once more, and the one that is later stops: so neither waits for the other, however slow it is.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use canted_film::Tile;

use crate::Monitor;

/// Most tiles that the device is shown at once.
const MOST_SHOWN: usize = 1 << 12;

/// Who makes tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Cpu,
    Device,
}

/// Tiles of a picture, those that are done and those that are begun.
pub(super) struct Division<'a> {
    monitor: &'a Monitor<'a>,
    is_done: Vec<AtomicBool>,
    state: Mutex<State>,
}

struct State {
    slots: Vec<Option<Tile>>,
    /// Who has begun each tile: the CPU, the device.
    begun: Vec<[bool; 2]>,
    /// Tiles that neither has begun, in order.
    waiting: VecDeque<usize>,
    n_done: usize,
    /// Tiles that the device was the first to finish.
    n_of_device: usize,
}

impl<'a> Division<'a> {
    /// What is to be done where `slots` has no tile.
    pub(super) fn new(slots: Vec<Option<Tile>>, monitor: &'a Monitor<'a>) -> Self {
        let is_done = slots.iter().map(|slot| AtomicBool::new(slot.is_some())).collect();
        let waiting: VecDeque<usize> = (0..slots.len()).filter(|&number| slots[number].is_none()).collect();
        let n_done = slots.len() - waiting.len();
        let begun = vec![[false; 2]; slots.len()];
        Self { monitor, is_done, state: Mutex::new(State { slots, begun, waiting, n_done, n_of_device: 0 }) }
    }

    /// The next tile for a thread of the CPU: `None` where there is nothing left to begin.
    pub(super) fn next_of_cpu(&self) -> Option<usize> {
        let mut state = self.state();
        let number = state.waiting.pop_front().or_else(|| state.left_by(Side::Device).next())?;
        state.begun[number][Side::Cpu as usize] = true;
        Some(number)
    }

    /// The next tiles for the device, as many of those it is shown as `worth` says: none where there is nothing left to begin.
    pub(super) fn next_of_device(&self, worth: impl FnOnce(&[usize]) -> usize) -> Vec<usize> {
        let mut state = self.state();
        let mut shown: Vec<usize> = state.waiting.iter().rev().take(MOST_SHOWN).copied().collect();
        if shown.is_empty() {
            shown = state.left_by(Side::Cpu).collect();
        } else {
            shown.truncate(worth(&shown));
            let n_left = state.waiting.len() - shown.len();
            state.waiting.truncate(n_left);
        }
        for &number in &shown {
            state.begun[number][Side::Device as usize] = true;
        }
        shown
    }

    /// Whether the work is cancelled.
    pub(super) fn is_cancelled(&self) -> bool {
        self.monitor.cancel.load(Ordering::Relaxed)
    }

    /// Whether work on these tiles is of no more use.
    pub(super) fn is_over(&self, numbers: &[usize]) -> bool {
        self.is_cancelled() || numbers.iter().all(|&number| self.is_done[number].load(Ordering::Relaxed))
    }

    /// Keeps a tile that nobody has finished before.
    pub(super) fn finish(&self, tile: Tile, side: Side) {
        let number = tile.number;
        if self.is_done[number].swap(true, Ordering::Relaxed) {
            return;
        }
        (self.monitor.finished)(&tile);
        let mut state = self.state();
        state.slots[number] = Some(tile);
        state.n_done += 1;
        state.n_of_device += usize::from(side == Side::Device);
        let (n_done, n_tiles) = (state.n_done, state.slots.len());
        drop(state);
        (self.monitor.progress)(n_done, n_tiles);
    }

    /// All tiles in order, and how many of them the device made; `None` where one is missing.
    pub(super) fn into_tiles(self) -> Option<(Vec<Tile>, usize)> {
        let State { slots, n_of_device, .. } = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        Some((slots.into_iter().collect::<Option<Vec<Tile>>>()?, n_of_device))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Tiles that `side` alone has begun and that are not done.
    fn left_by(&self, side: Side) -> impl Iterator<Item = usize> + '_ {
        let is_left = move |&number: &usize| {
            let begun = self.begun[number];
            begun[side as usize] && !begun[1 - side as usize] && self.slots[number].is_none()
        };
        (0..self.slots.len()).filter(is_left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(number: usize) -> Tile {
        Tile { number, pixels: vec![], guides: vec![], n_rays: 0 }
    }

    #[test]
    fn each_begins_at_its_end_and_takes_over_what_the_other_has_begun() {
        let cancel = AtomicBool::new(false);
        let monitor = Monitor { progress: &|_, _| (), finished: &|_| (), cancel: &cancel };
        let mut slots: Vec<Option<Tile>> = vec![None; 6];
        slots[1] = Some(tile(1));
        let division = Division::new(slots, &monitor);
        assert_eq!(division.next_of_cpu(), Some(0));
        let worth = |shown: &[usize]| shown.len().min(2);
        assert_eq!(division.next_of_device(worth), [5, 4]);
        assert_eq!(division.next_of_cpu(), Some(2));
        division.finish(tile(2), Side::Cpu);
        assert_eq!(division.next_of_device(worth), [3]);
        division.finish(tile(3), Side::Device);
        // What is left is begun: by the CPU 0, by the device 4 and 5.
        assert_eq!(division.next_of_device(worth), [0]);
        assert_eq!(division.next_of_cpu(), Some(4));
        assert_eq!(division.next_of_cpu(), Some(5));
        assert_eq!(division.next_of_cpu(), None);
        assert!(division.next_of_device(worth).is_empty());
        assert!(!division.is_over(&[4, 5]));
        for number in [5, 4, 0] {
            division.finish(tile(number), Side::Cpu);
            division.finish(tile(number), Side::Device);
        }
        assert!(division.is_over(&[4, 5]));
        let (tiles, n_of_device) = division.into_tiles().unwrap();
        assert_eq!((tiles.len(), n_of_device), (6, 1));
    }

    #[test]
    fn a_picture_that_lacks_a_tile_is_none() {
        let cancel = AtomicBool::new(true);
        let monitor = Monitor { progress: &|_, _| (), finished: &|_| (), cancel: &cancel };
        let division = Division::new(vec![None], &monitor);
        assert!(division.is_over(&[0]));
        assert!(division.into_tiles().is_none());
    }
}
