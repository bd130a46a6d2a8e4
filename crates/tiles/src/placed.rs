//! Points of world space against a store with placements: the answers of a TLAS over whole meshes.

use canted_tlas::{NearestSurface, NearestSurfaces};
use canted_trace::Ray;
use canted_wide::Place;

use crate::broad::{Ahead, Memory};
use crate::bvh::TiledBvh;
use crate::cache::Tile;
use crate::error::TileError;
use crate::points::{BATCH, add};
use crate::schedule::Item;

/// A point on its way to the nearest triangles.
struct Near {
    index: u32,
    point: [f64; 3],
    nearest: NearestSurfaces,
    last: Option<(f64, u32)>,
    /// Tiles that were visited: each has all its placements.
    visited: Vec<u32>,
}

impl Near {
    fn visit(&mut self, tile: &Tile) {
        let (Some(tlas), nearest) = (tile.placed(), &mut self.nearest) else { return };
        tlas.visit_near(self.point, nearest.bound(), &mut |found| {
            let (primitive, instance) = (tile.number(found.primitive), tile.placement(found.instance));
            nearest.take(NearestSurface { primitive, instance, ..found })
        });
    }
}

impl Item for Near {
    fn next(&mut self, bvh: &TiledBvh, _: &mut Memory) -> Option<u32> {
        loop {
            let next = bvh.broad.nearest(self.point, self.last, self.nearest.bound())?;
            self.last = Some(next);
            let tile = bvh.broad.tile_at(next.1);
            if !self.visited.contains(&tile) {
                self.visited.push(tile);
                return Some(tile);
            }
        }
    }
}

/// A point with the placements around it.
struct Within {
    index: u32,
    /// The mesh of each, and the point in its space.
    around: Vec<(u32, [f32; 3])>,
    ahead: Ahead,
    /// With respect to the last of `around`.
    place: Place,
    is_inside: bool,
}

impl Item for Within {
    fn next(&mut self, bvh: &TiledBvh, memory: &mut Memory) -> Option<u32> {
        while let Some(&(mesh, point)) = self.around.last().filter(|_| !self.is_inside) {
            let ray = Ray::new(point, [0.0, 0.0, 1.0]);
            let next = self.ahead.next(&bvh.broad.meshes[mesh as usize], &ray, memory);
            match next.filter(|_| self.place != Place::On) {
                Some(entry) => return Some(entry.1),
                None => {
                    self.is_inside = self.place != Place::Outside;
                    (self.ahead, self.place) = (Ahead::NEW, Place::Outside);
                    self.around.pop();
                }
            }
        }
        None
    }
}

impl TiledBvh {
    /// The `k` triangles closest to each point of world space among those at most `max_distance` away, nearest first, as
    /// [`Tlas::nearest_points`](canted_tlas::Tlas::nearest_points). On all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store without placements, whose answers are those of [`Self::try_nearest_points`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_nearest_surfaces(
        &self,
        points: &[[f64; 3]],
        k: usize,
        max_distance: f64,
        nearest: &mut [Vec<NearestSurface>],
    ) -> Result<(), TileError> {
        assert_eq!(points.len(), nearest.len(), "one answer for each point");
        self.has_placements()?;
        nearest.iter_mut().for_each(Vec::clear);
        if max_distance.is_nan() || max_distance < 0.0 || k == 0 {
            return Ok(());
        }
        for (points, nearest) in points.chunks(BATCH).zip(nearest.chunks_mut(BATCH)) {
            let item = |(i, &point): (usize, &[f64; 3])| {
                let nearest = NearestSurfaces { found: vec![], k, max_distance };
                let near = Near { index: i as u32, point, nearest, last: None, visited: vec![] };
                point.iter().all(|x| x.is_finite()).then_some(near)
            };
            let mut items: Vec<_> = points.iter().enumerate().filter_map(item).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut Near]| chunk.iter_mut().for_each(|item| item.visit(tile)))?;
            items.into_iter().for_each(|item| nearest[item.index as usize] = item.nearest.found);
        }
        Ok(())
    }

    /// Whether each point of world space is inside of any placement of a closed mesh, or on its surface, as
    /// [`Tlas::contains`](canted_tlas::Tlas::contains). On all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store without placements, whose answers are those of [`Self::try_contains`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_contains_placed(&self, points: &[[f64; 3]], inside: &mut [bool]) -> Result<(), TileError> {
        assert_eq!(points.len(), inside.len(), "one answer for each point");
        self.has_placements()?;
        let Some(placements) = &self.broad.placements else { return Ok(()) };
        for (points, inside) in points.chunks(BATCH).zip(inside.chunks_mut(BATCH)) {
            let item = |(i, &point): (usize, &[f64; 3])| {
                let mut around = vec![];
                let _ = placements.contains_with(point, |mesh, _, point| {
                    around.push((mesh, point));
                    false
                });
                Within { index: i as u32, around, ahead: Ahead::NEW, place: Place::Outside, is_inside: false }
            };
            let mut items: Vec<_> = points.iter().enumerate().map(item).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut Within]| {
                let points: Vec<[f32; 3]> =
                    chunk.iter().map(|item| item.around.last().map_or([0.0; 3], |a| a.1)).collect();
                let mut places = vec![Place::Outside; points.len()];
                tile.bvh().places(&points, &mut places);
                chunk.iter_mut().zip(places).for_each(|(item, place)| item.place = add(item.place, place));
            })?;
            items.into_iter().for_each(|item| inside[item.index as usize] = item.is_inside);
        }
        Ok(())
    }

    /// Distance of each point of world space to the nearest surface, negative inside, as
    /// [`Tlas::signed_distance`](canted_tlas::Tlas::signed_distance). On all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store without placements, whose answers are those of [`Self::try_signed_distances`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_signed_distances_placed(&self, points: &[[f64; 3]], distances: &mut [f64]) -> Result<(), TileError> {
        assert_eq!(points.len(), distances.len(), "one answer for each point");
        let (mut inside, mut nearest) = (vec![false; points.len()], vec![vec![]; points.len()]);
        self.try_contains_placed(points, &mut inside)?;
        self.try_nearest_surfaces(points, 1, f64::INFINITY, &mut nearest)?;
        for (i, distance) in distances.iter_mut().enumerate() {
            let none = if points[i].iter().any(|x| x.is_nan()) { f64::NAN } else { f64::INFINITY };
            let size = nearest[i].first().map_or(none, |found| found.distance);
            *distance = if size > 0.0 && inside[i] { -size } else { size };
        }
        Ok(())
    }

    /// An error where the store is one mesh.
    fn has_placements(&self) -> Result<(), TileError> {
        match self.is_plain {
            true => Err(TileError::of_path(&self.folder, "the store is one mesh, without placements")),
            false => Ok(()),
        }
    }
}
