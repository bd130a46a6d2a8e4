//! Which tiles a ray may hit, and from which `t` on; which tiles may be near a point.

use std::ops::Range;

use canted_obb::{Aabb, Affine, Obb, PrimId};
use canted_tlas::{Instance, Tlas};
use canted_trace::{Hit, InstanceId, Intersect, Query, Ray, ScaledRay, Side, TriangleTest, with_stack};
use canted_wide::WideBvh;

use crate::manifest::Manifest;

/// The bounds of a tile, which answer as its BVH would if it were hit where a ray enters the padded bounds.
///
/// A hit lies within [`Intersect::hit_error`] of the bounds: each coordinate of `o + t·d` is off by at most `e·(|o|∞ + ρ∞)`. So its `t` lies in the
/// interval of the bounds padded by as much. The interval is computed in `f64`: differences and quotients have errors below 2^-51 of
/// `|o|∞ + ρ∞` along each axis, for which the pad is larger by a thousandth, and the entry is rounded down twice: once to `f32`, once for
/// the `t` that an instance rounds.
#[derive(Clone, Debug)]
pub(crate) struct TileBounds(pub(crate) Aabb);

/// More than the roundings of an entry.
const SLACK: f64 = 1.001;

impl TileBounds {
    /// Where a ray enters the padded bounds, not above the `t` of any hit in the tile.
    fn entry(&self, ray: &ScaledRay) -> Option<f32> {
        let size = f64::from(reach(ray.origin)) + f64::from(reach(self.0.min).max(reach(self.0.max)));
        let pad = SLACK * f64::from(self.hit_error()) * size + f64::from(f32::MIN_POSITIVE);
        let (mut entry, mut exit) = (f64::from(ray.t_min), f64::from(ray.t_max));
        for k in 0..3 {
            let [o, d] = [ray.origin[k], ray.direction[k]].map(f64::from);
            let (low, high) = (f64::from(self.0.min[k]) - pad - o, f64::from(self.0.max[k]) + pad - o);
            if d == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (low / d, high / d);
            entry = entry.max(a.min(b));
            exit = exit.min(a.max(b));
        }
        // The slack of the pad covers the rounding of both ends, also of one that was given.
        (entry <= exit).then(|| ((entry as f32).next_down().next_down()).max(0.0))
    }
}

impl Intersect for TileBounds {
    fn bounds(&self) -> Obb {
        Obb::from_aabb(&self.0)
    }

    fn hit_error(&self) -> f32 {
        TriangleTest::Watertight.hit_error()
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, _: &mut dyn Query, _: &mut [u64]) -> Option<Hit> {
        let t = self.entry(ray)?;
        Some(Hit { t, u: 0.0, v: 0.0, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front })
    }

    fn occluded_scaled(&self, ray: &ScaledRay, _: &mut dyn Query, _: &mut [u64]) -> bool {
        self.entry(ray).is_some()
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        hits.extend(self.closest_hit_scaled(ray, query, stack));
    }
}

/// A tile that a ray may hit: from which `t` on, and its number. In the order of visits.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Entry(pub(crate) f32, pub(crate) u32);

/// Memory to use again.
#[derive(Default)]
pub(crate) struct Memory {
    pub(crate) hits: Vec<Hit>,
    pub(crate) entries: Vec<Entry>,
}

/// How many tiles a ray knows ahead: finding them takes longer than tracing one of them.
const N_AHEAD: usize = 8;

/// The tiles that a ray needs, one after another.
#[derive(Clone, Copy)]
pub(crate) struct Ahead {
    entries: [Entry; N_AHEAD],
    /// How many of them there are, and how many were taken.
    n: u8,
    n_taken: u8,
    /// Whether no tile follows them.
    is_all: bool,
}

impl Ahead {
    pub(crate) const NEW: Self = Self { entries: [Entry(0.0, 0); N_AHEAD], n: 0, n_taken: 0, is_all: false };

    /// The next tile of a scaled ray, whose `t_max` may have come down since.
    pub(crate) fn next(&mut self, tiles: &EnteredTiles, ray: &Ray, memory: &mut Memory) -> Option<Entry> {
        if self.n_taken == self.n && !self.is_all {
            tiles.entries(ray, &mut memory.hits, &mut memory.entries);
            let last = self.entries[..usize::from(self.n)].last();
            let n_before = last.map_or(0, |last| memory.entries.partition_point(|entry| entry <= last));
            let after = &memory.entries[n_before..];
            let n = after.len().min(N_AHEAD);
            self.entries[..n].copy_from_slice(&after[..n]);
            (self.n, self.n_taken, self.is_all) = (n as u8, 0, after.len() == n);
        }
        let next = *self.entries[..usize::from(self.n)].get(usize::from(self.n_taken))?;
        self.n_taken += 1;
        (next.0 <= ray.t_max).then_some(next)
    }
}

/// Tiles that rays may enter, in several places perhaps.
pub(crate) struct EnteredTiles {
    bounds: Tlas<TileBounds>,
    /// The tile of each instance of `bounds`.
    tile_of: Vec<u32>,
}

impl EnteredTiles {
    /// Each place: a tile, and where it is.
    fn new(boxes: &[Aabb], places: impl Iterator<Item = (u32, Affine)>) -> Result<Self, String> {
        let (tile_of, instances): (Vec<u32>, Vec<Instance>) =
            places.map(|(tile, affine)| (tile, Instance::new(tile, affine))).unzip();
        let bounds = boxes.iter().map(|aabb| TileBounds(*aabb)).collect();
        let bounds = Tlas::new(bounds, &instances, Default::default()).map_err(|error| error.to_string())?;
        Ok(Self { bounds, tile_of })
    }

    /// The tiles that a ray may hit, in order; `ray` is scaled. Replaces the content of `entries`; `hits` is memory to use.
    pub(crate) fn entries(&self, ray: &Ray, hits: &mut Vec<Hit>, entries: &mut Vec<Entry>) {
        entries.clear();
        hits.clear();
        if let Some(ray) = ScaledRay::new(ray) {
            with_stack(self.bounds.stack_len(), |stack| self.bounds.all_hits_scaled(&ray, &mut (), stack, hits));
        }
        entries.extend(hits.iter().map(|hit| Entry(hit.t, self.tile_of[hit.instance.index()])));
        entries.sort_unstable_by(|a, b| (a.1, a.0).partial_cmp(&(b.1, b.0)).unwrap_or(std::cmp::Ordering::Equal));
        // Of a tile in several places, the first that the ray enters.
        entries.dedup_by_key(|entry| entry.1);
        entries.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    }
}

/// The bounds of all tiles, wherever they are placed.
pub(crate) struct Broad {
    pub(crate) rays: EnteredTiles,
    /// The boxes of the places of `rays`, in world space.
    points: WideBvh<Aabb>,
    /// The tile at each of them.
    point_tiles: Vec<u32>,
    /// The greatest coordinate of these.
    reach: f32,
    /// Of a store with placements: the tiles of each mesh, in its space, and all placements, by the bounds of their meshes.
    pub(crate) meshes: Vec<EnteredTiles>,
    pub(crate) placements: Option<Tlas<TileBounds>>,
}

impl Broad {
    /// Of the tiles in `part` of a manifest that was checked.
    pub(crate) fn new(manifest: &Manifest, part: Range<u32>) -> Result<Self, String> {
        let boxes: Vec<Aabb> = manifest.tiles.iter().map(|tile| tile.aabb()).collect();
        let tiles_of = |mesh: usize| {
            let [first, n] = manifest.meshes[mesh].tiles;
            first.max(part.start)..(first + n).min(part.end)
        };
        let places = manifest.placements.iter().flat_map(|placement| {
            let affine = placement.affine();
            tiles_of(placement.mesh as usize).map(move |tile| (tile, affine))
        });
        let rays = EnteredTiles::new(&boxes, places)?;
        let (mut meshes, mut placements, mut in_world) =
            (vec![], None, boxes.iter().copied().zip(0..).filter(|(_, tile)| part.contains(tile)).collect::<Vec<_>>());
        if !manifest.is_plain() {
            let own = |mesh| EnteredTiles::new(&boxes, tiles_of(mesh).map(|tile| (tile, Affine::IDENTITY)));
            meshes = (0..manifest.meshes.len()).map(own).collect::<Result<_, _>>()?;
            let whole = |mesh: usize| tiles_of(mesh).fold(Aabb::EMPTY, |all, tile| all.union(boxes[tile as usize]));
            let bounds = (0..manifest.meshes.len()).map(|mesh| TileBounds(whole(mesh))).collect();
            let instances: Vec<Instance> =
                manifest.placements.iter().map(|place| Instance::new(place.mesh, place.affine())).collect();
            placements = Some(Tlas::new(bounds, &instances, Default::default()).map_err(|error| error.to_string())?);
            let placed = (0..).map(InstanceId).zip(&rays.tile_of);
            in_world = placed.filter_map(|(i, tile)| Some((rays.bounds.instance_bounds(i)?, *tile))).collect();
        }
        let (in_world, point_tiles): (Vec<Aabb>, Vec<u32>) = in_world.into_iter().unzip();
        let reach = in_world.iter().flat_map(|aabb| [aabb.min, aabb.max]).map(reach).fold(0.0, f32::max);
        let points = WideBvh::over(in_world).map_err(|error| error.to_string())?;
        Ok(Self { rays, points, point_tiles, reach, meshes, placements })
    }

    /// Bounds of everything, and how far a hit may lie outside of them.
    pub(crate) fn bounds(&self) -> (Obb, f32) {
        (self.rays.bounds.bounds(), self.rays.bounds.hit_error())
    }

    pub(crate) fn aabb(&self) -> Aabb {
        self.rays.bounds.aabb()
    }

    /// The place of a tile nearest to a point, by the distance to its bounds, after `last`, of those that may hold a triangle at most `limit` away:
    /// the squared distance of the bounds, and the place, whose tile [`Self::tile_at`] says.
    ///
    /// Distances of triangles fall short of the true ones by at most 2^-38 of the coordinates, for which the limit is larger; `point` may be
    /// rounded by as much as `f32` does.
    pub(crate) fn nearest(&self, point: [f64; 3], last: Option<(f64, u32)>, limit: f64) -> Option<(f64, u32)> {
        let max = f64::from(f32::MAX);
        let rounded = point.map(|x| x.clamp(-max, max) as f32);
        let size = f64::from(reach(rounded).max(self.reach)) * 2.0;
        let rounding = (0..3).map(|k| (point[k] - f64::from(rounded[k])).abs()).sum::<f64>();
        let far = limit + size / (1_u64 << 38) as f64;
        let squared = |distance: f64| distance * distance * (1.0 + 1e-12);
        let mut best: Option<(f64, u32)> = None;
        self.points.visit_near(rounded, squared(far + rounding), |place, aabb, bound| {
            let found = (squared_distance(point, aabb), place.0);
            let is_next =
                found.0 <= squared(far) && last.is_none_or(|last| last < found) && best.is_none_or(|b| found < b);
            if is_next {
                best = Some(found);
            }
            best.map_or(bound, |(distance, _)| squared(distance.sqrt() + rounding).min(bound))
        });
        best
    }

    /// The tile at a place.
    pub(crate) fn tile_at(&self, place: u32) -> u32 {
        self.point_tiles[place as usize]
    }
}

/// The greatest coordinate.
fn reach(corner: [f32; 3]) -> f32 {
    corner.iter().fold(0.0_f32, |most, x| most.max(x.abs()))
}

/// The squared distance to a box.
fn squared_distance(point: [f64; 3], aabb: &Aabb) -> f64 {
    let gap = |k: usize| {
        let x = point[k];
        (f64::from(aabb.min[k]) - x).max(x - f64::from(aabb.max[k])).max(0.0)
    };
    let [x, y, z] = [gap(0), gap(1), gap(2)];
    x * x + y * y + z * z
}
