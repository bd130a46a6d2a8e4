use std::sync::OnceLock;

use canted_lbvh::par;
use canted_obb::Affine;
use canted_trace::{InstanceId, Intersect, ObjectMap};

use crate::placement::{Bottom, Bounds, JOB, Placed};
use crate::tlas::deepest;
use crate::top::Top;
use crate::users::Users;
use crate::{Instance, InstanceError, Tlas, TopConfig};

/// Changes in place.
///
/// A change of one instance takes time that grows with the depth of a wide top level ([`TopConfig::Wide`](crate::TopConfig::Wide)), not with
/// the number of instances: boxes above it are written, or it gets another place. The first one after a build, or after all boxes were
/// written, prepares the top level for that in linear time. [`Tlas::edit`] makes several changes with one update: few are made one by one; for
/// more than a quarter of all instances every box is written, in linear time. A change of a BVH takes as long as changes of its instances; the first
/// one lists the instances of each BVH, in linear time.
///
/// Hits do not depend on how a TLAS was changed: they are those of a new [`Tlas`]. Rays become slower as the top level drifts from one that is
/// built for the instances where they are: [`Tlas::drift`] measures it, [`Tlas::rebuild_advised`] tells when [`Tlas::rebuild`] is worth it. A
/// clone may be built again on another thread while the frame goes on.
///
/// An instance whose transform is a scale by zero is hidden until it is moved: no ray hits it, and it has no bounds. So it is with those of a
/// BVH without primitives.
impl<B: Intersect> Tlas<B> {
    /// Starts several changes. The first edit finds what changes need of every instance, its bounds and boxes, makes ordinary instances of copies
    /// ([`Tlas::of_copies`]), and keeps that; [`Tlas::set_instances`] frees it.
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas};
    /// use canted_trace::{InstanceId, Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let build = |z: f32| TriangleBvh::build(&[[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]], &[[0, 1, 2]]);
    /// let at = |depth: f32| Affine::translation([0.0, 0.0, depth]);
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
        // Before a BVH is another one.
        self.find_bounds();
        self.placements.each();
        if let Some(bounds) = self.bounds.get() {
            self.top.prepare_changes(bounds);
        }
        TlasEdit { tlas: self, changed: vec![] }
    }

    /// Adds an instance; returns its number: see [`TlasEdit::insert`].
    ///
    /// ```
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas};
    /// use canted_trace::{InstanceId, Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let bvh = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
    /// let at = |depth: f32| Affine::translation([0.0, 0.0, depth]);
    /// let mut tlas = Tlas::new(vec![bvh], &[Instance::new(0, at(5.0)); 2], Default::default())?;
    /// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
    ///
    /// let near = tlas.insert(Instance::new(0, at(3.0)))?;
    /// assert_eq!(tlas.closest_hit(&ray).map(|hit| (hit.t, hit.instance)), Some((3.0, near)));
    /// tlas.set_transform(near, at(4.0))?;
    /// assert_eq!(tlas.closest_hit(&ray).map(|hit| hit.t), Some(4.0));
    /// tlas.remove(near)?;
    /// assert_eq!(tlas.closest_hit(&ray).map(|hit| (hit.t, hit.instance)), Some((5.0, InstanceId(0))));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`TlasEdit::insert`].
    pub fn insert(&mut self, instance: Instance) -> Result<InstanceId, InstanceError> {
        self.edit().insert(instance)
    }

    /// Removes an instance and returns it: see [`TlasEdit::remove`].
    ///
    /// # Errors
    /// As [`TlasEdit::remove`].
    pub fn remove(&mut self, instance: InstanceId) -> Result<Instance, InstanceError> {
        self.edit().remove(instance)
    }

    /// Replaces an instance: see [`TlasEdit::set_instance`].
    ///
    /// # Errors
    /// As [`TlasEdit::set_instance`].
    pub fn set_instance(&mut self, instance: InstanceId, new: Instance) -> Result<(), InstanceError> {
        self.edit().set_instance(instance, new)
    }

    /// Changes which rays test an instance: see [`TlasEdit::set_mask`].
    ///
    /// # Errors
    /// As [`TlasEdit::set_mask`].
    pub fn set_mask(&mut self, instance: InstanceId, mask: u32) -> Result<(), InstanceError> {
        self.edit().set_mask(instance, mask)
    }

    /// Moves an instance: see [`TlasEdit::set_transform`].
    ///
    /// # Errors
    /// As [`TlasEdit::set_transform`].
    pub fn set_transform(&mut self, instance: InstanceId, world_from_object: Affine) -> Result<(), InstanceError> {
        self.edit().set_transform(instance, world_from_object)
    }

    /// Replaces a bottom-level BVH, updates the top level and returns the old BVH: see [`TlasEdit::replace_blas`].
    ///
    /// # Errors
    /// As [`TlasEdit::replace_blas`].
    pub fn replace_blas(&mut self, index: u32, blas: B) -> Result<B, InstanceError> {
        self.edit().replace_blas(index, blas)
    }

    /// Changes a bottom-level BVH, updates the top level and returns the result of `change`: see
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

    /// How many times the predicted traversal cost of the top level has grown by changes since it was built.
    #[must_use]
    pub fn drift(&self) -> f32 {
        self.top.drift()
    }

    /// Whether the top level has drifted so far that [`Tlas::rebuild`] is advised.
    #[must_use]
    pub fn rebuild_advised(&self) -> bool {
        self.drift() > canted_wide::Refit::MAX_DRIFT
    }

    /// The bounds of all instances, which an edit starts with.
    fn known_bounds(&mut self) -> &mut Vec<Bounds> {
        self.find_bounds();
        self.bounds.get_mut().expect("they were found")
    }

    /// The instances of a BVH.
    fn users(&mut self, index: u32) -> Vec<InstanceId> {
        self.users.get_or_insert_with(|| Users::new(self.blas.len(), self.placements.each())).of(index)
    }

    /// Hides instances until they are placed again.
    fn hide(&mut self, instances: &[InstanceId]) {
        for id in instances {
            let placement = &mut self.placements.each()[id.index()];
            placement.map = ObjectMap::hidden(&placement.map.world_from_object());
        }
    }
}

/// Several changes to a [`Tlas`] that share one update of its top level.
///
/// [`TlasEdit::refit`] and [`TlasEdit::rebuild`] finish it. Dropping it refits too.
#[derive(Debug)]
pub struct TlasEdit<'a, B: Intersect> {
    tlas: &'a mut Tlas<B>,
    /// Numbers of instances with other bounds, and those that they had.
    changed: Vec<(u32, Bounds)>,
}

impl<B: Intersect> TlasEdit<'_, B> {
    /// Adds an instance; returns its number: that of the last instance that was removed, or of instances before if none is missing.
    ///
    /// # Errors
    /// An instance that [`Tlas::new`] would reject, reported with its number, or one more than a top-level BVH can index. The TLAS is then
    /// unchanged.
    pub fn insert(&mut self, instance: Instance) -> Result<InstanceId, InstanceError> {
        let tlas = &mut *self.tlas;
        let n = tlas.n_numbers();
        let index = tlas.removed.last().map_or(n, |&index| index as usize);
        if index >= tlas.config.max_instances() {
            return Err(InstanceError::TooMany { n_instances: n + 1 });
        }
        let placed = tlas.place(index, &instance)?;
        if tlas.removed.pop().is_none() {
            let Placed { placement, bounds, obb, .. } = Placed::hidden(&Instance::REMOVED);
            tlas.placements.each().push(placement);
            tlas.known_bounds().push(bounds);
            if matches!(tlas.config, TopConfig::Other(_)) {
                tlas.obbs.push(obb);
            }
            // One more, even if it cannot be hit.
            if placed.bounds.is_empty() {
                self.changed.push((index as u32, bounds));
            }
        }
        self.commit(index, placed);
        Ok(InstanceId(index as u32))
    }

    /// Removes an instance and returns it. The others keep their numbers; its own is that of the next instance that is inserted, and until
    /// then [`Instance::REMOVED`] is in its place.
    ///
    /// # Errors
    /// An instance that does not exist.
    pub fn remove(&mut self, instance: InstanceId) -> Result<Instance, InstanceError> {
        let old = self.instance(instance)?;
        let index = instance.index();
        self.commit(index, Placed::hidden(&Instance::REMOVED));
        self.tlas.removed.push(instance.0);
        Ok(old)
    }

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
        let placement = &mut self.tlas.placements.each()[instance.index()];
        if placement.map.is_hidden() {
            return self.set_instance(instance, old.with_mask(mask));
        }
        // Its place does not depend on the mask.
        placement.mask = mask;
        self.tlas.listed = OnceLock::new();
        Ok(())
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
    /// let at = |depth: f32| Instance::new(0, Affine::translation([0.0, 0.0, depth]));
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
        for ((id, _), placed) in changes.iter().zip(placed) {
            self.commit(id.index(), placed?);
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
        let supports = OnceLock::new();
        let instances = self.tlas.users(index);
        let placed = self.place_all(&instances, &Bottom::of(&blas, &supports))?;
        self.tlas.supports[index as usize] = supports;
        let old = std::mem::replace(&mut self.tlas.blas[index as usize], blas);
        self.needs_stack_of(index);
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
        let instances = self.tlas.users(index);
        self.tlas.hide(&instances);
        self.tlas.supports[index as usize] = OnceLock::new();
        let result = change(&mut self.tlas.blas[index as usize]);
        self.needs_stack_of(index);
        let Tlas { blas, supports, .. } = &*self.tlas;
        let placed = self.place_all(&instances, &Bottom::of(&blas[index as usize], &supports[index as usize]))?;
        placed.into_iter().for_each(|(instance, placed)| self.commit(instance, placed));
        Ok(result)
    }

    /// Fits the boxes of the top level to the changed instances.
    pub fn refit(self) {
        drop(self);
    }

    /// Builds the top level again: slower than a refit, and faster to trace once instances have moved far.
    pub fn rebuild(mut self) {
        let tlas = &mut *self.tlas;
        tlas.bottom_stack_len = deepest(&tlas.blas);
        // A topology that cannot be indexed leaves the old one, refitted.
        if let Ok(top) = Top::build(tlas.bounds_of_instances(), &tlas.obbs, &tlas.config, tlas.path) {
            tlas.top = top;
            self.changed.clear();
        }
    }

    /// The instance of this index.
    fn instance(&self, instance: InstanceId) -> Result<Instance, InstanceError> {
        let n_instances = self.tlas.n_instances();
        let error = || InstanceError::NoSuchInstance { instance: instance.index(), n_instances };
        self.tlas.instance(instance).filter(|instance| !instance.is_removed()).ok_or_else(error)
    }

    /// The BVH of this index.
    fn blas(&self, index: u32) -> Result<&B, InstanceError> {
        let n_blas = self.tlas.blas.len();
        self.tlas.blas.get(index as usize).ok_or(InstanceError::UnknownBlas { blas: index, n_blas })
    }

    /// A BVH is another one: traversals may need more memory than before.
    fn needs_stack_of(&mut self, index: u32) {
        let tlas = &mut *self.tlas;
        tlas.bottom_stack_len = tlas.bottom_stack_len.max(tlas.blas[index as usize].stack_len());
    }

    /// Places instances as if `bottom` were their BVH.
    fn place_all(
        &self,
        instances: &[InstanceId],
        bottom: &Bottom<'_, B>,
    ) -> Result<Vec<(usize, Placed)>, InstanceError> {
        let place = |id: &InstanceId| {
            let given = self.tlas.instance(*id).unwrap_or(Instance::REMOVED);
            Ok((id.index(), Placed::of(id.index(), &given, bottom)?))
        };
        par::map(instances, JOB, place).into_iter().collect()
    }

    fn commit(&mut self, index: usize, Placed { placement, moving, bounds, obb }: Placed) {
        let tlas = &mut *self.tlas;
        let old = tlas.bounds_of_instances()[index];
        if old != bounds || tlas.obbs.get(index).is_some_and(|known| *known != obb) {
            self.changed.push((index as u32, old));
        }
        let placements = tlas.placements.each();
        if let Some(users) = &mut tlas.users {
            users.change(index as u32, placements[index].blas, placement.blas);
        }
        placements[index] = placement;
        tlas.known_bounds()[index] = bounds;
        if let Some(known) = tlas.obbs.get_mut(index) {
            *known = obb;
        }
        if moving.is_some() && tlas.moving.len() <= index {
            tlas.moving.resize_with(tlas.placements.n(), || None);
        }
        if let Some(known) = tlas.moving.get_mut(index) {
            *known = moving;
        }
        tlas.listed = OnceLock::new();
    }
}

impl<B: Intersect> Drop for TlasEdit<'_, B> {
    fn drop(&mut self) {
        let Tlas { top, bounds, obbs, config, path, .. } = &mut *self.tlas;
        let bounds = bounds.get().map_or(&[][..], Vec::as_slice);
        top.update(&self.changed, (bounds, obbs), config, *path);
    }
}
