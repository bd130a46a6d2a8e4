//! `canted render`: a picture of a scene, and a report.

mod args;
mod camera;
mod checkpoint;
mod denoise;
mod exposure;
mod facts;
mod film;
mod frames;
#[cfg(feature = "gpu")]
mod gpu;
mod look;
mod overlay;
mod passes;
mod samples;
mod setup;

use std::{
    borrow::Cow,
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Film, Format, Record, Tile, encode, write_film_as};
#[cfg(feature = "gpu")]
use canted_renderer::DeviceFrames;
use canted_renderer::{FirstHit, MipMaps, Prepared, SampleSums, Settings, Surfaces, heatmap};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;
use serde_json::json;

use crate::{
    device::{DeviceArg, Machine},
    light::LightSource,
    load, memory, not_needed,
    options::{self, with_kernel},
    output::{self, Named},
};
pub(crate) use args::Args;
use args::checkpoint_record;
use checkpoint::CheckpointWriter;
pub(crate) use checkpoint::difference;
pub(crate) use denoise::denoised as denoised_film;
use facts::Fact;
pub(crate) use facts::dropped_samples;
use film::{CpuRenderer, FilmRenderer};
use look::LookArgs;
use overlay::Overlay;
pub(crate) use overlay::no_boxes;
pub(crate) use passes::{next as next_pass, whole as whole_film};
pub(crate) use setup::{Choice, Setup, choose, decided, setup};

/// A rendered picture or film.
enum Output {
    Picture(canted_film::Picture),
    /// A film, and its denoised picture.
    Film(Box<Film>, Record, Option<canted_film::Picture>),
}

impl Output {
    fn write(self, args: &Args, overlay: Option<&Overlay>) -> Result<()> {
        match self {
            Self::Film(film, record, denoised) => write(args, *film, denoised, &record, overlay),
            // A heat map is a diagram: its colors are not exposed.
            Self::Picture(picture) => write_encoded(args, picture, overlay),
        }
    }
}

/// Writes a film as it is so far.
fn show(args: &Args, film: Film) -> Result<()> {
    let denoised = denoised(args, &film)?;
    write(args, film, denoised, &Record::new(), None)
}

/// The denoised picture of a film, if it is requested.
fn denoised(args: &Args, film: &Film) -> Result<Option<canted_film::Picture>> {
    args.samples.denoise.then(|| denoise::denoised(film, args.crop)).transpose()
}

/// Writes the part of a film that is shown, or its denoised picture, and the requested channels.
///
/// Takes the film, so that its memory is free before the file is encoded.
fn write(
    args: &Args,
    film: Film,
    denoised: Option<canted_film::Picture>,
    record: &Record,
    overlay: Option<&Overlay>,
) -> Result<()> {
    let film = if args.crop.is_some() { cropped(&film, args.crop).into_owned() } else { film };
    let aovs = args.samples.aovs();
    if film.part().is_some() || !aovs.is_empty() {
        let mut picture = denoised.unwrap_or_else(|| film.picture());
        draw(args, &mut picture, overlay);
        return Ok(write_film_as(&args.output, &picture, &film, aovs, record)?);
    }
    write_picture(args, denoised.unwrap_or_else(|| film.into_picture()), overlay)
}

/// Draws boxes over the part of a picture that is shown.
fn draw(args: &Args, picture: &mut canted_film::Picture, overlay: Option<&Overlay>) {
    if let Some(overlay) = overlay {
        overlay.draw(picture, args.crop.map_or([0, 0], |[left, top, ..]| [left, top]));
    }
}

/// The part of a film that is shown.
fn cropped(film: &Film, crop: Option<[u32; 4]>) -> Cow<'_, Film> {
    crop.map_or(Cow::Borrowed(film), |[x, y, width, height]| Cow::Owned(film.cropped([x, y], [width, height])))
}

/// Writes a picture with the look of the options.
fn write_picture(args: &Args, picture: canted_film::Picture, overlay: Option<&Overlay>) -> Result<()> {
    let is_linear = args.format()?.is_linear();
    write_encoded(args, if is_linear { picture } else { args.look.apply(picture) }, overlay)
}

fn write_encoded(args: &Args, mut picture: canted_film::Picture, overlay: Option<&Overlay>) -> Result<()> {
    draw(args, &mut picture, overlay);
    let format = args.format()?;
    if args.is_stream() {
        let bytes = encode(&picture, format).map_err(|reason| anyhow!("cannot write standard output: {reason}"))?;
        return output::bytes_to_stdout(&bytes);
    }
    Ok(canted_film::write_picture(&args.output, &picture, format)?)
}

/// What rendering returns. The checkpoint is removed once the output is written.
struct Rendered {
    output: Output,
    facts: Vec<Fact>,
    checkpoint: Option<CheckpointWriter>,
    overlay: Option<Overlay>,
}

impl Rendered {
    /// A warning about a picture that is nearly black; heat maps and parts of pictures may be.
    fn darkness(&self, args: &Args) -> Option<String> {
        match &self.output {
            Output::Film(film, ..) if film.part().is_none() => exposure::darkness(&cropped(film, args.crop)),
            _ => None,
        }
    }

    /// Writes the output, then removes the checkpoint. Returns the facts.
    fn write(self, args: &Args) -> Result<Vec<Fact>> {
        let written = self.output.write(args, self.overlay.as_ref());
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
    let format = args.format()?;
    args.samples.check(format == Format::Exr, args.heatmap.is_some())?;
    if args.is_stream() {
        args.samples.check_stream()?;
        if args.run.json {
            return Err(anyhow!("-o - and --json both write to standard output; write the picture to a file"));
        }
    }
    let checkpoint = args.samples.checkpoint.as_deref().map(|path| ("--checkpoint", path));
    let picture = [("--output", args.output.as_path())].into_iter().filter(|_| !args.is_stream());
    let outputs: Vec<Named> = picture.chain(checkpoint).collect();
    output::check_distinct(&args.inputs()?.named(), &outputs)?;
    args.settings()?;
    args.check_crop()?;
    args.look.warn_ignored(format.is_linear());
    if args.animation.is_some() && args.time.is_none() && args.sequence.frames.is_none() {
        return Err(anyhow!("--animation requires --time or --frames"));
    }
    args.sequence.check_shutter(args.scene.as_deref(), args.time)?;
    check_device(args)?;
    if let Some(range) = args.sequence.frames {
        return frames::run(args, range);
    }
    if !args.is_stream() {
        output::probe(&args.output)?;
    }
    let start = Instant::now();
    let (path, options) = (args.scene.as_deref(), args.read_options(args.time));
    let mut scene = match (path, args.time.and_then(|time| args.sequence.shutter_times(time))) {
        (Some(path), Some(times)) => load::scene_in_shutter(path, times, &options)?,
        _ => load::scene_with(path, &options)?,
    };
    load::check_outputs(args.scene.as_deref(), &scene, &outputs)?;
    let source = args.light.apply(&mut scene)?;
    let load_time = start.elapsed();
    output::detail(|| format!("scene read in {:.3} s", load_time.as_secs_f64()));
    let machine = open_machine(args)?;
    let (rendered, look) =
        with_kernel!(args.structure.triangles, render(&mut scene, args, &machine, source, load_time))?;
    let args = &Args { look, ..args.clone() };
    if let Some(warning) = rendered.darkness(args) {
        output::warn(&warning);
    }
    let of_render = rendered.write(args)?;
    let mut facts = vec![
        ("scene", json!(load::name(args.scene.as_deref()))),
        ("picture", json!(args.output.display().to_string())),
        ("size", json!(args.output_size())),
    ];
    facts.extend(of_render);
    facts.extend(memory::peak_bytes().map(|bytes| ("peak_memory_bytes", json!(bytes))));
    facts.push(("seconds", json!(start.elapsed().as_secs_f64())));
    if args.is_stream() {
        return Ok(());
    }
    facts::report(&facts, args.run.json)
}

/// Rejects a heat map on a GPU, and sums of a device on the CPU.
fn check_device(args: &Args) -> Result<()> {
    if args.sums == SampleSums::Device && args.heatmap.is_none() && args.run.device == DeviceArg::Cpu {
        return Err(anyhow!("--sums device requires a GPU; use --device gpu, or --sums host"));
    }
    match (args.heatmap, &args.run.device) {
        (None, _) | (Some(_), DeviceArg::Auto | DeviceArg::Cpu) => Ok(()),
        (Some(_), _) => Err(anyhow!("--heatmap is not supported on the GPU; use --device cpu")),
    }
}

/// Opens the device, after the scene is read: an invalid scene does not wait for drivers.
fn open_machine(args: &Args) -> Result<Machine> {
    let has_passes = args.samples.has_passes() && args.run.device == DeviceArg::Auto;
    if args.heatmap.is_some() || has_passes {
        return Ok(Machine::Cpu);
    }
    Machine::open(&args.run.device, &args.structure)
}

fn render<K: LaneKernel>(
    scene: &mut Scene,
    args: &Args,
    machine: &Machine,
    source: LightSource,
    load_time: Duration,
) -> Result<(Rendered, LookArgs)> {
    let mut args = args.clone();
    let Setup { prepared, camera, choice } = setup::<K>(scene, &mut args, source)?;
    let mut last = LastFrame::default();
    let mut rendered = render_picture(scene, &args, machine, &prepared, &camera, choice, &mut last)?.rendered;
    rendered.facts.push(("load_seconds", json!(load_time.as_secs_f64())));
    Ok((rendered, args.look))
}

/// Empty tiles for all that a crop does not show and the filter does not read, so that they are not rendered.
fn outside(args: &Args, settings: &Settings) -> Vec<Tile> {
    let Some(crop) = args.crop else { return Vec::new() };
    let [left, top, width, height] = if args.samples.denoise { denoise::with_margin(crop, args.size) } else { crop };
    let tiling = settings.tiling();
    let is_shown = |number: usize| {
        let ([x, y], [columns, rows]) = (tiling.corner(number), tiling.size(number));
        x < left + width && left < x + columns && y < top + height && top < y + rows
    };
    (0..tiling.n_tiles()).filter(|&number| !is_shown(number)).map(|number| tiling.tile(number)).collect()
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

/// Renders a scene that is ready, with what the frame before left, if there is one; leaves the same of this frame.
#[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "the CPU is the only machine"))]
fn render_picture<K: LaneKernel>(
    scene: &Scene,
    args: &Args,
    machine: &Machine,
    prepared: &Prepared<K>,
    camera: &Camera,
    choice: Choice,
    last: &mut LastFrame,
) -> Result<Picture> {
    let settings = Settings { means_only: args.samples.needs_means_only(), ..args.settings()? };
    let mut facts = facts::of_structure(scene, prepared);
    facts.extend(choice.default_light.map(|strength| ("default_light", json!(strength))));
    facts.extend(choice.exposure.map(|stops| ("exposure", json!(stops))));
    if args.heatmap.is_none() {
        facts.push(("integrator_reason", json!(choice.integrator_reason)));
    }
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
        let surfaces = match &last.mip_maps {
            Some(known) => Surfaces::with_mip_maps(scene, settings.lod, known),
            None => Surfaces::with_lod(scene, settings.lod),
        };
        last.mip_maps = Some(surfaces.mip_maps());
        #[cfg(feature = "gpu")]
        let on_gpu = match machine.has_gpu() {
            true => gpu::GpuRenderer::new(machine, args, &surfaces, structure, camera, settings, last.device.as_mut())?,
            false => None,
        };
        #[cfg(not(feature = "gpu"))]
        let on_gpu: Option<CpuRenderer<K>> = None;
        if on_gpu.is_none() && args.first_hit == FirstHit::Raster {
            return Err(anyhow!(
                "--first-hit raster requires a GPU, and the CPU renders this picture; use --device gpu, or --first-hit auto"
            ));
        }
        if on_gpu.is_none() && args.sums == SampleSums::Device {
            return Err(anyhow!(
                "--sums device requires a GPU, and the CPU renders this picture; use --device gpu, or --sums host"
            ));
        }
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
        done.extend(outside(args, settings));
        let (film, of_device) = film::render(renderer, args, settings, checkpoint.as_ref(), done)?;
        facts.extend(of_device);
        let of_film = facts::of_film(&film, settings, start.elapsed(), &facts);
        facts.extend(of_film);
        if let Some(warning) = facts::dropped_samples(&film) {
            output::warn(&warning);
        }
        let start = Instant::now();
        let denoised = denoised(args, &film)?;
        if denoised.is_some() {
            facts.push(("denoise_seconds", json!(start.elapsed().as_secs_f64())));
        }
        Output::Film(Box::new(film), record, denoised)
    };
    let trace_time = start.elapsed();
    let overlay = Overlay::new(args, &prepared.structure, camera)?;
    facts.push(("trace_seconds", json!(trace_time.as_secs_f64())));
    facts.push(("threads", json!(rayon::current_num_threads())));
    facts.push(("not_needed", not_needed::json(&prepared.unused, args.heatmap.is_some())));
    Ok(Picture { rendered: Rendered { output, facts, checkpoint, overlay }, trace_time })
}
