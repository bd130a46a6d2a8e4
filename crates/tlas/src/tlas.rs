use canted_obb::{Aabb, Obb};
use canted_trace::{Hit, Query, Ray, ScaledRay};

use crate::instance::{Placed, WorldError};
use crate::top::{Top, TopConfig};
use crate::{Blas, Instance, InstanceError};

/// Two levels: a tree over instances, each a bottom level under an affine transform.
///
/// The top level is built over the root boxes of the bottom levels as they stand in the world. Moving instances
/// rebuilds it alone.
pub struct Tlas<B: Blas> {
    blas: Vec<B>,
    placed: Vec<Placed>,
    top: Top,
    config: TopConfig,
    /// Greatest world-space error of any hit.
    error: WorldError,
}

impl<B: Blas> Tlas<B> {
    /// Places `instances` of `blas`, under a top level built as `config` says.
    ///
    /// # Errors
    /// The first instance that names no bottom level, or whose transform is not finite, too near singular, or carries its
    /// box out of the numbers; or more instances than a tree can name.
    pub fn new(blas: Vec<B>, instances: &[Instance], config: TopConfig) -> Result<Self, InstanceError> {
        let top = Top::new(&[], &config)?;
        let mut tlas = Self { blas, placed: vec![], top, config, error: WorldError::default() };
        tlas.place(instances)?;
        Ok(tlas)
    }

    /// Places other instances of the same bottom levels: rebuilds the top level and nothing else.
    ///
    /// # Errors
    /// As [`Tlas::new`]; the old instances then stay.
    pub fn place(&mut self, instances: &[Instance]) -> Result<(), InstanceError> {
        let mut placed = Vec::with_capacity(instances.len());
        let mut boxes: Vec<Obb> = Vec::with_capacity(instances.len());
        let mut error = WorldError::default();
        for (index, instance) in instances.iter().enumerate() {
            let Some(blas) = self.blas.get(instance.blas as usize) else {
                return Err(InstanceError::NoSuchBlas { instance: index, blas: instance.blas });
            };
            let (in_place, bounds_world, its_error) = Placed::new(index, instance, &blas.bounds())?;
            placed.push(in_place);
            boxes.push(bounds_world);
            error = error.max(its_error);
        }
        self.top = Top::new(&boxes, &self.config)?;
        self.placed = placed;
        self.error = error;
        Ok(())
    }

    /// The bottom levels.
    #[must_use]
    pub fn blas(&self) -> &[B] {
        &self.blas
    }

    /// Number of instances.
    #[must_use]
    pub fn n_instances(&self) -> usize {
        self.placed.len()
    }

    /// Box around all instances, world space; empty for none.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.top.aabb()
    }

    /// Memory of the top level and of what stands in its boxes; bottom levels are their owner's.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.top.n_bytes() + size_of_val(&self.placed[..])
    }

    /// The accepted hit of least `t`; ties go to the lowest (instance, primitive).
    pub fn closest_hit<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray_world)?;
        let mut best: Option<Hit> = None;
        self.top.nearest_first(&ray, self.error.at(&ray), query, |instance, t_max, query| {
            let placed = &self.placed[instance.0 as usize];
            let ray_object = placed.ray_object(ray_world, best.map_or(ray_world.t_max, |best| best.t), query);
            match self.blas[placed.blas as usize].closest_hit(&ray_object, instance, query) {
                Some(hit) if best.is_none_or(|best| hit.before(&best)) => {
                    best = Some(hit);
                    ray.scaled_t(hit.t)
                }
                _ => t_max,
            }
        });
        best
    }

    /// Whether the ray meets anything that the query accepts.
    pub fn occluded<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> bool {
        let Some(ray) = ScaledRay::new(ray_world) else { return false };
        let mut found = false;
        self.top.in_any_order(&ray, self.error.at(&ray), query, |instance, t_max, query| {
            let placed = &self.placed[instance.0 as usize];
            let ray_object = placed.ray_object(ray_world, ray_world.t_max, query);
            found = self.blas[placed.blas as usize].occluded(&ray_object, instance, query);
            if found { -1.0 } else { t_max }
        });
        found
    }
}
