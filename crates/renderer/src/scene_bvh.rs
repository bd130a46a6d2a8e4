//! The acceleration structure of a scene, in one level or two: built once, updated from frame to frame.

use std::time::{Duration, Instant};

use canted_film::Hash;
use canted_lbvh::Strategy;
use canted_obb::{Affine, Obb, PrimId};
use canted_scene::{CurveSegments, CurveShape, Curves, Instance, Material, Mesh, Scene};
use canted_tlas::Tlas;
use canted_trace::{
    AcceptAt, Answers, HIT_ERROR, Hit, InstanceId, Intersect, Mapped, Query, Ray, ScaledRay, Side, answer_one_by_one,
};
use rayon::prelude::*;

use crate::bottom_level::Triangles;
use crate::update_policy::BvhCosts;
use crate::{BottomLevel, BvhKind, LevelChoice, LevelReason, PrepareError, SceneBvhConfig, coincident, light};

/// A feature that a scene does not need, and for which nothing is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnusedFeature {
    /// The feature.
    pub feature: &'static str,
    /// Why this scene does not need it.
    pub reason: &'static str,
}

/// The acceleration structure of a scene.
///
/// Its rays are in world space. In every hit, including those that a query sees, `instance` is an index into the scene's instances and
/// `primitive` a triangle index in the mesh of that instance.
pub struct SceneBvh {
    pub(crate) levels: SceneLevels,
    /// The number of levels, and why.
    pub choice: LevelChoice,
    /// What the scene does not need.
    pub unused: Vec<UnusedFeature>,
    /// Time to build all levels, or of the last update.
    pub build_time: Duration,
    /// For [`SceneBvh::update`].
    pub(crate) history: History,
}

/// The levels of a [`SceneBvh`].
pub enum SceneLevels {
    /// One BVH over the triangles of all instances, in world space.
    One(FlatBvh),
    /// A BVH per mesh, and one over the instances.
    Two(Tlas<BottomLevel>),
}

/// One BVH over the triangles of all instances, in world space.
pub struct FlatBvh {
    pub(crate) bvh: BottomLevel,
    /// Index of the first triangle of each instance.
    pub(crate) first: Vec<u32>,
    /// Whether each instance mirrors, so that triangles are wound the other way round than in object space.
    pub(crate) mirrors: Vec<bool>,
}

impl FlatBvh {
    /// The BVH.
    #[must_use]
    pub fn bvh(&self) -> &BottomLevel {
        &self.bvh
    }

    /// Replaces the index of a triangle among all instances by its instance and its index in the mesh, and the side by that in object
    /// space.
    #[inline]
    fn in_instance(&self, hit: Hit) -> Hit {
        let instance = self.first.partition_point(|&first| first <= hit.primitive.0) - 1;
        let primitive = PrimId(hit.primitive.0 - self.first[instance]);
        let side = match (self.mirrors[instance], hit.side) {
            (false, side) => side,
            (true, Side::Front) => Side::Back,
            (true, Side::Back) => Side::Front,
        };
        Hit { instance: InstanceId(instance as u32), primitive, side, ..hit }
    }

    /// Passes hits of the flat BVH on to `query` by instance.
    fn of_instances<'a>(&'a self, query: &'a mut dyn Query) -> Mapped<'a, impl Fn(&Hit) -> Hit> {
        Mapped { query, map: |hit: &Hit| self.in_instance(*hit) }
    }
}

impl SceneBvh {
    /// Builds what a scene needs for tracing, and nothing else.
    ///
    /// # Errors
    /// Invalid geometry or transforms, by index; more triangles than one BVH can index.
    pub fn build(scene: &Scene, config: &SceneBvhConfig) -> Result<Self, PrepareError> {
        Self::build_in(Capacity::of(config), scene, config)
    }

    /// [`SceneBvh::build`] with the capacity of one BVH.
    fn build_in(capacity: Capacity, scene: &Scene, config: &SceneBvhConfig) -> Result<Self, PrepareError> {
        let start = Instant::now();
        let choice = LevelChoice::of(scene, config, capacity.check(scene))?;
        let one = choice.is_one;
        let levels = if one { one_level(scene, config)? } else { two_levels(scene, config)? };
        let unused = unused_features(&levels, &choice, scene, config);
        let build_time = start.elapsed();
        Ok(Self { levels, choice, unused, build_time, history: History::new(scene, config, one, build_time) })
    }

    /// One level or two.
    #[must_use]
    pub fn levels(&self) -> &SceneLevels {
        &self.levels
    }

    /// The BVHs over triangles.
    #[must_use]
    pub fn bottom(&self) -> &[BottomLevel] {
        self.levels.bottom()
    }

    /// Memory of all levels.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        let bottom: usize = self.bottom().iter().map(BottomLevel::n_bytes).sum();
        match &self.levels {
            SceneLevels::One(_) => bottom,
            SceneLevels::Two(tlas) => bottom + tlas.n_bytes(),
        }
    }
}

impl SceneLevels {
    pub(crate) fn bottom(&self) -> &[BottomLevel] {
        match self {
            Self::One(flat) => std::slice::from_ref(&flat.bvh),
            Self::Two(tlas) => tlas.blas(),
        }
    }
}

impl Intersect for SceneBvh {
    fn bounds(&self) -> Obb {
        match &self.levels {
            SceneLevels::One(flat) => flat.bvh.bounds(),
            SceneLevels::Two(tlas) => tlas.bounds(),
        }
    }

    fn hit_error(&self) -> f32 {
        match &self.levels {
            SceneLevels::One(_) => HIT_ERROR,
            SceneLevels::Two(tlas) => tlas.hit_error(),
        }
    }

    fn stack_len(&self) -> usize {
        match &self.levels {
            SceneLevels::One(flat) => flat.bvh.stack_len(),
            SceneLevels::Two(tlas) => tlas.stack_len(),
        }
    }

    fn closest_hit_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> Option<Hit> {
        match &self.levels {
            SceneLevels::One(flat) => {
                let hit = if query.may_reject() {
                    flat.bvh.closest_hit_scaled(ray, &mut flat.of_instances(query), stack)
                } else {
                    flat.bvh.closest_hit_scaled(ray, query, stack)
                };
                hit.map(|hit| flat.in_instance(hit))
            }
            SceneLevels::Two(tlas) => tlas.closest_hit_scaled(ray, query, stack),
        }
    }

    fn occluded_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64]) -> bool {
        match &self.levels {
            SceneLevels::One(flat) if query.may_reject() => {
                flat.bvh.occluded_scaled(ray, &mut flat.of_instances(query), stack)
            }
            SceneLevels::One(flat) => flat.bvh.occluded_scaled(ray, query, stack),
            SceneLevels::Two(tlas) => tlas.occluded_scaled(ray, query, stack),
        }
    }

    fn all_hits_scaled(&self, ray: &ScaledRay, query: &mut dyn Query, stack: &mut [u64], hits: &mut Vec<Hit>) {
        match &self.levels {
            SceneLevels::One(flat) => {
                let start = hits.len();
                flat.bvh.all_hits_scaled(ray, &mut flat.of_instances(query), stack, hits);
                hits[start..].iter_mut().for_each(|hit| *hit = flat.in_instance(*hit));
            }
            SceneLevels::Two(tlas) => tlas.all_hits_scaled(ray, query, stack, hits),
        }
    }

    fn answer(&self, rays: &[Ray], first: usize, accept: Option<&AcceptAt>, answers: Answers) {
        let flat = match &self.levels {
            SceneLevels::One(flat) => flat,
            SceneLevels::Two(tlas) => return tlas.answer(rays, first, accept, answers),
        };
        let mapped =
            accept.map(|accept| move |index: usize, ray: &Ray, hit: &Hit| accept(index, ray, &flat.in_instance(*hit)));
        let mapped = mapped.as_ref().map(|mapped| mapped as &AcceptAt);
        match answers {
            Answers::Closest(hits) => {
                flat.bvh.answer(rays, first, mapped, Answers::Closest(&mut *hits));
                hits.iter_mut().flatten().for_each(|hit| *hit = flat.in_instance(*hit));
            }
            Answers::Occluded(occluded) => flat.bvh.answer(rays, first, mapped, Answers::Occluded(occluded)),
            lists => answer_one_by_one(self, rays, first, accept, lists),
        }
    }
}

/// Builds one BVH over the triangles of all instances.
fn one_level(scene: &Scene, config: &SceneBvhConfig) -> Result<SceneLevels, PrepareError> {
    // A mesh that stays where it is needs no copy.
    if let [instance] = &scene.instances[..]
        && instance.world_from_object == Affine::IDENTITY
    {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let triangles = coincident::of_mesh(scene, mesh);
        let triangles = Triangles { positions: &mesh.positions, close: None, triangles: &triangles, curves: None };
        return Ok(SceneLevels::One(FlatBvh { bvh: config.build(triangles)?, first: vec![0], mirrors: vec![false] }));
    }
    let (positions, triangles, first) = flatten_distinct(scene)?;
    let triangles = Triangles { positions: &positions, close: None, triangles: &triangles, curves: None };
    Ok(SceneLevels::One(FlatBvh { bvh: config.build(triangles)?, first, mirrors: mirrors(scene) }))
}

/// Builds a BVH per mesh, and one over the instances.
fn two_levels(scene: &Scene, config: &SceneBvhConfig) -> Result<SceneLevels, PrepareError> {
    let meshes =
        scene.meshes.par_iter().map(|mesh| config.build(Triangles::of(mesh, &coincident::of_mesh(scene, mesh))));
    let tlas = Tlas::new(meshes.collect::<Result<Vec<_>, _>>()?, &instances(scene), config.top())?;
    Ok(SceneLevels::Two(tlas))
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

/// [`flatten`] for one BVH: of equal triangles in stacks, the later ones are points.
///
/// # Errors
/// As [`flatten`].
pub(crate) fn flatten_distinct(scene: &Scene) -> Result<Flattened, PrepareError> {
    let (positions, mut triangles, first) = flatten(scene)?;
    coincident::in_scene(scene, &positions, &mut triangles, &first, &mirrors(scene));
    Ok((positions, triangles, first))
}

/// Whether each instance mirrors.
pub(crate) fn mirrors(scene: &Scene) -> Vec<bool> {
    scene.instances.iter().map(|instance| instance.world_from_object.determinant() < 0.0).collect()
}

/// How many triangles and vertices one BVH can index.
#[derive(Clone, Copy, Debug)]
struct Capacity {
    n_triangles: usize,
    n_vertices: usize,
}

impl Capacity {
    /// What `u32` can index.
    const MAX: Self = Self { n_triangles: u32::MAX as usize, n_vertices: u32::MAX as usize };

    fn of(config: &SceneBvhConfig) -> Self {
        Self { n_triangles: config.max_triangles(), ..Self::MAX }
    }

    /// Rejects a scene whose instances together exceed it.
    fn check(self, scene: &Scene) -> Result<(), PrepareError> {
        let n_triangles = scene.n_placed_triangles();
        let n_vertices = scene.instances.iter().map(|i| scene.meshes[i.mesh.0 as usize].positions.len()).sum();
        if n_triangles > self.n_triangles || n_vertices > self.n_vertices {
            return Err(PrepareError::TooMany { n_triangles, n_vertices });
        }
        Ok(())
    }
}

/// The instances of a scene for the top-level BVH.
pub(crate) fn instances(scene: &Scene) -> Vec<canted_tlas::Instance> {
    scene
        .instances
        .iter()
        .map(|instance| canted_tlas::Instance {
            world_from_object_close: instance.world_from_object_close,
            ..canted_tlas::Instance::new(instance.mesh.0, instance.world_from_object)
        })
        .collect()
}

/// Whether [`SceneBvh::build`] gives a scene one level.
///
/// # Errors
/// One level was requested, and the scene exceeds what one BVH can index.
pub fn has_one_level(scene: &Scene, config: &SceneBvhConfig) -> Result<bool, PrepareError> {
    level_choice(scene, config).map(|choice| choice.is_one)
}

/// The number of levels that [`SceneBvh::build`] gives a scene, and why.
pub(crate) fn level_choice(scene: &Scene, config: &SceneBvhConfig) -> Result<LevelChoice, PrepareError> {
    LevelChoice::of(scene, config, Capacity::of(config).check(scene))
}

/// Features that `scene` does not need in this structure.
pub(crate) fn unused_features(
    levels: &SceneLevels,
    choice: &LevelChoice,
    scene: &Scene,
    config: &SceneBvhConfig,
) -> Vec<UnusedFeature> {
    let aligned = match config.kind {
        BvhKind::Bvh2 if config.volumes == Strategy::Aabb => Some("axis-aligned boxes were requested"),
        BvhKind::Bih | BvhKind::KdTree => Some("the requested structure has none"),
        BvhKind::Wide if config.aligned => Some("aligned nodes were requested"),
        BvhKind::Bvh2 | BvhKind::Wide => {
            let has_any = levels.bottom().iter().any(BottomLevel::has_oriented_nodes);
            (!has_any).then_some("too little gain in predicted cost")
        }
    };
    let one_level = choice.is_one.then_some(match choice.reason {
        LevelReason::Requested => "one level was requested",
        LevelReason::OneInstance => "there is at most one instance",
        _ => "one level is predicted to cost rays less",
    });
    let any_material = |has: fn(&Material) -> bool| scene.materials.iter().any(has);
    let unless = |needed: bool, reason| (!needed).then_some(reason);
    [
        ("top-level BVH", one_level),
        ("motion", unless(scene.has_motion(), "no instance moves")),
        ("oriented nodes", aligned),
        ("textures", unless(any_material(|m| m.textures().next().is_some()), "no material has one")),
        ("texture coordinates", unless(scene.meshes.iter().any(|m| m.uvs.is_some()), "no texture is looked up")),
        ("alpha test", unless(any_material(Material::uses_alpha), "every surface is opaque")),
        ("shading normals", unless(scene.meshes.iter().any(|m| m.normals.is_some()), "no mesh has normals")),
        ("listed lights", unless(!scene.lights.is_empty(), "the scene lists none")),
        ("emission", unless(any_material(Material::is_emissive), "no surface emits")),
        ("light selection", unless(light::has_multiple_lights(scene), "there is at most one light")),
    ]
    .into_iter()
    .filter_map(|(feature, reason)| Some(UnusedFeature { feature, reason: reason? }))
    .collect()
}

/// Hashes of the vertices and of the triangles of a mesh, with what decides which of equal ones are kept: different ones are equal with probability 2^-64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MeshKey {
    pub(crate) positions: u64,
    pub(crate) triangles: u64,
}

impl MeshKey {
    pub(crate) fn of(scene: &Scene, mesh: &Mesh) -> Self {
        let [mut positions, mut triangles] = [Hash::default(); 2];
        positions.floats(&mesh.positions);
        // The number of positions is that of the first list.
        positions.floats(mesh.close.as_ref().map(|close| &close.positions[..]).unwrap_or_default());
        triangles.words(mesh.triangles.iter().flatten().copied());
        triangles.words(coincident::kinds(scene, mesh));
        if let Some(Curves { radii, segments, shape }) = &mesh.curves {
            triangles.word(match segments {
                CurveSegments::Linear(_) => 1,
                CurveSegments::Cubic(_) => 2,
                CurveSegments::Patches(_) => 3,
            });
            triangles.word(u64::from(*shape == CurveShape::Ribbon));
            triangles.words(segments.indices().iter().copied());
            triangles.words(radii.iter().map(|radius| radius.to_bits()));
            let close = mesh.close.iter().flat_map(|close| close.radii.iter().flatten());
            triangles.words(close.map(|radius| radius.to_bits()));
        }
        Self { positions: positions.finish(), triangles: triangles.finish() }
    }
}

/// What a [`SceneBvh`] was built or updated for.
#[derive(Clone, Debug)]
pub(crate) struct History {
    pub(crate) config: SceneBvhConfig,
    pub(crate) meshes: Vec<MeshKey>,
    pub(crate) instances: Vec<Instance>,
    /// Costs of each bottom-level BVH.
    pub(crate) costs: Vec<BvhCosts>,
    /// Whether an update failed, so that the structure may be a mixture.
    pub(crate) is_stale: bool,
}

impl History {
    fn new(scene: &Scene, config: &SceneBvhConfig, one_level: bool, build_time: Duration) -> Self {
        let seconds = build_time.as_secs_f64();
        let shares = if one_level { vec![1.0] } else { triangle_shares(scene, |_| 1) };
        Self {
            config: *config,
            meshes: scene.meshes.par_iter().map(|mesh| MeshKey::of(scene, mesh)).collect(),
            instances: scene.instances.clone(),
            costs: shares.into_iter().map(|share| BvhCosts::built_in(share * seconds)).collect(),
            is_stale: false,
        }
    }
}

/// For each mesh, the fraction of all triangles that is in it, if mesh `i` counts `weight(i)` times.
pub(crate) fn triangle_shares(scene: &Scene, weight: impl Fn(usize) -> usize) -> Vec<f64> {
    let weighted = |(i, mesh): (usize, &Mesh)| (mesh.n_primitives() * weight(i)) as f64;
    let all: Vec<f64> = scene.meshes.iter().enumerate().map(weighted).collect();
    let sum = all.iter().sum::<f64>().max(1.0);
    all.into_iter().map(|n| n / sum).collect()
}

#[cfg(test)]
mod tests {
    use canted_fixtures::displaced_icosphere;
    use canted_obb::Affine;
    use canted_scene::{Instance, Mesh, MeshId};

    use super::*;
    use crate::Levels;

    /// Two triangles over four vertices; `is_bad` where one has an invalid index.
    fn mesh(is_bad: bool) -> Mesh {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        Mesh { positions, triangles: vec![[0, 1, 2], [1, 2, if is_bad { 9 } else { 3 }]], ..Mesh::default() }
    }

    /// Three meshes with an instance each: six triangles, twelve vertices.
    fn scene(is_bad: bool) -> Scene {
        let instance = |i| Instance {
            mesh: MeshId(i),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 2 * i,
        };
        Scene { meshes: vec![mesh(is_bad); 3], instances: (0..3).map(instance).collect(), ..Scene::default() }
    }

    fn levels(capacity: Capacity, levels: Levels, is_bad: bool) -> Result<usize, PrepareError> {
        let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
        let bvh = SceneBvh::build_in(capacity, &scene(is_bad), &config)?;
        Ok(if matches!(bvh.levels, SceneLevels::One(_)) { 1 } else { 2 })
    }

    #[test]
    fn one_level_is_rejected_just_above_its_capacity() {
        let exact = Capacity { n_triangles: 6, n_vertices: 12 };
        assert_eq!(
            [Levels::One, Levels::Auto].map(|levels_wanted| levels(exact, levels_wanted, false)),
            [Ok(1), Ok(1)]
        );
        for low in [Capacity { n_triangles: 5, ..exact }, Capacity { n_vertices: 11, ..exact }] {
            let too_many = PrepareError::TooMany { n_triangles: 6, n_vertices: 12 };
            // The invalid index would be reported if the triangles were read.
            assert_eq!(
                [false, true].map(|is_bad| levels(low, Levels::One, is_bad)),
                [&too_many; 2].map(|e| Err(e.clone()))
            );
            assert_eq!(
                [Levels::Auto, Levels::Two].map(|levels_wanted| levels(low, levels_wanted, false)),
                [Ok(2), Ok(2)],
                "{low:?}"
            );
        }
    }

    /// A filter of a slice gets the index of its ray, and the instance and the side of each hit in the scene.
    #[test]
    fn slices_have_the_hits_of_their_rays() {
        let sphere = displaced_icosphere(3, 3);
        let mesh = Mesh { positions: sphere.positions, triangles: sphere.triangles, ..Mesh::default() };
        let n_triangles = mesh.triangles.len() as u32;
        let instance = |i: u16, mirror: f32| Instance {
            mesh: MeshId(0),
            world_from_object: Affine {
                columns: [
                    [mirror, 0.0, 0.0],
                    [0.2, 1.0, 0.0],
                    [0.0, 0.0, 1.0],
                    [1.5 * f32::from(i), 0.0, f32::from(i)],
                ],
            },
            world_from_object_close: None,
            first_primitive: n_triangles * u32::from(i),
        };
        let instances = vec![instance(0, 1.0), instance(1, -1.0), instance(2, 1.0)];
        let scene = Scene { meshes: vec![mesh], instances, ..Scene::default() };
        let rays: Vec<Ray> = (0_u16..2500)
            .map(|i| {
                let [x, y] = [i % 50, i / 50].map(|k| f32::from(k) / 50.0);
                Ray::new([8.0 * x - 2.0, 3.0 * y - 1.5, -9.0], [0.1, 0.05, 1.0])
            })
            .collect();
        let accepts = |i: usize, hit: &Hit| {
            let is_front = hit.side == canted_trace::Side::Front;
            !(i + hit.instance.index() + hit.primitive.index()).is_multiple_of(3) && (is_front || i.is_multiple_of(2))
        };
        let accept = |i: usize, _: &Ray, hit: &Hit| accepts(i, hit);
        for levels in [Levels::One, Levels::Two] {
            let bvh = SceneBvh::build(&scene, &SceneBvhConfig { levels, ..SceneBvhConfig::default() }).unwrap();
            let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
            bvh.closest_hits_with(&rays, &mut hits, &accept);
            bvh.occluded_many_with(&rays, &mut occluded, &accept);
            let (mut n, mut n_backs) = ([0; 3], 0);
            for (i, ray) in rays.iter().enumerate() {
                let alone = bvh.closest_hit_with(ray, &mut canted_trace::Accept(|hit: &Hit| accepts(i, hit)));
                assert_eq!((hits[i], occluded[i]), (alone, alone.is_some()), "{levels:?}, ray {i}");
                if let Some(hit) = alone {
                    n[hit.instance.index()] += 1;
                    n_backs += usize::from(hit.side == canted_trace::Side::Back);
                }
            }
            assert!(n.iter().all(|&n| n > 100) && n_backs > 20, "{n:?}, {n_backs} from the back");
        }
    }

    #[test]
    fn the_capacity_is_that_of_the_bvh() {
        let config = SceneBvhConfig::default();
        assert_eq!(config.max_triangles(), 1 << 27);
        assert_eq!(SceneBvhConfig { kind: BvhKind::Bvh2, ..config }.max_triangles(), 1 << 30);
    }
}
