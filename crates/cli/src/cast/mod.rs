//! `canted cast`: traces rays from a file.

mod files;
mod lines;
mod tiles;

use std::{
    cell::OnceCell,
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
#[cfg(feature = "gpu")]
use canted_gpu::{DeviceHit, Gpu, Outcome, TracedScene, block_on};
#[cfg(feature = "gpu")]
use canted_renderer::{DeviceError, traced_scene};
use canted_renderer::{PrepareError, SceneBvh, SceneBvhConfig};
use canted_scene::{ReadOptions, Scene};
use canted_trace::{Hit, Intersect as _, Ray};
use rayon::prelude::*;
use serde_json::json;

#[cfg(feature = "gpu")]
use crate::device::{built_or, named};
use crate::{
    device::{Machine, RunArgs},
    load::{self, FileArgs},
    options::{self, Form as _, Given, Structure, StructureOptions, one_of},
    output::{self, Named},
    settings::{self, SceneSettings},
};
use files::{Answer, Format};

/// Options of `canted cast`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  canted cast bunny.ply --rays rays.csv --hits hits.csv\n  \
                        scan | canted cast room.glb --rays - --hits - --format bin > hits.bin")]
pub(crate) struct Args {
    /// Scene: OBJ, PLY, STL, OFF, glTF, GLB, a scene file (.toml), lines: .hair, .tck, .trk, .pdb, .xyz, .gcode, or
    /// the folder of a store of `canted tiles`.
    scene: PathBuf,
    /// Time in the first animation of the file [default: rest pose]
    #[arg(long, value_parser = options::Finite::parse, value_name = "SECONDS", allow_hyphen_values = true)]
    time: Option<f32>,
    /// Animation of the file, by name or by number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX", requires = "time")]
    animation: Option<String>,
    #[command(flatten)]
    files: FileArgs,
    /// Memory of tiles that are held, of a store of `canted tiles`: bytes, with K, M, G or T for powers of 1024 [default: 2G]
    #[arg(long, value_name = "BYTES", value_parser = options::Bytes::parse)]
    memory: Option<u64>,
    /// Rays in world space: .csv (ox,oy,oz,dx,dy,dz,tmax) or .bin (seven little-endian f32 per ray). tmax is in units of the
    /// direction's length.
    /// `-` is standard input.
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    rays: PathBuf,
    /// Output file for hits: .csv (t,prim,u,v,instance) or .bin (f32 t, i32 prim, f32 u, f32 v). t is in units of the
    /// direction's length. prim counts the triangles of all instances, one instance after another, or the segments of lines; -1 is a miss. `-` is standard output.
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    hits: PathBuf,
    /// Format of rays and hits, in place of that of their file names; of `-`, csv.
    #[arg(long, value_parser = one_of(&[("csv", Format::Csv), ("bin", Format::Bin)]), value_name = "FORMAT")]
    format: Option<Format>,
    /// Test for occlusion only: prim is 0 for a hit and -1 for a miss.
    #[arg(long)]
    occluded: bool,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    structure: Given<StructureOptions>,
}

/// Traces all rays.
pub(crate) fn run(args: &Args) -> Result<()> {
    // Checked, but a cast takes nothing of them: they are about pictures.
    settings::scene_file(Some(&args.scene))?.as_ref().map(SceneSettings::of_file).transpose()?;
    let given = &args.structure.0;
    given.warn_ignored_preset(given);
    let structure = &given.resolve()?;
    let format = Format::of(&args.hits, args.format)?;
    if is_stream(&args.hits) && args.run.json {
        return Err(anyhow!("--hits - and --json both write to standard output; write the hits to a file"));
    }
    let mut inputs = load::Inputs::of(Some(&args.scene))?;
    if !is_stream(&args.rays) {
        inputs = inputs.and("--rays", &args.rays);
    }
    let outputs: Vec<Named> =
        Some(("--hits", args.hits.as_path())).into_iter().filter(|(_, path)| !is_stream(path)).collect();
    output::check_distinct(&inputs.named(), &outputs)?;
    args.run.start()?;
    let rays = files::read(&args.rays, args.format)?;
    if args.memory.is_some() && !args.scene.is_dir() {
        return Err(anyhow!("{}: --memory requires the folder of a store of `canted tiles`", args.scene.display()));
    }
    let (answers, cost) = if args.scene.is_dir() {
        if args.time.is_some() || args.files.line_radius.is_some() || args.files.point_radius.is_some() {
            return Err(anyhow!(
                "{}: --time, --line-radius and --point-radius are for scenes, not for tiles",
                args.scene.display()
            ));
        }
        if !is_stream(&args.hits) {
            output::probe(&args.hits)?;
        }
        let memory = args.memory.unwrap_or(2 << 30);
        tiles::trace(&args.scene, memory, &rays, args.occluded, structure, &args.run.device)?
    } else if args.is_about_lines()? {
        if !is_stream(&args.hits) {
            output::probe(&args.hits)?;
        }
        let options = args.read_options();
        lines::trace(&args.scene, &options, &rays, args.occluded, structure, &args.run.device)?
    } else {
        let scene = load::scene(Some(&args.scene), &args.read_options())?;
        load::check_outputs(Some(&args.scene), &scene, &outputs)?;
        if !is_stream(&args.hits) {
            output::probe(&args.hits)?;
        }
        let machine = Machine::open(&args.run.device, structure)?;
        trace(&scene, &rays, args, structure, &machine)?
    };
    if is_stream(&args.hits) {
        let mut bytes = Vec::new();
        files::write(&mut bytes, format, &answers)?;
        output::bytes_to_stdout(&bytes)?;
    } else {
        let mut out = AtomicFile::create(&args.hits)?;
        out.write(|out| files::write(out, format, &answers))?;
        out.finish()?;
    }
    report(&answers, cost, args)
}

/// What tracing all rays took.
#[derive(Clone, Copy)]
struct Cost {
    seconds: f64,
    /// On a GPU, the rays that exact arithmetic decided there.
    gpu_exact_rays: Option<u64>,
}

impl Args {
    fn read_options(&self) -> ReadOptions {
        self.files.read_options(self.time, self.animation.as_deref())
    }

    /// Whether the rays are traced against lines.
    ///
    /// # Errors
    /// Options that do not apply to the file.
    fn is_about_lines(&self) -> Result<bool> {
        let is_lines = canted_scene::is_lines(&self.scene);
        if is_lines && self.time.is_some() {
            return Err(anyhow!("{}: --time requires a file with an animation", self.scene.display()));
        }
        Ok(is_lines || !load::is_scene_file(&self.scene) && self.read_options().reads_lines())
    }
}

/// Whether a path stands for standard input or output.
fn is_stream(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Reports the number of rays and the time: as a note on standard error, or as JSON on standard output.
fn report(answers: &[Answer], Cost { seconds, gpu_exact_rays }: Cost, args: &Args) -> Result<()> {
    let n_rays = answers.len();
    let rate = n_rays as f64 / seconds.max(1e-9);
    if !args.run.json {
        if !output::is_quiet() {
            output::to_stderr(&format!("{n_rays} rays in {seconds:.3} s, {:.2} M rays/s", rate * 1e-6));
        }
        return Ok(());
    }
    let n_hits = answers.iter().filter(|answer| answer.is_hit()).count();
    let mut facts = json!({
        "hits_file": args.hits.display().to_string(),
        "rays": n_rays,
        "hits": n_hits,
        "trace_seconds": seconds,
        "rays_per_second": rate,
    });
    if let (Some(n), Some(facts)) = (gpu_exact_rays, facts.as_object_mut()) {
        facts.insert("gpu_exact_rays".to_owned(), n.into());
    }
    output::to_stdout(&facts.to_string())
}

/// All answers, and what tracing took.
fn trace(
    scene: &Scene,
    rays: &[Ray],
    args: &Args,
    structure: &Structure,
    machine: &Machine,
) -> Result<(Vec<Answer>, Cost)> {
    let config = SceneBvhConfig { on_device: machine.traces_on_gpu(), ..structure.config_for(scene) };
    let on_cpu = OnceCell::new();
    let bvh = || -> Result<&SceneBvh, PrepareError> {
        match on_cpu.get() {
            Some(bvh) => Ok(bvh),
            None => SceneBvh::build(scene, &config).map(|bvh| on_cpu.get_or_init(|| bvh)),
        }
    };
    // The CPU has nothing to build where a GPU builds for itself and completes all rays.
    #[cfg(feature = "gpu")]
    let of_gpu = match structure.built_on_gpu {
        Some(own) => on_gpu(machine, scene, rays, args, structure, |gpu| {
            built_or(gpu, scene, &config, own, || traced_scene(gpu, scene, bvh()?))
        })?,
        None => None,
    };
    #[cfg(feature = "gpu")]
    if let Some((answers, cost)) = &of_gpu
        && let Some(answers) = answers.iter().copied().collect::<Option<Vec<_>>>()
    {
        return Ok((answers, *cost));
    }
    let built = bvh().map_err(|error| anyhow!("{}: {error}", args.scene.display()))?;
    let on_cpu = |ray: &Ray| {
        if args.occluded {
            return if built.occluded(ray) { Answer::OCCLUDED } else { Answer::MISS };
        }
        built.closest_hit(ray).map_or(Answer::MISS, |Hit { t, u, v, primitive, instance, .. }| {
            Answer::hit([t, u, v], primitive.0, instance.0, scene)
        })
    };
    #[cfg(feature = "gpu")]
    {
        let traced = match of_gpu {
            Some(traced) => Some(traced),
            // After a fallback to the CPU, once is enough.
            None if structure.built_on_gpu.is_some() => None,
            None => on_gpu(machine, scene, rays, args, structure, |gpu| traced_scene(gpu, scene, built))?,
        };
        if let Some((answers, cost)) = traced {
            let start = Instant::now();
            let complete = |(ray, answer): (&Ray, Option<Answer>)| answer.unwrap_or_else(|| on_cpu(ray));
            let answers = rays.par_iter().zip(answers).map(complete).collect();
            let seconds = cost.seconds + start.elapsed().as_secs_f64();
            return Ok((answers, Cost { seconds, ..cost }));
        }
    }
    let start = Instant::now();
    let answers = rays.par_iter().map(on_cpu).collect();
    Ok((answers, Cost { seconds: start.elapsed().as_secs_f64(), gpu_exact_rays: None }))
}

/// Traces all rays; also returns what that took. Rays whose traversal the GPU does not complete have no answer. `None`
/// where the CPU traces all rays. `make` brings the scene to the GPU.
#[cfg(feature = "gpu")]
fn on_gpu(
    machine: &Machine,
    scene: &Scene,
    rays: &[Ray],
    args: &Args,
    structure: &Structure,
    make: impl FnOnce(&Gpu) -> Result<TracedScene, DeviceError>,
) -> Result<Option<(Vec<Option<Answer>>, Cost)>> {
    let ready = machine.ready(structure, make).map_err(|error| match error.downcast_ref() {
        Some(DeviceError::Prepare(of_scene)) => anyhow!("{}: {of_scene}", args.scene.display()),
        _ => error,
    })?;
    let Some((gpu, traced)) = ready else { return Ok(None) };
    let start = Instant::now();
    let hit = |hit: &Option<DeviceHit>| {
        hit.map_or(Answer::MISS, |DeviceHit { t, u, v, primitive, instance }| {
            Answer::hit([t, u, v], primitive, instance, scene)
        })
    };
    let occluded = |&is_hit: &bool| if is_hit { Answer::OCCLUDED } else { Answer::MISS };
    let answers = if args.occluded {
        block_on(traced.occluded(gpu, rays)).map(|found| completed(&found, occluded))
    } else {
        block_on(traced.closest_hits(gpu, rays)).map(|found| completed(&found, hit))
    };
    let answers = answers.map_err(|error| named(gpu, error.into()))?;
    let cost = Cost { seconds: start.elapsed().as_secs_f64(), gpu_exact_rays: Some(traced.n_exact_rays()) };
    Ok(Some((answers, cost)))
}

#[cfg(feature = "gpu")]
fn completed<T: Sync>(found: &[Outcome<T>], answer: impl Fn(&T) -> Answer + Sync) -> Vec<Option<Answer>> {
    let complete = |found: &Outcome<T>| match found {
        Outcome::Complete(found) => Some(answer(found)),
        Outcome::Incomplete => None,
    };
    found.par_iter().map(complete).collect()
}
