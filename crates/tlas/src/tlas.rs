use std::fmt;
use std::sync::OnceLock;

use canted_lbvh::par;
use canted_obb::{Aabb, Obb};
use canted_trace::{InstanceId, Intersect};
use canted_wide::SimdPath;

use crate::placement::{Bottom, Bounds, JOB, Moving, Placed, Placement};
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
    pub(crate) placements: Vec<Placement>,
    /// Of each instance what moves it; none if no instance moves.
    pub(crate) moving: Vec<Option<Box<Moving>>>,
    /// Bounds of each instance, world space, and the error of its hits.
    pub(crate) bounds: Vec<Bounds>,
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
        let path = SimdPath::detect();
        let mut tlas = Self {
            bottom_stack_len: deepest(&blas),
            supports: blas.iter().map(|_| OnceLock::new()).collect(),
            blas,
            users: None,
            removed: vec![],
            placements: vec![],
            moving: vec![],
            bounds: vec![],
            obbs: vec![],
            listed: OnceLock::new(),
            top: Top::build(&[], &[], &config, path)?,
            config,
            path,
        };
        tlas.set_instances(instances)?;
        Ok(tlas)
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
        self.top = Top::build(&bounds, &obbs, &self.config, self.path)?;
        let removed = (0..instances.len() as u32).rev().filter(|&i| instances[i as usize].is_removed());
        self.removed = removed.collect();
        self.users = None;
        (self.bounds, self.obbs) = (bounds, obbs);
        self.placements = placed.iter().map(|placed| placed.placement).collect();
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
        self.listed.get_or_init(|| (0..self.placements.len()).map(|i| self.given(i)).collect())
    }

    /// The instance of a number, [`Instance::REMOVED`] if it was removed; `None` if there never was one.
    #[must_use]
    pub fn instance(&self, instance: InstanceId) -> Option<Instance> {
        (instance.index() < self.placements.len()).then(|| self.given(instance.index()))
    }

    /// How many numbers of instances there are, with those of removed instances.
    #[must_use]
    pub fn n_numbers(&self) -> usize {
        self.placements.len()
    }

    /// The instance of a number that there is, as it was given.
    fn given(&self, index: usize) -> Instance {
        let Placement { map, blas, mask } = &self.placements[index];
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
        self.placements.len() - self.removed.len()
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
            + size_of_val(&self.bounds[..])
            + size_of_val(&self.obbs[..])
            + size_of_val(&self.removed[..])
            + self.users.as_ref().map_or(0, Users::n_bytes)
            + self.listed.get().map_or(0, |listed| size_of_val(&listed[..]));
        let n_supports = self.supports.iter().filter_map(KnownSupports::get).flatten().count();
        let supports = size_of_val(&self.supports[..]) + n_supports * size_of::<Supports>();
        self.top.n_bytes() + size_of_val(&self.placements[..]) + instances + supports
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
    use canted_obb::Affine;
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

    /// A cache line for rays, the bounds and the top level; lists that were asked for are counted too.
    #[test]
    fn an_instance_takes_two_hundred_bytes() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let bvh = TriangleBvh::build(&positions, &[[0, 1, 2]]).unwrap();
        let at = |i: u16| {
            let columns = Affine::rotation([0.0, 0.6, 0.8], f64::from(i)).columns;
            let place = [i / 100, i / 10 % 10, i % 10].map(|x| 2.0 * f32::from(x));
            Instance::new(0, Affine { columns: [columns[0], columns[1], columns[2], place] })
        };
        let instances: Vec<Instance> = (0..1000).map(at).collect();
        let tlas = Tlas::new(vec![bvh], &instances, TopConfig::default()).unwrap();
        let n_bytes = tlas.n_bytes();
        assert!(n_bytes <= 200 * instances.len(), "{n_bytes}");
        assert_eq!(tlas.instances(), instances);
        assert_eq!(tlas.n_bytes(), n_bytes + size_of_val(&instances[..]));
        assert_eq!(tlas.clone().instance(InstanceId(7)), Some(instances[7]));
        assert_eq!((tlas.instance(InstanceId(1000)), tlas.n_numbers()), (None, 1000));
    }
}
