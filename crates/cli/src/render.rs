//! `canted render`: a picture of a scene, and a report.

mod args;
mod camera;
mod checkpoint;
mod exposure;
mod facts;
mod film;
mod frames;
#[cfg(feature = "gpu")]
mod gpu;
mod samples;
mod setup;

use std::{
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Film, Record, write_exr, write_film, write_png};
use canted_renderer::{MipMaps, Prepared, Surfaces, heatmap};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;
use serde_json::json;

use crate::{
    device::{DeviceArg, Machine},
    load, memory, not_needed,
    options::{self, with_kernel},
    output::{self, Named},
};
pub(crate) use args::Args;
use args::checkpoint_record;
use checkpoint::CheckpointWriter;
pub(crate) use checkpoint::difference;
use facts::Fact;
pub(crate) use facts::dropped_samples;
use film::{CpuRenderer, FilmRenderer};
pub(crate) use setup::{Setup, setup};

/// A rendered picture or film.
enum Output {
    Picture(canted_film::Picture),
    Film(Film, Record),
}

impl Output {
    fn write(&self, args: &Args) -> Result<()> {
        match self {
            Self::Film(film, record) if film.part().is_some() || !film.guides().is_empty() => {
                Ok(write_film(&args.output, film, args.samples.aovs(), record)?)
            }
            Self::Film(film, _) => write_picture(&args.output, &film.picture()),
            Self::Picture(picture) => write_picture(&args.output, picture),
        }
    }
}

fn is_exr(path: &Path) -> bool {
    output::has_extension(path, "exr")
}

fn write_picture(path: &Path, picture: &canted_film::Picture) -> Result<()> {
    Ok(if is_exr(path) { write_exr(path, picture) } else { write_png(path, picture) }?)
}

/// What rendering returns. The checkpoint is removed once the output is written.
struct Rendered {
    output: Output,
    facts: Vec<Fact>,
    checkpoint: Option<CheckpointWriter>,
}

impl Rendered {
    /// Writes the output, then removes the checkpoint. Returns the facts.
    fn write(self, args: &Args) -> Result<Vec<Fact>> {
        let written = self.output.write(args);
        if let Some(checkpoint) = self.checkpoint {
            // If the output cannot be written, the next run continues from the checkpoint.
            if written.is_ok() { checkpoint.remove()? } else { checkpoint.save() }
        }
        written.map(|()| self.facts)
    }
}

/// Renders the picture, or the pictures of all frames.
pub(crate) fn run(args: &Args) -> Result<()> {
    options::use_threads(args.run.threads)?;
    if !is_exr(&args.output) && !output::has_extension(&args.output, "png") {
        return Err(output::unsupported(&args.output, ".png or .exr"));
    }
    args.samples.check(is_exr(&args.output), args.heatmap.is_some())?;
    let checkpoint = args.samples.checkpoint.as_deref().map(|path| ("--checkpoint", path));
    let outputs: Vec<Named> = [("--output", args.output.as_path())].into_iter().chain(checkpoint).collect();
    output::check_distinct(&args.inputs()?.named(), &outputs)?;
    args.settings()?;
    if args.animation.is_some() && args.time.is_none() && args.sequence.frames.is_none() {
        return Err(anyhow!("--animation requires --time or --frames"));
    }
    let machine = open_machine(args)?;
    if let Some(range) = args.sequence.frames {
        return frames::run(args, range, &machine);
    }
    output::probe(&args.output)?;
    let start = Instant::now();
    let mut scene = load::scene(args.scene.as_deref(), args.time, args.animation.as_deref())?;
    load::check_outputs(args.scene.as_deref(), &scene, &outputs)?;
    let has_default_light = args.light.apply(&mut scene)?;
    let load_time = start.elapsed();
    let rendered =
        with_kernel!(args.structure.triangles, render(&mut scene, args, &machine, has_default_light, load_time))?;
    let of_render = rendered.write(args)?;
    let mut facts = vec![
        ("scene", json!(load::name(args.scene.as_deref()))),
        ("picture", json!(args.output.display().to_string())),
        ("size", json!(args.size)),
    ];
    facts.extend(of_render);
    facts.extend(memory::peak_bytes().map(|bytes| ("peak_memory_bytes", json!(bytes))));
    facts.push(("seconds", json!(start.elapsed().as_secs_f64())));
    facts::report(&facts, args.run.json)
}

fn open_machine(args: &Args) -> Result<Machine> {
    match (args.heatmap, &args.run.device) {
        (None, device) => Machine::open(device),
        (Some(_), DeviceArg::Auto | DeviceArg::Cpu) => Ok(Machine::Cpu),
        (Some(_), _) => Err(anyhow!("--heatmap is not supported on the GPU; use --device cpu")),
    }
}

fn render<K: LaneKernel>(
    scene: &mut Scene,
    args: &Args,
    machine: &Machine,
    has_default_light: bool,
    load_time: Duration,
) -> Result<Rendered> {
    let Setup { prepared, camera, default_light } = setup::<K>(scene, args, has_default_light)?;
    let mut rendered = render_picture(scene, args, machine, &prepared, &camera, default_light, &mut None)?.rendered;
    rendered.facts.push(("load_seconds", json!(load_time.as_secs_f64())));
    Ok(rendered)
}

/// A rendered picture.
struct Picture {
    rendered: Rendered,
    /// Time of rays and shading.
    trace_time: Duration,
}

/// Renders a scene that is ready, with the mip maps of the frame before, if there is one; leaves those of this frame.
#[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "the CPU is the only machine"))]
fn render_picture<K: LaneKernel>(
    scene: &Scene,
    args: &Args,
    machine: &Machine,
    prepared: &Prepared<K>,
    camera: &Camera,
    default_light: Option<f32>,
    mip_maps: &mut Option<MipMaps>,
) -> Result<Picture> {
    let settings = args.settings()?;
    let mut facts = facts::of_structure(scene, prepared);
    facts.extend(default_light.map(|strength| ("default_light", json!(strength))));
    let start = Instant::now();
    let mut checkpoint = None;
    let output = if let Some(measure) = args.heatmap {
        let surfaces = Surfaces::new(scene);
        let map = heatmap(&surfaces, &prepared.structure, camera, args.size, measure, args.heatmap_scale)?;
        let [boxes, triangles] = map.mean();
        facts.push(("box_tests_per_ray", json!(boxes)));
        facts.push(("triangle_tests_per_ray", json!(triangles)));
        Output::Picture(map.picture)
    } else {
        let (structure, settings) = (&prepared.structure, &settings);
        let surfaces = match &mip_maps {
            Some(known) => Surfaces::with_mip_maps(scene, settings.lod, known),
            None => Surfaces::with_lod(scene, settings.lod),
        };
        *mip_maps = Some(surfaces.mip_maps());
        #[cfg(feature = "gpu")]
        let on_gpu = match machine.has_gpu() {
            true => gpu::GpuRenderer::new(machine, args, &surfaces, structure, camera, settings)?,
            false => None,
        };
        #[cfg(not(feature = "gpu"))]
        let on_gpu: Option<CpuRenderer<K>> = None;
        let on_cpu = CpuRenderer { surfaces: &surfaces, structure, camera, settings };
        let renderer: &dyn FilmRenderer = on_gpu.as_ref().map_or(&on_cpu, |on_gpu| on_gpu as &dyn FilmRenderer);
        let needs_record = settings.part.is_some() || args.samples.checkpoint.is_some();
        let record = if needs_record { args.record(scene, camera, settings, renderer.device()) } else { Record::new() };
        let mut done = Vec::new();
        if let Some(path) = &args.samples.checkpoint {
            let interval = Duration::from_secs(args.samples.checkpoint_every.into());
            let (opened, tiles) =
                CheckpointWriter::open(path.clone(), interval, &checkpoint_record(&record, settings))?;
            (checkpoint, done) = (Some(opened), tiles);
        }
        let (film, of_device) = film::render(renderer, args, settings, checkpoint.as_ref(), done)?;
        facts.extend(of_device);
        facts.extend(facts::of_film(&film, settings, start.elapsed()));
        if let Some(warning) = facts::dropped_samples(&film) {
            output::warn(&warning);
        }
        Output::Film(film, record)
    };
    let trace_time = start.elapsed();
    facts.push(("trace_seconds", json!(trace_time.as_secs_f64())));
    facts.push(("threads", json!(rayon::current_num_threads())));
    facts.push(("not_needed", not_needed::json(&prepared.unused, args.heatmap.is_some())));
    Ok(Picture { rendered: Rendered { output, facts, checkpoint }, trace_time })
}
