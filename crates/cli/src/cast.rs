//! `canted cast`: traces rays from a file.

#[cfg(feature = "gpu")]
mod gpu;
mod hits;
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
    device::{Machine, RunArgs},
    load,
    options::{self, StructureArgs, with_kernel},
    output::{self, Named},
};
use hits::Answer;

/// Options of `canted cast`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Scene: OBJ, PLY, STL, OFF, glTF, GLB, or a scene file (.toml).
    scene: PathBuf,
    /// Time in the first animation of the file [default: rest pose]
    #[arg(long, value_parser = options::number, value_name = "SECONDS", allow_hyphen_values = true)]
    time: Option<f32>,
    /// Animation of the file, by name or by number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX", requires = "time")]
    animation: Option<String>,
    /// Rays in world space: .csv (ox,oy,oz,dx,dy,dz,tmax) or .bin (seven little-endian f32 per ray). tmax is in units of the
    /// direction's length.
    #[arg(long, value_name = "FILE")]
    rays: PathBuf,
    /// Output file for hits: .csv (t,prim,u,v,instance) or .bin (f32 t, i32 prim, f32 u, f32 v). t is in units of the
    /// direction's length; prim is -1 for a miss.
    #[arg(long, value_name = "FILE")]
    hits: PathBuf,
    /// Test for occlusion only: prim is 0 for a hit and -1 for a miss.
    #[arg(long)]
    occluded: bool,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    structure: StructureArgs,
}

/// Traces all rays.
pub(crate) fn run(args: &Args) -> Result<()> {
    let format = hits::Format::of(&args.hits)?;
    let inputs = load::Inputs::of(Some(&args.scene))?.and("--rays", &args.rays);
    let outputs: [Named; 1] = [("--hits", &args.hits)];
    output::check_distinct(&inputs.named(), &outputs)?;
    let machine = args.run.start()?;
    let rays = rays::read(&args.rays)?;
    let scene = load::scene(Some(&args.scene), args.time, args.animation.as_deref())?;
    load::check_outputs(Some(&args.scene), &scene, &outputs)?;
    output::probe(&args.hits)?;
    let (answers, seconds) = with_kernel!(args.structure.triangles, trace(&scene, &rays, args, &machine))?;
    let mut out = AtomicFile::create(&args.hits)?;
    out.write(|out| hits::write(out, format, &answers))?;
    out.finish()?;
    report(&answers, seconds, args)
}

/// Reports the number of rays and the time: as a note on standard error, or as JSON on standard output.
fn report(answers: &[Answer], seconds: f64, args: &Args) -> Result<()> {
    let n_rays = answers.len();
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    let rate = n_rays as f64 / seconds.max(1e-9);
    if !args.run.json {
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

/// All answers, and the seconds spent tracing.
#[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "the CPU is the only machine"))]
fn trace<K: LaneKernel>(scene: &Scene, rays: &[Ray], args: &Args, machine: &Machine) -> Result<(Vec<Answer>, f64)> {
    let Prepared { structure, .. } = prepare::<K>(scene, &args.structure.config(scene)?)
        .map_err(|error| anyhow!("{}: {error}", args.scene.display()))?;
    let on_cpu = |ray: &Ray| {
        if args.occluded {
            return if structure.occluded(ray, &mut ()) { Answer::OCCLUDED } else { Answer::MISS };
        }
        structure.closest_hit(ray, &mut ()).map_or(Answer::MISS, |Hit { t, u, v, primitive, instance, .. }| {
            Answer::hit([t, u, v], primitive.0, instance.0, scene)
        })
    };
    #[cfg(feature = "gpu")]
    if let Some(traced) = gpu::trace(machine, scene, &structure, rays, args, on_cpu)? {
        return Ok(traced);
    }
    let start = Instant::now();
    let answers = rays.par_iter().map(on_cpu).collect();
    Ok((answers, start.elapsed().as_secs_f64()))
}
