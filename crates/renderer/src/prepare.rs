use std::time::{Duration, Instant};

use canted_lbvh::{GeometryError, Strategy, TopologyError};
use canted_scene::{Material, Scene};
use canted_tlas::InstanceError;
use canted_wide::{LaneKernel, Preset};

use crate::level::{Builder, Level, LevelConfig};
use crate::light;
use crate::structure::{Room, Structure, build_one, build_two};

/// How many levels a scene gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Levels {
    /// Two where placing meshes makes many more triangles than there are, or more than one tree has room for; else one.
    #[default]
    Auto,
    /// All triangles in world space under one tree; two levels all the same where an instance moves.
    One,
    /// A tree a mesh, and a tree over the instances.
    Two,
}

/// What the caller asks of a structure; the defaults choose by the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct StructureConfig {
    /// Number of levels.
    pub levels: Levels,
    /// Builder of the binary trees.
    pub builder: Builder,
    /// How much is spent on wide trees; binary ones have no presets.
    pub preset: Preset,
    /// Volumes of binary trees; `None` makes wide ones, whose nodes lean where their predicted cost is lower.
    pub volumes: Option<Strategy>,
}

/// Why a scene cannot be traced.
#[derive(Clone, Debug, PartialEq)]
pub enum PrepareError {
    /// A mesh cannot be built.
    Geometry(GeometryError),
    /// An instance cannot be placed.
    Instance(InstanceError),
    /// A foreign builder returned no tree.
    Topology(TopologyError),
    /// The scene flattened into one level would have more triangles than its tree can name, or more vertices than triangles can.
    TooMany {
        /// Triangles of all instances.
        n_triangles: usize,
        /// Vertices of all instances.
        n_vertices: usize,
    },
}

impl std::fmt::Display for PrepareError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Geometry(error) => error.fmt(f),
            Self::Instance(error) => error.fmt(f),
            Self::Topology(error) => write!(f, "the foreign builder made no tree: {error}"),
            Self::TooMany { n_triangles, n_vertices } => {
                write!(f, "{n_triangles} triangles with {n_vertices} vertices do not fit in one level")
            }
        }
    }
}

impl std::error::Error for PrepareError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Geometry(error) => Some(error),
            Self::Instance(error) => Some(error),
            Self::Topology(error) => Some(error),
            Self::TooMany { .. } => None,
        }
    }
}

impl From<GeometryError> for PrepareError {
    fn from(error: GeometryError) -> Self {
        Self::Geometry(error)
    }
}

impl From<InstanceError> for PrepareError {
    fn from(error: InstanceError) -> Self {
        Self::Instance(error)
    }
}

impl From<TopologyError> for PrepareError {
    fn from(error: TopologyError) -> Self {
        Self::Topology(error)
    }
}

/// A part of the pipeline that a scene does not need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The part.
    pub part: &'static str,
    /// Why this scene does without.
    pub because: &'static str,
}

/// A scene ready to trace.
pub struct Prepared<K: LaneKernel> {
    /// What answers rays.
    pub structure: Structure<K>,
    /// What the scene does not need, decided here once.
    pub left_out: Vec<LeftOut>,
    /// Time to build all levels.
    pub build_time: Duration,
}

/// Triangles that flattening may make of one, on average, before memory speaks for two levels.
const WORTH_FLATTENING: f64 = 1.5;

/// Builds what a scene needs for tracing, and nothing else.
///
/// # Errors
/// Geometry or transforms that cannot be traced, by index; more triangles than fit, before any is placed.
pub fn prepare<K: LaneKernel>(scene: &Scene, config: &StructureConfig) -> Result<Prepared<K>, PrepareError> {
    prepare_in(Room::under(config.volumes), scene, config)
}

/// As [`prepare`], where one tree has room for this.
#[expect(clippy::cast_precision_loss, reason = "the counts are compared coarsely")]
fn prepare_in<K: LaneKernel>(room: Room, scene: &Scene, config: &StructureConfig) -> Result<Prepared<K>, PrepareError> {
    let start = Instant::now();
    let level = LevelConfig { builder: config.builder, preset: config.preset, strategy: config.volumes };
    let n_triangles = scene.n_placed_triangles();
    let fits = room.check(scene);
    let one = match config.levels {
        _ if scene.has_motion() => false,
        // A flat tree answers rays faster: it has no boxes around whole meshes that overlap, and no transforms.
        Levels::Auto => fits.is_ok() && n_triangles as f64 <= WORTH_FLATTENING * scene.n_unique_triangles() as f64,
        Levels::One => true,
        Levels::Two => false,
    };
    if one {
        fits?;
    }
    let structure = if one { build_one(scene, &level)? } else { build_two(scene, &level)? };
    let straight = match config.volumes {
        Some(Strategy::Aabb) => "boxes along the axes are asked for",
        _ if structure.bottom().iter().any(Level::leans) => "",
        _ => "no gain by predicted cost",
    };
    let one_because = match config.levels {
        _ if !one => "",
        Levels::One => "one level is asked for",
        _ => "meshes are hardly repeated",
    };
    let left_out = left_out(scene, one_because, straight);
    Ok(Prepared { structure, left_out, build_time: start.elapsed() })
}

/// What `scene` does without; `one` says why there is one level, `straight` why no box leans, both empty where it is not so.
fn left_out(scene: &Scene, one: &'static str, straight: &'static str) -> Vec<LeftOut> {
    let mut left_out = vec![];
    let mut without = |needed: bool, part, because| {
        if !needed {
            left_out.push(LeftOut { part, because });
        }
    };
    without(one.is_empty(), "top level", one);
    without(scene.has_motion(), "motion", "no instance moves");
    without(straight.is_empty(), "leaning boxes", straight);
    let textured = scene.materials.iter().any(|m| m.textures().next().is_some());
    without(textured, "textures", "no material has one");
    without(scene.meshes.iter().any(|m| m.uvs.is_some()), "texture coordinates", "no texture is looked up");
    without(scene.materials.iter().any(Material::uses_alpha), "alpha test", "every surface is opaque");
    without(scene.meshes.iter().any(|m| m.normals.is_some()), "shading normals", "every mesh is flat");
    without(!scene.lights.is_empty(), "listed lights", "none is given");
    without(scene.materials.iter().any(Material::is_emissive), "emission", "no surface emits");
    without(light::has_multiple_lights(scene), "choice among lights", "there is one at most");
    left_out
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use canted_obb::Affine;
    use canted_scene::{Instance, Mesh, MeshId};
    use canted_trace::Watertight;

    use super::*;

    /// Two triangles over four vertices; `is_bad` where one names a vertex that is not there.
    fn mesh(is_bad: bool) -> Mesh {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        Mesh { positions, triangles: vec![[0, 1, 2], [1, 2, if is_bad { 9 } else { 3 }]], ..Mesh::default() }
    }

    /// Three meshes, each placed once: six triangles, twelve vertices.
    fn scene(is_bad: bool) -> Scene {
        let place = |i| Instance {
            mesh: MeshId(i),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 2 * i,
        };
        Scene { meshes: vec![mesh(is_bad); 3], instances: (0..3).map(place).collect(), ..Scene::default() }
    }

    fn levels(room: Room, levels: Levels, is_bad: bool) -> Result<usize, PrepareError> {
        let config = StructureConfig { levels, ..StructureConfig::default() };
        let Prepared { structure, .. } = prepare_in::<Watertight>(room, &scene(is_bad), &config)?;
        Ok(if matches!(structure, Structure::One(_)) { 1 } else { 2 })
    }

    #[test]
    fn one_level_is_refused_just_above_its_room_and_two_are_taken() {
        let just = Room { n_triangles: 6, n_vertices: 12 };
        assert_eq!([Levels::One, Levels::Auto].map(|asked| levels(just, asked, false)), [Ok(1), Ok(1)]);
        for low in [Room { n_triangles: 5, ..just }, Room { n_vertices: 11, ..just }] {
            let too_many = PrepareError::TooMany { n_triangles: 6, n_vertices: 12 };
            // A vertex that is not there would be told if any were looked at.
            assert_eq!(
                [false, true].map(|is_bad| levels(low, Levels::One, is_bad)),
                [&too_many; 2].map(|e| Err(e.clone()))
            );
            assert_eq!([Levels::Auto, Levels::Two].map(|asked| levels(low, asked, false)), [Ok(2), Ok(2)], "{low:?}");
        }
    }

    #[test]
    fn the_room_is_that_of_the_tree() {
        assert_eq!(Room::under(None).n_triangles, 1 << 27);
        assert_eq!(Room::under(Some(Strategy::Dop)).n_triangles, 1 << 30);
    }

    #[test]
    fn what_is_wrapped_is_the_source() {
        let instance = InstanceError::NotFinite { instance: 3 };
        assert_eq!(PrepareError::from(instance).source().map(ToString::to_string), Some(instance.to_string()));
        let geometry = GeometryError::TooMany { n_triangles: 1 << 31 };
        assert_eq!(PrepareError::from(geometry).source().map(ToString::to_string), Some(geometry.to_string()));
        let topology = TopologyError::Unreached { node: 1 };
        assert_eq!(PrepareError::from(topology).source().map(ToString::to_string), Some(topology.to_string()));
        assert!(PrepareError::TooMany { n_triangles: 1 << 31, n_vertices: 3 }.source().is_none());
    }
}
