//! How many levels of BVHs a scene gets, by predicted cost.

use std::fmt;

use canted_lbvh::{Costs, VolumeConfig, tree_cost, volumes};
use canted_obb::{Aabb, Affine, Obb};
use canted_sah::{TopDownConfig, top_down};
use canted_scene::{Instance, Mesh, Scene};
use rayon::prelude::*;

use crate::{BvhKind, Levels, PrepareError, SceneBvhConfig};

/// The number of levels of a scene, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelChoice {
    /// Whether there is one level.
    pub is_one: bool,
    /// Why.
    pub reason: LevelReason,
}

/// What decided the number of levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelReason {
    /// It was requested.
    Requested,
    /// An instance moves, or a mesh deforms while the shutter is open.
    Motion,
    /// A mesh has curves.
    Curves,
    /// One BVH cannot index all triangles or vertices.
    Capacity,
    /// One level would store too many triangles more than once.
    Copies {
        /// Triangles of all instances.
        n_placed: usize,
        /// Triangles of all meshes.
        n_unique: usize,
    },
    /// There is at most one instance.
    OneInstance,
    /// The geometry is invalid, which the build reports.
    Invalid,
    /// The predicted cost of a ray.
    Predicted(PredictedCosts),
}

impl LevelReason {
    /// In words.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Requested => "requested",
            Self::Motion => "an instance moves",
            Self::Curves => "a mesh has curves",
            Self::Capacity => "more than one BVH can index",
            Self::Copies { .. } => "one level would copy too many triangles",
            Self::OneInstance => "at most one instance",
            Self::Invalid => "invalid geometry",
            Self::Predicted(_) => "predicted cost",
        }
    }
}

/// As `one level: predicted cost 12.3, in two levels 25.1`.
impl fmt::Display for LevelChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = self.reason.name();
        write!(f, "{}: {reason}", if self.is_one { "one level" } else { "two levels" })?;
        match self.reason {
            LevelReason::Predicted(PredictedCosts { one, two }) => {
                let (chosen, other) = if self.is_one { (one, two) } else { (two, one) };
                let other_levels = if self.is_one { "two levels" } else { "one level" };
                write!(f, " {chosen:.1}, in {other_levels} {other:.1}")
            }
            LevelReason::Copies { n_placed, n_unique } => write!(f, " ({n_placed} instead of {n_unique})"),
            _ => Ok(()),
        }
    }
}

/// Binary nodes that a line through a scene is expected to visit in a tree over runs of triangles, by the surface area heuristic. The
/// nodes below the runs are not counted: they are the same in one level and in two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedCosts {
    /// In one level.
    pub one: f64,
    /// In two levels.
    pub two: f64,
}

/// Triangles in world space for each one in a mesh up to which the memory of one level is acceptable.
const MOST_COPIES: f64 = 1.5;

/// Runs of triangles that predictions are made of, about.
const RUNS: usize = 1 << 12;

/// How many times the predicted cost of two levels one level may have: for rotated meshes, predictions are off by up to so much.
/// It was set by hand on the scenes of `benches/TRIED.md`.
const MARGIN: f64 = 1.5;

/// Cost of moving a ray into an instance and starting below it, in binary nodes; set by hand on the same scenes.
const ENTRY: f64 = 4.0;

impl LevelChoice {
    /// The choice for `scene`; `fits` is an error where one BVH cannot index it.
    pub(crate) fn of(
        scene: &Scene,
        config: &SceneBvhConfig,
        fits: Result<(), PrepareError>,
    ) -> Result<Self, PrepareError> {
        let two = |reason| Ok(Self { is_one: false, reason });
        if scene.has_motion() {
            return two(LevelReason::Motion);
        }
        if scene.has_curves() {
            return two(LevelReason::Curves);
        }
        match config.levels {
            Levels::Two => return two(LevelReason::Requested),
            Levels::One => return fits.map(|()| Self { is_one: true, reason: LevelReason::Requested }),
            Levels::Auto if fits.is_err() => return two(LevelReason::Capacity),
            Levels::Auto => {}
        }
        let (n_placed, n_unique) = (scene.n_placed_triangles(), scene.n_unique_triangles());
        if n_placed as f64 > MOST_COPIES * n_unique as f64 {
            return two(LevelReason::Copies { n_placed, n_unique });
        }
        if scene.instances.len() < 2 {
            return Ok(Self { is_one: true, reason: LevelReason::OneInstance });
        }
        Ok(match PredictedCosts::of(scene, config) {
            Some(costs) => Self { is_one: costs.one <= MARGIN * costs.two, reason: LevelReason::Predicted(costs) },
            None => Self { is_one: true, reason: LevelReason::Invalid },
        })
    }
}

impl PredictedCosts {
    /// Predicts the cost of a ray through `scene`; `None` where its geometry is invalid.
    #[must_use]
    pub fn of(scene: &Scene, config: &SceneBvhConfig) -> Option<Self> {
        let run = scene.n_placed_triangles().div_ceil(RUNS).max(1);
        let runs = |mesh: &Mesh, map: &Affine| run_boxes(mesh, run, map);
        // Trees below instances do not depend on where these are.
        let below = scene.meshes.par_iter().map(|mesh| Some(visited(&runs(mesh, &Affine::IDENTITY)?)));
        let below: Vec<f64> = below.collect::<Option<_>>()?;
        let placed = |i: &Instance| runs(&scene.meshes[i.mesh.0 as usize], &i.world_from_object);
        let in_world: Vec<Vec<Aabb>> = scene.instances.par_iter().map(placed).collect::<Option<_>>()?;
        let area = union(in_world.iter().flatten()).area().max(f64::MIN_POSITIVE);
        let (mut instances, mut entries, mut inside) = (vec![], 0.0, 0.0);
        for (boxes, instance) in in_world.iter().zip(&scene.instances).filter(|(boxes, _)| !boxes.is_empty()) {
            let aabb = union(boxes);
            let entered = aabb.area() / area;
            entries += entered * ENTRY;
            inside += entered * below[instance.mesh.0 as usize];
            instances.push(aabb);
        }
        let without_entries = visited(&instances) + inside;
        let two = without_entries + entries;
        let aligned = visited(&in_world.concat());
        // Oriented nodes follow instances that are rotated as the nodes below these do.
        let has_oriented = config.kind == BvhKind::Wide && !config.aligned;
        let one = if has_oriented { aligned.min(without_entries) } else { aligned };
        (one.is_finite() && two.is_finite()).then_some(Self { one, two })
    }
}

/// Triangles of a run from which its box is made, at most.
const OF_A_RUN: usize = 16;

/// The boxes of runs of neighbors in the list of a mesh's triangles, under a map; `None` if a vertex is not finite or does not exist.
fn run_boxes(mesh: &Mesh, run: usize, map: &Affine) -> Option<Vec<Aabb>> {
    let step = run.div_ceil(OF_A_RUN);
    let of = |run: &[[u32; 3]]| {
        let mut aabb = Aabb::EMPTY;
        for &i in run.iter().step_by(step).flatten() {
            let point = map.point(*mesh.positions.get(i as usize)?);
            point.iter().all(|x| x.is_finite()).then(|| aabb.grow(point))?;
        }
        Some(aabb)
    };
    mesh.triangles.chunks(run).map(of).collect()
}

fn union<'a>(boxes: impl IntoIterator<Item = &'a Aabb>) -> Aabb {
    boxes.into_iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
}

/// Inner nodes of a tree over boxes that a line through all of them is expected to visit.
fn visited(boxes: &[Aabb]) -> f64 {
    if boxes.len() < 2 {
        return 0.0;
    }
    let tree = top_down(boxes, &TopDownConfig::BINNED);
    let leaves: Vec<Obb> = tree.leaves.iter().map(|leaf| Obb::from_aabb(&boxes[leaf.index()])).collect();
    let volumes = volumes(&tree, &leaves, &VolumeConfig::default());
    let area = tree_cost(&tree, &volumes, &leaves, &Costs::default(), 1.0).area;
    area / union(boxes).area().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use canted_scene::MeshId;

    use super::*;
    use crate::SceneBvh;

    /// A rod along x of length 40 and width 1, of `2 n` triangles.
    fn rod(n: u16) -> Mesh {
        let x = |i: u16| 40.0 * f32::from(i) / f32::from(n);
        let positions = (0..=n).flat_map(|i| [[x(i), 0.0, 0.0], [x(i), 1.0, 1.0]]).collect();
        let triangles =
            (0..u32::from(n)).flat_map(|i| [[2 * i, 2 * i + 1, 2 * i + 2], [2 * i + 1, 2 * i + 3, 2 * i + 2]]);
        Mesh { positions, triangles: triangles.collect(), ..Mesh::default() }
    }

    fn scene(meshes: Vec<Mesh>, places: &[Affine], is_shared: bool) -> Scene {
        let instance = |(i, &world_from_object): (usize, &Affine)| Instance {
            mesh: MeshId(if is_shared { 0 } else { i as u32 }),
            world_from_object,
            world_from_object_close: None,
            first_primitive: 0,
        };
        Scene { meshes, instances: places.iter().enumerate().map(instance).collect(), ..Scene::default() }
    }

    fn choice(scene: &Scene, config: &SceneBvhConfig) -> LevelChoice {
        SceneBvh::build(scene, config).unwrap().choice
    }

    const BINARY: SceneBvhConfig = SceneBvhConfig {
        levels: Levels::Auto,
        kind: BvhKind::Bvh2,
        preset: canted_wide::Preset::Balanced,
        builder: None,
        volumes: canted_lbvh::Strategy::Aabb,
        aligned: false,
        triangles: canted_trace::TriangleTest::Watertight,
        on_device: false,
    };

    fn predicted(choice: LevelChoice) -> PredictedCosts {
        match choice.reason {
            LevelReason::Predicted(costs) => costs,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn meshes_that_overlap_get_one_level() {
        // Ten rods through each other, a mesh each.
        let places: Vec<Affine> = (0..10u8).map(|i| Affine::translation([f32::from(i), 0.1, 0.0])).collect();
        let found = choice(&scene(vec![rod(100); 10], &places, false), &BINARY);
        let costs = predicted(found);
        assert!(found.is_one && costs.one < 0.7 * costs.two, "{found}");
        let text = found.to_string();
        assert!(text.starts_with("one level: predicted cost ") && text.contains(", in two levels "), "{text}");
    }

    #[test]
    fn a_mesh_of_its_own_frame_keeps_it_below_binary_nodes() {
        // Two thin bundles across the diagonal: boxes in world space are fat, those in object space are not.
        let across = Affine::rotation([0.0, 1.0, 0.0], 0.78).then(&Affine::rotation([0.0, 0.0, 1.0], 0.6));
        let bundle = |n: u16| {
            let mut mesh = Mesh::default();
            for i in 0..n {
                let base = mesh.positions.len() as u32;
                let shift = [0.0, 0.02 * f32::from(i), 0.03 * f32::from(i * 7 % n)];
                let rod = rod(2);
                mesh.positions
                    .extend(rod.positions.iter().map(|p| [p[0], 0.01 * p[1] + shift[1], 0.01 * p[2] + shift[2]]));
                mesh.triangles.extend(rod.triangles.iter().map(|t| t.map(|i| base + i)));
            }
            mesh
        };
        let places = [across, across.then(&Affine::translation([60.0, 0.0, 0.0]))];
        let bundles = scene(vec![bundle(400), bundle(400)], &places, false);
        let found = choice(&bundles, &BINARY);
        let costs = predicted(found);
        assert!(!found.is_one && costs.one > MARGIN * costs.two, "{found}");
        // Oriented nodes follow the bundles in one level as well.
        let wide = SceneBvhConfig { kind: BvhKind::Wide, ..BINARY };
        assert!(choice(&bundles, &wide).is_one);
        assert!(!choice(&bundles, &SceneBvhConfig { aligned: true, ..wide }).is_one);
    }

    #[test]
    fn copies_get_two_levels_and_requests_are_followed() {
        let places: Vec<Affine> = (0..4u8).map(|i| Affine::translation([50.0 * f32::from(i), 0.0, 0.0])).collect();
        let copies = scene(vec![rod(10)], &places, true);
        let found = choice(&copies, &BINARY);
        assert_eq!(found.to_string(), "two levels: one level would copy too many triangles (80 instead of 20)");
        for (levels, is_one) in [(Levels::One, true), (Levels::Two, false)] {
            let found = choice(&copies, &SceneBvhConfig { levels, ..BINARY });
            assert_eq!(found, LevelChoice { is_one, reason: LevelReason::Requested });
        }
        let one = choice(&scene(vec![rod(10)], &places[..1], true), &BINARY);
        assert_eq!(one, LevelChoice { is_one: true, reason: LevelReason::OneInstance });
    }

    #[test]
    fn invalid_geometry_is_left_to_the_build() {
        let mut bad = scene(vec![rod(3), rod(3)], &[Affine::IDENTITY; 2], false);
        for (place, value) in [([0, 0], f32::NAN), ([1, 2], f32::INFINITY)] {
            bad.meshes[place[0]].positions[place[1]][1] = value;
            assert_eq!(PredictedCosts::of(&bad, &BINARY), None);
            assert!(SceneBvh::build(&bad, &BINARY).is_err());
        }
        bad = scene(vec![rod(3), rod(3)], &[Affine::IDENTITY; 2], false);
        bad.meshes[1].triangles[0][2] = 99;
        assert_eq!(PredictedCosts::of(&bad, &BINARY), None);
    }
}
