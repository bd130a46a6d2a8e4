use canted_lbvh::{MAX_PRIMITIVES, Strategy, VolumeConfig};
use canted_obb::PrimId;
use canted_scene::Scene;
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{Hit, InstanceId, Query, Ray};
use canted_wide::{Config, LaneKernel, MAX_TRIANGLES};
use rayon::prelude::*;

use crate::level::{Level, LevelConfig, build_level};
use crate::{PrepareError, Tracer};

/// What stands between rays and a scene's triangles, with the triangle test `K`.
pub enum Structure<K: LaneKernel> {
    /// All instances' triangles in world space, under one tree.
    One(Flat<K>),
    /// A tree a mesh, and a tree over the instances.
    Two(Tlas<Level<K>>),
}

/// One level: a tree over the triangles of all instances, in world space.
pub struct Flat<K: LaneKernel> {
    blas: Level<K>,
    /// Number of the first triangle of each instance; instances follow each other.
    first: Vec<u32>,
}

impl<K: LaneKernel> Flat<K> {
    /// The tree over all triangles.
    #[must_use]
    pub fn blas(&self) -> &Level<K> {
        &self.blas
    }

    /// Number of the first triangle of each instance.
    pub(crate) fn first(&self) -> &[u32] {
        &self.first
    }
}

/// A hit with instance and triangle of its mesh, for one that counts through all instances.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "instances are numbered by u32")]
fn placed(first: &[u32], hit: Hit) -> Hit {
    let instance = first.partition_point(|&first| first <= hit.primitive.0) - 1;
    Hit { instance: InstanceId(instance as u32), primitive: PrimId(hit.primitive.0 - first[instance]), ..hit }
}

/// A query that sees hits placed.
struct Placing<'a, Q> {
    first: &'a [u32],
    query: &'a mut Q,
    /// The last that was asked about and accepted: of a search for the closest, the answer, for only what comes before it is
    /// asked about.
    accepted: Option<Hit>,
}

impl<'a, Q> Placing<'a, Q> {
    fn new(first: &'a [u32], query: &'a mut Q) -> Self {
        Self { first, query, accepted: None }
    }
}

impl<Q: Query> Query for Placing<'_, Q> {
    const MAY_REJECT: bool = Q::MAY_REJECT;

    #[inline]
    fn boxes(&mut self, n: u32) {
        self.query.boxes(n);
    }
    #[inline]
    fn triangles(&mut self, n: u32) {
        self.query.triangles(n);
    }
    #[inline]
    fn time(&self) -> f32 {
        self.query.time()
    }
    #[inline]
    fn accepts(&mut self, hit: &Hit) -> bool {
        if !Q::MAY_REJECT {
            return true;
        }
        let placed = placed(self.first, *hit);
        let accepts = self.query.accepts(&placed);
        if accepts {
            self.accepted = Some(placed);
        }
        accepts
    }
}

impl<K: LaneKernel> Structure<K> {
    /// The bottom levels.
    #[must_use]
    pub fn bottom(&self) -> &[Level<K>] {
        match self {
            Self::One(flat) => std::slice::from_ref(&flat.blas),
            Self::Two(tlas) => tlas.blas(),
        }
    }

    /// Memory of all levels.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        let bottom: usize = self.bottom().iter().map(Level::n_bytes).sum();
        match self {
            Self::One(_) => bottom,
            Self::Two(tlas) => bottom + tlas.n_bytes(),
        }
    }
}

impl<K: LaneKernel> Tracer for Structure<K> {
    fn closest_hit<Q: Query>(&self, ray: &Ray, query: &mut Q) -> Option<Hit> {
        match self {
            Self::One(flat) => {
                let mut query = Placing::new(&flat.first, query);
                let hit = flat.blas.closest_hit_with(ray, InstanceId(0), &mut query)?;
                Some(query.accepted.unwrap_or_else(|| placed(&flat.first, hit)))
            }
            Self::Two(tlas) => tlas.closest_hit_with(ray, query),
        }
    }

    fn occluded<Q: Query>(&self, ray: &Ray, query: &mut Q) -> bool {
        match self {
            Self::One(flat) => flat.blas.occluded_with(ray, InstanceId(0), &mut Placing::new(&flat.first, query)),
            Self::Two(tlas) => tlas.occluded_with(ray, query),
        }
    }
}

/// All instances' triangles in world space, under one tree.
pub(crate) fn build_one<K: LaneKernel>(scene: &Scene, config: &LevelConfig) -> Result<Structure<K>, PrepareError> {
    let (positions, triangles, first) = flatten(scene)?;
    Ok(Structure::One(Flat { blas: build_level(&positions, &triangles, config)?, first }))
}

/// A scene as one mesh in world space: positions, triangles, and each instance's first triangle.
pub type Flattened = (Vec<[f32; 3]>, Vec<[u32; 3]>, Vec<u32>);

/// The scene as one mesh in world space, moving instances where they are as the shutter opens.
///
/// # Errors
/// More triangles than a tree can name, or more vertices than triangles can, before any is placed.
#[expect(clippy::cast_possible_truncation, reason = "triangles and vertices are few enough to be numbered by u32")]
pub fn flatten(scene: &Scene) -> Result<Flattened, PrepareError> {
    Room { n_triangles: MAX_PRIMITIVES, n_vertices: Room::N_VERTICES }.check(scene)?;
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

/// What one tree has room for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub(crate) n_triangles: usize,
    pub(crate) n_vertices: usize,
}

impl Room {
    /// As many vertices as indices can name.
    pub(crate) const N_VERTICES: usize = u32::MAX as usize;

    /// Of a tree with such volumes; `None` for a wide one.
    pub(crate) fn under(volumes: Option<Strategy>) -> Self {
        let n_triangles = if volumes.is_some() { MAX_PRIMITIVES } else { MAX_TRIANGLES };
        Self { n_triangles, n_vertices: Self::N_VERTICES }
    }

    /// Refuses a scene whose instances together have more.
    pub(crate) fn check(self, scene: &Scene) -> Result<(), PrepareError> {
        let n_triangles = scene.n_placed_triangles();
        let n_vertices = scene.instances.iter().map(|i| scene.meshes[i.mesh.0 as usize].positions.len()).sum();
        if n_triangles > self.n_triangles || n_vertices > self.n_vertices {
            return Err(PrepareError::TooMany { n_triangles, n_vertices });
        }
        Ok(())
    }
}

/// A tree a mesh, and a tree over the instances.
pub(crate) fn build_two<K: LaneKernel>(scene: &Scene, config: &LevelConfig) -> Result<Structure<K>, PrepareError> {
    let levels = scene
        .meshes
        .par_iter()
        .map(|mesh| build_level(&mesh.positions, &mesh.triangles, config))
        .collect::<Result<Vec<_>, _>>()?;
    let top = match config.strategy {
        None => TopConfig::Wide(Config::preset(config.preset)),
        Some(strategy) => TopConfig::Binary(VolumeConfig { strategy, fallback: true }),
    };
    Ok(Structure::Two(Tlas::new(levels, &instances(scene), top)?))
}

/// The instances of a scene as the top level knows them.
pub(crate) fn instances(scene: &Scene) -> Vec<Instance> {
    scene
        .instances
        .iter()
        .map(|instance| Instance {
            blas: instance.mesh.0,
            world_from_object: instance.world_from_object,
            world_from_object_close: instance.world_from_object_close,
        })
        .collect()
}
