use std::time::{Duration, Instant};

use canted_film::Hash;
use canted_lbvh::Strategy;
use canted_scene::{Instance, Material, Mesh, Scene};
use canted_wide::LaneKernel;
use rayon::prelude::*;

use crate::accel::{Accel, Bvh};
use crate::structure::{Capacity, Structure};
use crate::update_policy::BvhCosts;
use crate::{PrepareError, light};

/// How many levels of BVHs a scene gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Levels {
    /// Two where instances multiply the number of triangles or exceed what one BVH can index; else one.
    #[default]
    Auto,
    /// One BVH over all triangles in world space; two levels all the same where an instance moves.
    One,
    /// A BVH per mesh, and one over the instances.
    Two,
}

/// The acceleration structure to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct StructureConfig {
    /// Number of levels.
    pub levels: Levels,
    /// The BVH of each level.
    pub accel: Accel,
}

/// A feature that a scene does not need, and for which nothing is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnusedFeature {
    /// The feature.
    pub feature: &'static str,
    /// Why this scene does not need it.
    pub reason: &'static str,
}

/// A scene ready to trace.
pub struct Prepared<K: LaneKernel> {
    /// The acceleration structure.
    pub structure: Structure<K>,
    /// What the scene does not need.
    pub unused: Vec<UnusedFeature>,
    /// Time to build all levels, or of the last update.
    pub build_time: Duration,
    /// For [`Prepared::update`].
    pub(crate) history: History,
}

/// Hashes of the vertices and of the triangles of a mesh: different ones are equal with probability 2^-64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MeshKey {
    pub(crate) positions: u64,
    pub(crate) triangles: u64,
}

impl MeshKey {
    pub(crate) fn of(mesh: &Mesh) -> Self {
        let [mut positions, mut triangles] = [Hash::default(); 2];
        positions.floats(&mesh.positions);
        // The number of positions is that of the first list.
        positions.floats(mesh.close.as_ref().map(|close| &close.positions[..]).unwrap_or_default());
        triangles.words(mesh.triangles.iter().flatten().copied());
        Self { positions: positions.finish(), triangles: triangles.finish() }
    }
}

/// What a [`Prepared`] was built or updated for.
#[derive(Clone, Debug)]
pub(crate) struct History {
    pub(crate) config: StructureConfig,
    pub(crate) meshes: Vec<MeshKey>,
    pub(crate) instances: Vec<Instance>,
    /// Costs of each bottom-level BVH.
    pub(crate) costs: Vec<BvhCosts>,
    /// Whether an update failed, so that the structure may be a mixture.
    pub(crate) is_stale: bool,
}

impl History {
    fn new(scene: &Scene, config: &StructureConfig, one_level: bool, build_time: Duration) -> Self {
        let seconds = build_time.as_secs_f64();
        let shares = if one_level { vec![1.0] } else { triangle_shares(scene, |_| 1) };
        Self {
            config: *config,
            meshes: scene.meshes.par_iter().map(MeshKey::of).collect(),
            instances: scene.instances.clone(),
            costs: shares.into_iter().map(|share| BvhCosts::built_in(share * seconds)).collect(),
            is_stale: false,
        }
    }
}

/// For each mesh, the fraction of all triangles that is in it, if mesh `i` counts `weight(i)` times.
pub(crate) fn triangle_shares(scene: &Scene, weight: impl Fn(usize) -> usize) -> Vec<f64> {
    let weighted = |(i, mesh): (usize, &Mesh)| (mesh.triangles.len() * weight(i)) as f64;
    let all: Vec<f64> = scene.meshes.iter().enumerate().map(weighted).collect();
    let sum = all.iter().sum::<f64>().max(1.0);
    all.into_iter().map(|n| n / sum).collect()
}

/// Triangles in world space for each one in a mesh up to which one level is faster and its memory acceptable.
const WORTH_FLATTENING: f64 = 1.5;

/// Builds what a scene needs for tracing, and nothing else.
///
/// # Errors
/// Invalid geometry or transforms, by index; more triangles than one BVH can index.
pub fn prepare<K: LaneKernel>(scene: &Scene, config: &StructureConfig) -> Result<Prepared<K>, PrepareError> {
    prepare_in(Capacity { n_triangles: config.accel.max_triangles(), ..Capacity::MAX }, scene, config)
}

/// [`prepare`] with the capacity of one BVH.
fn prepare_in<K: LaneKernel>(
    capacity: Capacity,
    scene: &Scene,
    config: &StructureConfig,
) -> Result<Prepared<K>, PrepareError> {
    let start = Instant::now();
    let one = has_one_level_in(capacity, scene, config)?;
    let structure = if one { Structure::one(scene, &config.accel)? } else { Structure::two(scene, &config.accel)? };
    let unused = unused_features(&structure, scene, config);
    let build_time = start.elapsed();
    Ok(Prepared { structure, unused, build_time, history: History::new(scene, config, one, build_time) })
}

/// Whether [`prepare`] gives a scene one level.
///
/// # Errors
/// One level was requested, and the scene exceeds what one BVH can index.
pub(crate) fn has_one_level(scene: &Scene, config: &StructureConfig) -> Result<bool, PrepareError> {
    has_one_level_in(Capacity { n_triangles: config.accel.max_triangles(), ..Capacity::MAX }, scene, config)
}

fn has_one_level_in(capacity: Capacity, scene: &Scene, config: &StructureConfig) -> Result<bool, PrepareError> {
    let n_triangles = scene.n_placed_triangles();
    let fits = capacity.check(scene);
    let one = match config.levels {
        _ if scene.has_motion() => false,
        // One level traces faster: no bounds of whole meshes that overlap, and no transforms.
        Levels::Auto => fits.is_ok() && n_triangles as f64 <= WORTH_FLATTENING * scene.n_unique_triangles() as f64,
        Levels::One => true,
        Levels::Two => false,
    };
    if one {
        fits?;
    }
    Ok(one)
}

/// Features that `scene` does not need in this structure.
pub(crate) fn unused_features<K: LaneKernel>(
    structure: &Structure<K>,
    scene: &Scene,
    config: &StructureConfig,
) -> Vec<UnusedFeature> {
    let aligned = match config.accel {
        Accel::Binary { strategy: Strategy::Aabb, .. } => Some("axis-aligned boxes were requested"),
        Accel::Bih | Accel::KdTree => Some("the requested structure has none"),
        _ if structure.bottom().iter().any(Bvh::has_oriented_nodes) => None,
        _ => Some("no gain in predicted cost"),
    };
    let one_level = match config.levels {
        _ if !matches!(structure, Structure::One(_)) => None,
        Levels::One => Some("one level was requested"),
        _ => Some("few meshes have several instances"),
    };
    unused(scene, one_level, aligned)
}

/// Features that `scene` does not need; the reasons why it has one level and aligned nodes only, if so.
fn unused(scene: &Scene, one_level: Option<&'static str>, aligned: Option<&'static str>) -> Vec<UnusedFeature> {
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

#[cfg(test)]
mod tests {
    use canted_obb::Affine;
    use canted_scene::{Instance, Mesh, MeshId};
    use canted_trace::Watertight;

    use super::*;

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
        let config = StructureConfig { levels, ..StructureConfig::default() };
        let Prepared { structure, .. } = prepare_in::<Watertight>(capacity, &scene(is_bad), &config)?;
        Ok(if matches!(structure, Structure::One(_)) { 1 } else { 2 })
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

    #[test]
    fn the_capacity_is_that_of_the_bvh() {
        assert_eq!(Accel::default().max_triangles(), 1 << 27);
        assert_eq!(Accel::Binary { strategy: Strategy::Dop, builder: None }.max_triangles(), 1 << 30);
    }
}
