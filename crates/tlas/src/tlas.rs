use canted_obb::{Aabb, Obb};
use canted_trace::{Hit, Query, Ray, ScaledRay};
use canted_wide::SimdPath;

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
    /// What the top level is walked on, where it is wide.
    path: SimdPath,
    /// Greatest world-space error of any hit.
    error: WorldError,
}

impl<B: Blas> Tlas<B> {
    /// Places `instances` of `blas`, under a top level built as `config` says.
    ///
    /// # Errors
    /// More instances than the tree over them can name, before any is looked at; the first that names no bottom level, or whose
    /// transform is not finite, too near singular, or carries its box out of the numbers.
    pub fn new(blas: Vec<B>, instances: &[Instance], config: TopConfig) -> Result<Self, InstanceError> {
        let top = Top::new(&[], &config)?;
        let (path, error) = (SimdPath::detect(), WorldError::default());
        let mut tlas = Self { blas, placed: vec![], top, config, path, error };
        tlas.place(instances)?;
        Ok(tlas)
    }

    /// The same instances, the tree over which is walked on another path where it is wide; on the scalar one where this machine
    /// lacks it. Bottom levels have paths of their own.
    #[must_use]
    pub fn with_path(self, path: SimdPath) -> Self {
        Self { top: self.top.with_path(path), path, ..self }
    }

    /// Places other instances of the same bottom levels: rebuilds the top level and nothing else.
    ///
    /// # Errors
    /// As [`Tlas::new`]; the old instances then stay.
    pub fn place(&mut self, instances: &[Instance]) -> Result<(), InstanceError> {
        self.place_at_most(self.config.most_instances(), instances)
    }

    /// As [`Tlas::place`], of at most so many instances.
    fn place_at_most(&mut self, most: usize, instances: &[Instance]) -> Result<(), InstanceError> {
        if instances.len() > most {
            return Err(InstanceError::TooMany { n_instances: instances.len() });
        }
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
        self.top = Top::new(&boxes, &self.config)?.with_path(self.path);
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

    /// The hit of least `t`; ties go to the lowest (instance, primitive).
    #[must_use]
    pub fn closest_hit(&self, ray_world: &Ray) -> Option<Hit> {
        self.closest_hit_with(ray_world, &mut ())
    }

    /// Whether the ray hits anything: agrees with [`Tlas::closest_hit`].
    #[must_use]
    pub fn occluded(&self, ray_world: &Ray) -> bool {
        self.occluded_with(ray_world, &mut ())
    }

    /// The accepted hit of least `t`; ties go to the lowest (instance, primitive).
    pub fn closest_hit_with<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray_world)?;
        let mut best: Option<Hit> = None;
        self.top.traverse_ordered(&ray, self.error.at(&ray), query, |instance, t_max, query| {
            let placed = &self.placed[instance.0 as usize];
            let ray_object = placed.ray_object(ray_world, best.map_or(ray_world.t_max, |best| best.t), query);
            match self.blas[placed.blas as usize].closest_hit_with(&ray_object, instance, query) {
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
    pub fn occluded_with<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> bool {
        let Some(ray) = ScaledRay::new(ray_world) else { return false };
        let mut found = false;
        self.top.traverse_any(&ray, self.error.at(&ray), query, |instance, t_max, query| {
            let placed = &self.placed[instance.0 as usize];
            let ray_object = placed.ray_object(ray_world, ray_world.t_max, query);
            found = self.blas[placed.blas as usize].occluded_with(&ray_object, instance, query);
            if found { -1.0 } else { t_max }
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use canted_lbvh::VolumeConfig;
    use canted_obb::Affine;
    use canted_trace::Watertight;
    use canted_wide::{Config, TriangleBvh};

    use super::*;

    #[test]
    fn too_many_instances_are_told_before_any_is_looked_at() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let wide = || TriangleBvh::<Watertight>::build(&positions, &[[0, 1, 2]], &Config::default()).unwrap();
        let good = Instance::still(0, Affine::IDENTITY);
        for config in [TopConfig::default(), TopConfig::Binary(VolumeConfig::default())] {
            let mut tlas = Tlas::new(vec![wide()], &[good], config).unwrap();
            tlas.place_at_most(3, &[good; 3]).unwrap();
            // A mesh that is not there would be told if any were looked at; what stood before stays.
            for instance in [good, Instance::still(7, Affine::IDENTITY)] {
                assert_eq!(tlas.place_at_most(3, &[instance; 4]), Err(InstanceError::TooMany { n_instances: 4 }));
                assert_eq!(tlas.n_instances(), 3);
            }
        }
        assert_eq!(TopConfig::default().most_instances(), 1 << 26);
        assert_eq!(TopConfig::Binary(VolumeConfig::default()).most_instances(), 1 << 30);
    }
}
