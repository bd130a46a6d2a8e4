//! Work that waits at tiles: each item names the tile that it needs next, and a tile is read for all that wait there.

use canted_lbvh::par;

use crate::broad::Memory;
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

/// The places of the items that wait at each tile.
type Queues = [Vec<u32>];

/// What is done with items at a tile.
type Visit<'a, I> = dyn Fn(&Tile, &mut [&mut I]) + Sync + 'a;

impl TiledBvh {
    /// Brings all items to the tiles that they need; they stay in place.
    ///
    /// Of the tiles in memory, the one where most wait comes first, then the one of all others where most wait. It is read by another thread
    /// meanwhile where both fit into memory.
    pub(crate) fn run<I: Item>(&self, items: &mut [I], visit: &Visit<'_, I>) -> Result<(), TileError> {
        let mut queues: Vec<Vec<u32>> = (0..self.cache.n_tiles()).map(|_| vec![]).collect();
        let all: Vec<u32> = (0..items.len() as u32).collect();
        self.advance(items, &all, &mut queues, &|_| ());
        while let Some((tile, then)) = self.choose(&queues) {
            let mut own = std::mem::take(&mut queues[tile as usize]);
            // From several tiles, each in order.
            own.sort_unstable();
            let held = self.cache.get(tile)?;
            self.cache.check_unchanged(tile)?;
            let mut trace = || self.advance(items, &own, &mut queues, &|chunk| visit(&held, chunk));
            match then {
                None => trace(),
                // An error is reported when the tile is needed.
                Some(then) => std::thread::scope(|scope| {
                    scope.spawn(move || drop(self.cache.get(then)));
                    trace();
                }),
            }
        }
        Ok(())
    }

    /// Works on the items at `places`, which ascend, and moves them to the queues of the tiles that they need next.
    fn advance<I: Item>(
        &self,
        items: &mut [I],
        places: &[u32],
        queues: &mut Queues,
        work: &(dyn Fn(&mut [&mut I]) + Sync),
    ) {
        let (mut jobs, mut rest, mut first) = (vec![], items, 0);
        for part in places.chunks(CHUNK) {
            let end = part.last().map_or(first, |last| last + 1);
            let (own, after) = rest.split_at_mut((end - first) as usize);
            jobs.push((part, own, first));
            (rest, first) = (after, end);
        }
        let next = par::map_jobs(jobs, |(part, own, first)| {
            let mut chunk = at_places(own, part, first);
            work(&mut chunk);
            let mut memory = Memory::default();
            chunk.iter_mut().map(|item| item.next(self, &mut memory)).collect::<Vec<_>>()
        });
        for (place, tile) in places.iter().zip(next.iter().flatten()) {
            if let Some(tile) = tile {
                queues[*tile as usize].push(*place);
            }
        }
    }

    /// The tile to visit, and the one to read meanwhile.
    fn choose(&self, queues: &Queues) -> Option<(u32, Option<u32>)> {
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

/// The items at places that ascend, of which `items` begin with the one at `first`.
fn at_places<'a, I>(mut items: &'a mut [I], places: &[u32], mut first: u32) -> Vec<&'a mut I> {
    let mut chosen = Vec::with_capacity(places.len());
    for &place in places {
        let (_, from) = std::mem::take(&mut items).split_at_mut((place - first) as usize);
        if let Some((item, after)) = from.split_first_mut() {
            chosen.push(item);
            (items, first) = (after, place + 1);
        }
    }
    chosen
}
