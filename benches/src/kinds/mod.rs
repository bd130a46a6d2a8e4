//! The generated kinds of scenes: every preset compared with Embree, and its hits with a loop over all triangles.
//!
//! ```text
//! kind, size, seed -> subject (model, rays) -> entries -> built, traced in turn -> checked (loop) -> tables, JSON lines
//! ```

mod checked;
mod tables;
#[cfg(feature = "peers")]
pub(crate) mod trees;

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use canted_fixtures::{
    Mesh, SplitMix64,
    kinds::{self, Family, Kind, RayKind, Scene},
};
use canted_lbvh::stages::Stage;
use canted_obb::Affine;
use canted_tlas::Instance;
use canted_trace::{Hit, Ray};
use serde_json::json;
use tables::Tables;

use crate::{
    models::{self, Model, Placed},
    options::Options,
    timing::Seconds,
    wide::{
        Record,
        engine::{self, Answers, Built, Engine, Entry},
        ours,
    },
};

/// Triangles of kinds that are not ordinary, and with `--quick`.
const SIZE: [usize; 2] = [100_000, 10_000];
/// Least and greatest number of triangles of ordinary kinds, in geometric progression, and of fresh ones, drawn.
const ORDINARY_SIZES: [f64; 2] = [40_000.0, 1_000_000.0];

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let mut record = Record::create("kinds.jsonl")?;
    let mut tables = Tables::default();
    if options.is_fresh {
        writeln!(std::io::stderr(), "seed {}: `kinds --fresh {0}` measures the same scenes", options.seed)?;
    }
    let chosen = chosen(options)?;
    let generated = chosen.into_iter().map(|(kind, size)| Subject::generated(kind, size, options));
    let files = model_files(options)?;
    for subject in generated.chain(files.iter().map(|file| Subject::of_file(file, options))) {
        let subject = subject?;
        // A pool of one thread builds and traces everything on one thread.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let measured = one.install(|| subject.measure(options))?;
        let measured = measured.check(&subject);
        add_record(&mut record, &measured, options.seed)?;
        std::io::stderr().write_all(tables::summary(&measured).as_bytes())?;
        tables.add(measured);
    }
    tables.write(out, options);
    Ok(())
}

/// The kinds to measure with their sizes: the fifty or the fresh ones, all or those that `--scenes` names by themselves or by their family.
/// A folder of models is measured alone, unless `--fresh` or kinds are named.
fn chosen(options: &Options) -> Result<Vec<(&'static Kind, usize)>> {
    let words = options.scenes(&[]);
    let is_known = |word: &str| kinds::named(word).is_some() || Family::ALL.iter().any(|family| family.name() == word);
    if let Some(unknown) = words.iter().find(|word| !is_known(word)) {
        bail!("there is no kind or family '{unknown}'");
    }
    if options.models.is_some() && !options.is_fresh && words.is_empty() {
        return Ok(vec![]);
    }
    let is_chosen = |kind: &Kind| words.is_empty() || words.iter().any(|w| w == kind.name || w == kind.family.name());
    let all = if options.is_fresh { kinds::fresh() } else { kinds::all() };
    let mut rng = SplitMix64::new(options.seed);
    let sized = all.iter().map(|kind| (kind, size(kind, options.is_quick, &mut rng)));
    Ok(sized.filter(|(kind, _)| is_chosen(kind)).collect())
}

/// The files of the folder of `--models`, by name.
fn model_files(options: &Options) -> Result<Vec<PathBuf>> {
    let Some(folder) = &options.models else { return Ok(vec![]) };
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<PathBuf>>>()?;
    let mut files: Vec<PathBuf> = paths.into_iter().filter(|path| path.is_file()).collect();
    files.sort();
    Ok(files)
}

/// The number of triangles asked of a kind.
fn size(kind: &Kind, is_quick: bool, rng: &mut SplitMix64) -> usize {
    let drawn = rng.unit();
    if is_quick {
        return SIZE[1];
    }
    if kind.family == Family::Fresh {
        return between_sizes(drawn);
    }
    let ordinary: Vec<&str> =
        kinds::all().iter().filter(|kind| kind.family == Family::Ordinary).map(|kind| kind.name).collect();
    // Steps of seven, coprime to their number, so that neighbors of one kind of geometry differ in size.
    let place = ordinary.iter().position(|name| *name == kind.name).map(|place| place * 7 % ordinary.len());
    place.map_or(SIZE[0], |place| between_sizes(place as f64 / (ordinary.len() - 1) as f64))
}

/// The size at a fraction of the range of ordinary sizes, in geometric progression.
fn between_sizes(fraction: f64) -> usize {
    let [least, greatest] = ORDINARY_SIZES;
    (least * (greatest / least).powf(fraction)).round() as usize
}

/// Rays of each kind, and with `--quick`.
const N_RAYS: [usize; 2] = [65_536, 16_384];

/// What files of others are called where kinds have a family.
pub(super) const MODELS: &str = "models";

/// A scene, ready for measuring.
pub(super) struct Subject {
    pub(super) name: String,
    family: &'static str,
    pub(super) model: Model,
    n_triangles: usize,
    pub(super) sets: Vec<(RayKind, Vec<Ray>)>,
}

impl Subject {
    /// Generates the scene and its rays.
    pub(super) fn generated(kind: &'static Kind, size: usize, options: &Options) -> Result<Self> {
        Self::new(kind.name.to_owned(), kind.family.name(), kind.generate(size, options.seed), options)
    }

    /// Reads a file as one mesh.
    fn of_file(path: &Path, options: &Options) -> Result<Self> {
        let (positions, triangles, _) = canted_renderer::flatten(&canted_scene::read(path)?)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Self::new(name, MODELS, Scene::of_mesh(Mesh { positions, triangles }), options)
    }

    fn new(name: String, family: &'static str, scene: Scene, options: &Options) -> Result<Self> {
        let n_rays = N_RAYS[usize::from(options.is_quick)];
        let rays = |kind| scene.rays(kind, n_rays, options.seed).iter().map(models::ray).collect();
        let sets = RayKind::ALL.map(|kind| (kind, rays(kind))).into();
        Ok(Self { name, family, n_triangles: scene.n_triangles(), sets, model: model(scene)? })
    }

    /// Builds every engine and traces every set, on this thread.
    pub(super) fn measure(&self, options: &Options) -> Result<Measured> {
        let entries = entries(&self.model, options);
        // Repeated even with `--quick`: the first build of a small scene measures the start of threads.
        let (engines, built): (Vec<_>, Vec<_>) = engine::build_all(&entries, true)?.into_iter().unzip();
        let sets = self.sets.iter().map(|(kind, rays)| Set::measure(*kind, rays, &engines, options.rounds)).collect();
        let engines = entries.iter().map(|entry| entry.name.clone()).zip(built).collect();
        Ok(Measured {
            name: self.name.clone(),
            family: self.family,
            n_triangles: self.n_triangles,
            engines,
            sets,
            checks: vec![],
        })
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

/// The measurements of one set of rays; vectors are in the order of the engines.
pub(super) struct Set {
    pub(super) kind: RayKind,
    pub(super) n_rays: usize,
    pub(super) seconds: Vec<Vec<Seconds>>,
    pub(super) answers: Vec<Answers>,
}

impl Set {
    fn measure(kind: RayKind, rays: &[Ray], engines: &[Box<dyn Engine>], rounds: usize) -> Self {
        let (seconds, answers) = engine::answers(engines, rays, rounds, kind == RayKind::Occlusion);
        Self { kind, n_rays: rays.len(), seconds, answers }
    }
}

/// All measurements of one scene.
pub(super) struct Measured {
    pub(super) name: String,
    /// Of kinds the name of their family; else [`MODELS`].
    pub(super) family: &'static str,
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
    let stage = |stage: &Stage| json!({ "stage": stage.name, "seconds": stage.seconds, "serial_seconds": stage.serial_seconds });
    for (i, (name, built)) in measured.engines.iter().enumerate() {
        let sets = measured
            .sets
            .iter()
            .map(|set| json!({ "rays": set.kind.name(), "n": set.n_rays, "cpu_s": engine::cpu(&set.seconds[i]) }));
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
            "kind": measured.name,
            "family": measured.family,
            "seed": seed,
            "triangles": measured.n_triangles,
            "engine": name,
            "bytes": built.n_bytes,
            "build_one_thread_s": built.one_thread,
            "build_two_threads_s": built.two_threads,
            "stages": built.stages.iter().map(stage).collect::<Vec<_>>(),
            "sets": sets.collect::<Vec<_>>(),
            "check": check,
        }))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(args: &str) -> Options {
        Options::read(args.split_whitespace().map(str::to_owned)).unwrap()
    }

    #[test]
    fn kinds_are_chosen_by_name_and_by_family() {
        let names =
            |args: &str| -> Vec<&str> { chosen(&options(args)).unwrap().iter().map(|(kind, _)| kind.name).collect() };
        assert_eq!(names("kinds").len(), 50);
        assert_eq!(names("kinds --scenes gears,far"), ["gears", "far_1e4", "far_1e6", "far_1e7"]);
        assert!(chosen(&options("kinds --scenes gears,sponza")).unwrap_err().to_string().contains("'sponza'"));
    }

    #[test]
    fn fresh_kinds_have_drawn_sizes() {
        let drawn = |args: &str| chosen(&options(args)).unwrap();
        let [first, again, other] = ["kinds --fresh 5", "kinds --fresh 5", "kinds --fresh 6"].map(drawn);
        let sizes = |chosen: &[(&Kind, usize)]| chosen.iter().map(|&(_, size)| size).collect::<Vec<_>>();
        assert!(first.len() >= 8 && first.iter().all(|(kind, _)| kind.family == Family::Fresh));
        assert_eq!(sizes(&first), sizes(&again));
        assert_ne!(sizes(&first), sizes(&other));
        assert!(sizes(&first).iter().all(|size| (40_000..=1_000_000).contains(size)));
        assert!(drawn("kinds --models cars").is_empty());
    }

    #[test]
    fn ordinary_sizes_cover_the_range_once_each() {
        let all = chosen(&options("kinds --scenes ordinary")).unwrap();
        let mut sizes: Vec<usize> = all.iter().map(|&(_, size)| size).collect();
        sizes.sort_unstable();
        assert_eq!((sizes[0], sizes[sizes.len() - 1]), (40_000, 1_000_000));
        assert!(sizes.windows(2).all(|pair| pair[0] < pair[1]), "{sizes:?}");
        assert!(chosen(&options("kinds --quick")).unwrap().iter().all(|&(_, size)| size == SIZE[1]));
    }
}
