//! Options of `canted render`.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::{Filter, Format, Record};
use canted_renderer::{BoxLevel, FirstHit, Integrator, Lod, Measure, SampleSums, Settings, light_hash, scene_hash};
use canted_scene::{Camera, Material, ReadOptions, Scene};

use super::{
    camera::{self, CameraArgs},
    frames::FrameArgs,
    look::LookArgs,
    samples::SampleArgs,
};
use crate::{
    device::{DeviceArg, RunArgs},
    light::LightArgs,
    load::Inputs,
    options::{self, StructureArgs, one_of},
    output,
};

/// Options of `canted render`.
#[derive(clap::Args, Clone)]
#[command(mut_arg("device", |arg| arg.help(DEVICE)))]
#[command(after_help = "Examples:\n  canted render helmet.glb -o helmet.png --size 1920x1080 --spp 64\n  \
                        canted render fox.glb --frames 0..48 -o fox_%04d.png --env studio.hdr")]
pub(crate) struct Args {
    /// Scene: OBJ, PLY, STL, OFF, glTF, GLB, or a scene file (.toml) [default: the built-in scene]
    pub(crate) scene: Option<PathBuf>,
    /// Time in the animation of the file [default: rest pose]
    #[arg(long, help_heading = SCENE, value_parser = options::number, value_name = "SECONDS", requires = "scene", allow_hyphen_values = true)]
    pub(crate) time: Option<f32>,
    /// Animation of the file, by name or by number from 0 [default: the first]
    #[arg(long, help_heading = SCENE, requires = "scene", value_name = "NAME|INDEX")]
    pub(crate) animation: Option<String>,
    /// Material variant of a glTF file, by name or by number from 0 [default: the materials of its primitives]
    #[arg(long, help_heading = SCENE, requires = "scene", value_name = "NAME|INDEX")]
    pub(crate) variant: Option<String>,
    /// Output image: .png, .jpg, .webp (sRGB), .hdr or .exr (linear); `-` is standard output.
    #[arg(short, long, help_heading = PICTURE, default_value = "canted.png", value_name = "FILE", allow_hyphen_values = true)]
    pub(crate) output: PathBuf,
    /// Format of the output, in place of that of its name [default: by the extension; png for -]
    #[arg(long, help_heading = PICTURE, value_parser = one_of(&Format::ALL), value_name = "FORMAT")]
    pub(super) format: Option<Format>,
    /// Image size in pixels.
    #[arg(long, help_heading = PICTURE, value_parser = options::size, default_value = "1280x720", value_name = "WxH", allow_hyphen_values = true)]
    pub(crate) size: [u32; 2],
    /// Render only a part of the picture, whose output it is: left, top, width and height in pixels of the whole.
    #[arg(long, help_heading = PICTURE, value_parser = crop, value_name = "X,Y,W,H", allow_hyphen_values = true)]
    pub(super) crop: Option<[u32; 4]>,
    /// Show the number of intersection tests per camera ray instead of light.
    #[arg(long, help_heading = PICTURE, value_parser = one_of(&[("boxes", Measure::Boxes), ("triangles", Measure::Triangles)]), value_name = "TESTS")]
    pub(crate) heatmap: Option<Measure>,
    /// Number of tests shown in the brightest color of the heat map; a wide node counts as eight boxes.
    #[arg(long, help_heading = PICTURE, value_parser = clap::value_parser!(u32).range(1..), default_value_t = 128, requires = "heatmap", value_name = "N")]
    pub(crate) heatmap_scale: u32,
    /// Draw boxes of the acceleration structure over the picture: those of a level, 0 for the root, or of all leaves. Axis-aligned boxes are
    /// blue, oriented ones orange.
    #[arg(long, help_heading = PICTURE, value_name = "LEVEL|leaves")]
    pub(crate) boxes: Option<BoxLevel>,
    #[command(flatten)]
    pub(super) run: RunArgs,
    #[command(flatten)]
    pub(super) sequence: FrameArgs,
    #[command(flatten)]
    pub(super) samples: SampleArgs,
    /// Random seed.
    #[arg(long, help_heading = RENDERING, default_value_t = 0, value_name = "N", allow_hyphen_values = true)]
    pub(super) seed: u32,
    /// Pixel reconstruction filter.
    #[arg(long, help_heading = RENDERING, default_value = "box", value_parser = one_of(&FILTERS), value_name = "FILTER")]
    pub(super) filter: Filter,
    /// Texture filtering: `none` (bilinear), `cone` (isotropic ray cones) or `aniso` (anisotropic).
    #[arg(long, help_heading = RENDERING, default_value = "aniso", value_parser = one_of(&LODS), value_name = "LOD")]
    pub(super) lod: Lod,
    /// Light transport: `hybrid` is fast and approximate, `path` is a path tracer [default: path for glossy surfaces, glass
    /// and scenes lit by their own surfaces, else hybrid]
    #[arg(long, help_heading = RENDERING, value_parser = one_of(&INTEGRATORS), value_name = "INTEGRATOR")]
    pub(crate) integrator: Option<Integrator>,
    /// Maximum number of bounces after the first hit [default: 2 for hybrid, 32 for path]
    #[arg(long, help_heading = RENDERING, value_parser = clap::value_parser!(u32).range(0..=4096), value_name = "N")]
    pub(super) bounces: Option<u32>,
    /// Ambient occlusion radius of `hybrid` in world units; inf disables ambient light [default: a tenth of the scene's
    /// diagonal]
    #[arg(long, help_heading = RENDERING, value_parser = options::radius, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(super) ao_radius: Option<f32>,
    /// Give back the light that rough metal, coats and glass lose between their microfacets: on or off. `off` is for
    /// comparison with renderers that scatter once; `hybrid` has no such surfaces.
    #[arg(long, help_heading = RENDERING, action = clap::ArgAction::Set, default_value = "on", value_parser = one_of(&SWITCH), value_name = "on|off")]
    pub(super) energy_compensation: bool,
    /// First hits of `hybrid` on a GPU: `raster` starts rays at what a raster pass saw, `trace` traces them, `auto` measures which is
    /// faster. The picture is the same.
    #[arg(long, help_heading = RENDERING, default_value = "auto", value_parser = one_of(&FIRST_HITS), value_name = "auto|raster|trace")]
    pub(super) first_hit: FirstHit,
    /// Where samples of a GPU are summed: `host` downloads each of them, `device` downloads sums of up to 64 samples of a pixel. Use `device`
    /// where the download takes long: many samples per pixel on a fast GPU. Pictures differ by roundings only.
    #[arg(long, help_heading = RENDERING, default_value = "host", value_parser = one_of(&SUMS), value_name = "host|device")]
    pub(super) sums: SampleSums,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    #[command(flatten)]
    pub(crate) structure: StructureArgs,
}

const SCENE: &str = "Scene";

const PICTURE: &str = "Picture";

/// Help heading of the options about light transport.
pub(super) const RENDERING: &str = "Rendering";

const DEVICE: &str = "Compute device: auto, cpu, gpu, both (CPU and GPU share the tiles), both:NAME, or part of an adapter \
                      name (see `canted devices`). `auto` uses a hardware GPU that supports the scene, else the CPU";

const FILTERS: [(&str, Filter); 5] = [
    ("box", Filter::BOX),
    ("tent", Filter::TENT),
    ("gaussian", Filter::GAUSSIAN),
    ("mitchell", Filter::MITCHELL),
    ("blackman-harris", Filter::BLACKMAN_HARRIS),
];

const LODS: [(&str, Lod); 3] = [("none", Lod::None), ("cone", Lod::Cone), ("aniso", Lod::Aniso)];

const SWITCH: [(&str, bool); 2] = [("on", true), ("off", false)];

/// Names of [`FirstHit`].
pub(super) const FIRST_HITS: [(&str, FirstHit); 3] =
    [("auto", FirstHit::Auto), ("raster", FirstHit::Raster), ("trace", FirstHit::Trace)];

const SUMS: [(&str, SampleSums); 2] = [("host", SampleSums::Host), ("device", SampleSums::Device)];

const INTEGRATORS: [(&str, Integrator); 2] = [("hybrid", Integrator::Hybrid), ("path", Integrator::Path)];

/// Left, top, width and height of a rectangle.
fn crop(text: &str) -> Result<[u32; 4], String> {
    let numbers: Vec<Option<u32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers[..] {
        [Some(left), Some(top), Some(width), Some(height)] if width > 0 && height > 0 => Ok([left, top, width, height]),
        _ => Err(format!("'{text}' is not X,Y,W,H: four whole numbers, of which the last two are positive")),
    }
}

impl Args {
    /// The format of the output.
    ///
    /// # Errors
    /// An extension without a format.
    pub(super) fn format(&self) -> Result<Format> {
        let by_name = || if self.is_stream() { Some(Format::Png) } else { Format::of_path(&self.output) };
        let format = self.format.or_else(by_name);
        format.ok_or_else(|| output::unsupported(&self.output, ".png, .jpg, .webp, .hdr or .exr"))
    }

    /// Whether the output is standard output.
    pub(super) fn is_stream(&self) -> bool {
        self.output.as_os_str() == "-"
    }

    /// The device.
    pub(crate) fn device(&self) -> &DeviceArg {
        &self.run.device
    }

    /// How a GPU finds first hits.
    #[cfg(feature = "gpu")]
    pub(crate) fn first_hit(&self) -> FirstHit {
        self.first_hit
    }

    /// The size of the output.
    pub(super) fn output_size(&self) -> [u32; 2] {
        self.crop.map_or(self.size, |[.., width, height]| [width, height])
    }

    /// Rejects a crop that exceeds the picture, or goes with options that need the whole picture.
    pub(super) fn check_crop(&self) -> Result<()> {
        let Some([left, top, width, height]) = self.crop else { return Ok(()) };
        let ends = [u64::from(left) + u64::from(width), u64::from(top) + u64::from(height)];
        if ends[0] > self.size[0].into() || ends[1] > self.size[1].into() {
            let [w, h] = self.size;
            return Err(anyhow!("--crop {left},{top},{width},{height} exceeds the picture of {w} x {h} pixels"));
        }
        self.samples.check_crop()
    }

    /// Chooses the integrator unless it is given: the one that shows the materials and lights of the scene.
    /// Returns why.
    pub(crate) fn choose_integrator(&mut self, scene: &Scene, is_lit_by_emission: bool) -> &'static str {
        /// Reflections of rougher surfaces look like those of a diffuse one.
        const ROUGH: f32 = 0.6;
        let is_shiny = |m: &Material| {
            let is_glossy = m.roughness < ROUGH || m.metallic_roughness_texture.is_some();
            m.transmission > 0.0 || is_glossy && (m.metallic > 0.0 || m.specular > 0.0)
        };
        let (integrator, reason) = match self.integrator {
            Some(given) => (given, "given"),
            None if self.ao_radius.is_some() => (Integrator::Hybrid, "--ao-radius is given"),
            None if is_lit_by_emission => (Integrator::Path, "surfaces light the scene"),
            None if scene.materials.iter().any(is_shiny) => (Integrator::Path, "some surfaces reflect or transmit"),
            None => (Integrator::Hybrid, "all surfaces are diffuse"),
        };
        self.integrator = Some(integrator);
        reason
    }

    /// Whether the exposure may be chosen: for a model without exposure, its own lights and a format that is not linear. Scene files
    /// are made for the exposure that they have. A heat map shows no light.
    pub(crate) fn needs_exposure(&self) -> bool {
        let is_model = self.scene.as_deref().is_some_and(|path| !output::has_extension(path, "toml"));
        let is_linear = self.format().is_ok_and(Format::is_linear);
        is_model && !is_linear && self.heatmap.is_none() && self.look.is_unset() && self.light.is_empty()
    }

    /// How the file of the scene is read, at a time in seconds.
    pub(crate) fn read_options(&self, time: Option<f32>) -> ReadOptions {
        ReadOptions { time, animation: self.animation.clone(), variant: self.variant.clone() }
    }

    /// The files that are read.
    pub(crate) fn inputs(&self) -> Result<Inputs> {
        let inputs = Inputs::of(self.scene.as_deref())?;
        Ok(match self.light.environment_file() {
            Some((image, ..)) => inputs.and("--env", image),
            None => inputs,
        })
    }

    pub(crate) fn settings(&self) -> Result<Settings> {
        let Self { size: [width, height], filter, lod, seed, ao_radius, energy_compensation, sums, .. } = *self;
        let integrator = self.integrator.unwrap_or(Integrator::Hybrid);
        if ao_radius.is_some() && integrator != Integrator::Hybrid {
            return Err(anyhow!("--ao-radius requires --integrator hybrid"));
        }
        let bounces = self.bounces.unwrap_or(integrator.bounces());
        let mut settings = Settings {
            width,
            height,
            integrator,
            filter,
            lod,
            bounces,
            seed,
            energy_compensation,
            ao_radius,
            sums,
            ..Settings::default()
        };
        self.samples.apply(&mut settings)?;
        Ok(settings)
    }

    /// Everything that determines the value of a sample, by name. The device is included because devices round differently.
    pub(super) fn record(&self, scene: &Scene, camera: &Camera, settings: &Settings, device: String) -> Record {
        let own = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("scene", format!("{:016x}", scene_hash(scene))),
            ("light", format!("{:016x}", light_hash(scene))),
            ("triangles", options::name_of(&options::TRIANGLE_TESTS, &self.structure.triangles).to_owned()),
            ("device", device),
        ];
        let named = |(name, value): (&str, String)| (name.to_owned(), value);
        // The camera is last: a camera that frames the scene depends on the size, which is the more useful difference.
        own.map(named).into_iter().chain(settings.record()).chain(camera::record(camera).map(named)).collect()
    }
}

/// The record of a checkpoint, which also states what its tiles are sums of.
pub(super) fn checkpoint_record(record: &Record, settings: &Settings) -> Record {
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
