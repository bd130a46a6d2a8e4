//! What lights a scene: the options, else the file, else a sky and a sun.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_scene::{Environment, EnvironmentImage, Light, Material, Scene};

use crate::{load, options};

/// Lights from the command line. Any of them replaces all lights of the file and its environment.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct LightArgs {
    /// Radiance (W/(m² sr)) from outside: the same from everywhere, or a picture of all directions (`.hdr`, `.exr`). `--env`, `--sun`,
    /// `--point` and `--sphere` together replace all lights of the scene and its environment.
    #[arg(long, value_parser = environment, value_name = "R,G,B|FILE", allow_hyphen_values = true)]
    env: Option<EnvironmentArg>,
    /// Turns the picture of `--env` by so many degrees about the y axis, counter-clockwise seen from above.
    #[arg(long, value_parser = options::number, value_name = "DEG", requires = "env", allow_hyphen_values = true)]
    env_turn: Option<f32>,
    /// Factor of the radiance of `--env`.
    #[arg(long, value_parser = options::factor, value_name = "X", requires = "env", allow_hyphen_values = true)]
    env_scale: Option<f32>,
    /// Direction in which sunlight travels, and its irradiance (W/m²) on a surface that faces it; the sky is black without `--env`.
    #[arg(long, value_parser = options::sextuple, value_name = "DX,DY,DZ,R,G,B", allow_hyphen_values = true)]
    sun: Vec<[f32; 6]>,
    /// Position and radiant intensity (W/sr) of a point light.
    #[arg(long, value_parser = options::sextuple, value_name = "X,Y,Z,R,G,B", allow_hyphen_values = true)]
    point: Vec<[f32; 6]>,
    /// Middle, radius and radiance (W/(m² sr)) of a ball of light; spots and discs are for scene files.
    #[arg(long, value_parser = options::numbers::<7>, value_name = "X,Y,Z,RADIUS,R,G,B", allow_hyphen_values = true)]
    sphere: Vec<[f32; 7]>,
}

/// What `--env` names.
#[derive(Clone, Debug)]
enum EnvironmentArg {
    Constant([f32; 3]),
    Picture(PathBuf),
}

/// A file by its ending, else three numbers.
fn environment(text: &str) -> Result<EnvironmentArg, String> {
    let ending = Path::new(text).extension().unwrap_or_default();
    if ["hdr", "exr"].iter().any(|known| ending.eq_ignore_ascii_case(known)) {
        return Ok(EnvironmentArg::Picture(text.into()));
    }
    let color = options::triple(text).map_err(|why| format!("{why}; a file ends in .hdr or .exr"))?;
    Ok(EnvironmentArg::Constant(color))
}

impl LightArgs {
    /// Puts the lights into the scene; says whether they are nobody's choice but ours.
    pub(crate) fn apply(&self, scene: &mut Scene) -> Result<bool> {
        if self.env.is_none() && self.sun.is_empty() && self.point.is_empty() && self.sphere.is_empty() {
            let emits = scene.materials.iter().any(Material::is_emissive);
            let is_dark = scene.lights.is_empty() && scene.environment.is_none() && !emits;
            if is_dark {
                set_default(scene, 1.0);
            }
            return Ok(is_dark);
        }
        scene.environment = Some(self.environment()?);
        scene.lights.clear();
        for &[x, y, z, r, g, b] in &self.sun {
            if [x, y, z] == [0.0; 3] {
                return Err(anyhow!("--sun has the direction 0,0,0"));
            }
            let irradiance = color("--sun", [r, g, b])?;
            scene.lights.push(Light::Sun { direction: unit([x, y, z]), irradiance });
        }
        for &[x, y, z, r, g, b] in &self.point {
            let intensity = color("--point", [r, g, b])?;
            scene.lights.push(Light::Point { position: [x, y, z], intensity });
        }
        for &[x, y, z, radius, r, g, b] in &self.sphere {
            if radius <= 0.0 {
                return Err(anyhow!("--sphere has the radius {radius}, which is not above zero"));
            }
            let radiance = color("--sphere", [r, g, b])?;
            scene.lights.push(Light::Sphere { center: [x, y, z], radius, radiance });
        }
        Ok(false)
    }

    /// The file of `--env`, the factor of its radiance and the angle by which it is turned.
    pub(crate) fn environment_file(&self) -> Option<(&Path, [f32; 3], f32)> {
        let Some(EnvironmentArg::Picture(path)) = &self.env else { return None };
        Some((path, [self.env_scale.unwrap_or(1.0); 3], self.env_turn.unwrap_or(0.0)))
    }

    /// Black without `--env`.
    fn environment(&self) -> Result<Environment> {
        if let Some((path, scale, turn_degrees)) = self.environment_file() {
            let mut warnings = Vec::new();
            let image = canted_scene::read_environment(path, &mut warnings)?;
            load::warn(&warnings);
            return Ok(Environment::Image(EnvironmentImage { scale, turn_degrees, ..image }));
        }
        let Some(EnvironmentArg::Constant(radiance)) = &self.env else { return Ok([0.0; 3].into()) };
        if self.env_turn.is_some() {
            return Err(anyhow!(
                "--env-turn says nothing of an --env that is the same from everywhere: it turns pictures"
            ));
        }
        let scale = self.env_scale.unwrap_or(1.0);
        let scaled = color("--env", *radiance)?.map(|c| c * scale);
        if !scaled.iter().all(|c| c.is_finite()) {
            return Err(anyhow!("--env times --env-scale {scale} is more than single precision holds"));
        }
        Ok(scaled.into())
    }
}

/// A colour of an option, which no component makes negative.
fn color(name: &str, color: [f32; 3]) -> Result<[f32; 3]> {
    if color.iter().all(|&c| c >= 0.0) {
        return Ok(color);
    }
    Err(anyhow!("{name} {},{},{} has a negative colour", color[0], color[1], color[2]))
}

/// A blue sky and a sun high up, times `strength`.
pub(crate) fn set_default(scene: &mut Scene, strength: f32) {
    scene.environment = Some([0.40, 0.50, 0.65].map(|c| c * strength).into());
    let irradiance = [2.0, 1.9, 1.7].map(|c| c * strength);
    scene.lights = vec![Light::Sun { direction: unit([-0.3, -1.0, -0.2]), irradiance }];
}

/// The direction at length one, for a vector of any length but zero.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn unit(v: [f32; 3]) -> [f32; 3] {
    let v = v.map(f64::from);
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| (x / length) as f32)
}
