//! `canted cast`: batch ray queries.

mod hits;
mod on_device;
mod rays;

use std::{path::PathBuf, time::Instant};

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
use canted_renderer::{Prepared, Tracer, prepare};
use canted_scene::Scene;
use canted_trace::{Hit, Ray};
use canted_wide::LaneKernel;
use rayon::prelude::*;
use serde_json::json;

use crate::{
    Outcome,
    device::{DeviceArg, Machine},
    load,
    options::{self, StructureArgs, with_kernel},
    output::{self, Named},
};
use hits::Answer;

/// Options of `canted cast`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF, GLB, or a scene file in TOML.
    scene: PathBuf,
    /// Seconds into the file's first animation; the pose that the file has without it.
    #[arg(long, value_parser = options::number, value_name = "SECONDS", allow_hyphen_values = true)]
    time: Option<f32>,
    /// Rays, `.csv` (ox,oy,oz,dx,dy,dz,tmax, in this order) or `.bin` (seven little-endian f32 a ray): in world space, tmax in
    /// lengths of the direction.
    #[arg(long, value_name = "FILE")]
    rays: PathBuf,
    /// Hits to write, `.csv` (t,prim,u,v,instance) or `.bin` (f32 t, i32 prim, f32 u, f32 v); t in lengths of the ray's direction.
    #[arg(long, value_name = "FILE")]
    hits: PathBuf,
    /// Only ask whether anything is hit: prim is 0 where it is and -1 where not.
    #[arg(long)]
    occluded: bool,
    #[command(flatten)]
    structure: StructureArgs,
    /// What computes: `auto` takes a GPU where there is one that knows the scene, else the CPU; `cpu`; `gpu` the best adapter;
    /// else a part of an adapter's name, which `canted devices` lists.
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: DeviceArg,
    /// Number of threads; all processors without it.
    #[arg(long, value_parser = options::threads, value_name = "N")]
    threads: Option<usize>,
    /// Print the facts about the run as JSON.
    #[arg(long)]
    json: bool,
}

/// Answers all rays.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    options::use_threads(args.threads)?;
    let format = hits::Format::of(&args.hits)?;
    let inputs = load::Inputs::of(Some(&args.scene))?.and("--rays", &args.rays);
    let outputs: [Named; 1] = [("--hits", &args.hits)];
    output::check_distinct(&inputs.named(), &outputs)?;
    if matches!(args.device, DeviceArg::Both(_)) {
        return Err(anyhow!("--device both shares out tiles of pictures, not rays: use cpu, gpu or an adapter's name"));
    }
    let machine = args.device.open()?;
    let rays = rays::read(&args.rays)?;
    let scene = load::scene_at(Some(&args.scene), args.time)?;
    load::check_outputs(Some(&args.scene), &scene, &outputs)?;
    // A place that cannot be written is told before the work.
    output::probe(&args.hits)?;
    let (answers, seconds) = with_kernel!(args.structure.triangles, answer(&scene, &rays, args, &machine))?;
    let mut out = AtomicFile::create(&args.hits)?;
    out.write(|out| hits::write(out, format, &answers))?;
    out.finish()?;
    report(&answers, seconds, args)?;
    Ok(Outcome::Done)
}

/// Says how many rays were answered in how many seconds: people as a side note, programs as the result.
fn report(answers: &[Answer], seconds: f64, args: &Args) -> Result<()> {
    let n_rays = answers.len();
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    let rate = n_rays as f64 / seconds.max(1e-9);
    if !args.json {
        output::to_stderr(&format!("{n_rays} rays in {seconds:.3} s, {:.2} M rays/s", rate * 1e-6));
        return Ok(());
    }
    let n_hits = answers.iter().filter(|answer| answer.is_hit()).count();
    let facts = json!({
        "hits_file": args.hits.display().to_string(),
        "rays": n_rays,
        "hits": n_hits,
        "trace_seconds": seconds,
        "rays_per_second": rate,
    });
    output::to_stdout(&facts.to_string())
}

/// All answers, and the seconds that they took.
fn answer<K: LaneKernel>(scene: &Scene, rays: &[Ray], args: &Args, machine: &Machine) -> Result<(Vec<Answer>, f64)> {
    let Prepared { structure, .. } = prepare::<K>(scene, &args.structure.config(scene))
        .map_err(|error| anyhow!("{}: {error}", args.scene.display()))?;
    let on_cpu = |ray: &Ray| {
        if args.occluded {
            return if structure.occluded(ray, &mut ()) { Answer::OCCLUDED } else { Answer::MISS };
        }
        structure.closest_hit(ray, &mut ()).map_or(Answer::MISS, |Hit { t, u, v, primitive, instance, .. }| {
            let first = scene.instances[instance.0 as usize].first_primitive;
            Answer::hit([t, u, v], [first, primitive.0, instance.0])
        })
    };
    let traced = on_device::traced(machine, scene, &structure, args)?;
    let start = Instant::now();
    let answers = match (machine.gpu(), traced) {
        (Some(gpu), Some(traced)) => on_device::answers(gpu, &traced, scene, rays, args.occluded, on_cpu)
            .map_err(|error| machine.named(error.into()))?,
        _ => rays.par_iter().map(on_cpu).collect(),
    };
    Ok((answers, start.elapsed().as_secs_f64()))
}
