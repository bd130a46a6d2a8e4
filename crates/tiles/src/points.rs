//! Points: nearest triangles, containment and signed distances over all tiles.

use canted_obb::PrimId;
use canted_trace::Ray;
use canted_wide::{ClosestPoint, DistanceShape as _, Found, NearestList, NearestPoint, Place};

use crate::broad::{Ahead, Memory};
use crate::bvh::TiledBvh;
use crate::cache::Tile;
use crate::error::TileError;
use crate::schedule::Item;

/// Points that wait at once.
pub(crate) const BATCH: usize = 1 << 20;

/// A point on its way to the nearest triangles.
struct Near {
    index: u32,
    point: [f32; 3],
    /// Those so far, with their numbers in the mesh.
    nearest: NearestList,
    last: Option<(f64, u32)>,
}

impl Near {
    fn visit(&mut self, tile: &Tile) {
        let point = self.point;
        tile.bvh().visit_near(point, self.nearest.bound(), |primitive, shape, _| {
            let ClosestPoint { distance_squared, position } = shape.closest_point(point);
            self.nearest.take((distance_squared, tile.number(primitive), position));
            self.nearest.bound()
        });
    }
}

impl Item for Near {
    fn next(&mut self, bvh: &TiledBvh, _: &mut Memory) -> Option<u32> {
        let next = bvh.broad.nearest(self.point.map(f64::from), self.last, self.nearest.bound().sqrt())?;
        self.last = Some(next);
        Some(bvh.broad.tile_at(next.1))
    }
}

/// A point with the tiles above it.
struct Above {
    index: u32,
    point: [f32; 3],
    ahead: Ahead,
    place: Place,
}

impl Above {
    fn new(index: usize, point: [f32; 3]) -> Self {
        Self { index: index as u32, point, ahead: Ahead::NEW, place: Place::Outside }
    }
}

/// The place with respect to one more tile: an odd number of odd numbers is odd.
pub(crate) fn add(place: Place, of_tile: Place) -> Place {
    match (place, of_tile) {
        (Place::On, _) | (_, Place::On) => Place::On,
        (place, Place::Outside) => place,
        (Place::Outside, Place::Inside) => Place::Inside,
        (Place::Inside, Place::Inside) => Place::Outside,
    }
}

impl Item for Above {
    fn next(&mut self, bvh: &TiledBvh, memory: &mut Memory) -> Option<u32> {
        if self.place == Place::On {
            return None;
        }
        self.ahead.next(&bvh.broad.rays, &Ray::new(self.point, [0.0, 0.0, 1.0]), memory).map(|entry| entry.1)
    }
}

impl TiledBvh {
    /// The `k` triangles closest to each point among those at most `max_distance` away, nearest first; ties go to the lowest number. On all
    /// threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store with placements.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_nearest_points(
        &self,
        points: &[[f32; 3]],
        k: usize,
        max_distance: f32,
        nearest: &mut [Vec<NearestPoint>],
    ) -> Result<(), TileError> {
        assert_eq!(points.len(), nearest.len(), "one answer for each point");
        nearest.iter_mut().for_each(Vec::clear);
        self.find_nearest(points, k, max_distance, &mut |i, found| {
            nearest[i].extend(found.iter().copied().map(NearestPoint::from));
        })
    }

    /// Calls `answer` with the index of a point and what is near it.
    fn find_nearest(
        &self,
        points: &[[f32; 3]],
        k: usize,
        max_distance: f32,
        answer: &mut dyn FnMut(usize, &[Found]),
    ) -> Result<(), TileError> {
        self.one_mesh("distances")?;
        if max_distance.is_nan() || max_distance < 0.0 || k == 0 {
            return Ok(());
        }
        let limit = f64::from(max_distance) * f64::from(max_distance);
        for (batch, points) in points.chunks(BATCH).enumerate() {
            let item = |(i, &point): (usize, &[f32; 3])| {
                let index = i as u32;
                let is_finite = point.iter().all(|x| x.is_finite());
                is_finite.then(|| Near { index, point, nearest: NearestList::new(k, limit), last: None })
            };
            let mut items: Vec<_> = points.iter().enumerate().filter_map(item).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut Near]| {
                chunk.iter_mut().for_each(|item| item.visit(tile));
            })?;
            items.iter().for_each(|item| answer(batch * BATCH + item.index as usize, item.nearest.found()));
        }
        Ok(())
    }

    /// Whether each point is inside of a closed mesh or on its surface, by parity, as
    /// [`TriangleBvh::contains`](canted_wide::TriangleBvh::contains). On all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store with placements.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_contains(&self, points: &[[f32; 3]], inside: &mut [bool]) -> Result<(), TileError> {
        assert_eq!(points.len(), inside.len(), "one answer for each point");
        self.each_place(points, &mut |i, place| inside[i] = place != Place::Outside)
    }

    fn each_place(&self, points: &[[f32; 3]], answer: &mut dyn FnMut(usize, Place)) -> Result<(), TileError> {
        self.one_mesh("containment and signed distances")?;
        for (batch, points) in points.chunks(BATCH).enumerate() {
            let mut items: Vec<_> = points.iter().enumerate().map(|(i, &point)| Above::new(i, point)).collect();
            self.run(&mut items, &|tile, chunk: &mut [&mut Above]| {
                let points: Vec<[f32; 3]> = chunk.iter().map(|item| item.point).collect();
                let mut places = vec![Place::Outside; points.len()];
                tile.bvh().places(&points, &mut places);
                chunk.iter_mut().zip(places).for_each(|(item, place)| item.place = add(item.place, place));
            })?;
            items.iter().for_each(|item| answer(batch * BATCH + item.index as usize, item.place));
        }
        Ok(())
    }

    /// Distance of each point to the surface of a closed mesh, negative inside by parity, as
    /// [`TriangleBvh::signed_distance`](canted_wide::TriangleBvh::signed_distance). On all threads.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store with placements.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn try_signed_distances(&self, points: &[[f32; 3]], distances: &mut [f32]) -> Result<(), TileError> {
        assert_eq!(points.len(), distances.len(), "one answer for each point");
        let mut places = vec![Place::Outside; points.len()];
        self.each_place(points, &mut |i, place| places[i] = place)?;
        distances.fill(f32::INFINITY);
        self.find_nearest(points, 1, f32::INFINITY, &mut |i, found| {
            distances[i] = found.first().map_or(f32::INFINITY, |found| found.0.sqrt() as f32);
        })?;
        for ((distance, place), point) in distances.iter_mut().zip(places).zip(points) {
            *distance = match place {
                _ if point.iter().any(|x| x.is_nan()) => f32::NAN,
                Place::On => 0.0,
                Place::Inside => -*distance,
                Place::Outside => *distance,
            };
        }
        Ok(())
    }

    /// The vertices of a triangle of a store of one mesh, as they were given; those of one without area are the ends of its longest edge.
    /// `None` where there is no such triangle.
    ///
    /// # Errors
    /// A tile that cannot be read, with its file; a store with placements.
    pub fn try_triangles(&self, numbers: &[u32]) -> Result<Vec<Option<[[f32; 3]; 3]>>, TileError> {
        self.one_mesh("vertices")?;
        let mut vertices = vec![None; numbers.len()];
        let mut left: Vec<(u32, usize)> = numbers.iter().copied().zip(0..).collect();
        left.sort_unstable();
        for tile in 0..self.n_tiles() as u32 {
            if left.is_empty() {
                break;
            }
            // The numbers alone are read of tiles that have none of the triangles.
            let numbers = self.cache.numbers(tile)?;
            let has = |number: u32| numbers.binary_search(&number);
            if left.iter().all(|&(number, _)| has(number).is_err()) {
                continue;
            }
            let tile = self.cache.get(tile)?;
            left.retain(|&(number, i)| match has(number) {
                Ok(at) => {
                    vertices[i] = Some(tile.bvh().triangle(PrimId(at as u32)));
                    false
                }
                Err(_) => true,
            });
        }
        Ok(vertices)
    }
}
