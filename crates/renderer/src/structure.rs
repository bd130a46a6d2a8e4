use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Leaf, Strategy, VolumeConfig};
use canted_obb::{Aabb, PrimId};
use canted_sah::{PlocConfig, ReinsertConfig};
use canted_scene::Scene;
use canted_tlas::{Blas, Instance, MeshBlas, PairOrder, Tlas};
use canted_trace::{Hit, InstanceId, Kernel, Query, Ray};

use crate::{PrepareError, Tracer};

/// What stands between rays and a scene's triangles, with the triangle test `K`.
pub enum Structure<K: Kernel> {
    /// All instances' triangles in world space, under one tree.
    One(Flat<K>),
    /// A tree a mesh, and a tree over the instances.
    Two(Tlas<MeshBlas<K>>),
}

/// One level: a tree over the triangles of all instances, in world space.
pub struct Flat<K: Kernel> {
    blas: MeshBlas<K>,
    /// Number of the first triangle of each instance; instances follow each other.
    first: Vec<u32>,
}

impl<K: Kernel> Flat<K> {
    /// The tree over all triangles.
    #[must_use]
    pub fn blas(&self) -> &MeshBlas<K> {
        &self.blas
    }

    /// A hit with instance and triangle of its mesh, for one that counts through all instances.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "instances are numbered by u32")]
    fn placed(first: &[u32], hit: Hit) -> Hit {
        let instance = first.partition_point(|&first| first <= hit.primitive.0) - 1;
        Hit { instance: InstanceId(instance as u32), primitive: PrimId(hit.primitive.0 - first[instance]), ..hit }
    }
}

/// A query that sees hits placed.
struct Placing<'a, Q> {
    first: &'a [u32],
    query: &'a mut Q,
}

impl<Q: Query> Query for Placing<'_, Q> {
    #[inline]
    fn boxes(&mut self, n: u32) {
        self.query.boxes(n);
    }
    #[inline]
    fn triangles(&mut self, n: u32) {
        self.query.triangles(n);
    }
    #[inline]
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.query.accepts(&Flat::<canted_trace::Watertight>::placed(self.first, *hit))
    }
}

impl<K: Kernel> Tracer for Structure<K> {
    fn closest_hit<Q: Query>(&self, ray: &Ray, query: &mut Q) -> Option<Hit> {
        match self {
            Self::One(flat) => {
                let mut query = Placing { first: &flat.first, query };
                let hit = flat.blas.closest_hit(ray, InstanceId(0), &mut query)?;
                Some(Flat::<K>::placed(&flat.first, hit))
            }
            Self::Two(tlas) => tlas.closest_hit(ray, query),
        }
    }

    fn occluded<Q: Query>(&self, ray: &Ray, query: &mut Q) -> bool {
        match self {
            Self::One(flat) => flat.blas.occluded(ray, InstanceId(0), &mut Placing { first: &flat.first, query }),
            Self::Two(tlas) => tlas.occluded(ray, query),
        }
    }
}

/// Which builder makes the binary trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Builder {
    /// Neighbours along the curve joined by area, then subtrees reinserted: dearer to build, faster to trace.
    #[default]
    Ploc,
    /// The radix tree as it is.
    Lbvh,
    /// `obvhs`: its tree, our volumes.
    #[cfg(feature = "baseline")]
    Obvhs,
}

/// How a bottom level is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelConfig {
    pub(crate) builder: Builder,
    /// `None` chooses by predicted cost.
    pub(crate) strategy: Option<Strategy>,
}

/// A built bottom level and the strategy it ended with.
pub(crate) struct Level<K: Kernel> {
    pub(crate) blas: MeshBlas<K>,
    pub(crate) strategy: Strategy,
}

/// Predicted cost of oriented nodes over axis-aligned ones below which `auto` takes them.
///
/// A leaning pair costs more than the model says where its 128 bytes miss the cache; a tenth is left for that.
const WORTHWHILE: f64 = 0.9;

/// Builds one bottom level, choosing volumes by predicted cost where the caller leaves it open.
pub(crate) fn build_level<K: Kernel>(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    config: &LevelConfig,
) -> Result<Level<K>, PrepareError> {
    let (corners, bounds) = lbvh::gather(positions, triangles)?;
    let tree = build_tree(&corners, &bounds, config.builder)?;
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    let fit = |strategy| lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true });
    let (strategy, volumes) = match config.strategy {
        Some(strategy) => (strategy, fit(strategy)),
        None => {
            let (aabbs, slabs) = (fit(Strategy::Aabb), fit(Strategy::PcaUnbounded));
            let cost = |volumes| lbvh::sums(&tree, volumes, &sorted, &lbvh::Costs::default(), 1.0).sah;
            if cost(&slabs) < WORTHWHILE * cost(&aabbs) {
                (Strategy::PcaUnbounded, slabs)
            } else {
                (Strategy::Aabb, aabbs)
            }
        }
    };
    Ok(Level { blas: MeshBlas::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst), strategy })
}

fn build_tree(corners: &[Corners], bounds: &Aabb, builder: Builder) -> Result<lbvh::Tree, PrepareError> {
    match builder {
        #[cfg(feature = "baseline")]
        Builder::Obvhs if corners.len() > 1 => {
            Ok(crate::baseline::obvhs_tree(corners, obvhs::BvhBuildParams::medium_build())?)
        }
        Builder::Lbvh => {
            let codes = lbvh::codes(&Domain::new(bounds, 3, Bits::B63), corners);
            Ok(lbvh::radix(lbvh::by_code(&codes, Bits::B63)))
        }
        _ => Ok(ploc_tree(corners, bounds)),
    }
}

/// The tree that [`Builder::Ploc`] makes: neighbours along the curve joined by area, then subtrees reinserted.
#[must_use]
pub fn ploc_tree(corners: &[Corners], bounds: &Aabb) -> lbvh::Tree {
    let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
    // By the middles of their boxes the two halves of a rectangle stand side by side.
    let codes = lbvh::codes_of_boxes(&Domain::new(bounds, 2, Bits::B63), &boxes);
    let sorted = lbvh::by_code(&codes, Bits::B63);
    let in_order: Vec<Aabb> = sorted.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    let tree = canted_sah::ploc(sorted, &in_order, &PlocConfig::default());
    let in_order: Vec<Aabb> = tree.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
    canted_sah::reinsert(&tree, &in_order, &ReinsertConfig::BALANCED)
}

/// All instances' triangles in world space, under one tree.
pub(crate) fn build_one<K: Kernel>(
    scene: &Scene,
    config: &LevelConfig,
) -> Result<(Structure<K>, Vec<Strategy>), PrepareError> {
    let (positions, triangles, first) = flatten(scene);
    let level = build_level(&positions, &triangles, config)?;
    Ok((Structure::One(Flat { blas: level.blas, first }), vec![level.strategy]))
}

/// The scene as one mesh in world space: positions, triangles, and each instance's first triangle.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "triangles and vertices are numbered by u32")]
pub fn flatten(scene: &Scene) -> (Vec<[f32; 3]>, Vec<[u32; 3]>, Vec<u32>) {
    let (mut positions, mut triangles, mut first) = (vec![], vec![], vec![]);
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let base = positions.len() as u32;
        first.push(triangles.len() as u32);
        positions.extend(mesh.positions.iter().map(|&p| instance.world_from_object.point(p)));
        triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| base + i)));
    }
    (positions, triangles, first)
}

/// A tree a mesh, and a tree over the instances.
pub(crate) fn build_two<K: Kernel>(
    scene: &Scene,
    config: &LevelConfig,
) -> Result<(Structure<K>, Vec<Strategy>), PrepareError> {
    let levels = scene
        .meshes
        .iter()
        .map(|mesh| build_level(&mesh.positions, &mesh.triangles, config))
        .collect::<Result<Vec<_>, _>>()?;
    let strategies = levels.iter().map(|level| level.strategy).collect();
    let instances: Vec<Instance> = scene
        .instances
        .iter()
        .map(|instance| Instance { blas: instance.mesh.0, world_from_object: instance.world_from_object })
        .collect();
    let top = VolumeConfig { strategy: config.strategy.unwrap_or(Strategy::Aabb), fallback: true };
    let tlas = Tlas::new(levels.into_iter().map(|level| level.blas).collect(), &instances, top)?;
    Ok((Structure::Two(tlas), strategies))
}
