//! `canted render`: a picture, and what it took.

mod camera;
mod checkpoint;
mod exposure;
mod facts;
mod film;
mod look;
mod samples;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_renderer::{
    Film, Integrator, Measure, Picture, Record, Settings, Surfaces, heatmap, light_hash, scene_hash, write_exr,
    write_film, write_png,
};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;
use clap::ValueEnum;
use serde_json::json;

use crate::{
    Outcome,
    device::{DeviceArg, Machine},
    left_out,
    light::LightArgs,
    load::{self, Inputs},
    memory,
    options::{self, FilterArg, IntegratorArg, LodArg, StructureArgs, with_kernel},
    output::{self, Named},
};
use camera::CameraArgs;
use checkpoint::Keeper;
pub(crate) use checkpoint::difference;
use facts::Fact;
use film::Maker;
pub(crate) use look::{Looked, look};
use samples::SampleArgs;

/// Options of `canted render`.
#[derive(clap::Args, Clone)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF, GLB, or a scene file in TOML; the built-in one without it.
    pub(crate) scene: Option<PathBuf>,
    /// Seconds into the file's first animation; the pose that the file has without it.
    #[arg(long, value_parser = options::number, value_name = "SECONDS", requires = "scene", allow_hyphen_values = true)]
    pub(crate) time: Option<f32>,
    /// The picture: `.png` (sRGB) or `.exr` (linear).
    #[arg(short, long, default_value = "canted.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Pixels, as 1280x720.
    #[arg(long, value_parser = options::size, default_value = "1280x720", value_name = "WxH", allow_hyphen_values = true)]
    pub(crate) size: [u32; 2],
    #[command(flatten)]
    samples: SampleArgs,
    /// How light around the middle of a pixel is weighed.
    #[arg(long, value_enum, default_value_t = FilterArg::Box, value_name = "FILTER")]
    filter: FilterArg,
    /// How much of a texture a lookup averages: the texels about a point, a square, or the ellipse that is seen.
    #[arg(long, value_enum, default_value_t = LodArg::Aniso, value_name = "LOD")]
    lod: LodArg,
    /// Which light is gathered: `hybrid` is fast and approximate, `path` computes what materials and lights say.
    #[arg(long, value_enum, default_value_t = IntegratorArg::Hybrid, value_name = "INTEGRATOR")]
    integrator: IntegratorArg,
    /// Bounces after the surface that the camera sees: 2 for `hybrid`, 32 for `path` without it.
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=4096), value_name = "N")]
    bounces: Option<u32>,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    #[command(flatten)]
    pub(crate) structure: StructureArgs,
    /// World-space distance over which cut-off bounces' light returns beside an occluder, for `hybrid`; `inf` for none, a tenth of
    /// the scene's diagonal without it.
    #[arg(long, value_parser = options::radius, value_name = "LENGTH", allow_hyphen_values = true)]
    ao_radius: Option<f32>,
    /// Show what primary rays cost instead of light.
    #[arg(long, value_enum, value_name = "TESTS")]
    heatmap: Option<HeatmapArg>,
    /// Tests shown in the brightest colour of a heat map; a wide node counts as eight boxes.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), default_value_t = 128, requires = "heatmap", value_name = "N")]
    heatmap_scale: u32,
    /// What computes: `auto` takes a GPU where there is one that knows the scene, else the CPU; `cpu`; `gpu` the best adapter;
    /// `both` shares the tiles out between CPU and GPU, and is the CPU alone where the only adapter is software; `both:NAME` shares
    /// with this one; else a part of an adapter's name, which `canted devices` lists.
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: DeviceArg,
    /// Number of threads; all processors without it.
    #[arg(long, value_parser = options::threads, value_name = "N")]
    threads: Option<usize>,
    /// Chooses the random numbers.
    #[arg(long, default_value_t = 0, value_name = "N", allow_hyphen_values = true)]
    seed: u32,
    /// Print the facts about the run as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(ValueEnum, Clone, Copy)]
enum HeatmapArg {
    Boxes,
    Triangles,
}

impl Args {
    /// What `canted` alone does.
    pub(crate) fn built_in() -> Self {
        let settings = Settings::default();
        Self {
            scene: None,
            time: None,
            output: "canted.png".into(),
            size: [settings.width, settings.height],
            samples: SampleArgs::defaults(),
            filter: FilterArg::Box,
            lod: LodArg::Aniso,
            bounces: None,
            camera: CameraArgs::default(),
            integrator: IntegratorArg::Hybrid,
            light: LightArgs::default(),
            structure: StructureArgs::defaults(),
            ao_radius: None,
            heatmap: None,
            heatmap_scale: 128,
            device: DeviceArg::Auto,
            threads: None,
            seed: settings.seed,
            json: false,
        }
    }

    /// What is read.
    pub(crate) fn inputs(&self) -> Result<Inputs> {
        let inputs = Inputs::of(self.scene.as_deref())?;
        Ok(match self.light.environment_file() {
            Some((image, ..)) => inputs.and("--env", image),
            None => inputs,
        })
    }

    pub(crate) fn settings(&self) -> Result<Settings> {
        let [width, height] = self.size;
        let Self { seed, ao_radius, .. } = *self;
        let (filter, lod) = (self.filter.filter(), self.lod.lod());
        let integrator = self.integrator.integrator();
        if ao_radius.is_some() && integrator != Integrator::Hybrid {
            return Err(anyhow!("--ao-radius is of the hybrid integrator alone"));
        }
        let bounces = self.bounces.unwrap_or(integrator.bounces());
        let mut settings =
            Settings { width, height, integrator, filter, lod, bounces, seed, ao_radius, ..Settings::default() };
        self.samples.apply(&mut settings)?;
        Ok(settings)
    }

    /// What decides the value of a sample, by name; `device` does by its roundings.
    fn record(&self, scene: &Scene, camera: &Camera, settings: &Settings, device: String) -> Record {
        let own = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("scene", format!("{:016x}", scene_hash(scene))),
            ("light", format!("{:016x}", light_hash(scene))),
            ("triangles", format!("{:?}", self.structure.triangles).to_lowercase()),
            ("device", device),
        ];
        // The camera last: it may be another for another size.
        let camera = ("camera", format!("{camera:?}"));
        let named = |(name, value): (&str, String)| (name.to_owned(), value);
        own.map(named).into_iter().chain(settings.record()).chain([named(camera)]).collect()
    }
}

/// Whether a file's name says EXR.
pub(crate) fn is_exr(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"))
}

/// Whether a file's name says PNG.
pub(crate) fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

/// Tells of names of files that are no pictures, and of options that the picture has no room for.
fn check_output(args: &Args) -> Result<()> {
    let path = &args.output;
    if !is_exr(path) && !is_png(path) {
        return Err(anyhow!("{}: pictures end in .png or .exr", path.display()));
    }
    args.samples.check(is_exr(path), args.heatmap.is_some())
}

/// What was made.
enum Made {
    Picture(Picture),
    Film(Film, Record),
}

impl Made {
    fn write(&self, args: &Args) -> Result<()> {
        match self {
            Self::Film(film, record) if film.part().is_some() || !film.guides().is_empty() => {
                write_film(&args.output, film, args.samples.aovs(), record)?;
                Ok(())
            }
            Self::Film(film, _) => write_picture(&args.output, &film.picture()),
            Self::Picture(picture) => write_picture(&args.output, picture),
        }
    }
}

fn write_picture(path: &Path, picture: &Picture) -> Result<()> {
    Ok(if is_exr(path) { write_exr(path, picture) } else { write_png(path, picture) }?)
}

/// What was made, what it took, and the checkpoint that is of no more use once it is written.
struct Run {
    made: Made,
    facts: Vec<Fact>,
    keeper: Option<Keeper>,
}

/// Renders the picture.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    options::use_threads(args.threads)?;
    check_output(args)?;
    let checkpoint = args.samples.checkpoint.as_deref().map(|path| ("--checkpoint", path));
    let outputs: Vec<Named> = [("--output", args.output.as_path())].into_iter().chain(checkpoint).collect();
    output::check_distinct(&args.inputs()?.named(), &outputs)?;
    args.settings()?;
    let machine = machine(args)?;
    // A place that cannot be written is told before the work.
    output::probe(&args.output)?;
    let start = Instant::now();
    let mut scene = load::scene_at(args.scene.as_deref(), args.time)?;
    let default_light = args.light.apply(&mut scene)?;
    let load_time = start.elapsed();
    let run = with_kernel!(args.structure.triangles, trace(&mut scene, args, &machine, default_light, load_time))?;
    let written = run.made.write(args);
    if let Some(keeper) = run.keeper {
        // A picture that finds no place, on a full disk say, is not to be made once more.
        if written.is_ok() { keeper.remove()? } else { keeper.save() }
    }
    written?;
    let mut facts = vec![
        ("scene", json!(load::name(args.scene.as_deref()))),
        ("picture", json!(args.output.display().to_string())),
        ("size", json!(args.size)),
    ];
    facts.extend(run.facts);
    if let Some(bytes) = memory::peak_bytes() {
        facts.push(("peak_memory_bytes", json!(bytes)));
    }
    facts.push(("seconds", json!(start.elapsed().as_secs_f64())));
    facts::report(&facts, args.json)?;
    Ok(Outcome::Done)
}

/// Opens what computes the picture.
fn machine(args: &Args) -> Result<Machine> {
    match (args.heatmap, &args.device) {
        (None, device) => device.open(),
        (Some(_), DeviceArg::Auto | DeviceArg::Cpu) => Ok(Machine::Cpu),
        (Some(_), _) => Err(anyhow!("--heatmap shows the tests of the CPU: use --device cpu")),
    }
}

fn trace<K: LaneKernel>(
    scene: &mut Scene,
    args: &Args,
    machine: &Machine,
    default_light: bool,
    load_time: Duration,
) -> Result<Run> {
    let Looked { prepared, camera, default_light } = look::<K>(scene, args, default_light)?;
    let settings = args.settings()?;
    let mut facts = facts::built(scene, &prepared, load_time);
    facts.extend(default_light.map(|strength| ("default_light", json!(strength))));
    let scene: &Scene = scene;
    let start = Instant::now();
    let mut keeper = None;
    let made = if let Some(measure) = args.heatmap {
        let measure = match measure {
            HeatmapArg::Boxes => Measure::Boxes,
            HeatmapArg::Triangles => Measure::Triangles,
        };
        let surfaces = Surfaces::new(scene);
        let map = heatmap(&surfaces, &prepared.structure, &camera, args.size, measure, args.heatmap_scale)?;
        let [boxes, triangles] = map.mean();
        facts.push(("box_tests_per_ray", json!(boxes)));
        facts.push(("triangle_tests_per_ray", json!(triangles)));
        Made::Picture(map.picture)
    } else {
        let surfaces = machine.gpu().map(|_| Surfaces::with_lod(scene, settings.lod));
        let maker = Maker::new(machine, args, surfaces.as_ref(), &prepared.structure, &camera, &settings)?;
        let needs_record = settings.part.is_some() || args.samples.checkpoint.is_some();
        let record = if needs_record { args.record(scene, &camera, &settings, maker.device()) } else { Record::new() };
        let mut done = Vec::new();
        if let Some(path) = &args.samples.checkpoint {
            let interval = Duration::from_secs(args.samples.checkpoint_every.into());
            let (opened, tiles) = Keeper::open(path.clone(), interval, &of_tiles(&record, &settings))?;
            (keeper, done) = (Some(opened), tiles);
        }
        let (film, of_device) = maker.film(scene, &prepared, &camera, (args, &settings), keeper.as_ref(), done)?;
        facts.extend(of_device);
        facts.extend(facts::of_film(&film, &settings, start.elapsed()));
        if let Some(warning) = facts::of_dropped(&film) {
            output::to_stderr(&warning);
        }
        Made::Film(film, record)
    };
    facts.push(("trace_seconds", json!(start.elapsed().as_secs_f64())));
    facts.push(("threads", json!(rayon::current_num_threads())));
    facts.push(("left_out", left_out::json(&prepared.left_out, args.heatmap.is_some())));
    Ok(Run { made, facts, keeper })
}

/// The record of a checkpoint: what its tiles are sums of, too.
fn of_tiles(record: &Record, settings: &Settings) -> Record {
    let noise = settings.noise.map_or_else(|| "none".to_owned(), |noise| noise.to_string());
    let own = [
        ("samples", format!("{:?}", settings.range())),
        ("is part", settings.part.is_some().to_string()),
        ("noise", noise),
        ("aovs", settings.aovs.to_string()),
        ("tile", settings.tile.to_string()),
    ];
    record.iter().cloned().chain(own.map(|(name, value)| (name.to_owned(), value))).collect()
}
