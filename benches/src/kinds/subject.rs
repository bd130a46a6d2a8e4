//! One scene of a kind with its rays, and the measuring of all engines on it.
//!
//! Reads: kind, size, options. Writes: build times, seconds of each round, and the answers.
//! Holds: every engine traces the same rays, in turn.

use anyhow::Result;
use canted_fixtures::{
    Mesh,
    kinds::{Kind, RayKind, Scene},
};
use canted_obb::Affine;
use canted_tlas::Instance;
use canted_trace::{Hit, Ray};
use serde_json::json;

use crate::{
    models::{Model, Placed},
    options::Options,
    rays,
    timing::Seconds,
    wide::{
        Record,
        engine::{self, Built, Engine, Entry},
        ours,
    },
};

/// Rays of each kind, and with `--quick`.
const N_RAYS: [usize; 2] = [65_536, 16_384];

/// A scene, ready for measuring.
pub(super) struct Subject {
    pub(super) kind: &'static Kind,
    pub(super) model: Model,
    n_triangles: usize,
    pub(super) sets: Vec<(RayKind, Vec<Ray>)>,
}

impl Subject {
    /// Generates the scene and its rays.
    pub(super) fn new(kind: &'static Kind, size: usize, options: &Options) -> Result<Self> {
        let scene = kind.generate(size, options.seed);
        let n_rays = N_RAYS[usize::from(options.is_quick)];
        let rays = |kind| scene.rays(kind, n_rays, options.seed).iter().map(rays::ray).collect();
        let sets = RayKind::ALL.map(|kind| (kind, rays(kind))).into();
        Ok(Self { kind, n_triangles: scene.n_triangles(), sets, model: model(scene)? })
    }

    /// Builds every engine and traces every set, on this thread.
    pub(super) fn measure(&self, options: &Options) -> Result<Measured> {
        let entries = entries(&self.model, options);
        // Repeated even with `--quick`: the first build of a small scene measures the start of threads.
        let (engines, built): (Vec<_>, Vec<_>) = engine::build_all(&entries, true)?.into_iter().unzip();
        let sets = self.sets.iter().map(|(kind, rays)| Set::measure(*kind, rays, &engines, options.rounds)).collect();
        let engines = entries.iter().map(|entry| entry.name.clone()).zip(built).collect();
        Ok(Measured { kind: self.kind, n_triangles: self.n_triangles, engines, sets, checks: vec![] })
    }
}

/// Every preset first, then the newest Embree in every mode.
fn entries<'a>(model: &'a Model, options: &Options) -> Vec<Entry<'a>> {
    let mut entries = ours::presets(model);
    #[cfg(feature = "peers")]
    entries.extend(crate::wide::embree::newest(model));
    entries.retain(|entry| options.wants_engine(&entry.name));
    entries
}

/// The scene as the engines take it. A scene of two levels is not flattened: its mesh is empty.
fn model(scene: Scene) -> Result<Model> {
    let Scene { mut meshes, instances, views, .. } = scene;
    if instances.is_empty() {
        return Ok(Model { mesh: meshes.remove(0), views, placed: None });
    }
    let instances = instances
        .iter()
        .map(|placement| {
            let columns = placement.world_from_object;
            Ok(Instance::new(u32::try_from(placement.mesh)?, Affine { columns }))
        })
        .collect::<Result<_>>()?;
    Ok(Model { mesh: Mesh::default(), views, placed: Some(Placed { meshes, instances }) })
}

/// Answers of one engine.
pub(super) enum Answers {
    Closest(Vec<Option<Hit>>),
    Occluded(Vec<bool>),
}

/// The measurements of one set of rays; vectors are in the order of the engines.
pub(super) struct Set {
    pub(super) kind: RayKind,
    pub(super) n_rays: usize,
    pub(super) seconds: Vec<Vec<Seconds>>,
    pub(super) answers: Vec<Answers>,
}

impl Set {
    fn measure(kind: RayKind, rays: &[Ray], engines: &[Box<dyn Engine>], rounds: usize) -> Self {
        let (seconds, answers) = if kind == RayKind::Occlusion {
            let (seconds, answers) = engine::occluded(engines, rays, rounds);
            (seconds, answers.into_iter().map(Answers::Occluded).collect())
        } else {
            let (seconds, answers) = engine::closest(engines, rays, rounds);
            (seconds, answers.into_iter().map(Answers::Closest).collect())
        };
        Self { kind, n_rays: rays.len(), seconds, answers }
    }
}

/// All measurements of one scene.
pub(super) struct Measured {
    pub(super) kind: &'static Kind,
    pub(super) n_triangles: usize,
    pub(super) engines: Vec<(String, Built)>,
    pub(super) sets: Vec<Set>,
    /// One for each of our engines, in their order; empty until checked.
    pub(super) checks: Vec<Check>,
}

/// The name of our engines starts with this.
pub(super) const OURS: &str = "WideBvh";

/// What the comparison of one of our engines found.
#[derive(Clone, Debug, Default)]
pub(super) struct Check {
    /// Rays compared with the loop.
    pub(super) n_looped: usize,
    /// Rays compared with our other engines.
    pub(super) n_compared: usize,
    pub(super) differences: Vec<Difference>,
}

/// A ray whose answer is wrong.
#[derive(Clone, Debug)]
pub(super) struct Difference {
    pub(super) rays: RayKind,
    /// Index of the ray.
    pub(super) index: usize,
    pub(super) ray: Ray,
    /// The loop's hit and the engine's; of occlusion rays the engine reports only whether there is one.
    pub(super) truth: Option<Hit>,
    pub(super) found: String,
}

/// Adds a scene to the JSON lines: one for each engine.
pub(super) fn add_record(record: &mut Record, measured: &Measured, seed: u64) -> Result<()> {
    for (i, (name, built)) in measured.engines.iter().enumerate() {
        let sets = measured.sets.iter().map(|set| {
            let cpu: Vec<f64> = set.seconds[i].iter().map(|seconds| seconds.cpu).collect();
            json!({ "rays": set.kind.name(), "n": set.n_rays, "cpu_s": cpu })
        });
        let check = measured.checks.get(i).map(|check| {
            let differences = check.differences.iter().map(|difference| {
                let bits = |v: [f32; 3]| v.map(f32::to_bits);
                json!({
                    "rays": difference.rays.name(),
                    "index": difference.index,
                    "origin_bits": bits(difference.ray.origin),
                    "direction_bits": bits(difference.ray.direction),
                    "t_max_bits": difference.ray.t_max.to_bits(),
                    "truth": format!("{:?}", difference.truth),
                    "found": difference.found,
                })
            });
            json!({ "looped": check.n_looped, "differences": differences.collect::<Vec<_>>() })
        });
        record.line(&json!({
            "kind": measured.kind.name,
            "family": measured.kind.family.name(),
            "seed": seed,
            "triangles": measured.n_triangles,
            "engine": name,
            "bytes": built.n_bytes,
            "build_one_thread_s": built.one_thread,
            "build_two_threads_s": built.two_threads,
            "sets": sets.collect::<Vec<_>>(),
            "check": check,
        }))?;
    }
    Ok(())
}
