//! The acceleration structure of a scene, in one level or two.

use canted_obb::{Affine, PrimId};
use canted_scene::{Mesh, Scene};
use canted_tlas::{Blas, Instance, Tlas};
use canted_trace::{Hit, InstanceId, Query, Ray};
use canted_wide::LaneKernel;
use rayon::prelude::*;

use crate::accel::{Accel, Bvh, Triangles};
use crate::query::forward;
use crate::{PrepareError, Tracer};

/// The acceleration structure of a scene, with the triangle test `K`.
pub enum Structure<K: LaneKernel> {
    /// One BVH over the triangles of all instances, in world space.
    One(Flat<K>),
    /// A BVH per mesh, and one over the instances.
    Two(Tlas<Bvh<K>>),
}

/// One BVH over the triangles of all instances, in world space.
pub struct Flat<K: LaneKernel> {
    pub(crate) bvh: Bvh<K>,
    /// Index of the first triangle of each instance.
    pub(crate) first: Vec<u32>,
}

impl<K: LaneKernel> Flat<K> {
    /// The BVH.
    #[must_use]
    pub fn bvh(&self) -> &Bvh<K> {
        &self.bvh
    }

    /// Index of the first triangle of each instance.
    #[cfg(feature = "gpu")]
    pub(crate) fn first(&self) -> &[u32] {
        &self.first
    }
}

/// Replaces the index of a triangle among all instances by its instance and its index in the mesh.
#[inline]
fn in_instance(first: &[u32], hit: Hit) -> Hit {
    let instance = first.partition_point(|&first| first <= hit.primitive.0) - 1;
    Hit { instance: InstanceId(instance as u32), primitive: PrimId(hit.primitive.0 - first[instance]), ..hit }
}

/// Passes hits of the flat BVH on to `query` by instance.
struct InInstance<'a, Q> {
    first: &'a [u32],
    query: &'a mut Q,
    /// The last accepted hit: the closest one at the end of a search, which only offers hits closer than the last.
    accepted: Option<Hit>,
}

impl<'a, Q> InInstance<'a, Q> {
    fn new(first: &'a [u32], query: &'a mut Q) -> Self {
        Self { first, query, accepted: None }
    }
}

impl<Q: Query> Query for InInstance<'_, Q> {
    const MAY_REJECT: bool = Q::MAY_REJECT;

    forward!(counters: query, mask: query);
    #[inline]
    fn time(&self) -> f32 {
        self.query.time()
    }
    #[inline]
    fn accepts(&mut self, hit: &Hit) -> bool {
        if !Q::MAY_REJECT {
            return true;
        }
        let hit = in_instance(self.first, *hit);
        let accepts = self.query.accepts(&hit);
        if accepts {
            self.accepted = Some(hit);
        }
        accepts
    }
}

impl<K: LaneKernel> Structure<K> {
    /// The BVHs over triangles.
    #[must_use]
    pub fn bottom(&self) -> &[Bvh<K>] {
        match self {
            Self::One(flat) => std::slice::from_ref(&flat.bvh),
            Self::Two(tlas) => tlas.blas(),
        }
    }

    /// Memory of all levels.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        let bottom: usize = self.bottom().iter().map(Bvh::n_bytes).sum();
        match self {
            Self::One(_) => bottom,
            Self::Two(tlas) => bottom + tlas.n_bytes(),
        }
    }

    /// Builds one BVH over the triangles of all instances.
    pub(crate) fn one(scene: &Scene, accel: &Accel) -> Result<Self, PrepareError> {
        // A mesh that stays where it is needs no copy.
        if let [instance] = &scene.instances[..]
            && instance.world_from_object == Affine::IDENTITY
        {
            let Mesh { positions, triangles, .. } = &scene.meshes[instance.mesh.0 as usize];
            let triangles = Triangles { positions, close: None, triangles };
            return Ok(Self::One(Flat { bvh: accel.build(triangles)?, first: vec![0] }));
        }
        let (positions, triangles, first) = flatten(scene)?;
        let triangles = Triangles { positions: &positions, close: None, triangles: &triangles };
        Ok(Self::One(Flat { bvh: accel.build(triangles)?, first }))
    }

    /// Builds a BVH per mesh, and one over the instances.
    pub(crate) fn two(scene: &Scene, accel: &Accel) -> Result<Self, PrepareError> {
        let meshes = scene.meshes.par_iter().map(|mesh| accel.build(mesh.into()));
        Ok(Self::Two(Tlas::new(meshes.collect::<Result<Vec<_>, _>>()?, &instances(scene), accel.top())?))
    }
}

impl<K: LaneKernel> Tracer for Structure<K> {
    fn closest_hit<Q: Query>(&self, ray: &Ray, query: &mut Q) -> Option<Hit> {
        match self {
            Self::One(flat) => {
                let mut query = InInstance::new(&flat.first, query);
                let hit = flat.bvh.closest_hit_with(ray, InstanceId(0), &mut query)?;
                Some(query.accepted.unwrap_or_else(|| in_instance(&flat.first, hit)))
            }
            Self::Two(tlas) => tlas.closest_hit_with(ray, query),
        }
    }

    fn occluded<Q: Query>(&self, ray: &Ray, query: &mut Q) -> bool {
        match self {
            Self::One(flat) => flat.bvh.occluded_with(ray, InstanceId(0), &mut InInstance::new(&flat.first, query)),
            Self::Two(tlas) => tlas.occluded_with(ray, query),
        }
    }
}

/// A scene as one mesh in world space: positions, triangles, and the first triangle of each instance.
pub type Flattened = (Vec<[f32; 3]>, Vec<[u32; 3]>, Vec<u32>);

/// Transforms all instances into one mesh in world space; what moves, as the shutter opens.
///
/// # Errors
/// [`PrepareError::TooMany`], before any instance is transformed.
pub fn flatten(scene: &Scene) -> Result<Flattened, PrepareError> {
    Capacity { n_triangles: canted_lbvh::MAX_PRIMITIVES, ..Capacity::MAX }.check(scene)?;
    let (mut positions, mut triangles, mut first) = (vec![], vec![], vec![]);
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let base = positions.len() as u32;
        first.push(triangles.len() as u32);
        positions.extend(mesh.positions.iter().map(|&p| instance.world_from_object.point(p)));
        triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| base + i)));
    }
    Ok((positions, triangles, first))
}

/// How many triangles and vertices one BVH can index.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capacity {
    pub(crate) n_triangles: usize,
    pub(crate) n_vertices: usize,
}

impl Capacity {
    /// What `u32` can index.
    pub(crate) const MAX: Self = Self { n_triangles: u32::MAX as usize, n_vertices: u32::MAX as usize };

    /// Rejects a scene whose instances together exceed it.
    pub(crate) fn check(self, scene: &Scene) -> Result<(), PrepareError> {
        let n_triangles = scene.n_placed_triangles();
        let n_vertices = scene.instances.iter().map(|i| scene.meshes[i.mesh.0 as usize].positions.len()).sum();
        if n_triangles > self.n_triangles || n_vertices > self.n_vertices {
            return Err(PrepareError::TooMany { n_triangles, n_vertices });
        }
        Ok(())
    }
}

/// The instances of a scene for the top-level BVH.
pub(crate) fn instances(scene: &Scene) -> Vec<Instance> {
    scene
        .instances
        .iter()
        .map(|instance| Instance {
            world_from_object_close: instance.world_from_object_close,
            ..Instance::new(instance.mesh.0, instance.world_from_object)
        })
        .collect()
}
