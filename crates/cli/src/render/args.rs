//! Options of `canted render`, and what they come to.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Result, anyhow};
use canted_film::{Aov, Aovs, Format};
use canted_renderer::{BoxLevel, Measure, SampleSums, Settings, UpdatePolicy};
use clap::{
    ArgGroup,
    builder::{PossibleValuesParser, TypedValueParser},
};
use serde::{Deserialize, Serialize};

use super::{
    film::Passes,
    output::{Denoising, FEW_SAMPLES, GUIDES, OutputFile},
};
use crate::{
    device::{DeviceArg, Machine, RunArgs},
    load,
    options::{Finite, Form as _, Given, Positive, Value, Whole, named, one_of},
    output::{self, Named as NamedFile},
    settings::{self, MAX_SAMPLES, PICTURE, PictureArgs, Plan, Purpose, RENDERING},
};

/// Options of `canted render`.
pub(crate) type Args = PictureArgs<RenderArgs>;

/// Options of `canted render` about a run: its files, devices and reports.
#[derive(clap::Args, Clone)]
#[command(mut_arg("device", |arg| arg.help(DEVICE)))]
#[command(after_help = "Examples:\n  canted render helmet.glb -o helmet.png --size 1920x1080 --spp 64\n  \
                        canted render fox.glb --frames 0..48 -o fox_%04d.png --env studio.hdr\n\n\
                        Ctrl-C leaves a whole, noisier picture, or the frames that are finished; a second one ends at once without.")]
pub(crate) struct RenderArgs {
    /// Output image: .png, .jpg, .webp (sRGB), .hdr or .exr (linear); `-` is standard output. A file of this name is replaced
    /// [default: canted.png]
    #[arg(short, long, help_heading = PICTURE, display_order = 3, value_name = "FILE", allow_hyphen_values = true)]
    pub(crate) output: Option<PathBuf>,
    /// The output without --output.
    #[arg(skip = DEFAULT_OUTPUT)]
    pub(crate) default_output: PathBuf,
    /// Without --output, replace a file of the picture's name even if another program wrote it.
    #[arg(long, help_heading = PICTURE, display_order = 3)]
    force: bool,
    /// Format of the output, in place of that of its name [default: by the extension; png for -]
    #[arg(long, help_heading = PICTURE, display_order = 4, value_parser = one_of(&Format::ALL), value_name = "FORMAT")]
    format: Option<Format>,
    /// Render and write only a rectangle of the picture: left, top, width and height, in pixels of the whole picture.
    #[arg(long, help_heading = PICTURE, display_order = 6, value_parser = crop, value_name = "X,Y,W,H", allow_hyphen_values = true)]
    crop: Option<[u32; 4]>,
    #[command(flatten)]
    diagram: Given<DiagramArgs>,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    sequence: FrameArgs,
    #[command(flatten)]
    samples: SampleArgs,
    /// Where samples of a GPU are summed: `host` downloads each of them, `device` downloads one sum for each pixel, `auto` is
    /// `device` on a hardware GPU where that downloads fewer bytes, else `host`. Pictures have the same bits.
    #[arg(long, help_heading = RENDERING, display_order = 79, default_value = "auto", value_parser = sums(), value_name = "auto|host|device")]
    sums: Sums,
}

/// Where samples are summed; none for the better of both.
#[derive(Clone, Copy, Debug)]
struct Sums(Option<SampleSums>);

fn sums() -> impl TypedValueParser<Value = Sums> {
    let names = ["auto"].into_iter().chain(SampleSums::ALL.map(SampleSums::name));
    PossibleValuesParser::new(names).map(|name| Sums(SampleSums::ALL.into_iter().find(|sums| sums.name() == name)))
}

const DEVICE: &str = "Compute device: auto, cpu, gpu, both (CPU and GPU share the tiles), both:NAME, or part of an adapter \
                      name (see `canted devices`). `auto` uses a hardware GPU that supports the scene, else the CPU";

/// The output without `--output`.
const DEFAULT_OUTPUT: &str = "canted.png";

/// Options of what a picture shows of the acceleration structure.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = PICTURE, next_display_order = 10)]
pub(crate) struct DiagramArgs {
    /// Show the number of intersection tests per camera ray instead of light.
    #[arg(long, value_name = "TESTS")]
    pub(crate) heatmap: Option<Value<Measure>>,
    /// Number of tests shown in the brightest color of the heat map; a wide node counts as eight boxes.
    #[arg(long, default_value = "128", requires = "heatmap", value_name = "N")]
    pub(crate) heatmap_scale: Option<Value<Whole<1, { u32::MAX }>>>,
    /// Draw boxes of the acceleration structure over the picture: those of a level, 0 for the root, or of all leaves. Axis-aligned boxes are
    /// blue, oriented ones orange.
    #[arg(long, value_name = "LEVEL|leaves")]
    pub(crate) boxes: Option<Value<BoxLevel>>,
}

const HEATMAP_SCALE: u32 = 128;

impl DiagramArgs {
    /// What the heat map measures, and the tests of its brightest color.
    pub(crate) fn measure(&self) -> Option<(Measure, u32)> {
        Some((self.heatmap?.0, self.heatmap_scale.map_or(HEATMAP_SCALE, |scale| scale.0)))
    }

    /// The boxes that are drawn.
    pub(crate) fn boxes(&self) -> Option<BoxLevel> {
        self.boxes.map(|boxes| boxes.0)
    }
}

/// Options of `canted render` about samples.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = RENDERING, next_display_order = 50)]
pub(crate) struct SampleArgs {
    /// Render only the samples A to B-1 and store their exact sums in the EXR, for `canted merge`.
    #[arg(long, display_order = 41, value_parser = samples, value_name = "A..B", conflicts_with_all = ["noise", "boxes"], allow_hyphen_values = true)]
    samples: Option<[u32; 2]>,
    /// Render on the CPU in passes over the whole picture, and rewrite the output after each; Ctrl-C leaves the passes that are complete.
    #[arg(long, conflicts_with_all = ["samples", "noise", "checkpoint", "frames"])]
    preview: bool,
    /// Render on the CPU in passes for at most this time, up to --spp samples per pixel, if it is given. One sample is always taken.
    #[arg(long, value_parser = Positive::parse, value_name = "N", conflicts_with_all = ["samples", "noise", "checkpoint", "frames"])]
    seconds: Option<f32>,
    /// Additional EXR channels: depth, normal, shading-normal, albedo, instance, primitive, tests, or all; emission, direct and indirect are
    /// the light in parts, whose sum is the picture that is not denoised; with the integrator hybrid, diffuse and shadow, ambient and
    /// occlusion are the light at the first surface and the parts of it that arrive.
    #[arg(long, value_parser = aov, value_delimiter = ',', value_name = "LIST")]
    aovs: Vec<Aovs>,
    /// Remove noise with a filter guided by albedo, normals and depth: on or off; other channels are not filtered [default: on below 64
    /// samples per pixel in formats of 8 bits, up to 2^24 pixels, else off]
    #[arg(long, value_parser = named::<bool>(), num_args = 0..=1, default_missing_value = "on", value_name = "on|off")]
    denoise: Option<bool>,
    /// Checkpoint file: continue from it if it exists, update it while rendering, remove it when the picture is written.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Time between checkpoint updates in seconds.
    #[arg(long, default_value_t = 60, requires = "checkpoint", value_name = "SECONDS")]
    checkpoint_every: u32,
}

/// Options about frames.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Frames", next_display_order = 30, group = ArgGroup::new("timed").args(["frames", "shutter"]).multiple(true))]
pub(crate) struct FrameArgs {
    /// Render the frames A to B-1, frame N at N / FPS seconds of the animation. --output requires a field for the frame number,
    /// e.g. frame_%04d.png.
    #[arg(long, value_parser = frames, value_name = "A..B", conflicts_with = "time", allow_hyphen_values = true)]
    pub(super) frames: Option<[u32; 2]>,
    /// Frames per second.
    #[arg(long, default_value = "24", value_parser = rate, requires = "timed", value_name = "N", allow_hyphen_values = true)]
    fps: f64,
    /// Open the shutter A to B frames after the time of the picture, e.g. 0..0.5: what the animation moves or deforms is
    /// blurred. Requires --time or --frames.
    #[arg(long, value_parser = interval, requires = "scene", value_name = "A..B", allow_hyphen_values = true)]
    shutter: Option<[f64; 2]>,
    /// Turn the camera around its target by DEGREES in the course of all frames, counter-clockwise seen from above.
    #[arg(long, value_parser = Finite::parse, requires = "frames", value_name = "DEGREES", allow_hyphen_values = true)]
    pub(super) turntable: Option<f32>,
    /// Keep frames whose pictures exist and are whole.
    #[arg(long, requires = "frames")]
    pub(super) resume: bool,
    /// How BVHs follow moving triangles. `auto` refits until a rebuild pays for itself.
    #[arg(long, default_value = "auto", value_parser = named::<UpdatePolicy>(), requires = "frames", value_name = "POLICY")]
    pub(super) update: UpdatePolicy,
}

/// A picture to render, or the pictures of a sequence: options that are checked and agree with each other.
#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) plan: Plan,
    pub(super) output: OutputFile,
    pub(super) sequence: FrameArgs,
    pub(super) run: RunArgs,
    pub(super) boxes: Option<BoxLevel>,
    /// Whether samples are summed where it is faster.
    pub(super) chooses_sums: bool,
    /// Rendering in passes, if it is requested.
    pub(super) passes: Option<Passes>,
    /// A file of finished tiles, and the time between its updates.
    pub(super) checkpoint: Option<(PathBuf, Duration)>,
}

impl Args {
    /// Checks the options and resolves them. Warns about options without effect.
    ///
    /// # Errors
    /// Options that contradict each other or the scene file, or outputs that would replace an input.
    pub(super) fn job(self) -> Result<Job> {
        let RenderArgs {
            output,
            default_output,
            force,
            format,
            crop,
            diagram: Given(diagram),
            run,
            sequence,
            samples,
            sums,
        } = self.own.clone();
        let keeps_others = output.is_none() && !force;
        let path = output.unwrap_or(default_output);
        let is_stream = path.as_os_str() == "-";
        let by_name = || if is_stream { Some(Format::Png) } else { Format::of_path(&path) };
        let format = format.or_else(by_name).ok_or_else(|| unsupported(&path))?;
        let heatmap = diagram.measure();
        let file = settings::scene_file(self.source.scene.as_deref())?;
        let purpose = Purpose {
            part: samples.samples,
            has_time_limit: samples.seconds.is_some(),
            aovs: samples.shown(),
            factor: factor(&samples.aovs),
            heatmap,
            is_linear: format.is_linear(),
            shows_data: !samples.aovs.is_empty() || diagram.measure().is_some() || diagram.boxes().is_some(),
        };
        let ignored = heatmap.map(|_| {
            let sums = (sums.0 == Some(SampleSums::Device)).then_some("sums");
            settings::ignored_by_heatmap(&self, sums)
        });
        let given = self.structure.0.clone();
        let mut plan = self.resolve(file.as_ref(), &purpose)?;
        plan.options.structure.warn_ignored_preset(&given);
        let denoising = samples.denoising(&plan.settings, &purpose);
        if matches!(denoising, Denoising::OfFewSamples | Denoising::On) {
            plan.settings.aovs = GUIDES.into_iter().fold(plan.settings.aovs, Aovs::with);
        }
        let has_noise = plan.settings.noise.is_some();
        let passes = (samples.preview || samples.seconds.is_some()).then(|| Passes {
            // A time that exceeds the type is no limit.
            budget: samples.seconds.map(|time| Duration::try_from_secs_f32(time).unwrap_or(Duration::MAX)),
            is_shown: samples.preview && !is_stream,
        });
        if plan.is_transparent() && !format.has_alpha() {
            return Err(anyhow!("--background transparent requires a .png, .webp or .exr output"));
        }
        if plan.is_transparent() && samples.samples.is_some() {
            return Err(anyhow!("--background transparent and --samples cannot be used together"));
        }
        samples.check(&purpose, format == Format::Exr, has_noise)?;
        if let Some(ignored) = ignored.filter(|ignored| !ignored.is_empty()) {
            output::warn(&format!("--heatmap ignores {}", ignored.join(", ")));
        }
        if is_stream {
            samples.check_stream()?;
            if run.json {
                return Err(anyhow!("-o - and --json both write to standard output; write the picture to a file"));
            }
        }
        plan.settings.sums = sums.0.unwrap_or_default();
        plan.settings.means_only = passes.is_none();
        let every = Duration::from_secs(samples.checkpoint_every.into());
        let job = Job {
            output: OutputFile {
                path,
                format,
                is_stream,
                keeps_others,
                crop,
                size: plan.size(),
                aovs: samples.shown(),
                denoising,
                is_transparent: plan.is_transparent(),
                look: plan.look.clone(),
            },
            plan,
            sequence,
            run,
            boxes: diagram.boxes(),
            chooses_sums: sums.0.is_none(),
            passes,
            checkpoint: samples.checkpoint.clone().map(|path| (path, every)),
        };
        output::check_distinct(&job.plan.inputs()?.named(), &job.outputs())?;
        job.output.check_crop()?;
        if crop.is_some() {
            samples.check_crop()?;
        }
        job.plan.look.warn_ignored(format.is_linear());
        job.check_times()?;
        job.check_device()?;
        Ok(job)
    }
}

impl Job {
    /// The files that are written, but for those of frames.
    pub(super) fn outputs(&self) -> Vec<NamedFile<'_>> {
        let picture = [("--output", self.output.path.as_path())].into_iter().filter(|_| !self.output.is_stream);
        picture.chain(self.checkpoint_file()).collect()
    }

    /// The checkpoint.
    pub(super) fn checkpoint_file(&self) -> Option<NamedFile<'_>> {
        self.checkpoint.as_ref().map(|(path, _)| ("--checkpoint", path.as_path()))
    }

    /// The job with leaves for the machine, and samples summed where that is faster, unless the options say where.
    pub(super) fn on(&self, machine: &Machine) -> Self {
        let mut job = self.clone();
        // Boxes that are drawn are the same on every machine.
        job.plan.structure.config.on_device = machine.traces_on_gpu() && self.boxes.is_none();
        let settings = &mut job.plan.settings;
        if self.chooses_sums && machine.has_bus() {
            settings.sums = SampleSums::of_fewer_bytes(settings);
        }
        job
    }

    /// Rejects options of times that contradict each other.
    fn check_times(&self) -> Result<()> {
        let source = &self.plan.source;
        if source.animation.is_some() && source.time.is_none() && self.sequence.frames.is_none() {
            return Err(anyhow!("--animation requires --time or --frames"));
        }
        self.sequence.check_shutter(source.scene.as_deref(), source.time())
    }

    /// Rejects a heat map on a GPU, and sums of a device on the CPU.
    fn check_device(&self) -> Result<()> {
        let is_heatmap = self.plan.heatmap.is_some();
        match &self.run.device {
            DeviceArg::Cpu if !is_heatmap && self.plan.settings.sums == SampleSums::Device => {
                Err(anyhow!("--sums device requires a GPU; use --device gpu, or --sums host"))
            }
            DeviceArg::Auto | DeviceArg::Cpu => Ok(()),
            _ if is_heatmap => Err(anyhow!("--heatmap is not supported on the GPU; use --device cpu")),
            _ => Ok(()),
        }
    }
}

impl SampleArgs {
    /// Rejects options that the output format or a heat map does not support.
    fn check(&self, purpose: &Purpose, is_exr: bool, has_noise: bool) -> Result<()> {
        let given = [
            ("--samples", self.samples.is_some(), true),
            ("--aovs", !self.aovs.is_empty(), true),
            ("--noise", has_noise, false),
            ("--checkpoint", self.checkpoint.is_some(), false),
            ("--denoise", self.denoise == Some(true), false),
            ("--preview", self.preview, false),
            ("--seconds", self.seconds.is_some(), false),
        ];
        for (name, _, needs_exr) in given.into_iter().filter(|&(_, is_given, _)| is_given) {
            if purpose.heatmap.is_some() {
                return Err(anyhow!("{name} and --heatmap cannot be used together"));
            }
            if needs_exr && !is_exr {
                return Err(anyhow!("{name} requires an .exr output"));
            }
            if has_noise && ["--preview", "--seconds"].contains(&name) {
                return Err(anyhow!("{name} and --noise, which the scene file sets, cannot be used together"));
            }
        }
        if self.denoise == Some(true) && self.samples.is_some() {
            return Err(anyhow!(
                "--denoise and --samples cannot be used together; render the parts with --aovs albedo and use canted merge --denoise"
            ));
        }
        Ok(())
    }

    /// Rejects options that need a file.
    fn check_stream(&self) -> Result<()> {
        self.reject(!self.aovs.is_empty(), "requires an output file, not -")
    }

    /// Rejects options that need the whole picture.
    fn check_crop(&self) -> Result<()> {
        self.reject(false, "and --crop cannot be used together")
    }

    fn reject(&self, has_aovs: bool, reason: &str) -> Result<()> {
        let given =
            [("--samples", self.samples.is_some()), ("--aovs", has_aovs), ("--checkpoint", self.checkpoint.is_some())];
        match given.into_iter().find(|&(_, is_given)| is_given) {
            None => Ok(()),
            Some((name, _)) => Err(anyhow!("{name} {reason}")),
        }
    }

    /// The additional channels that are written.
    fn shown(&self) -> Aovs {
        union(&self.aovs)
    }

    /// Whether the picture is denoised.
    fn denoising(&self, settings: &Settings, purpose: &Purpose) -> Denoising {
        /// Pixels up to which pictures are denoised without an option: what guides the filter takes 300 bytes of each.
        const MOST_PIXELS: u64 = 1 << 24;
        let n_pixels = u64::from(settings.width) * u64::from(settings.height);
        let is_picture = n_pixels <= MOST_PIXELS && !purpose.is_linear && purpose.heatmap.is_none();
        // The first passes have few samples, too.
        let may_have_few = purpose.has_time_limit || self.preview || settings.samples < FEW_SAMPLES;
        match self.denoise {
            Some(true) => Denoising::On,
            None if is_picture && may_have_few => Denoising::OfFewSamples,
            None if is_picture => Denoising::IfStopped,
            Some(false) | None => Denoising::Off,
        }
    }
}

/// A channel of light at the first surface that lists name; `all` names none.
pub(crate) fn factor(lists: &[Aovs]) -> Option<Aov> {
    let all: Aovs = Aov::ALL.into_iter().collect();
    let mut named = lists.iter().filter(|list| **list != all).flat_map(|list| list.iter());
    named.find(|aov| Aov::FACTORS.contains(aov))
}

/// All channels of lists.
pub(crate) fn union(lists: &[Aovs]) -> Aovs {
    lists.iter().flat_map(|aovs| aovs.iter()).collect()
}

impl FrameArgs {
    /// Time of a frame in seconds: that of `--time N/FPS`, so the quotient is rounded once.
    pub(super) fn time(&self, frame: u32) -> f32 {
        (f64::from(frame) / self.fps) as f32
    }

    /// How far the camera has turned at a frame.
    pub(super) fn degrees(&self, frame: u32) -> f64 {
        match (self.turntable, self.frames) {
            (Some(degrees), Some([first, end])) => {
                f64::from(degrees) * (f64::from(frame - first) / f64::from(end - first))
            }
            _ => 0.0,
        }
    }

    /// Times in seconds as the shutter opens and as it closes, for the picture of a time; `None` without --shutter.
    pub(super) fn shutter_times(&self, time: f32) -> Option<[f32; 2]> {
        Some(self.shutter?.map(|frames| (f64::from(time) + frames / self.fps) as f32))
    }

    /// Rejects --shutter without a time, or with a scene file.
    fn check_shutter(&self, scene: Option<&Path>, time: Option<f32>) -> Result<()> {
        let (Some([a, b]), Some(scene)) = (self.shutter, scene) else { return Ok(()) };
        if load::is_scene_file(scene) {
            let scene = scene.display();
            return Err(anyhow!("{scene}: --shutter requires a glTF file; a scene file sets the time of each asset"));
        }
        let last = time.or_else(|| self.frames.map(|[_, end]| self.time(end - 1)));
        let last = last.ok_or_else(|| anyhow!("--shutter requires --time or --frames"))?;
        match self.shutter_times(last) {
            Some(times) if times.iter().all(|time| time.is_finite()) => Ok(()),
            _ => Err(anyhow!("--shutter {a}..{b}: the time exceeds single precision")),
        }
    }

    /// Rejects frames whose time is not a number of `f32`.
    pub(super) fn check_time(&self, last: u32) -> Result<()> {
        if self.time(last).is_finite() {
            return Ok(());
        }
        Err(anyhow!("--fps {}: the time of frame {last} exceeds single precision", self.fps))
    }
}

/// The error for an output that is not written, with a way to get it.
fn unsupported(path: &Path) -> anyhow::Error {
    const VIDEOS: [&str; 8] = ["mp4", "m4v", "mov", "mkv", "webm", "avi", "ogv", "gif"];
    let error = output::unsupported(path, ".png, .jpg, .webp, .hdr or .exr");
    let name = path.display();
    if VIDEOS.iter().any(|video| output::has_extension(path, video)) {
        return anyhow!(
            "{error}; for a video, render --frames 0..48 -o frame_%04d.png and run ffmpeg -framerate 24 -i frame_%04d.png {name}"
        );
    }
    match path.extension() {
        Some(_) => anyhow!("{error}, and convert it, e.g. magick canted.png {name}"),
        None => error,
    }
}

/// Left, top, width and height of a rectangle.
pub(crate) fn crop(text: &str) -> Result<[u32; 4], String> {
    let numbers: Vec<Option<u32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers[..] {
        [Some(left), Some(top), Some(width), Some(height)] if width > 0 && height > 0 => Ok([left, top, width, height]),
        _ => Err(format!("'{text}' is not X,Y,W,H: four whole numbers, of which the last two are positive")),
    }
}

/// Sample numbers as `A..B`.
fn samples(text: &str) -> Result<[u32; 2], String> {
    let [start, end] = range(text, "0..16")?;
    if end > MAX_SAMPLES {
        return Err(format!("{end} exceeds the limit of {MAX_SAMPLES} samples"));
    }
    Ok([start, end])
}

/// Frame numbers as `A..B`.
fn frames(text: &str) -> Result<[u32; 2], String> {
    range(text, "0..48")
}

fn range(text: &str, example: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once("..").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    let [start, end]: [u32; 2] = parsed.ok_or_else(|| format!("expected A..B, e.g. {example}"))?;
    if start >= end { Err(format!("{start}..{end} is empty")) } else { Ok([start, end]) }
}

/// An interval of finite numbers as `A..B`.
fn interval(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let parsed = text.split_once("..").and_then(|(a, b)| Some([number(a)?, number(b)?]));
    let [open, close] = parsed.ok_or("expected A..B, e.g. 0..0.5")?;
    if open < close { Ok([open, close]) } else { Err(format!("{open}..{close} is empty")) }
}

/// A number of frames per second.
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.trim().parse().ok().filter(|&rate: &f64| rate > 0.0 && rate.is_finite());
    rate.ok_or_else(|| format!("'{text}' is not a finite number greater than 0"))
}

/// One channel name, or all.
pub(crate) fn aov(text: &str) -> Result<Aovs, String> {
    if text == "all" {
        return Ok(Aov::ALL.into_iter().collect());
    }
    let found = Aov::ALL.into_iter().find(|aov| aov.name() == text);
    let unknown = || format!("unknown channel '{text}'; use {} or all", Aov::ALL.map(Aov::name).join(", "));
    found.map(|aov| Aovs::NONE.with(aov)).ok_or_else(unknown)
}

#[cfg(test)]
mod tests {
    use canted_scene::{SceneFile, Setting};
    use clap::{Arg, Args as _, Command, FromArgMatches as _};

    use super::*;
    use crate::{
        options::{changed, given, names},
        settings::SceneSettings,
    };

    /// A value of an option that is not its default, unless it is a flag, and the words that it needs beside it.
    fn sample(arg: &Arg) -> (Option<String>, &'static str) {
        let (value, others) = match arg.get_id().as_str() {
            "scene" => ("b.glb", ""),
            "output" => ("b.png", ""),
            "force" => ("", ""),
            "crop" => ("1,1,2,2", ""),
            "heatmap_scale" => ("9", "--heatmap=boxes"),
            "boxes" => ("leaves", ""),
            "device" => ("cpu", ""),
            "threads" => ("3", ""),
            "size" => ("6x4", ""),
            "spp" => ("3", ""),
            "samples" => ("2..5", "-oa.exr"),
            "noise" | "ao_radius" | "clamp" => ("0.5", ""),
            "seed" => ("7", ""),
            "bounces" => ("5", ""),
            "seconds" => ("0.5", ""),
            "aovs" => ("depth", "-oa.exr"),
            "checkpoint" => ("b.part", ""),
            "checkpoint_every" => ("5", "--checkpoint=a.part"),
            "exposure" => ("1.5", ""),
            "background" => ("0,0.5,1", ""),
            "frames" => ("1..4", ""),
            "fps" => ("30", "--frames=0..2"),
            "shutter" => ("0..0.5", "--time=1 a.glb"),
            "turntable" => ("90", "--frames=0..2"),
            "resume" | "update" => ("", "--frames=0..2"),
            "time" => ("0.5", "a.glb"),
            "animation" => ("walk", "--time=1 a.glb"),
            "variant" | "camera" => ("red", "a.glb"),
            "texture_path" => ("maps", "a.glb"),
            "allow_parent" => ("on", "a.glb"),
            "line_radius" | "point_radius" => ("0.25", "a.glb"),
            "eye" | "target" | "up" | "env" => ("1,2,3", ""),
            "fov" | "ortho" | "focus" => ("33", ""),
            "aperture" => ("0.25", ""),
            "env_turn" => ("30", "--env=a.hdr"),
            "env_scale" => ("2", "--env=1,1,1"),
            "sun" | "point" => ("1,2,3,4,5,6", ""),
            "sphere" => ("1,2,3,4,5,6,7", ""),
            _ => ("", ""),
        };
        if !arg.get_action().takes_values() {
            return (None, others);
        }
        let (names, defaults) = (arg.get_possible_values(), arg.get_default_values());
        let named = names.iter().rev().find(|name| defaults.iter().all(|default| default != name.get_name()));
        let value = named.map_or(value, |name| name.get_name());
        assert!(!value.is_empty(), "add a value of --{} here", arg.get_id());
        (Some(value.to_owned()), others)
    }

    fn command() -> Command {
        Args::augment_args(Command::new("render"))
    }

    fn parsed(words: &[String]) -> Args {
        let words = words.iter().flat_map(|words| words.split_whitespace());
        Args::from_arg_matches(&command().get_matches_from(["render"].into_iter().chain(words))).unwrap()
    }

    /// Everything that is resolved, without the options themselves.
    fn resolved(args: Args) -> String {
        let mut job = args.job().unwrap();
        job.plan.options = SceneSettings::default();
        format!("{job:?}")
    }

    /// Each option has an effect on what is rendered, from the command line and from scene files; `canted scene` writes it, and `canted view`
    /// sets and prints it.
    #[test]
    fn no_option_is_forgotten() {
        let settings =
            [names::<crate::settings::PictureOptions>(), names::<crate::options::StructureOptions>()].concat();
        for arg in command().get_arguments() {
            let id = arg.get_id().as_str();
            let (value, others) = sample(arg);
            let option = match (&value, arg.get_long()) {
                (Some(value), Some(long)) => format!("--{long}={value}"),
                (Some(value), None) => value.clone(),
                (None, _) => format!("--{}", arg.get_long().unwrap()),
            };
            let [with, without] = [vec![others.to_owned(), option.clone()], vec![others.to_owned()]]
                .map(|words| resolved(parsed(&words)));
            assert!(with != without, "--{id} has no effect");

            let Some(value) = value else { continue };
            if names::<PictureArgs<DiagramArgs>>().iter().any(|name| name == id) && id != "scene" {
                let none: PictureArgs<DiagramArgs> = serde_json::from_str("{}").unwrap();
                let set = changed(&none, &[(id.to_owned(), value.clone())]).unwrap();
                assert_eq!(given(&set), [(id.to_owned(), value.clone())]);
                assert_eq!(changed(&set, &[(id.to_owned(), String::new())]).unwrap(), none);
            }
            if !settings.iter().any(|name| name == id) {
                continue;
            }
            let plan = |words: &[String], settings: Vec<Setting>| {
                let mut file = SceneFile::default();
                file.settings = settings;
                let file = SceneFile::parse(file.to_toml().as_bytes(), Path::new("a.toml")).unwrap();
                parsed(words).resolve(Some(&file), &Purpose::default()).unwrap()
            };
            let setting = Setting { key: id.to_owned(), value: Some(value.clone()), comment: String::new(), line: 0 };
            let by_file = plan(&[], vec![setting]);
            assert_eq!(format!("{by_file:?}"), format!("{:?}", plan(&[option], vec![])), "{id} in a scene file");
            let written = by_file.decided_settings().written();
            let reread = plan(&[], written.clone()).decided_settings().written();
            assert!(written.iter().any(|one| one.key == id && one.value.as_ref() == Some(&value)), "{id}: {written:?}");
            assert_eq!(reread, written, "{id}");
        }
    }
}
