//! What determines a picture: options over settings of a scene file over defaults, resolved once.
//!
//! ```text
//! command line -> PictureArgs --+
//!                               +-> SceneSettings (merged) -> Plan -> renderer
//! scene file -> SceneSettings --+
//! ```
//!
//! An option is a setting of scene files if its struct is part of [`SceneSettings`]. What it does is said where its struct is taken apart: in
//! `settings`, [`LookOptions::apply`], [`StructureOptions::resolve`] or `resolve`, none of which compiles without a new one.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_film::{Aov, Aovs, Filter, Picture, ToneMap};
use canted_renderer::{Cull, FirstHit, Hemisphere, Integrator, Lod, Measure, Pattern, SceneBvh, Settings, stands_on_z};
use canted_scene::{Camera, Environment, Material, ReadOptions, Scene, SceneFile, Setting, suggestion};
use clap::Command;
use serde::{Deserialize, Serialize};

use crate::{
    camera::{CAMERA, CameraArgs, CameraSource, Staged, flat_bases},
    light::{Background, EnvironmentArgs, LightArgs, LightSource, Preset, StageOptions},
    load::{self, FileArgs},
    options::{
        self, Finite, Form, Given, Length, Named, Positive, Size, Structure, StructureOptions, Text, Value, Whole,
        flag, given, names,
    },
    output,
};

/// The maximum number of samples per pixel, a guard against typing errors.
pub(crate) const MAX_SAMPLES: u32 = 1 << 20;

const DEFAULT_SAMPLES: u32 = 16;

const MAX_BOUNCES: u32 = 4096;

/// Help headings. Structs state the order of their options in the help, because headings mix options of several structs.
pub(crate) const PICTURE: &str = "Picture";
pub(crate) const RENDERING: &str = "Rendering";
const LOOK: &str = "Look (formats of 8 and 16 bits; .exr and .hdr stay linear)";

/// The options of a command that makes pictures, with those of its own in `R`.
#[derive(clap::Args, Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) struct PictureArgs<R: clap::Args> {
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) source: SceneArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) own: R,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) options: Given<PictureOptions>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) light: LightArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) structure: Given<StructureOptions>,
}

/// Which scene, and in which pose. Scene files state the pose of each asset.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = "Scene")]
pub(crate) struct SceneArgs {
    /// Scene: OBJ, PLY, STL, OFF, glTF, GLB, a scene file (.toml), or lines: .hair, .tck, .trk, .pdb, .xyz, .gcode [default: the built-in scene]
    #[arg(help_heading = None)]
    #[serde(skip)]
    pub(crate) scene: Option<PathBuf>,
    /// Time in the animation of the file [default: rest pose]
    #[arg(long, value_name = "SECONDS", requires = "scene", allow_hyphen_values = true)]
    pub(crate) time: Option<Value<Finite>>,
    /// Animation of the file, by name or by number from 0 [default: the first]
    #[arg(long, requires = "scene", value_name = "NAME|INDEX")]
    pub(crate) animation: Option<String>,
    /// Material variant of a glTF file, by name or by number from 0 [default: the materials of its primitives]
    #[arg(long, requires = "scene", value_name = "NAME|INDEX")]
    pub(crate) variant: Option<String>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) files: FileArgs,
}

impl SceneArgs {
    /// The time in seconds.
    pub(crate) fn time(&self) -> Option<f32> {
        self.time.map(|time| time.0)
    }

    /// How the file is read, at a time in seconds.
    pub(crate) fn read_options(&self, time: Option<f32>) -> ReadOptions {
        ReadOptions { variant: self.variant.clone(), ..self.files.read_options(time, self.animation.as_deref()) }
    }
}

/// Everything that a scene file can set in `[settings]`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(crate) struct SceneSettings {
    #[serde(flatten)]
    pub(crate) picture: PictureOptions,
    #[serde(flatten)]
    pub(crate) structure: StructureOptions,
}

/// Options of the picture.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub(crate) struct PictureOptions {
    /// Image size in pixels.
    #[arg(long, help_heading = PICTURE, display_order = 5, default_value = "1280x720", value_name = "WxH", allow_hyphen_values = true)]
    pub(crate) size: Option<Value<Size>>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) rendering: RenderingOptions,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) look: LookOptions,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) stage: StageOptions,
    /// Up axis of the scene: `z` for files of CAD and GIS programs. Sets the view that frames the scene and the default light
    /// [default: y; z for an STL, PLY, OFF or OBJ file that clearly stands on a flat base across z]
    #[arg(long, help_heading = CAMERA, display_order = 93, value_name = "AXIS")]
    pub(crate) up_axis: Option<Value<UpAxis>>,
}

/// Options of samples and light transport, which a heat map ignores.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = RENDERING, next_display_order = 60)]
#[serde(default)]
pub(crate) struct RenderingOptions {
    /// Samples per pixel; with --noise, the maximum [default: 16]
    #[arg(long, display_order = 40, value_name = "N")]
    pub(crate) spp: Option<Value<Whole<1, MAX_SAMPLES>>>,
    /// Sample pattern [default: stratified; sobol with --samples or --noise]
    #[arg(long, display_order = 42, value_name = "PATTERN")]
    pub(crate) sampler: Option<Value<Pattern>>,
    /// Stop sampling a pixel when its relative standard error falls below ERROR, e.g. 0.02.
    #[arg(long, display_order = 43, value_name = "ERROR")]
    pub(crate) noise: Option<Value<Positive>>,
    /// Random seed.
    #[arg(long, default_value = "0", value_name = "N", allow_hyphen_values = true)]
    seed: Option<Value<Whole<0, { u32::MAX }>>>,
    /// Pixel reconstruction filter.
    #[arg(long, default_value = "box", value_name = "FILTER")]
    filter: Option<Value<Filter>>,
    /// Texture filtering: `none` (bilinear), `cone` (isotropic ray cones) or `aniso` (anisotropic).
    #[arg(long, default_value = "aniso", value_name = "LOD")]
    lod: Option<Value<Lod>>,
    /// Light transport: `hybrid` is fast and approximate, `path` is a path tracer [default: path for glossy surfaces, glass
    /// and scenes lit by their own surfaces, else hybrid]
    #[arg(long, value_name = "INTEGRATOR")]
    pub(crate) integrator: Option<Value<Integrator>>,
    /// Maximum number of bounces after the first hit [default: 2 for hybrid, 32 for path]
    #[arg(long, value_name = "N")]
    pub(crate) bounces: Option<Value<Whole<0, MAX_BOUNCES>>>,
    /// Ambient occlusion radius of `hybrid` in world units; inf disables ambient light [default: a tenth of the scene's
    /// diagonal]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    ao_radius: Option<Value<Length>>,
    /// Back-face culling: with `auto` the backs of materials that a glTF file calls single-sided are invisible, and rays of the camera and
    /// of light pass through them; `back` does so for all materials, `off` for none. Glass always has both sides.
    #[arg(long, default_value = "auto", value_name = "auto|off|back")]
    cull: Option<Value<Cull>>,
    /// Limit of the radiance that a sample brings from light scattered by two surfaces or more, or `off`. Removes fireflies (bright specks), and
    /// some light with them.
    #[arg(long, default_value = "off", value_name = "VALUE|off", allow_hyphen_values = true)]
    clamp: Option<Value<Clamp>>,
    /// Give back the light that rough metal, coats and glass lose between their microfacets: on or off. `off` is for
    /// comparison with renderers that scatter once; `hybrid` has no such surfaces.
    #[arg(long, default_value = "on", value_name = "on|off")]
    energy_compensation: Option<Value<bool>>,
    /// Diffuse and ambient directions: `cosine` samples them in proportion to the cosine to the normal, `uniform` all alike, for comparison:
    /// the same picture with more noise.
    #[arg(long, default_value = "cosine", value_name = "uniform|cosine")]
    hemisphere: Option<Value<Hemisphere>>,
    /// First hits of `hybrid` on a GPU: `raster` starts rays at what a raster pass saw, `trace` traces them, `auto` measures which is
    /// faster. The picture is the same.
    #[arg(long, default_value = "auto", value_name = "auto|raster|trace")]
    first_hit: Option<Value<FirstHit>>,
}

/// Exposure and tone curve of pictures in formats that are not linear.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = LOOK, next_display_order = 80)]
#[serde(default)]
pub(crate) struct LookOptions {
    /// Exposure in stops, each of which doubles the brightness, or `auto` for a mean of middle gray [default: 0]
    #[arg(long, value_name = "EV|auto", allow_hyphen_values = true)]
    exposure: Option<Value<Exposure>>,
    /// Tone curve: `none` clamps, `filmic-neutral` (Khronos PBR Neutral) keeps the colors of glTF materials, `agx` and `aces` are
    /// those of films.
    #[arg(long, default_value = "none", value_name = "CURVE")]
    pub(crate) tone_map: Option<Value<ToneMap>>,
}

/// The value of `--clamp`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clamp(Option<f32>);

impl Form for Clamp {
    type Value = Self;

    fn parse(text: &str) -> Result<Self, String> {
        if text == "off" {
            return Ok(Self(None));
        }
        let limit = Positive::parse(text)
            .map_err(|_| format!("'{text}' is neither off nor a finite number greater than zero"))?;
        Ok(Self(Some(limit)))
    }
}

impl Text for Clamp {
    fn text(&self) -> String {
        self.0.map_or_else(|| "off".to_owned(), |limit| limit.to_string())
    }
}

/// The direction that is up in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UpAxis(pub(crate) [f32; 3]);

impl UpAxis {
    const Y: Self = Self(crate::light::DEFAULT_UP);
    const Z: Self = Self([0.0, 0.0, 1.0]);
}

impl Named for UpAxis {
    fn all() -> Vec<Self> {
        vec![Self::Y, Self::Z]
    }

    fn name(self) -> &'static str {
        if self.0[1] == 0.0 { "z" } else { "y" }
    }
}

/// The value of `--exposure`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Exposure {
    Auto,
    Stops(f32),
}

impl Form for Exposure {
    type Value = Self;

    fn parse(text: &str) -> Result<Self, String> {
        /// More stops than between the darkest and the brightest `f32`.
        const LIMIT: f32 = 200.0;
        if text == "auto" {
            return Ok(Self::Auto);
        }
        match Finite::parse(text) {
            Ok(stops) if stops.abs() <= LIMIT => Ok(Self::Stops(stops)),
            _ => Err(format!("'{text}' is neither auto nor a number of stops from -{LIMIT} to {LIMIT}")),
        }
    }
}

impl Text for Exposure {
    fn text(&self) -> String {
        match self {
            Self::Auto => "auto".to_owned(),
            Self::Stops(stops) => stops.to_string(),
        }
    }
}

impl LookOptions {
    /// Whether no exposure is given.
    fn is_unset(&self) -> bool {
        self.exposure.is_none()
    }

    /// The number of stops, unless it depends on the picture.
    pub(crate) fn stops(&self) -> Option<f32> {
        match self.exposure?.0 {
            Exposure::Stops(stops) => Some(stops),
            Exposure::Auto => None,
        }
    }

    /// The tone curve.
    pub(crate) fn curve(&self) -> ToneMap {
        self.tone_map.map_or(ToneMap::None, |curve| curve.0)
    }

    /// Exposes by a number of stops; `None` for no given exposure.
    pub(crate) fn set_stops(&mut self, stops: Option<f32>) {
        self.exposure = stops.map(|stops| Value(Exposure::Stops(stops)));
    }

    /// Warns about options without effect on a linear format.
    pub(crate) fn warn_ignored(&self, is_linear: bool) {
        let Self { exposure, tone_map: _ } = self;
        if is_linear && (exposure.is_some() || self.curve() != ToneMap::None) {
            output::warn("--exposure and --tone-map have no effect on linear formats");
        }
    }

    /// The picture as it is encoded.
    pub(crate) fn apply(&self, picture: Picture) -> Picture {
        // Without `..`, so that a new option cannot be forgotten.
        let Self { exposure, tone_map: _ } = self;
        let stops = if *exposure == Some(Value(Exposure::Auto)) {
            let stops = picture.auto_exposure();
            output::note(&format!("--exposure auto: {stops:+.2}"));
            stops
        } else {
            self.stops().unwrap_or(0.0)
        };
        let exposed = if stops == 0.0 { picture } else { picture.exposed(stops) };
        match self.curve() {
            ToneMap::None => exposed,
            curve => exposed.tone_mapped(curve),
        }
    }
}

impl SceneSettings {
    /// The settings of a scene file.
    ///
    /// # Errors
    /// A setting that is unknown or has an invalid value, with its line.
    pub(crate) fn of_file(file: &SceneFile) -> Result<Self> {
        let fail = |line: usize, error: String| anyhow!("{}: line {line}: {error}", file.path().display());
        file.settings.iter().try_fold(Self::default(), |all, setting| {
            let one = Self::of_one(setting).map_err(|error| fail(setting.line, error))?;
            Ok(options::or(&one, &all))
        })
    }

    /// Rejects a scene file with an invalid setting, for commands that use none.
    pub(crate) fn check(scene: Option<&Path>) -> Result<()> {
        scene_file(scene)?.as_ref().map(Self::of_file).transpose().map(drop)
    }

    fn of_one(Setting { key, value, .. }: &Setting) -> Result<Self, String> {
        let is_of = |names: Vec<String>| names.contains(key);
        let table = match () {
            () if is_of(names::<CameraArgs>()) => "[camera]",
            () if is_of(names::<EnvironmentArgs>()) => "[environment]",
            () if is_of(names::<LightArgs>()) => "[[lights]]",
            () if key != "scene" && is_of(names::<SceneArgs>()) => "[[assets]]",
            () => {
                let known = Self::names();
                if !known.contains(key) {
                    let near = suggestion(key, known.iter().map(|name| &name[..]));
                    return Err(format!("unknown key '{}' in [settings]{near}", key.escape_debug()));
                }
                let Some(value) = value else { return Ok(Self::default()) };
                return serde_json::from_value(serde_json::json!({ key: value }))
                    .map_err(|error| format!("invalid value {value:?} for '{key}' in [settings]: {error}"));
            }
        };
        Err(format!("'{key}' is not a key of [settings]; set it in {table}"))
    }

    /// The names of all settings, in the order in which they are written.
    fn names() -> Vec<String> {
        [names::<PictureOptions>(), names::<StructureOptions>()].concat()
    }

    /// Settings of a file without those that contradict options of the command line: settings for one kind of picture do not prevent
    /// another.
    fn without_replaced(mut self, given: &Self, purpose: &Purpose) -> Self {
        let rendering = &mut self.picture.rendering;
        if purpose.is_linear {
            self.picture.look = LookOptions::default();
        }
        if purpose.part.is_some() || purpose.heatmap.is_some() {
            rendering.noise = None;
        }
        // A part determines the number of samples, except for patterns that depend on the total.
        let sampler = given.picture.rendering.sampler.or(rendering.sampler);
        if purpose.part.is_some() && sampler != Some(Value(Pattern::Stratified)) {
            rendering.spp = None;
        }
        if given.picture.rendering.integrator == Some(Value(Integrator::Path)) {
            rendering.ao_radius = None;
        }
        self.structure = self.structure.without_replaced(&given.structure);
        self
    }

    /// All settings as they are written, with the default values of those that are not set.
    pub(crate) fn written(self) -> Vec<Setting> {
        let defaults =
            Self { picture: options::defaults::<PictureOptions>(), structure: options::defaults::<StructureOptions>() };
        let all = options::or(&self, &defaults);
        let texts = [given(&all.picture), given(&all.structure)].concat();
        let command = <StructureOptions as clap::Args>::augment_args(<PictureOptions as clap::Args>::augment_args(
            Command::new("canted"),
        ));
        let setting = |arg: &clap::Arg| {
            let key = arg.get_id().to_string();
            let value = texts.iter().find(|(name, _)| *name == key).map(|(_, text)| text.clone());
            let comment = arg.get_help().map(|help| help.to_string().replace('\n', " ")).unwrap_or_default();
            Setting { key, value, comment, line: 0 }
        };
        command.get_arguments().map(setting).collect()
    }
}

/// What a picture is made for, besides what is in a scene file.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Purpose {
    /// The samples of a part.
    pub(crate) part: Option<[u32; 2]>,
    /// Whether a time limit decides the number of samples.
    pub(crate) has_time_limit: bool,
    /// Additional channels.
    pub(crate) aovs: Aovs,
    /// A channel of light at the first surface that is asked for by name, which needs the integrator `hybrid`.
    pub(crate) factor: Option<Aov>,
    /// A heat map in place of light, and the tests of its brightest color.
    pub(crate) heatmap: Option<(Measure, u32)>,
    /// Whether the picture has no exposure and no tone curve.
    pub(crate) is_linear: bool,
    /// Whether the picture shows data of the scene: channels or boxes, of which a ground is no part.
    pub(crate) shows_data: bool,
}

/// Everything that determines a picture, once it is resolved. The scene decides what is left: camera, light and integrator.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) source: SceneArgs,
    pub(crate) camera: CameraArgs,
    pub(crate) light: LightArgs,
    pub(crate) structure: Structure,
    pub(crate) look: LookOptions,
    /// Up in world space, unless the camera says otherwise.
    up_axis: [f32; 3],
    /// A channel that only the integrator `hybrid` has, if one is asked for by name.
    factor: Option<Aov>,
    pub(crate) heatmap: Option<(Measure, u32)>,
    /// With the integrator that was chosen last.
    pub(crate) settings: Settings,
    /// The integrator that is given, or was chosen.
    pub(crate) integrator: Option<Integrator>,
    pub(crate) first_hit: FirstHit,
    /// The options over the settings of the scene file.
    pub(crate) options: SceneSettings,
    is_linear: bool,
    /// Whether the picture shows data of the scene, of which a ground is no part.
    pub(crate) shows_data: bool,
    pub(crate) stage: Stage,
    /// What was decided about the surroundings of the scene.
    decided_stage: Option<StageOptions>,
}

/// The surroundings of a scene as far as they are given.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stage {
    pub(crate) light: Option<Preset>,
    pub(crate) background: Option<Background>,
    pub(crate) ground: Option<bool>,
}

impl Stage {
    fn new(options: &StageOptions) -> Self {
        // Without `..`, so that a new option cannot be forgotten.
        let StageOptions { light, background, ground } = options;
        Self {
            light: light.map(|light| light.0),
            background: background.map(|background| background.0),
            ground: ground.and_then(|ground| ground.0),
        }
    }
}

impl<R: clap::Args> PictureArgs<R> {
    /// The options over the settings of a scene file.
    ///
    /// # Errors
    /// Options that contradict each other, or a scene file with an invalid setting.
    pub(crate) fn resolve(self, file: Option<&SceneFile>, purpose: &Purpose) -> Result<Plan> {
        let given = SceneSettings { picture: self.options.0, structure: self.structure.0 };
        let of_file = file.map(SceneSettings::of_file).transpose()?.unwrap_or_default();
        if given.picture.stage.light.is_some() && !self.light.is_empty() {
            return Err(anyhow!("--light and --env, --sun, --point or --sphere cannot be used together"));
        }
        let mut options = options::or(&given, &of_file.without_replaced(&given, purpose));
        if !self.light.is_empty() {
            options.picture.stage.light = None;
        }
        // Without `..`, so that a new option cannot be forgotten.
        let SceneSettings { picture: PictureOptions { size: _, rendering: _, look, stage: _, up_axis }, structure } =
            &options;
        let RenderingOptions { ao_radius, integrator, first_hit, .. } = options.picture.rendering;
        let integrator = integrator.map(|integrator| integrator.0);
        if ao_radius.is_some() && integrator == Some(Integrator::Path) {
            return Err(anyhow!("--ao-radius requires --integrator hybrid"));
        }
        let mut plan = Plan {
            source: self.source,
            camera: self.camera,
            light: self.light,
            structure: structure.resolve()?,
            look: look.clone(),
            up_axis: up_axis.map_or(crate::light::DEFAULT_UP, |axis| axis.0.0),
            heatmap: purpose.heatmap,
            settings: settings(&options.picture, purpose)?,
            integrator,
            factor: purpose.factor,
            first_hit: first_hit.map_or(FirstHit::default(), |first_hit| first_hit.0),
            is_linear: purpose.is_linear,
            shows_data: purpose.shows_data || purpose.heatmap.is_some(),
            stage: Stage::new(&options.picture.stage),
            decided_stage: None,
            options,
        };
        if plan.is_transparent() {
            // Where it has hits, the picture is opaque.
            plan.settings.aovs = plan.settings.aovs.with(Aov::Depth);
        }
        if let (Some(aov), Some(Integrator::Path)) = (plan.factor, plan.integrator) {
            return Err(anyhow!("--aovs {} requires --integrator hybrid", aov.name()));
        }
        plan.set_integrator(plan.integrator.unwrap_or(Integrator::Hybrid));
        Ok(plan)
    }
}

/// The renderer's settings, but for integrator and bounces.
fn settings(options: &PictureOptions, purpose: &Purpose) -> Result<Settings> {
    // Without `..`, so that a new option cannot be forgotten. What is not used here, `resolve` uses.
    let RenderingOptions {
        spp,
        sampler,
        noise,
        seed,
        filter,
        lod,
        integrator: _,
        bounces: _,
        ao_radius,
        cull,
        clamp,
        energy_compensation,
        hemisphere,
        first_hit: _,
    } = options.rendering;
    let default = Settings::default();
    let [width, height] = options.size.map_or([default.width, default.height], |size| size.0);
    let Purpose { part, has_time_limit, aovs, .. } = *purpose;
    // Both need samples that do not depend on the total number.
    let needs_prefix = part.is_some() || noise.is_some() || has_time_limit;
    let usual = if needs_prefix { Pattern::Sobol } else { Pattern::Stratified };
    let pattern = sampler.map_or(usual, |sampler| sampler.0);
    let samples = match (part, spp.map(|spp| spp.0)) {
        (None, None) if has_time_limit => MAX_SAMPLES,
        (None, spp) => spp.unwrap_or(DEFAULT_SAMPLES),
        (Some([start, end]), Some(spp)) if pattern == Pattern::Stratified => {
            if end > spp {
                return Err(anyhow!("--samples {start}..{end} exceeds --spp {spp}"));
            }
            spp
        }
        (Some([start, end]), Some(spp)) => {
            return Err(anyhow!(
                "--samples {start}..{end} sets the number of samples; remove --spp {spp}, or add --sampler stratified, which needs the total"
            ));
        }
        (Some([start, end]), None) if pattern == Pattern::Stratified => {
            return Err(anyhow!(
                "--samples {start}..{end} with --sampler stratified requires --spp, the total of all parts"
            ));
        }
        (Some([_, end]), None) => end,
    };
    Ok(Settings {
        width,
        height,
        samples,
        part,
        noise: noise.map(|noise| noise.0),
        aovs,
        seed: seed.map_or(default.seed, |seed| seed.0),
        pattern,
        filter: filter.map_or(default.filter, |filter| filter.0),
        lod: lod.map_or(default.lod, |lod| lod.0),
        cull: cull.map_or(default.cull, |cull| cull.0),
        clamp: clamp.and_then(|clamp| clamp.0.0),
        energy_compensation: energy_compensation.map_or(default.energy_compensation, |is_on| is_on.0),
        hemisphere: hemisphere.map_or(default.hemisphere, |hemisphere| hemisphere.0),
        ao_radius: ao_radius.map(|radius| radius.0),
        ..default
    })
}

impl Plan {
    /// The size of the picture in pixels.
    pub(crate) fn size(&self) -> [u32; 2] {
        [self.settings.width, self.settings.height]
    }

    /// Up in world space.
    pub(crate) fn up(&self) -> [f32; 3] {
        self.camera.up(self.up_axis)
    }

    /// The camera of the options, else of the file, else one that frames the scene.
    ///
    /// # Errors
    /// A focus distance for a camera without a lens, or a camera that the file does not have.
    pub(crate) fn camera(
        &self,
        scene: &Scene,
        bvh: &SceneBvh,
        staged: Option<&Staged>,
    ) -> Result<(Camera, CameraSource)> {
        self.camera.camera(scene, bvh, staged, self.aspect(), self.up_axis, self.is_model())
    }

    /// Whether the camera depends on what the scene is about.
    pub(crate) fn needs_framing(&self, scene: &Scene) -> bool {
        self.camera.needs_framing(scene, self.is_model())
    }

    /// Width over height of the picture.
    pub(crate) fn aspect(&self) -> f64 {
        let [width, height] = self.size().map(f64::from);
        width / height
    }

    /// Whether the scene is a file of a model, whose cameras and lights may be leftovers; those of scene files are there on purpose.
    fn is_model(&self) -> bool {
        self.source.scene.as_deref().is_some_and(|path| !load::is_scene_file(path))
    }

    /// Sets the lights of the scene, and reports those of a scene file that are not used.
    pub(crate) fn apply_light(&self, scene: &mut Scene) -> Result<LightSource> {
        let has_lights = scene.lights.iter().any(|light| !light.is_off())
            || match &scene.environment {
                None => false,
                Some(Environment::Constant(radiance)) => *radiance != [0.0; 3],
                Some(Environment::Image(_)) => true,
            };
        if let (Some(preset), true, false) = (self.stage.light, has_lights, self.is_model()) {
            output::note(&format!(
                "the light '{}' replaces the lights and the environment of the scene; without `light` in [settings] and --light they are used",
                preset.name()
            ));
        }
        self.light.apply(scene, self.stage.light)
    }

    /// Whether the unit of the scene is the meter, as in glTF files.
    pub(crate) fn is_in_meters(&self) -> bool {
        let of_gltf = |path: &Path| ["gltf", "glb", "toml"].iter().any(|known| output::has_extension(path, known));
        self.source.scene.as_deref().is_none_or(of_gltf)
    }

    /// Whether z is up because the scene shows it, where neither options nor the format say which axis is.
    pub(crate) fn shows_z_up(&self, scene: &Scene) -> bool {
        let Some(path) = self.source.scene.clone().filter(|_| self.options.picture.up_axis.is_none()) else {
            return false;
        };
        self.camera.up.is_none() && stands_on_z(scene, &flat_bases(&path))
    }

    /// Makes z the up axis.
    pub(crate) fn set_z_up(&mut self) {
        self.up_axis = UpAxis::Z.0;
    }

    /// Whether the picture has transparency.
    pub(crate) fn is_transparent(&self) -> bool {
        self.heatmap.is_none() && self.stage.background == Some(Background::Transparent)
    }

    /// Stores what was decided about the surroundings, for scene files.
    pub(crate) fn keep_stage(&mut self, light: Preset, background: Background, has_ground: bool) {
        let (light, background, ground) = (Some(Value(light)), Some(Value(background)), Some(Value(Some(has_ground))));
        self.decided_stage = Some(StageOptions { light, background, ground });
    }

    /// Sets the integrator, and its bounces unless they are given.
    fn set_integrator(&mut self, integrator: Integrator) {
        self.settings.integrator = integrator;
        // What `all` names beyond it is not rendered.
        let of_integrator = integrator.aovs();
        self.settings.aovs = self.settings.aovs.iter().filter(|&aov| of_integrator.contains(aov)).collect();
        let bounces = self.options.picture.rendering.bounces;
        self.settings.bounces = bounces.map_or(integrator.bounces(), |bounces| bounces.0);
    }

    /// Renders with an integrator from now on.
    pub(crate) fn choose(&mut self, integrator: Integrator) {
        self.integrator = Some(integrator);
        self.set_integrator(integrator);
    }

    /// Chooses the integrator unless it is given: the one that shows the materials and lights of the scene. Returns why.
    pub(crate) fn choose_integrator(&mut self, scene: &Scene, is_lit_by_emission: bool) -> &'static str {
        /// Reflections of rougher surfaces look like those of a diffuse one.
        const ROUGH: f32 = 0.6;
        /// Nothing but the reflection shows the shape of a darker surface.
        const BLACK: f32 = 0.1;
        let is_shiny = |m: &Material| {
            let is_black = m.base_color.iter().all(|&c| c < BLACK);
            let is_glossy = m.roughness < ROUGH || m.metallic_roughness_texture.is_some() || is_black;
            m.transmission > 0.0 || is_glossy && (m.metallic > 0.0 || m.specular > 0.0)
        };
        let (integrator, reason) = match self.integrator {
            Some(given) => (given, "given"),
            None if self.settings.ao_radius.is_some() => (Integrator::Hybrid, "--ao-radius is given"),
            None if self.factor.is_some() => (Integrator::Hybrid, "--aovs names light at the first surface"),
            None if is_lit_by_emission => (Integrator::Path, "surfaces light the scene"),
            None if scene.materials.iter().any(is_shiny) => (Integrator::Path, "some surfaces reflect or transmit"),
            None => (Integrator::Hybrid, "all surfaces are diffuse"),
        };
        self.choose(integrator);
        reason
    }

    /// Whether the exposure may be chosen: for a model without exposure, its own lights and a format that is not linear. Scene files
    /// are made for the exposure that they have. A heat map shows no light.
    pub(crate) fn needs_exposure(&self) -> bool {
        self.is_model() && !self.is_linear && self.heatmap.is_none() && self.look.is_unset() && self.light.is_empty()
    }

    /// The settings, with what was decided for the scene. Scene files have the exposure that they say.
    pub(crate) fn decided_settings(&self) -> SceneSettings {
        let mut decided = SceneSettings::default();
        let Settings { samples, pattern, bounces, integrator, .. } = self.settings;
        decided.picture.rendering = RenderingOptions {
            spp: Some(Value(samples)),
            sampler: Some(Value(pattern)),
            bounces: Some(Value(bounces)),
            integrator: Some(Value(integrator)),
            ..RenderingOptions::default()
        };
        if let Some(stage) = &self.decided_stage {
            decided.picture.stage = stage.clone();
        }
        decided.picture.up_axis = Some(Value(UpAxis(self.up_axis)));
        decided.picture.look.set_stops(self.look.stops().filter(|stops| *stops != 0.0));
        options::or(&decided, &self.options)
    }

    /// The files that are read.
    pub(crate) fn inputs(&self) -> Result<load::Inputs> {
        let inputs = load::Inputs::of(self.source.scene.as_deref())?;
        Ok(match self.light.environment_file() {
            Some((image, ..)) => inputs.and("--env", image),
            None => inputs,
        })
    }
}

/// The options that a heat map ignores. Settings of a scene file may be for other pictures.
pub(crate) fn ignored_by_heatmap<R: clap::Args>(args: &PictureArgs<R>, more: Option<&str>) -> Vec<String> {
    let of_scene = [given(&args.light), given(&args.camera.lens)].concat();
    let of_options = [given(&args.options.0.rendering), given(&args.options.0.stage)].concat();
    let names = of_options.into_iter().chain(more.map(|name| (name.to_owned(), String::new())));
    let mut ignored: Vec<String> = names.chain(of_scene).map(|(name, _)| flag(&name)).collect();
    // An option may be repeated.
    ignored.dedup();
    ignored
}

/// The scene file that a path names.
///
/// # Errors
/// A scene file that is unreadable or invalid.
pub(crate) fn scene_file(path: Option<&Path>) -> Result<Option<SceneFile>> {
    path.filter(|path| load::is_scene_file(path)).map(load::scene_file).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the help calls default is what the renderer does without the option.
    #[test]
    fn the_help_states_the_defaults() {
        let (none, purpose) = (PictureOptions::default(), Purpose::default());
        assert_eq!(settings(&options::defaults(), &purpose).unwrap(), settings(&none, &purpose).unwrap());
        let structure = options::defaults::<StructureOptions>();
        assert_eq!(structure.resolve().unwrap(), StructureOptions::default().resolve().unwrap());
        assert_eq!(options::defaults::<PictureOptions>().look.curve(), ToneMap::None);
    }
}
