use std::fmt;
use std::sync::OnceLock;

use canted_lbvh::par;
use canted_obb::{Aabb, Affine, Obb};
use canted_trace::{InstanceId, Intersect};
use canted_wide::SimdPath;

use crate::placement::{Bottom, Bounds, JOB, Moving, Placed, Placement, Placements};
use crate::support::{KnownSupports, Supports};
use crate::top::{Top, TopConfig};
use crate::users::Users;
use crate::{Instance, InstanceError};

/// A two-level BVH: a top level over instances, each a bottom-level BVH under an affine transform.
///
/// [`Intersect`] and [`Crossings`](canted_trace::Crossings) have the queries.
/// The top level is built over the bounds of the bottom-level BVHs in world space. [`Tlas::insert`], [`Tlas::remove`], [`Tlas::set_transform`],
/// [`Tlas::update_blas`], [`Tlas::replace_blas`] and [`Tlas::edit`] change a TLAS in place.
///
/// # Several kinds in one TLAS
/// Bottom-level BVHs may be anything that implements [`Intersect`]. A `Tlas<Box<dyn Intersect>>` has several kinds:
///
/// ```
/// use canted_bvh2::{Bvh2, Bvh2Config};
/// use canted_obb::Affine;
/// use canted_tlas::{Instance, Tlas};
/// use canted_trace::{Intersect, Ray, Sphere};
/// use canted_wide::{TriangleBvh, WideBvh};
///
/// let (positions, triangles) = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
/// let shapes: Vec<Box<dyn Intersect>> = vec![
///     Box::new(TriangleBvh::build(&positions, &triangles)?),
///     Box::new(Bvh2::build(&positions, &triangles, &Bvh2Config::default())?),
///     Box::new(WideBvh::over(vec![Sphere { center: [0.0, 0.0, -4.0], radius: 1.0 }])?),
/// ];
/// let instances = [0, 1, 2].map(|kind| Instance::new(kind, Affine::IDENTITY));
/// let tlas = Tlas::new(shapes, &instances, Default::default())?;
/// let mut hits = vec![];
/// tlas.all_hits(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]), &mut hits);
/// assert_eq!(hits.iter().map(|hit| hit.instance.0).collect::<Vec<_>>(), [0, 1, 2, 2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # A TLAS of TLASes
/// A TLAS implements [`Intersect`] itself, so it may be below another one. The instance of a hit is then that of the outermost TLAS, and its
/// primitive that of the innermost BVH; each TLAS on the way tests the mask of its instances and moves them at the time of the ray.
/// `t` is rounded once at each level.
#[derive(Clone)]
pub struct Tlas<B> {
    pub(crate) blas: Vec<B>,
    /// How far each reaches, once an instance needs that.
    pub(crate) supports: Vec<KnownSupports>,
    /// Entries of memory that the traversals of the bottom-level BVHs need, or more.
    pub(crate) bottom_stack_len: usize,
    /// The instances of each bottom-level BVH, from the first change of one on.
    pub(crate) users: Option<Users>,
    /// Numbers of removed instances, the next one that is used again last.
    pub(crate) removed: Vec<u32>,
    /// What traversal needs of each instance.
    pub(crate) placements: Placements,
    /// Of each instance what moves it; none if no instance moves.
    pub(crate) moving: Vec<Option<Box<Moving>>>,
    /// Bounds of each instance, world space, and the error of its hits: from the first request or change on.
    pub(crate) bounds: OnceLock<Vec<Bounds>>,
    /// Oriented boxes of each instance; none where the top level is over axis-aligned ones.
    pub(crate) obbs: Vec<Obb>,
    /// The instances as they were given, from the first request on.
    pub(crate) listed: OnceLock<Vec<Instance>>,
    pub(crate) top: Top,
    pub(crate) config: TopConfig,
    /// The SIMD path of the top level.
    pub(crate) path: SimdPath,
}

impl<B: Intersect> Tlas<B> {
    /// Places `instances` of the bottom-level BVHs in `blas`.
    ///
    /// # Errors
    /// More instances than a top-level BVH can index, before any is checked; the first instance that refers to a
    /// bottom-level BVH that does not exist, or whose transform is not finite, has a condition number above
    /// [`MAX_CONDITION`](crate::MAX_CONDITION), or moves its bounds out of the range of `f32`. A scale by zero hides an instance.
    pub fn new(blas: Vec<B>, instances: &[Instance], config: TopConfig) -> Result<Self, InstanceError> {
        let mut tlas = Self::without_instances(blas, config)?;
        tlas.set_instances(instances)?;
        Ok(tlas)
    }

    /// Places copies of one bottom-level BVH by their maps from its object space to world space, in less memory: as [`Tlas::new`] with an
    /// [`Instance::new`] for each, whose hits are the same bits, in 48 bytes and those of the top level instead of 64.
    ///
    /// A ray computes a determinant and a division more for each copy that it enters. [`Tlas::edit`], and each change by another method, makes ordinary
    /// instances of all copies.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::Tlas;
    /// use canted_trace::{InstanceId, Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let leaf = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
    /// let maps = [5.0, 3.0].map(|depth| Affine::translation([0.0, 0.0, depth]));
    /// let tlas = Tlas::of_copies(leaf, &maps, Default::default())?;
    /// let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).expect("a hit");
    /// assert_eq!((hit.t, hit.instance), (3.0, InstanceId(1)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Tlas::new`].
    pub fn of_copies(blas: B, world_from_object: &[Affine], config: TopConfig) -> Result<Self, InstanceError> {
        let mut tlas = Self::without_instances(vec![blas], config)?;
        let n_instances = world_from_object.len();
        if n_instances > tlas.config.max_instances() {
            return Err(InstanceError::TooMany { n_instances });
        }
        let place = |index: usize| {
            let placed = tlas.place(index, &Instance::new(0, world_from_object[index]))?;
            Ok::<_, InstanceError>((placed.bounds, placed.obb))
        };
        let placed = par::from_fn(n_instances, JOB, place).into_iter().collect::<Result<Vec<_>, _>>()?;
        let (bounds, obbs): (Vec<Bounds>, Vec<Obb>) = placed.into_iter().unzip();
        tlas.build_top(&bounds, if matches!(tlas.config, TopConfig::Other(_)) { obbs } else { vec![] })?;
        tlas.placements = Placements::Copies(world_from_object.iter().map(Affine::rows).collect());
        Ok(tlas)
    }

    fn without_instances(blas: Vec<B>, config: TopConfig) -> Result<Self, InstanceError> {
        let path = SimdPath::detect();
        Ok(Self {
            bottom_stack_len: deepest(&blas),
            supports: blas.iter().map(|_| OnceLock::new()).collect(),
            blas,
            users: None,
            removed: vec![],
            placements: Placements::Each(vec![]),
            moving: vec![],
            bounds: OnceLock::new(),
            obbs: vec![],
            listed: OnceLock::new(),
            top: Top::build(&[], &[], &config, path)?,
            config,
            path,
        })
    }

    /// Builds the top level over these bounds, for rays.
    fn build_top(&mut self, bounds: &[Bounds], obbs: Vec<Obb>) -> Result<(), InstanceError> {
        self.top = Top::build(bounds, &obbs, &self.config, self.path)?.for_rays();
        (self.bounds, self.obbs) = (OnceLock::new(), obbs);
        Ok(())
    }

    /// The bounds of each instance, world space, and the error of its hits.
    pub(crate) fn bounds_of_instances(&self) -> &[Bounds] {
        // On this thread alone: one that waited for others here might be given work that waits for it.
        self.bounds.get_or_init(|| (0..self.n_numbers()).map(|index| self.bounds_of(index)).collect())
    }

    /// Finds the bounds of all instances, which queries about places and changes need, on several threads, and keeps them.
    #[doc(hidden)]
    pub fn find_bounds(&self) {
        if self.bounds.get().is_none() {
            // Another thread may have been first, with the same bounds.
            let _ = self.bounds.set(par::from_fn(self.n_numbers(), JOB, |index| self.bounds_of(index)));
        }
    }

    fn bounds_of(&self, index: usize) -> Bounds {
        match self.given(index) {
            removed if removed.is_removed() => Bounds::EMPTY,
            instance => self.place(index, &instance).map_or(Bounds::EMPTY, |placed| placed.bounds),
        }
    }

    /// The same TLAS with its top level traced on another SIMD path: on the scalar one if this machine does not support
    /// it. Bottom-level BVHs have paths of their own.
    #[must_use]
    pub fn with_path(self, path: SimdPath) -> Self {
        Self { top: self.top.with_path(path), path, ..self }
    }

    /// Replaces all instances and rebuilds the top level. Bottom-level BVHs stay.
    ///
    /// # Errors
    /// As [`Tlas::new`]; the old instances then stay.
    pub fn set_instances(&mut self, instances: &[Instance]) -> Result<(), InstanceError> {
        self.set_instances_within(self.config.max_instances(), instances)
    }

    /// [`Tlas::set_instances`] with a limit on their number.
    fn set_instances_within(&mut self, max: usize, instances: &[Instance]) -> Result<(), InstanceError> {
        if instances.len() > max {
            return Err(InstanceError::TooMany { n_instances: instances.len() });
        }
        let placed = par::from_fn(instances.len(), JOB, |index| match &instances[index] {
            removed if removed.is_removed() => Ok(Placed::hidden(removed)),
            instance => self.place(index, instance),
        });
        let placed = placed.into_iter().collect::<Result<Vec<_>, _>>()?;
        let bounds: Vec<Bounds> = placed.iter().map(|placed| placed.bounds).collect();
        let is_oriented = matches!(self.config, TopConfig::Other(_));
        let obbs: Vec<Obb> = placed.iter().filter(|_| is_oriented).map(|placed| placed.obb).collect();
        self.build_top(&bounds, obbs)?;
        let removed = (0..instances.len() as u32).rev().filter(|&i| instances[i as usize].is_removed());
        self.removed = removed.collect();
        self.users = None;
        self.placements = Placements::Each(placed.iter().map(|placed| placed.placement).collect());
        let moves = placed.iter().any(|placed| placed.moving.is_some());
        self.moving = placed.into_iter().filter(|_| moves).map(|placed| placed.moving).collect();
        self.listed = OnceLock::new();
        Ok(())
    }

    /// The placement and the world-space bounds of an instance.
    pub(crate) fn place(&self, index: usize, instance: &Instance) -> Result<Placed, InstanceError> {
        let Some(blas) = self.blas.get(instance.blas as usize) else {
            return Err(InstanceError::NoSuchBlas { instance: index, blas: instance.blas });
        };
        Placed::of(index, instance, &Bottom::of(blas, &self.supports[instance.blas as usize]))
    }

    /// The bottom-level BVHs.
    #[must_use]
    pub fn blas(&self) -> &[B] {
        &self.blas
    }

    /// The bottom-level BVHs, without the top level.
    #[must_use]
    pub fn into_blas(self) -> Vec<B> {
        self.blas
    }

    /// The instances by number; those that were removed are [`Instance::REMOVED`].
    ///
    /// The first call after a change makes a list of 112 bytes for each; [`Tlas::instance`] and [`Tlas::n_numbers`] need none.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        self.listed.get_or_init(|| (0..self.n_numbers()).map(|i| self.given(i)).collect())
    }

    /// The instance of a number, [`Instance::REMOVED`] if it was removed; `None` if there never was one.
    #[must_use]
    pub fn instance(&self, instance: InstanceId) -> Option<Instance> {
        (instance.index() < self.n_numbers()).then(|| self.given(instance.index()))
    }

    /// How many numbers of instances there are, with those of removed instances.
    #[must_use]
    pub fn n_numbers(&self) -> usize {
        self.placements.n()
    }

    /// The instance of a number that there is, as it was given.
    fn given(&self, index: usize) -> Instance {
        let mut made = None;
        let Placement { map, blas, mask } = self.placements.of(index, &mut made);
        Instance {
            blas: *blas,
            world_from_object: map.world_from_object(),
            world_from_object_close: self.moving(index).map(|moving| moving.close),
            mask: *mask,
        }
    }

    /// What moves an instance.
    #[inline]
    pub(crate) fn moving(&self, index: usize) -> Option<&Moving> {
        self.moving.get(index).and_then(|moving| moving.as_deref())
    }

    /// Number of instances, without those that were removed.
    #[must_use]
    pub fn n_instances(&self) -> usize {
        self.n_numbers() - self.removed.len()
    }

    /// How the top level is built.
    #[must_use]
    pub fn config(&self) -> &TopConfig {
        &self.config
    }

    /// Box around all instances that can be hit, world space; empty for none.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.top.aabb()
    }

    /// Calls `visit` with the box of each node and leaf of the top level, world space: the box, its level, 0 for a root, and whether it
    /// is a leaf, which holds the bounds of one or a few instances. Instances of very different condition are below roots of their own.
    pub fn each_box(&self, visit: impl FnMut(Obb, u32, bool)) {
        self.top.each_box(visit);
    }

    /// Memory of the top level and of the instances, without the bottom-level BVHs.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        let n_moving = self.moving.iter().flatten().count();
        let instances = size_of_val(&self.moving[..])
            + n_moving * size_of::<Moving>()
            + self.bounds.get().map_or(0, |bounds| size_of_val(&bounds[..]))
            + size_of_val(&self.obbs[..])
            + size_of_val(&self.removed[..])
            + self.users.as_ref().map_or(0, Users::n_bytes)
            + self.listed.get().map_or(0, |listed| size_of_val(&listed[..]));
        let n_supports = self.supports.iter().filter_map(KnownSupports::get).flatten().count();
        let supports = size_of_val(&self.supports[..]) + n_supports * size_of::<Supports>();
        self.top.n_bytes() + self.placements.n_bytes() + instances + supports
    }
}

/// The greatest need of memory of some BVHs.
pub(crate) fn deepest<B: Intersect>(blas: &[B]) -> usize {
    blas.iter().map(B::stack_len).fold(0, usize::max)
}

/// Bottom-level BVHs, sizes and bounds, not every instance.
impl<B: Intersect + fmt::Debug> fmt::Debug for Tlas<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tlas")
            .field("blas", &self.blas)
            .field("n_instances", &self.n_instances())
            .field("config", &self.config)
            .field("aabb", &self.aabb())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use canted_bvh2::Bvh2Boxes;
    use canted_lbvh::VolumeConfig;
    use canted_trace::Ray;
    use canted_wide::TriangleBvh;

    use super::*;

    #[test]
    fn too_many_instances_are_reported_before_any_is_checked() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let bvh = || TriangleBvh::build(&positions, &[[0, 1, 2]]).unwrap();
        let good = Instance::new(0, Affine::IDENTITY);
        let binary = || TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()));
        for config in [TopConfig::default(), binary()] {
            let mut tlas = Tlas::new(vec![bvh()], &[good], config).unwrap();
            tlas.set_instances_within(3, &[good; 3]).unwrap();
            // A BVH that does not exist would be reported if instances were checked first; the old instances stay.
            for instance in [good, Instance::new(7, Affine::IDENTITY)] {
                let result = tlas.set_instances_within(3, &[instance; 4]);
                assert_eq!(result, Err(InstanceError::TooMany { n_instances: 4 }));
                assert_eq!(tlas.n_instances(), 3);
            }
        }
        assert_eq!(TopConfig::default().max_instances(), 1 << 26);
        assert_eq!(binary().max_instances(), 1 << 30);
    }

    /// Maps of many kinds: rotated, sheared, mirrored and far away, or hidden.
    fn maps(n: u16) -> Vec<Affine> {
        let at = |i: u16| {
            let columns = Affine::rotation([0.0, 0.6, 0.8], f64::from(i)).columns;
            let mut place = [i / 100, i / 10 % 10, i % 10].map(|x| 2.0 * f32::from(x));
            let mut axes = [columns[0], columns[1], columns[2]];
            match i % 9 {
                1 => axes[1] = [0, 1, 2].map(|k| axes[1][k] + 0.5 * axes[0][k]),
                2 => axes[0] = axes[0].map(|x| -x),
                3 if i.is_multiple_of(5) => place[0] += 1e5,
                4 if i.is_multiple_of(7) => axes = [[0.0; 3]; 3],
                _ => {}
            }
            Affine { columns: [axes[0], axes[1], axes[2], place] }
        };
        (0..n).map(at).collect()
    }

    fn triangle() -> TriangleBvh {
        TriangleBvh::build(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]).unwrap()
    }

    /// A cache line for rays, or 48 bytes of a copy, and the top level; what was asked for and what changes need are counted too.
    #[test]
    fn a_copy_takes_less_memory_than_an_instance() {
        let maps = maps(1000);
        let instances: Vec<Instance> = maps.iter().map(|&map| Instance::new(0, map)).collect();
        let n = instances.len();
        let tlas = Tlas::new(vec![triangle()], &instances, TopConfig::default()).unwrap();
        let n_bytes = tlas.n_bytes();
        assert!(n_bytes <= 128 * n, "{n_bytes}");
        assert_eq!(tlas.instances(), instances);
        assert_eq!(tlas.n_bytes(), n_bytes + size_of_val(&instances[..]));
        assert_eq!(tlas.clone().instance(InstanceId(7)), Some(instances[7]));
        assert_eq!((tlas.instance(InstanceId(1000)), tlas.n_numbers()), (None, 1000));
        let _ = tlas.instance_bounds(InstanceId(0));
        assert_eq!(tlas.n_bytes(), n_bytes + size_of_val(&instances[..]) + n * size_of::<Bounds>());

        let mut copies = Tlas::of_copies(triangle(), &maps, TopConfig::default()).unwrap();
        let of_copies = copies.n_bytes();
        assert_eq!(of_copies, n_bytes - 16 * n);
        copies.set_mask(InstanceId(3), 1).unwrap();
        assert!(copies.n_bytes() <= 205 * n, "{}", copies.n_bytes());
        // Where all can be hit and have errors of one size, numbers need no list.
        let rotated = |map: &Affine, i: u16| {
            let [x, y, z, _] = Affine::rotation([0.0, 0.6, 0.8], f64::from(i)).columns;
            Affine { columns: [x, y, z, map.columns[3].map(|x| x.min(100.0))] }
        };
        let similar: Vec<Affine> = maps.iter().zip(0..).map(|(map, i)| rotated(map, i)).collect();
        let copies = Tlas::of_copies(triangle(), &similar, TopConfig::default()).unwrap();
        assert!(copies.n_bytes() <= 108 * n, "{}", copies.n_bytes());
    }

    /// Every query of copies, and of both after changes, has the bits of instances that were placed one by one.
    #[test]
    fn copies_are_instances() {
        let maps = maps(600);
        let instances: Vec<Instance> = maps.iter().map(|&map| Instance::new(0, map)).collect();
        for config in [TopConfig::default(), TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()))] {
            let mut tlas = Tlas::new(vec![triangle()], &instances, config.clone()).unwrap();
            let mut copies = Tlas::of_copies(triangle(), &maps, config).unwrap();
            let mut rng = canted_fixtures::SplitMix64::new(9);
            for change in 0..3 {
                let (mut n_hits, all) = (0, |tlas: &Tlas<TriangleBvh>, ray: &Ray| {
                    let mut hits = vec![];
                    tlas.all_hits(ray, &mut hits);
                    hits
                });
                for (i, map) in maps.iter().enumerate() {
                    let target = map.columns[3];
                    let direction = rng.on_sphere().map(|x| x as f32);
                    let origin = [0, 1, 2].map(|k| target[k] - 3.0 * direction[k] + 0.2 * (rng.signed() as f32));
                    let ray = Ray::new(origin, direction);
                    let hit = tlas.closest_hit(&ray);
                    n_hits += usize::from(hit.is_some());
                    assert_eq!(copies.closest_hit(&ray), hit, "{change}, {i}");
                    assert_eq!(copies.occluded(&ray), hit.is_some());
                    assert_eq!(all(&copies, &ray), all(&tlas, &ray));
                    let id = InstanceId(i as u32);
                    assert_eq!(copies.instance_bounds(id), tlas.instance_bounds(id));
                    assert_eq!(copies.instance(id), tlas.instance(id));
                }
                assert!(n_hits > 150, "{n_hits}");
                // Another mesh, then other instances.
                let moved = maps[change].then(&Affine::translation([0.25; 3]));
                for tlas in [&mut tlas, &mut copies] {
                    if change == 0 {
                        let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0]];
                        tlas.update_blas(0, |bvh| bvh.refit(&positions, &[[0, 1, 2]])).unwrap().unwrap();
                    }
                    (0..200).for_each(|i| tlas.set_transform(InstanceId(3 * i), moved).unwrap());
                    tlas.remove(InstanceId(change as u32)).unwrap();
                    tlas.insert(instances[5]).unwrap();
                }
            }
        }
    }

    /// Slices and queries about places, each of a new TLAS, of which nothing was asked before: with errors of several sizes, and of one.
    #[test]
    fn slices_and_places_of_copies_are_those_of_instances() {
        let many = maps(600);
        let similar = many.iter().filter(|map| map.columns[3][0] < 100.0 && map.columns[0] != [0.0; 3]).copied();
        for maps in [similar.collect(), many] {
            let instances: Vec<Instance> = maps.iter().map(|&map| Instance::new(0, map)).collect();
            let both = || {
                let config = TopConfig::default();
                let copies = Tlas::of_copies(triangle(), &maps, config.clone()).unwrap();
                [copies, Tlas::new(vec![triangle()], &instances, config).unwrap()]
            };
            let mut rng = canted_fixtures::SplitMix64::new(10);
            let points: Vec<[f64; 3]> = maps
                .iter()
                .map(|map| {
                    let near = rng.signed3();
                    [0, 1, 2].map(|k| f64::from(map.columns[3][k]) + 0.5 * near[k])
                })
                .collect();
            let rays: Vec<Ray> = points
                .iter()
                .map(|point| {
                    let direction = rng.on_sphere();
                    let origin = [0, 1, 2].map(|k| (point[k] - 3.0 * direction[k]) as f32);
                    Ray::new(origin, direction.map(|x| x as f32))
                })
                .collect();
            let hits = both().map(|tlas| {
                let mut hits = vec![None; rays.len()];
                tlas.closest_hits(&rays, &mut hits);
                hits
            });
            assert!(hits[0] == hits[1] && hits[0].iter().flatten().count() > 50);
            let odd = |i: usize, _: &Ray, hit: &canted_trace::Hit| !(i + hit.instance.index()).is_multiple_of(2);
            let occluded = both().map(|tlas| {
                let mut occluded = vec![false; rays.len()];
                tlas.occluded_many_with(&rays, &mut occluded, &odd);
                occluded
            });
            assert!(occluded[0] == occluded[1] && occluded[0].contains(&true));
            let nearest = both().map(|tlas| {
                let mut nearest = vec![None; points.len()];
                tlas.par_nearest_point_many(&points, 2.0, &mut nearest);
                nearest
            });
            assert!(nearest[0] == nearest[1] && nearest[0].iter().flatten().count() > 300);
        }
    }

    #[test]
    fn copies_that_cannot_be_placed_are_reported() {
        let flat = Affine { columns: [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]] };
        let bad = [Affine::IDENTITY, flat, Affine { columns: [[f32::NAN; 3]; 4] }];
        let errors = [1, 2].map(|i| {
            let maps = [bad[0], bad[i]];
            let instances = maps.map(|map| Instance::new(0, map));
            let error = Tlas::of_copies(triangle(), &maps, TopConfig::default()).unwrap_err();
            assert_eq!(Some(error), Tlas::new(vec![triangle()], &instances, TopConfig::default()).err());
            error
        });
        assert_eq!(errors[1], InstanceError::NotFinite { instance: 1 });
        assert!(Tlas::of_copies(triangle(), &[], TopConfig::default()).unwrap().is_empty());
    }
}
