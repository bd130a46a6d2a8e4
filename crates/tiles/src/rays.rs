//! Rays: hits of all tiles, in the order of one BVH.

use canted_obb::Obb;
use canted_tlas::in_world_order;
use canted_trace::{
    Crossings, Hit, HitLists, InstanceId, Intersect, Mapped, ObjectRay, Query, Ray, ScaledRay, TriangleTest,
    alternate_sides, with_stack,
};
use canted_wide::CrossingParts;

use crate::broad::{Ahead, Entry, Memory};
use crate::bvh::TiledBvh;
use crate::cache::Tile;
use crate::error::TileError;
use crate::schedule::Item;

/// Rays that wait at once; more are traced one batch after another, so that their memory is bounded.
const BATCH: usize = 1 << 20;

/// A ray on its way through the tiles. All `t` are scaled.
struct OnWay {
    index: u32,
    /// With a direction whose greatest component lies in `[1, 2)`, up to the closest hit so far.
    ray: Ray,
    ahead: Ahead,
    hit: Option<Hit>,
    is_done: bool,
}

impl OnWay {
    /// `None` for a ray that cannot hit.
    fn new(index: usize, ray: &Ray) -> Option<Self> {
        let ray = plain(&ScaledRay::new(ray)?);
        Some(Self { index: index as u32, ray, ahead: Ahead::NEW, hit: None, is_done: false })
    }

    /// Takes a hit, with its numbers in the whole.
    fn take(&mut self, hit: Hit) {
        if self.hit.is_none_or(|best| hit.before(&best)) {
            self.ray.t_max = hit.t;
            self.hit = Some(hit);
        }
    }
}

/// The scaled ray as a ray of its own: its scale is 1.
fn plain(ray: &ScaledRay) -> Ray {
    let &ScaledRay { origin, direction, t_min, t_max, time, mask, .. } = ray;
    Ray { origin, direction, t_min, t_max, time, mask }
}

impl Item for OnWay {
    fn next(&mut self, bvh: &TiledBvh, memory: &mut Memory) -> Option<u32> {
        if self.is_done {
            return None;
        }
        // Up to the closest hit so far, so tiles behind it are not among them.
        self.ahead.next(&bvh.broad.rays, &self.ray, memory).map(|entry| entry.1)
    }
}

/// A ray that visits every tile that it may hit. All `t` are scaled.
struct Through {
    index: u32,
    ray: Ray,
    scaled: ScaledRay,
    ahead: Ahead,
    hits: Vec<Hit>,
    parts: CrossingParts,
    /// Of a store with placements, those of each.
    placed: Vec<PlacedParts>,
}

/// The crossings of a ray with one placement.
struct PlacedParts {
    placement: InstanceId,
    object: ObjectRay,
    parts: CrossingParts,
}

impl Through {
    /// `None` for a ray that cannot hit.
    fn new(index: usize, ray: &Ray) -> Option<Self> {
        let ray = plain(&ScaledRay::new(ray)?);
        let scaled = ScaledRay::new(&ray)?;
        Some(Self {
            index: index as u32,
            ray,
            scaled,
            ahead: Ahead::NEW,
            hits: vec![],
            parts: CrossingParts::default(),
            placed: vec![],
        })
    }
}

impl Item for Through {
    fn next(&mut self, bvh: &TiledBvh, memory: &mut Memory) -> Option<u32> {
        self.ahead.next(&bvh.broad.rays, &self.ray, memory).map(|entry| entry.1)
    }
}

/// Order of all hits of a ray.
fn sort(hits: &mut [Hit]) {
    hits.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then((a.instance, a.primitive).cmp(&(b.instance, b.primitive))));
}

/// Makes `t` of the scaled ray those of the ray.
fn to_caller(ray: &Ray, hits: &mut [Hit]) {
    if let Some(ray) = ScaledRay::new(ray) {
        hits.iter_mut().for_each(|hit| hit.t = ray.caller_t(hit.t));
    }
}

impl TiledBvh {
    /// The closest hit of each ray, on all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) -> Result<(), TileError> {
        assert_eq!(rays.len(), hits.len(), "one answer for each ray");
        hits.fill(None);
        for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
            let mut items: Vec<_> = rays.iter().enumerate().filter_map(|(i, ray)| OnWay::new(i, ray)).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut OnWay]| {
                let rays: Vec<Ray> = chunk.iter().map(|item| item.ray).collect();
                let mut found = vec![None; rays.len()];
                tile.target().closest_hits(&rays, &mut found);
                for (item, hit) in chunk.iter_mut().zip(found) {
                    hit.into_iter().for_each(|hit| item.take(tile.in_whole(hit)));
                }
            })?;
            for item in items {
                let i = item.index as usize;
                hits[i] = item.hit;
                hits[i].iter_mut().for_each(|hit| to_caller(&rays[i], std::slice::from_mut(hit)));
            }
        }
        Ok(())
    }

    /// Whether each ray hits anything, on all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_occluded(&self, rays: &[Ray], occluded: &mut [bool]) -> Result<(), TileError> {
        assert_eq!(rays.len(), occluded.len(), "one answer for each ray");
        for (rays, occluded) in rays.chunks(BATCH).zip(occluded.chunks_mut(BATCH)) {
            occluded.fill(false);
            let mut items: Vec<_> = rays.iter().enumerate().filter_map(|(i, ray)| OnWay::new(i, ray)).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut OnWay]| {
                let rays: Vec<Ray> = chunk.iter().map(|item| item.ray).collect();
                let mut found = vec![false; rays.len()];
                tile.target().occluded_many(&rays, &mut found);
                for (item, is_hit) in chunk.iter_mut().zip(found) {
                    item.is_done = is_hit;
                }
            })?;
            for item in items {
                occluded[item.index as usize] = item.is_done;
            }
        }
        Ok(())
    }

    /// Every hit of each ray, in the order of [`Intersect::all_hits`], on all threads. Replaces the content of `lists`.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file.
    pub fn try_all_hits(&self, rays: &[Ray], lists: &mut HitLists) -> Result<(), TileError> {
        let visit = |tile: &Tile, item: &mut Through| {
            let (first, target) = (item.hits.len(), tile.target());
            with_stack(target.stack_len(), |stack| {
                target.all_hits_scaled(&item.scaled, &mut (), stack, &mut item.hits);
            });
            item.hits[first..].iter_mut().for_each(|hit| *hit = tile.in_whole(*hit));
        };
        self.through(rays, lists, &visit, &|mut item| {
            sort(&mut item.hits);
            item.hits
        })
    }

    /// Every crossing of each ray, in the order of [`Crossings::crossings`], on all threads. Replaces the content of `lists`.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file.
    pub fn try_crossings(&self, rays: &[Ray], lists: &mut HitLists) -> Result<(), TileError> {
        let visit = |tile: &Tile, item: &mut Through| {
            let Some(tlas) = tile.placed() else {
                return item.parts.add(tile.bvh(), &item.scaled, |primitive| tile.number(primitive));
            };
            let placed = &mut item.placed;
            with_stack(tlas.stack_len(), |stack| {
                tlas.each_entered(&item.scaled, stack, &mut |bvh, object, instance, _| {
                    let placement = tile.placement(instance);
                    let own = placed.iter().position(|own| own.placement == placement).unwrap_or_else(|| {
                        placed.push(PlacedParts { placement, object: *object, parts: CrossingParts::default() });
                        placed.len() - 1
                    });
                    placed[own].parts.add(bvh, &object.ray, |primitive| tile.number(primitive));
                });
            });
        };
        self.through(rays, lists, &visit, &|mut item| {
            if self.is_plain {
                item.parts.finish(&item.scaled, &mut item.hits);
                return item.hits;
            }
            let (mut found, mut own) = (vec![], vec![]);
            for PlacedParts { placement, object, parts } in item.placed {
                parts.finish(&object.ray, &mut own);
                let placed = |hit: Hit| (object.world_t(hit.t), Hit { instance: placement, ..hit });
                found.extend(own.drain(..).map(placed));
            }
            in_world_order(&item.scaled, found, &mut item.hits);
            alternate_sides(&mut item.hits);
            item.hits
        })
    }

    /// Brings every ray to every tile that it may hit, and makes lists of what `finish` returns.
    fn through(
        &self,
        rays: &[Ray],
        lists: &mut HitLists,
        visit: &(dyn Fn(&Tile, &mut Through) + Sync),
        finish: &dyn Fn(Through) -> Vec<Hit>,
    ) -> Result<(), TileError> {
        lists.clear(rays.len());
        for rays in rays.chunks(BATCH) {
            let mut items: Vec<_> = rays.iter().enumerate().filter_map(|(i, ray)| Through::new(i, ray)).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut Through]| {
                chunk.iter_mut().for_each(|item| visit(tile, item));
            })?;
            let mut done = items.into_iter().peekable();
            for (i, ray) in (0..).zip(rays) {
                let own = done.next_if(|item| item.index == i);
                lists.add_ray(|hits| {
                    let mut found = own.map(finish).unwrap_or_default();
                    to_caller(ray, &mut found);
                    hits.append(&mut found);
                });
            }
        }
        Ok(())
    }

    /// The tiles that a ray may hit, in order.
    fn entries(&self, ray: &Ray) -> Vec<Entry> {
        let mut entries = vec![];
        self.broad.rays.entries(ray, &mut vec![], &mut entries);
        entries
    }
}

/// What was found, or a panic that names the tile.
fn found<T>(result: Result<T, TileError>) -> T {
    result.unwrap_or_else(|error| panic!("{error}"))
}

/// Passes hits of a tile on to `query`: with the numbers of the whole, and the caller's `t`.
fn in_whole<'a>(tile: &'a Tile, ray: &'a ScaledRay, query: &'a mut dyn Query) -> Mapped<'a, impl Fn(&Hit) -> Hit> {
    let map = |hit: &Hit| {
        let hit = tile.in_whole(*hit);
        Hit { t: ray.caller_t(hit.t), ..hit }
    };
    Mapped { query, map }
}

/// One ray at a time; slices of rays read each tile few times. Panics where a tile cannot be read.
impl Intersect for TiledBvh {
    fn bounds(&self) -> Obb {
        if self.is_plain && !self.aabb().is_empty() {
            return Obb::from_aabb(&self.aabb());
        }
        self.broad.bounds().0
    }

    fn hit_error(&self) -> f32 {
        if self.is_plain { TriangleTest::Watertight.hit_error() } else { self.broad.bounds().1 }
    }

    fn has_local_error(&self) -> bool {
        self.is_plain
    }

    fn is_empty(&self) -> bool {
        self.aabb().is_empty()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> Option<Hit> {
        let mut way = OnWay::new(0, &plain(ray))?;
        for Entry(t, tile) in self.entries(&way.ray) {
            if t > way.ray.t_max {
                break;
            }
            let (tile, scaled) = (found(self.cache.get(tile)), ScaledRay::new(&way.ray)?);
            let (target, query) = (tile.target(), &mut in_whole(&tile, ray, query));
            let hit = with_stack(target.stack_len(), |stack| target.closest_hit_scaled(&scaled, query, stack));
            hit.into_iter().for_each(|hit| way.take(tile.in_whole(hit)));
        }
        way.hit.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64]) -> bool {
        let plain = plain(ray);
        let Some(scaled) = ScaledRay::new(&plain) else { return false };
        self.entries(&plain).into_iter().any(|Entry(_, tile)| {
            let tile = found(self.cache.get(tile));
            let (target, query) = (tile.target(), &mut in_whole(&tile, ray, query));
            with_stack(target.stack_len(), |stack| target.occluded_scaled(&scaled, query, stack))
        })
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, _: &mut [u64], hits: &mut Vec<Hit>) {
        let plain = plain(ray);
        let Some(scaled) = ScaledRay::new(&plain) else { return };
        let first = hits.len();
        for Entry(_, tile) in self.entries(&plain) {
            let tile = found(self.cache.get(tile));
            let (target, of_tile, query) = (tile.target(), hits.len(), &mut in_whole(&tile, ray, query));
            with_stack(target.stack_len(), |stack| target.all_hits_scaled(&scaled, query, stack, hits));
            hits[of_tile..].iter_mut().for_each(|hit| *hit = tile.in_whole(*hit));
        }
        sort(&mut hits[first..]);
        hits[first..].iter_mut().for_each(|hit| hit.t = ray.caller_t(hit.t));
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        found(self.try_closest_hits(rays, hits));
    }

    fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        found(self.try_closest_hits(rays, hits));
    }

    fn occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        found(self.try_occluded(rays, occluded));
    }

    fn par_occluded_many(&self, rays: &[Ray], occluded: &mut [bool]) {
        found(self.try_occluded(rays, occluded));
    }

    fn all_hits_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        found(self.try_all_hits(rays, lists));
    }
}

/// Panics where a tile cannot be read.
impl Crossings for TiledBvh {
    fn crossings_scaled(&self, ray: &ScaledRay, _: &mut [u64], crossings: &mut Vec<Hit>) {
        let mut lists = HitLists::new();
        found(self.try_crossings(&[plain(ray)], &mut lists));
        crossings.extend(lists.hits().iter().map(|hit| Hit { t: ray.caller_t(hit.t), ..*hit }));
    }

    fn crossings_listed(&self, rays: &[Ray], lists: &mut HitLists) {
        found(self.try_crossings(rays, lists));
    }
}
