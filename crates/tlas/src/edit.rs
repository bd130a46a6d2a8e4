use canted_lbvh::par;
use canted_obb::Affine;
use canted_trace::{InstanceId, Intersect};

use crate::placement::{Bounds, JOB, Placement};
use crate::tlas::deepest;
use crate::top::Top;
use crate::{Instance, InstanceError, Tlas};

/// Changes in place.
///
/// A change costs what it touches: new bounds for the instances of a changed BVH, or for a moved instance, then one refit
/// of the top level, which takes time linear in the number of instances; it is built again instead where an instance becomes
/// so ill-conditioned, compared with the others, that it would slow rays that do not meet it. [`Tlas::edit`] makes several changes with one
/// refit, or rebuilds the top level. Hits do not depend on it: after any change they are those of a new [`Tlas`].
impl<B: Intersect> Tlas<B> {
    /// Starts several changes.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas};
    /// use canted_trace::{InstanceId, Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let build = |z: f32| TriangleBvh::build(&[[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]], &[[0, 1, 2]]);
    /// let [x, y, z, _] = Affine::IDENTITY.columns;
    /// let at = |depth: f32| Affine { columns: [x, y, z, [0.0, 0.0, depth]] };
    /// let mut tlas = Tlas::new(vec![build(0.0)?], &[Instance::new(0, at(5.0)); 2], Default::default())?;
    ///
    /// let mut edit = tlas.edit();
    /// edit.set_transform(InstanceId(1), at(3.0))?;
    /// edit.replace_blas(0, build(1.0)?)?;
    /// edit.refit();
    ///
    /// let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).expect("a hit");
    /// assert_eq!((hit.t, hit.instance), (4.0, InstanceId(1)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn edit(&mut self) -> TlasEdit<'_, B> {
        TlasEdit { tlas: self, bounds_changed: false }
    }

    /// Moves an instance and refits the top level: see [`TlasEdit::set_transform`].
    ///
    /// # Errors
    /// As [`TlasEdit::set_transform`].
    pub fn set_transform(&mut self, instance: InstanceId, world_from_object: Affine) -> Result<(), InstanceError> {
        self.edit().set_transform(instance, world_from_object)
    }

    /// Replaces a bottom-level BVH, refits the top level and returns the old BVH: see [`TlasEdit::replace_blas`].
    ///
    /// # Errors
    /// As [`TlasEdit::replace_blas`].
    pub fn replace_blas(&mut self, index: u32, blas: B) -> Result<B, InstanceError> {
        self.edit().replace_blas(index, blas)
    }

    /// Changes a bottom-level BVH, refits the top level and returns the result of `change`: see
    /// [`TlasEdit::update_blas`].
    ///
    /// # Errors
    /// As [`TlasEdit::update_blas`].
    pub fn update_blas<R>(&mut self, index: u32, change: impl FnOnce(&mut B) -> R) -> Result<R, InstanceError> {
        self.edit().update_blas(index, change)
    }

    /// Builds the top level again, as [`Tlas::new`] does.
    pub fn rebuild(&mut self) {
        self.edit().rebuild();
    }

    /// How many times the predicted traversal cost of the top level has grown by refits since it was built.
    #[must_use]
    pub fn drift(&self) -> f32 {
        self.top.drift()
    }

    /// Whether the top level has drifted so far that [`Tlas::rebuild`] is advised.
    #[must_use]
    pub fn rebuild_advised(&self) -> bool {
        self.drift() > canted_wide::Refit::MAX_DRIFT
    }

    /// Hides the instances of a BVH until they are placed again.
    fn hide(&mut self, index: u32) {
        for placement in self.placements.iter_mut().filter(|placement| placement.blas == index) {
            placement.mask = 0;
        }
    }
}

/// What traversal needs of an instance, and its bounds in world space.
type Placed = (Placement, Bounds);

/// Several changes to a [`Tlas`] that share one update of its top level.
///
/// [`TlasEdit::refit`] and [`TlasEdit::rebuild`] finish it. Dropping it refits too.
#[derive(Debug)]
pub struct TlasEdit<'a, B: Intersect> {
    tlas: &'a mut Tlas<B>,
    bounds_changed: bool,
}

impl<B: Intersect> TlasEdit<'_, B> {
    /// Moves an instance. A moving instance becomes static; [`TlasEdit::set_instance`] gives it another motion.
    ///
    /// # Errors
    /// As [`TlasEdit::set_instance`].
    pub fn set_transform(&mut self, instance: InstanceId, world_from_object: Affine) -> Result<(), InstanceError> {
        let old = self.instance(instance)?;
        self.set_instance(instance, Instance { world_from_object, world_from_object_close: None, ..old })
    }

    /// Changes which rays test an instance.
    ///
    /// # Errors
    /// An instance that does not exist.
    pub fn set_mask(&mut self, instance: InstanceId, mask: u32) -> Result<(), InstanceError> {
        let old = self.instance(instance)?;
        self.set_instance(instance, old.with_mask(mask))
    }

    /// Replaces an instance.
    ///
    /// # Errors
    /// An instance that does not exist, or a new one that [`Tlas::new`] would reject. The old one then stays.
    pub fn set_instance(&mut self, instance: InstanceId, new: Instance) -> Result<(), InstanceError> {
        self.instance(instance)?;
        let index = instance.index();
        let placed = self.tlas.place(index, &new)?;
        self.commit(index, placed);
        self.tlas.instances[index] = new;
        Ok(())
    }

    /// Replaces several instances, on all threads. Where one is named twice, the last counts.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas};
    /// use canted_trace::{InstanceId, Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bvh = TriangleBvh::build(&triangle, &[[0, 1, 2]])?;
    /// let [x, y, z, _] = Affine::IDENTITY.columns;
    /// let at = |depth: f32| Instance::new(0, Affine { columns: [x, y, z, [0.0, 0.0, depth]] });
    /// let mut tlas = Tlas::new(vec![bvh], &[at(5.0); 3], Default::default())?;
    /// tlas.edit().set_each(&[(InstanceId(2), at(3.0)), (InstanceId(0), at(4.0))])?;
    /// let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).expect("a hit");
    /// assert_eq!((hit.t, hit.instance), (3.0, InstanceId(2)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`TlasEdit::set_instance`], for the first in the order given. All instances then stay as they were.
    pub fn set_each(&mut self, changes: &[(InstanceId, Instance)]) -> Result<(), InstanceError> {
        let placed = par::map(changes, JOB, |(id, new)| {
            self.instance(*id)?;
            self.tlas.place(id.index(), new)
        });
        if let Some(Err(error)) = placed.iter().find(|placed| placed.is_err()) {
            return Err(*error);
        }
        for ((id, new), placed) in changes.iter().zip(placed) {
            let index = id.index();
            self.commit(index, placed?);
            self.tlas.instances[index] = *new;
        }
        Ok(())
    }

    /// Replaces a bottom-level BVH and returns the old one.
    ///
    /// # Errors
    /// A BVH that does not exist; an instance that the bounds of `blas` move out of the range of `f32`. The old BVH then
    /// stays.
    pub fn replace_blas(&mut self, index: u32, blas: B) -> Result<B, InstanceError> {
        self.blas(index)?;
        let placed = self.place_all(index, &blas)?;
        let old = std::mem::replace(&mut self.tlas.blas[index as usize], blas);
        self.tlas.bottom_stack_len = deepest(&self.tlas.blas);
        placed.into_iter().for_each(|(instance, placed)| self.commit(instance, placed));
        Ok(old)
    }

    /// Changes a bottom-level BVH in place, for instance by a refit, and returns the result of `change`.
    ///
    /// # Errors
    /// A BVH that does not exist; an instance that the new bounds move out of the range of `f32`. In the second case, or if
    /// `change` panics, no ray hits the instances of the BVH until they are placed again: by a successful change of
    /// the BVH or of the instance.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas};
    /// use canted_trace::{Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let triangle = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    /// let bvh = TriangleBvh::build(&triangle(1.0), &[[0, 1, 2]])?;
    /// let mut tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY)], Default::default())?;
    /// let refit = tlas.update_blas(0, |bvh| bvh.refit(&triangle(2.0), &[[0, 1, 2]]))??;
    /// assert!(!refit.rebuild_advised());
    /// let hit = tlas.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]));
    /// assert_eq!(hit.map(|hit| hit.t), Some(2.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn update_blas<R>(&mut self, index: u32, change: impl FnOnce(&mut B) -> R) -> Result<R, InstanceError> {
        self.blas(index)?;
        self.tlas.hide(index);
        let result = change(&mut self.tlas.blas[index as usize]);
        self.tlas.bottom_stack_len = deepest(&self.tlas.blas);
        let placed = self.place_all(index, &self.tlas.blas[index as usize])?;
        placed.into_iter().for_each(|(instance, placed)| self.commit(instance, placed));
        Ok(result)
    }

    /// Fits the boxes of the top level to the changed instances, in the same topology.
    pub fn refit(self) {
        drop(self);
    }

    /// Builds the top level again: slower than a refit, and faster to trace once instances have moved far.
    pub fn rebuild(mut self) {
        let tlas = &mut *self.tlas;
        // A topology that cannot be indexed leaves the old one, refitted.
        if let Ok(top) = Top::build(&tlas.bounds, &tlas.config, tlas.path) {
            tlas.top = top;
            self.bounds_changed = false;
        }
    }

    /// The instance of this index.
    fn instance(&self, instance: InstanceId) -> Result<Instance, InstanceError> {
        let instances = &self.tlas.instances;
        let error = || InstanceError::NoSuchInstance { instance: instance.index(), n_instances: instances.len() };
        instances.get(instance.index()).copied().ok_or_else(error)
    }

    /// The BVH of this index.
    fn blas(&self, index: u32) -> Result<&B, InstanceError> {
        let n_blas = self.tlas.blas.len();
        self.tlas.blas.get(index as usize).ok_or(InstanceError::UnknownBlas { blas: index, n_blas })
    }

    /// Places all instances of a BVH as if `blas` were at its index.
    fn place_all(&self, index: u32, blas: &B) -> Result<Vec<(usize, Placed)>, InstanceError> {
        let (bounds, hit_error) = (blas.bounds(), (blas.hit_error(), blas.has_local_error()));
        let of_blas = self.tlas.instances.iter().enumerate().filter(|(_, instance)| instance.blas == index);
        let of_blas: Vec<(usize, &Instance)> = of_blas.collect();
        let place = |&(i, instance): &(usize, &Instance)| Ok((i, Placement::new(i, instance, &bounds, hit_error)?));
        par::map(&of_blas, JOB, place).into_iter().collect()
    }

    fn commit(&mut self, index: usize, (placement, bounds): Placed) {
        self.bounds_changed |= self.tlas.bounds[index] != bounds;
        self.tlas.placements[index] = placement;
        self.tlas.bounds[index] = bounds;
    }
}

impl<B: Intersect> Drop for TlasEdit<'_, B> {
    fn drop(&mut self) {
        if self.bounds_changed {
            let Tlas { top, bounds, config, path, .. } = &mut *self.tlas;
            top.refit(bounds, config, *path);
        }
    }
}
