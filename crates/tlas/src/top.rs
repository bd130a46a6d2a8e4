use canted_lbvh::{self as lbvh, Bits, Domain, VolumeConfig};
use canted_obb::Aabb;
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay, SlabRay};

use crate::{Binary, Blas, Instance, InstanceError, PairOrder, instance::Placed};

/// Two levels: a tree over instances, each a bottom level under an affine transform.
///
/// The top level is built over the root boxes of the bottom levels as they stand in the world. Moving instances
/// rebuilds it alone.
pub struct Tlas<B: Blas> {
    blas: Vec<B>,
    placed: Vec<Placed>,
    /// Instance of each leaf of the top level.
    leaves: Vec<InstanceId>,
    binary: Binary,
    volumes: VolumeConfig,
    /// World-space error of any hit: `error_per_origin · |o|∞ + error`.
    error_per_origin: f64,
    error: f64,
}

impl<B: Blas> Tlas<B> {
    /// Places `instances` of `blas`, with `volumes` for the nodes of the top level.
    ///
    /// # Errors
    /// The first instance that names no bottom level, or whose transform is not finite or too near singular.
    pub fn new(blas: Vec<B>, instances: &[Instance], volumes: VolumeConfig) -> Result<Self, InstanceError> {
        let mut tlas = Self {
            blas,
            placed: vec![],
            leaves: vec![],
            binary: Binary::empty(),
            volumes,
            error_per_origin: 0.0,
            error: 0.0,
        };
        tlas.place(instances)?;
        Ok(tlas)
    }

    /// Places other instances of the same bottom levels: rebuilds the top level and nothing else.
    ///
    /// # Errors
    /// As [`Tlas::new`]; the old instances then stay.
    pub fn place(&mut self, instances: &[Instance]) -> Result<(), InstanceError> {
        let placed = instances
            .iter()
            .enumerate()
            .map(|(index, instance)| match self.blas.get(instance.blas as usize) {
                None => Err(InstanceError::NoSuchBlas { instance: index, blas: instance.blas }),
                Some(blas) => Placed::new(index, instance, &blas.bounds()),
            })
            .collect::<Result<Vec<_>, _>>()?;
        let boxes: Vec<Aabb> = placed.iter().map(|placed| placed.bounds_world.aabb()).collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let codes = lbvh::codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes);
        let tree = lbvh::radix(lbvh::by_code(&codes, Bits::B63));
        let sorted: Vec<_> = tree.leaves.iter().map(|leaf| placed[leaf.index()].bounds_world).collect();
        let volumes = lbvh::volumes(&tree, &sorted, &self.volumes);
        self.binary = Binary::new(&tree, &volumes, &sorted, &bounds, PairOrder::Numbered);
        self.leaves = tree.leaves.iter().map(|leaf| InstanceId(leaf.0)).collect();
        self.error_per_origin = placed.iter().map(|p| p.error_per_origin).fold(0.0, f64::max);
        self.error = placed.iter().map(|p| p.error).fold(0.0, f64::max);
        self.placed = placed;
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

    /// The traced top level.
    #[must_use]
    pub fn binary(&self) -> &Binary {
        &self.binary
    }

    /// The accepted hit of least `t`; ties go to the lowest (instance, primitive).
    pub fn closest_hit<Q: Query>(&self, ray_world: &Ray, query: &mut Q) -> Option<Hit> {
        let ray = ScaledRay::new(ray_world)?;
        let mut best: Option<Hit> = None;
        self.binary.closest(&self.slab_ray(&ray), ray.t_max, query, |leaf, t_max, query| {
            let instance = self.leaves[leaf as usize];
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
        self.binary.any(&self.slab_ray(&ray), ray.t_max, query, |leaf, t_max, query| {
            let instance = self.leaves[leaf as usize];
            let placed = &self.placed[instance.0 as usize];
            let ray_object = placed.ray_object(ray_world, ray_world.t_max, query);
            found = self.blas[placed.blas as usize].occluded(&ray_object, instance, query);
            if found { -1.0 } else { t_max }
        });
        found
    }

    /// The ray for the top level's boxes, padded by what the way through object space can add.
    fn slab_ray(&self, ray: &ScaledRay) -> SlabRay {
        let origin = ray.origin.iter().map(|o| f64::from(o.abs())).fold(0.0, f64::max);
        SlabRay::with_error(ray, self.binary.reach(), self.error_per_origin * origin + self.error)
    }
}
