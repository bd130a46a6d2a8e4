//! The light of a scene: from the options, else from the file, else one that needs no file.

pub(crate) mod ground;
mod sky;
mod stage;
mod studio;

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_scene::{Environment, EnvironmentImage, Light, Material, Scene};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    options::{Finite, Form, NotNegative, Numbers, Text, Value},
    output,
};

use stage::LIGHT;
pub(crate) use stage::{Background, Preset, StageOptions, axes, set_light};

/// Lights from the command line. They replace all lights of the file and its environment.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = LIGHT, next_display_order = 100)]
#[serde(default)]
pub(crate) struct LightArgs {
    #[command(flatten)]
    #[serde(flatten)]
    environment: EnvironmentArgs,
    /// Sun: direction in which the light travels, and irradiance in W/m² on a surface that faces it; repeatable.
    #[arg(long, value_name = "DX,DY,DZ,R,G,B", allow_hyphen_values = true)]
    sun: Vec<Value<Numbers<6>>>,
    /// Point light: position and radiant intensity in W/sr; repeatable.
    #[arg(long, value_name = "X,Y,Z,R,G,B", allow_hyphen_values = true)]
    point: Vec<Value<Numbers<6>>>,
    /// Sphere light: center, radius and radiance in W/(m² sr); repeatable (spot and disk lights require a scene file).
    #[arg(long, value_name = "X,Y,Z,RADIUS,R,G,B", allow_hyphen_values = true)]
    sphere: Vec<Value<Numbers<7>>>,
}

/// Light from all around.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = LIGHT)]
pub(crate) struct EnvironmentArgs {
    /// Environment light: constant radiance in W/(m² sr), or an environment map (.hdr or .exr) [default: black]
    #[arg(long, value_name = "R,G,B|FILE", allow_hyphen_values = true)]
    env: Option<Value<EnvironmentArg>>,
    /// Rotation of the environment map about the y axis, in degrees, counter-clockwise seen from above.
    #[arg(long, value_name = "DEG", requires = "env", allow_hyphen_values = true)]
    env_turn: Option<Value<Finite>>,
    /// Factor for the radiance of --env.
    #[arg(long, value_name = "X", requires = "env", allow_hyphen_values = true)]
    env_scale: Option<Value<NotNegative>>,
}

/// The value of `--env`.
#[derive(Clone, Debug, PartialEq)]
enum EnvironmentArg {
    Constant([f32; 3]),
    Map(PathBuf),
}

impl Text for EnvironmentArg {
    fn text(&self) -> String {
        match self {
            Self::Constant(radiance) => radiance.text(),
            Self::Map(path) => path.display().to_string(),
        }
    }
}

/// A file by its extension, else three numbers.
impl Form for EnvironmentArg {
    type Value = Self;

    fn parse(text: &str) -> Result<Self, String> {
        if ["hdr", "exr"].iter().any(|known| output::has_extension(Path::new(text), known)) {
            return Ok(Self::Map(text.into()));
        }
        let color = Numbers::parse(text).map_err(|error| format!("{error}; use R,G,B or a .hdr or .exr file"))?;
        Ok(Self::Constant(color))
    }
}

/// Where the light of a scene comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightSource {
    /// From options, or from lights or the environment of the file.
    Given,
    /// From surfaces that emit alone, which may light no others.
    Emission,
    /// A light that needs no file: because it was chosen, or there is no other.
    Default,
}

impl LightArgs {
    /// Sets the lights of the scene. `preset` replaces those of the scene, and options replace it.
    pub(crate) fn apply(&self, scene: &mut Scene, preset: Option<Preset>) -> Result<LightSource> {
        scene.environment = self.environment_or(scene.environment.take())?;
        self.apply_lights(scene, preset)
    }

    /// The environment of the options, else the one of the scene.
    pub(crate) fn environment_or(&self, of_scene: Option<Environment>) -> Result<Option<Environment>> {
        if self.is_empty() { Ok(of_scene) } else { self.environment.read().map(Some) }
    }

    /// Whether no light is given.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// [`LightArgs::apply`] to a scene that has its environment.
    pub(crate) fn apply_lights(&self, scene: &mut Scene, preset: Option<Preset>) -> Result<LightSource> {
        if self.is_empty() {
            if preset.is_none() && (scene.lights.iter().any(|light| !light.is_off()) || scene.environment.is_some()) {
                return Ok(LightSource::Given);
            }
            if preset.is_none() && scene.materials.iter().any(Material::is_emissive) {
                return Ok(LightSource::Emission);
            }
            // Until the scene decides.
            set_light(scene, preset.unwrap_or(Preset::Studio), 1.0, DEFAULT_UP);
            return Ok(LightSource::Default);
        }
        scene.lights.clear();
        // Without `..`, so that a new kind cannot be forgotten.
        let Self { environment: _, sun, point, sphere } = self;
        for &Value([x, y, z, r, g, b]) in sun {
            if [x, y, z] == [0.0; 3] {
                return Err(anyhow!("--sun {x},{y},{z},{r},{g},{b}: the direction is zero"));
            }
            let irradiance = color("--sun", [r, g, b])?;
            scene.lights.push(Light::Sun { direction: unit([x, y, z]), irradiance });
        }
        for &Value([x, y, z, r, g, b]) in point {
            let intensity = color("--point", [r, g, b])?;
            scene.lights.push(Light::Point { position: [x, y, z], intensity });
        }
        for &Value([x, y, z, radius, r, g, b]) in sphere {
            if radius <= 0.0 {
                return Err(anyhow!("--sphere: radius {radius} is not greater than zero"));
            }
            let radiance = color("--sphere", [r, g, b])?;
            scene.lights.push(Light::Sphere { center: [x, y, z], radius, radiance });
        }
        Ok(LightSource::Given)
    }

    /// Rejects options of the environment without one, as the command line does.
    pub(crate) fn check(&self) -> Result<()> {
        let EnvironmentArgs { env, env_turn, env_scale } = &self.environment;
        if env.is_none() && (env_turn.is_some() || env_scale.is_some()) {
            return Err(anyhow!("--env-turn and --env-scale require --env"));
        }
        Ok(())
    }

    /// The file of `--env`, the factor of its radiance and its rotation in degrees.
    pub(crate) fn environment_file(&self) -> Option<(&Path, [f32; 3], f32)> {
        self.environment.file()
    }
}

impl EnvironmentArgs {
    /// The file of `--env`, the factor of its radiance and its rotation in degrees.
    fn file(&self) -> Option<(&Path, [f32; 3], f32)> {
        let Some(Value(EnvironmentArg::Map(path))) = &self.env else { return None };
        Some((path, [self.scale(); 3], self.env_turn.map_or(0.0, |turn| turn.0)))
    }

    fn scale(&self) -> f32 {
        self.env_scale.map_or(1.0, |scale| scale.0)
    }

    fn read(&self) -> Result<Environment> {
        if let Some((path, scale, turn_degrees)) = self.file() {
            let mut warnings = Vec::new();
            let image = canted_scene::read_environment(path, &mut warnings)?;
            warnings.iter().for_each(|warning| output::warn(warning));
            return Ok(Environment::Image(EnvironmentImage { scale, turn_degrees, ..image }));
        }
        let Some(Value(EnvironmentArg::Constant(radiance))) = &self.env else { return Ok([0.0; 3].into()) };
        if self.env_turn.is_some() {
            return Err(anyhow!("--env-turn requires an environment map: --env FILE"));
        }
        let scale = self.scale();
        let scaled = color("--env", *radiance)?.map(|c| c * scale);
        if !scaled.iter().all(|c| c.is_finite()) {
            return Err(anyhow!("--env times --env-scale {scale} exceeds single precision"));
        }
        Ok(scaled.into())
    }
}

/// Checks the color of an option.
fn color(name: &str, color: [f32; 3]) -> Result<[f32; 3]> {
    if color.iter().all(|&c| c >= 0.0) {
        return Ok(color);
    }
    Err(anyhow!("{name}: color {},{},{} has a negative component", color[0], color[1], color[2]))
}

/// Up where nothing else is said.
pub(crate) const DEFAULT_UP: [f32; 3] = [0.0, 1.0, 0.0];

/// Normalizes a nonzero vector.
fn unit(v: [f32; 3]) -> [f32; 3] {
    let v: DVec3 = Vec3::from(v).into();
    (v / v.length()).as_vec3().into()
}
