//! Work that waits at tiles: each item names the tile that it needs next, and a tile is read for all that wait there.

use canted_lbvh::par;

use crate::bvh::TiledBvh;
use crate::cache::Tile;
use crate::error::TileError;

/// Items that a thread takes at a time.
const CHUNK: usize = 1024;

/// A ray or a point that needs tiles one after another.
pub(crate) trait Item: Send {
    /// The tile that it needs next, if it needs one.
    fn next(&mut self, bvh: &TiledBvh, memory: &mut Memory) -> Option<u32>;
}

/// Memory to use again.
#[derive(Default)]
pub(crate) struct Memory {
    pub(crate) hits: Vec<canted_trace::Hit>,
    pub(crate) entries: Vec<crate::broad::Entry>,
}

/// An item with the tile that it waits for.
struct Waiting<I> {
    item: I,
    tile: Option<u32>,
}

impl TiledBvh {
    /// Brings all items to the tiles that they need. Returns them in any order.
    ///
    /// Of the tiles in memory, the one where most wait comes first, then the one of all others where most wait. It is read by another thread
    /// meanwhile where both fit into memory.
    pub(crate) fn run<I: Item>(
        &self,
        items: Vec<I>,
        visit: &(dyn Fn(&Tile, &mut [&mut I]) + Sync),
    ) -> Result<Vec<I>, TileError> {
        let mut queues: Vec<Vec<Waiting<I>>> = (0..self.cache.n_tiles()).map(|_| vec![]).collect();
        let mut done = Vec::with_capacity(items.len());
        let mut waiting: Vec<Waiting<I>> = items.into_iter().map(|item| Waiting { item, tile: None }).collect();
        par::for_chunks(&mut waiting, CHUNK, |_, chunk| self.ask(chunk));
        distribute(waiting, &mut queues, &mut done);
        while let Some((tile, then)) = self.choose(&queues) {
            let mut own = std::mem::take(&mut queues[tile as usize]);
            let held = self.cache.get(tile)?;
            let mut trace = || {
                par::for_chunks(&mut own, CHUNK, |_, chunk| {
                    visit(&held, &mut chunk.iter_mut().map(|waiting| &mut waiting.item).collect::<Vec<_>>());
                    self.ask(chunk);
                });
            };
            match then {
                None => trace(),
                // An error is reported when the tile is needed.
                Some(then) => std::thread::scope(|scope| {
                    scope.spawn(move || drop(self.cache.get(then)));
                    trace();
                }),
            }
            distribute(own, &mut queues, &mut done);
        }
        Ok(done)
    }

    fn ask<I: Item>(&self, chunk: &mut [Waiting<I>]) {
        let mut memory = Memory::default();
        for waiting in chunk {
            waiting.tile = waiting.item.next(self, &mut memory);
        }
    }

    /// The tile to visit, and the one to read meanwhile.
    fn choose<I>(&self, queues: &[Vec<I>]) -> Option<(u32, Option<u32>)> {
        let held = self.cache.held();
        let longest = |is_held: bool, but: Option<u32>| {
            let own = (0..)
                .zip(queues)
                .filter(|(tile, queue)| !queue.is_empty() && Some(*tile) != but && held[*tile as usize] == is_held);
            own.max_by_key(|(tile, queue)| (queue.len(), std::cmp::Reverse(*tile))).map(|(tile, _)| tile)
        };
        let tile = longest(true, None).or_else(|| longest(false, None))?;
        let then = longest(false, Some(tile))
            .filter(|&then| queues[tile as usize].len() >= CHUNK && self.cache.fits_with(then, tile));
        Some((tile, then))
    }
}

fn distribute<I>(items: Vec<Waiting<I>>, queues: &mut [Vec<Waiting<I>>], done: &mut Vec<I>) {
    for waiting in items {
        match waiting.tile {
            Some(tile) => queues[tile as usize].push(waiting),
            None => done.push(waiting.item),
        }
    }
}
