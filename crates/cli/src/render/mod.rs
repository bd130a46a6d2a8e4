//! `canted render`: a picture of a scene, and a report.
//!
//! ```text
//! Args -> Job (resolved once) -> scene, machine -> setup -> film -> output file, facts
//! ```

mod args;
mod facts;
mod film;
mod frames;
#[cfg(feature = "gpu")]
mod gpu;
mod output;
mod probes;
mod setup;

use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use canted_film::{Film, Record, Tile};
#[cfg(feature = "gpu")]
use canted_renderer::DeviceFrames;
use canted_renderer::{FirstHit, MipMaps, SampleSums, SceneBvh, Settings, Surfaces, heatmap, light_hash, scene_hash};
use canted_scene::{Camera, Scene};
use serde_json::json;

use crate::{
    camera,
    device::{DeviceArg, Machine},
    light::LightSource,
    load, options, output as print, process,
    settings::Plan,
};
use args::Job;
pub(crate) use args::{Args, DiagramArgs, aov, crop, factor, union};
use facts::Fact;
pub(crate) use facts::dropped_samples;
pub(crate) use facts::{not_needed, parts_text};
use film::{CheckpointWriter, CpuRenderer, FilmJob, FilmRenderer};
pub(crate) use film::{difference, next as next_pass, whole as whole_film};
use output::{Output, OutputFile, Overlay};
pub(crate) use output::{check_crop, denoised as denoised_film, no_boxes, tiles_outside};
pub(crate) use setup::{Choice, Setup, choose, decided, settle, setup, stage, staged};

/// What rendering returns. The checkpoint is removed once the output is written.
struct Rendered {
    output: Output,
    facts: Vec<Fact>,
    checkpoint: Option<CheckpointWriter>,
    overlay: Option<Overlay>,
}

impl Rendered {
    /// A warning about a picture that is nearly black; heat maps and parts of pictures may be.
    fn darkness(&self, file: &OutputFile) -> Option<String> {
        match &self.output {
            Output::Film(film, ..) if film.part().is_none() => probes::darkness(&file.cropped(film)),
            _ => None,
        }
    }

    /// Writes the output, then removes the checkpoint. Returns the facts.
    fn write(self, file: &OutputFile) -> Result<Vec<Fact>> {
        let written = file.write(self.output, self.overlay.as_ref());
        if let Some(checkpoint) = self.checkpoint {
            // If the output cannot be written, the next run continues from the checkpoint.
            if written.is_ok() { checkpoint.remove()? } else { checkpoint.save() }
        }
        written.map(|()| self.facts)
    }
}

/// Renders the picture, or the pictures of all frames.
pub(crate) fn run(args: Args) -> Result<()> {
    let job = args.job()?;
    options::use_threads(job.run.threads)?;
    match job.sequence.frames {
        Some(range) => frames::run(&job, range),
        None => one(job),
    }
}

/// Renders one picture.
fn one(mut job: Job) -> Result<()> {
    let is_replaced = job.output.probe()?;
    let start = Instant::now();
    let mut scene = read(&job)?;
    load::check_outputs(job.plan.source.scene.as_deref(), &scene, &job.outputs())?;
    let source = job.plan.apply_light(&mut scene)?;
    let load_time = start.elapsed();
    print::detail(|| format!("scene read in {:.3} s", load_time.as_secs_f64()));
    let machine = open_machine(&job)?;
    job = job.on(&machine);
    let rendered = render(&mut scene, &mut job, &machine, source)?;
    if let Some(warning) = rendered.darkness(&job.output) {
        print::warn(&warning);
    }
    let before_writing = Instant::now();
    let of_render = rendered.write(&job.output)?;
    let write_time = before_writing.elapsed();
    let mut facts = vec![
        ("scene", json!(load::name(job.plan.source.scene.as_deref()))),
        ("picture", json!(job.output.path.display().to_string())),
        ("replaced", json!(is_replaced)),
        ("size", json!(job.output.shown_size())),
    ];
    facts.extend(of_render);
    facts.push(("load_seconds", json!(load_time.as_secs_f64())));
    facts.push(("write_seconds", json!(write_time.as_secs_f64())));
    facts.extend(process::peak_bytes().map(|bytes| ("peak_memory_bytes", json!(bytes))));
    facts.push(("seconds", json!(start.elapsed().as_secs_f64())));
    if job.output.is_stream {
        return Ok(());
    }
    facts::report(&facts, job.run.json)
}

/// Reads the scene in its pose, or in those of a shutter that is open for some time.
fn read(job: &Job) -> Result<Scene> {
    let source = &job.plan.source;
    let (path, options) = (source.scene.as_deref(), source.read_options(source.time()));
    match (path, source.time().and_then(|time| job.sequence.shutter_times(time))) {
        (Some(path), Some(times)) => load::scene_in_shutter(path, times, &options),
        _ => load::scene(path, &options),
    }
}

/// Opens the device, after the scene is read: an invalid scene does not wait for drivers.
fn open_machine(job: &Job) -> Result<Machine> {
    let has_passes = job.passes.is_some() && job.run.device == DeviceArg::Auto;
    if job.plan.heatmap.is_some() || has_passes {
        return Ok(Machine::Cpu);
    }
    Machine::open(&job.run.device, &job.plan.structure)
}

fn render(scene: &mut Scene, job: &mut Job, machine: &Machine, source: LightSource) -> Result<Rendered> {
    let start = Instant::now();
    let Setup { bvh, camera, choice, mip_maps } = setup(scene, &mut job.plan, source)?;
    let choice_time = start.elapsed().saturating_sub(bvh.build_time);
    job.output.look = job.plan.look.clone();
    let view = Frame { scene, bvh: &bvh, camera: &camera, choice, label: "" };
    let mut last = LastFrame {
        mip_maps,
        #[cfg(feature = "gpu")]
        device: None,
    };
    let mut rendered = render_picture(&view, job, machine, &mut last)?.rendered;
    rendered.facts.push(("choice_seconds", json!(choice_time.as_secs_f64())));
    Ok(rendered)
}

/// A rendered picture.
struct Picture {
    rendered: Rendered,
    /// Time of rays and shading.
    trace_time: Duration,
}

/// What the picture of a frame leaves for the next one.
#[derive(Default)]
struct LastFrame {
    mip_maps: Option<MipMaps>,
    /// Only in a sequence.
    #[cfg(feature = "gpu")]
    device: Option<DeviceFrames>,
}

/// A scene that is ready to render.
struct Frame<'a> {
    scene: &'a Scene,
    bvh: &'a SceneBvh,
    camera: &'a Camera,
    choice: Choice,
    /// Stands before the progress bar.
    label: &'a str,
}

/// Renders a scene that is ready, with what the frame before left, if there is one; leaves the same of this frame.
fn render_picture(frame: &Frame, job: &Job, machine: &Machine, last: &mut LastFrame) -> Result<Picture> {
    let &Frame { scene, bvh, camera, choice, .. } = frame;
    let mut facts = facts::of_structure(scene, bvh);
    facts.extend(facts::of_view(scene, camera, &choice));
    if job.plan.heatmap.is_none() {
        facts.push(("integrator_reason", json!(choice.integrator_reason)));
    }
    let start = Instant::now();
    let (mut checkpoint, mut other_time) = (None, Duration::ZERO);
    let output = if let Some((measure, scale)) = job.plan.heatmap {
        let map = heatmap(&Surfaces::new(scene), bvh, camera, job.plan.size(), measure, scale)?;
        let [boxes, triangles] = map.mean();
        facts.push(("box_tests_per_ray", json!(boxes)));
        facts.push(("triangle_tests_per_ray", json!(triangles)));
        Output::Picture(map.picture)
    } else {
        let lod = job.plan.settings.lod;
        let surfaces = probes::surfaces(scene, lod, &mut last.mip_maps);
        #[cfg(feature = "gpu")]
        let device = last.device.as_mut();
        #[cfg(feature = "gpu")]
        let (on_gpu, prepared) = {
            let start = Instant::now();
            (gpu::GpuRenderer::new(machine, &job.plan, &surfaces, bvh, camera, device)?, start.elapsed())
        };
        #[cfg(feature = "gpu")]
        if on_gpu.is_some() {
            other_time += prepared;
            facts.push(("device_seconds", json!(prepared.as_secs_f64())));
        }
        #[cfg(not(feature = "gpu"))]
        let on_gpu: Option<CpuRenderer> = match machine {
            Machine::Cpu => None,
        };
        let cpu = CpuRenderer { surfaces: &surfaces, bvh, camera, settings: &job.plan.settings };
        let renderer: &dyn FilmRenderer = match &on_gpu {
            Some(on_gpu) => on_gpu,
            None => {
                check_for_cpu(job)?;
                &cpu
            }
        };
        let (film, record) = film_of(frame, job, renderer, &cpu, &mut facts, &mut checkpoint)?;
        let start = Instant::now();
        let denoised = job.output.denoised(&film)?;
        if denoised.is_some() {
            other_time += start.elapsed();
            facts.push(("denoise_seconds", json!(start.elapsed().as_secs_f64())));
        }
        Output::Film(Box::new(film), record, denoised)
    };
    let trace_time = start.elapsed() - other_time;
    let overlay = job.boxes.map(|level| Overlay::new(level, bvh, camera, job.plan.size())).transpose()?;
    facts.push(("trace_seconds", json!(trace_time.as_secs_f64())));
    facts.push(("threads", json!(rayon::current_num_threads())));
    facts.push(("not_needed", not_needed(&bvh.unused, job.plan.heatmap.is_some())));
    Ok(Picture { rendered: Rendered { output, facts, checkpoint, overlay }, trace_time })
}

/// Rejects what only GPUs do.
fn check_for_cpu(job: &Job) -> Result<()> {
    let plan = &job.plan;
    let sums_on_device = plan.settings.sums == SampleSums::Device && !job.chooses_sums;
    let needs_gpu = [
        ("--first-hit raster", plan.first_hit == FirstHit::Raster, "--first-hit auto"),
        ("--sums device", sums_on_device, "--sums host"),
    ];
    match needs_gpu.into_iter().find(|&(_, is_given, _)| is_given) {
        None => Ok(()),
        Some((option, _, other)) => {
            Err(anyhow!("{option} requires a GPU, and the CPU renders this picture; use --device gpu, or {other}"))
        }
    }
}

/// Renders a film, from a checkpoint and with one if they are requested. Returns its record as well.
fn film_of(
    frame: &Frame,
    job: &Job,
    renderer: &dyn FilmRenderer,
    cpu: &CpuRenderer,
    facts: &mut Vec<Fact>,
    checkpoint: &mut Option<CheckpointWriter>,
) -> Result<(Film, Record)> {
    let (start, settings) = (Instant::now(), &job.plan.settings);
    let needs_record = settings.part.is_some() || job.checkpoint.is_some();
    let record = if needs_record { record(frame, &job.plan, renderer.device()) } else { Record::new() };
    let mut done: Vec<Tile> = Vec::new();
    if let Some((path, interval)) = &job.checkpoint {
        let (opened, tiles) = CheckpointWriter::open(path.clone(), *interval, &checkpoint_record(&record, settings))?;
        (*checkpoint, done) = (Some(opened), tiles);
    }
    done.extend(job.output.outside(settings));
    let film_job = FilmJob {
        settings,
        output: &job.output,
        passes: job.passes.clone(),
        checkpoint: checkpoint.as_ref(),
        label: frame.label,
        is_frame: job.sequence.frames.is_some(),
        cpu,
    };
    let (film, of_device) = film::render(renderer, &film_job, done)?;
    facts.extend(of_device);
    let of_film = facts::of_film(&film, settings, start.elapsed(), facts);
    facts.extend(of_film);
    if let Some(warning) = facts::dropped_samples(&film) {
        print::warn(&warning);
    }
    Ok((film, record))
}

/// Everything that determines the value of a sample, by name. The device is included because devices round differently.
fn record(frame: &Frame, plan: &Plan, device: String) -> Record {
    let own = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("scene", format!("{:016x}", scene_hash(frame.scene))),
        ("light", format!("{:016x}", light_hash(frame.scene))),
        ("triangles", plan.structure.config.triangles.name().to_owned()),
        ("device", device),
    ];
    let named = |(name, value): (&str, String)| (name.to_owned(), value);
    // The camera is last: a camera that frames the scene depends on the size, which is the more useful difference.
    let of_camera = camera::record(frame.camera).map(named);
    own.map(named).into_iter().chain(plan.settings.record()).chain(of_camera).collect()
}

/// The record of a checkpoint, which also states what its tiles are sums of.
fn checkpoint_record(record: &Record, settings: &Settings) -> Record {
    let noise = settings.noise.map_or_else(|| "none".to_owned(), |noise| noise.to_string());
    let own = [
        ("samples", format!("{:?}", settings.range())),
        ("use", if settings.part.is_some() { "a part to merge" } else { "a picture" }.to_owned()),
        ("noise", noise),
        ("aovs", settings.aovs.to_string()),
        ("tile", settings.tile.to_string()),
    ];
    record.iter().cloned().chain(own.map(|(name, value)| (name.to_owned(), value))).collect()
}
