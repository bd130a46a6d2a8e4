//! `canted render`: a picture, and what it took.

mod facts;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_renderer::{
    Film, Measure, Picture, Prepared, RenderError, Settings, Surfaces, WritePictureError, frame, heatmap, prepare,
    render, write_exr, write_png,
};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::{
    Outcome, interrupt,
    light::{self, LightArgs},
    load, memory,
    options::{self, FilterArg, SamplerArg, StructureArgs, with_kernel},
    output,
};
use facts::Fact;

/// Options of `canted render`.
#[derive(clap::Args, Clone)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF or GLB; the built-in one without it.
    scene: Option<PathBuf>,
    /// The picture: `.png` (sRGB) or `.exr` (linear).
    #[arg(short, long, default_value = "canted.png", value_name = "FILE")]
    output: PathBuf,
    /// Pixels, as 1280x720.
    #[arg(long, value_parser = options::size, default_value = "1280x720", value_name = "WxH")]
    size: [u32; 2],
    /// Samples per pixel.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_048_576), default_value_t = 16, value_name = "N")]
    spp: u32,
    /// How the samples of a pixel are spread.
    #[arg(long, value_enum, default_value_t = SamplerArg::Stratified, value_name = "PATTERN")]
    sampler: SamplerArg,
    /// How light around the middle of a pixel is weighed.
    #[arg(long, value_enum, default_value_t = FilterArg::Box, value_name = "FILTER")]
    filter: FilterArg,
    /// Diffuse bounces after the surface that the camera sees.
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=4096), default_value_t = 2, value_name = "N")]
    bounces: u32,
    /// Where the camera stands.
    #[arg(long, value_parser = options::triple, value_name = "X,Y,Z", allow_hyphen_values = true)]
    eye: Option<[f32; 3]>,
    /// What it looks at.
    #[arg(long, value_parser = options::triple, value_name = "X,Y,Z", allow_hyphen_values = true)]
    target: Option<[f32; 3]>,
    /// What points up in the picture.
    #[arg(long, value_parser = options::triple, value_name = "X,Y,Z", allow_hyphen_values = true)]
    up: Option<[f32; 3]>,
    /// Vertical field of view in degrees.
    #[arg(long, value_parser = options::fov, value_name = "DEG")]
    fov: Option<f32>,
    #[command(flatten)]
    light: LightArgs,
    #[command(flatten)]
    structure: StructureArgs,
    /// World-space distance over which cut-off bounces' light returns beside an occluder; `inf` for none.
    #[arg(long, value_parser = options::radius, value_name = "LENGTH", allow_hyphen_values = true)]
    ao_radius: Option<f32>,
    /// Show what primary rays cost instead of light.
    #[arg(long, value_enum, value_name = "TESTS")]
    heatmap: Option<HeatmapArg>,
    /// Tests shown in the brightest colour of a heat map; a wide node counts as eight boxes.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), default_value_t = 128, value_name = "N")]
    heatmap_scale: u32,
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
            output: "canted.png".into(),
            size: [settings.width, settings.height],
            spp: settings.samples,
            sampler: SamplerArg::Stratified,
            filter: FilterArg::Box,
            bounces: settings.bounces,
            eye: None,
            target: None,
            up: None,
            fov: None,
            light: LightArgs::default(),
            structure: StructureArgs::defaults(),
            ao_radius: None,
            heatmap: None,
            heatmap_scale: 128,
            threads: None,
            seed: settings.seed,
            json: false,
        }
    }

    fn settings(&self) -> Settings {
        let [width, height] = self.size;
        Settings {
            width,
            height,
            samples: self.spp,
            pattern: self.sampler.pattern(),
            filter: self.filter.filter(),
            bounces: self.bounces,
            seed: self.seed,
            ao_radius: self.ao_radius,
            ..Settings::default()
        }
    }
}

/// Writes a picture in one format.
type Write = fn(&Path, &Picture) -> Result<(), WritePictureError>;

/// How a picture is written, by the file's ending.
fn writer(path: &Path) -> Result<Write> {
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
        "png" => Ok(write_png),
        "exr" => Ok(write_exr),
        _ => Err(anyhow!("{}: pictures end in .png or .exr", path.display())),
    }
}

/// What was made, beside the picture.
struct Run {
    picture: Picture,
    facts: Vec<Fact>,
}

/// Renders the picture.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    options::use_threads(args.threads)?;
    let write = writer(&args.output)?;
    // A place that cannot be written is told before the work.
    drop(output::Whole::create(&args.output)?);
    let start = Instant::now();
    let mut scene = load::scene(args.scene.as_deref())?;
    let default_light = args.light.apply(&mut scene)?;
    let load_time = start.elapsed();
    let run = with_kernel!(args.structure.triangles, trace(&mut scene, args, default_light, load_time))?;
    write(&args.output, &run.picture)?;
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
    facts::report(&facts, args.json);
    Ok(Outcome::Done)
}

fn trace<K: LaneKernel>(scene: &mut Scene, args: &Args, default_light: bool, load_time: Duration) -> Result<Run> {
    let name = load::name(args.scene.as_deref());
    let prepared: Prepared<K> = prepare(scene, &args.structure.config()).map_err(|error| anyhow!("{name}: {error}"))?;
    let mut facts = facts::built(scene, &prepared, load_time);
    let camera = camera(scene, &prepared, args);
    if default_light && args.heatmap.is_none() {
        let strength = strength_of_default_light(scene, &prepared, &camera, &args.settings())?;
        light::set_default(scene, strength);
        facts.push(("default_light", json!(strength)));
    }
    let scene: &Scene = scene;
    let start = Instant::now();
    let picture = if let Some(measure) = args.heatmap {
        let measure = match measure {
            HeatmapArg::Boxes => Measure::Boxes,
            HeatmapArg::Triangles => Measure::Triangles,
        };
        let surfaces = Surfaces::new(scene);
        let map = heatmap(&surfaces, &prepared.structure, &camera, args.size, measure, args.heatmap_scale)?;
        let [boxes, triangles] = map.mean();
        facts.push(("box_tests_per_ray", json!(boxes)));
        facts.push(("triangle_tests_per_ray", json!(triangles)));
        map.picture
    } else {
        let film = film(scene, &prepared, &camera, &args.settings())?;
        #[expect(clippy::cast_precision_loss, reason = "rays are fewer than 2^53")]
        let rate = film.n_rays() as f64 / start.elapsed().as_secs_f64();
        facts.extend([
            ("samples_per_pixel", json!(args.spp)),
            ("bounces", json!(args.bounces)),
            ("rays", json!(film.n_rays())),
            ("rays_per_second", json!(rate)),
            ("dropped_samples", json!(film.n_dropped())),
        ]);
        if film.n_dropped() > 0 {
            output::to_stderr(&format!("warning: {} samples were not finite and were dropped", film.n_dropped()));
        }
        film.picture()
    };
    facts.push(("trace_seconds", json!(start.elapsed().as_secs_f64())));
    facts.push(("threads", json!(rayon::current_num_threads())));
    let left_out: Vec<Value> =
        prepared.left_out.iter().map(|left| json!({ "part": left.part, "because": left.because })).collect();
    facts.push(("left_out", json!(left_out)));
    Ok(Run { picture, facts })
}

/// By how much our own light must be stronger for a picture that is not dark, as interiors lit by a sky are.
///
/// A small picture tells; light only scales it.
fn strength_of_default_light<K: LaneKernel>(
    scene: &Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    settings: &Settings,
) -> Result<f32> {
    /// Mean radiance of a well exposed picture, and the least and greatest strength.
    const MEAN: f64 = 0.3;
    const LIMITS: (f64, f64) = (1.0, 32.0);
    let [width, height] = [settings.width, settings.height].map(|side| side.min(64));
    let probe = Settings { width, height, samples: 16, ..*settings };
    let film = render(scene, &prepared.structure, camera, &probe, &|_, _| {}, interrupt::flag())?;
    let sum: f64 = film.pixels().iter().flat_map(|pixel| pixel.mean()).sum();
    let mean = sum / f64::from(3 * width * height);
    #[expect(clippy::cast_possible_truncation, reason = "a factor of light")]
    let strength = (MEAN / mean.max(f64::MIN_POSITIVE)).clamp(LIMITS.0, LIMITS.1) as f32;
    Ok(strength)
}

/// Renders with a progress bar.
fn film<K: LaneKernel>(
    scene: &Scene,
    prepared: &Prepared<K>,
    camera: &Camera,
    settings: &Settings,
) -> Result<Film, RenderError> {
    // Hidden by the library where standard error is no terminal.
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {elapsed} of about {duration}") {
        bar.set_style(style);
    }
    let progress = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let film = render(scene, &prepared.structure, camera, settings, &progress, interrupt::flag());
    bar.finish_and_clear();
    film
}

/// The camera of the options, else of the file, else one that frames the scene.
fn camera<K: LaneKernel>(scene: &Scene, prepared: &Prepared<K>, args: &Args) -> Camera {
    let [width, height] = args.size;
    let mut camera = match scene.cameras.first() {
        Some(camera) => *camera,
        None => frame(scene, &prepared.structure, f64::from(width) / f64::from(height)),
    };
    if let Some(eye) = args.eye {
        // An eye without a target looks at the middle of the scene.
        #[expect(clippy::cast_possible_truncation, reason = "the middle of f32 numbers")]
        let center = scene.bounds_world().center().map(|x| x as f32);
        camera = Camera { eye, target: center, up: [0.0, 1.0, 0.0], ..camera };
    }
    if let Some(target) = args.target {
        camera.target = target;
    }
    if let Some(up) = args.up {
        camera.up = up;
    }
    if let Some(fov) = args.fov {
        camera.fov_degrees = fov;
    }
    camera
}
