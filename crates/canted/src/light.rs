//! What lights a scene: the options, else the file, else a sky and a sun.

use anyhow::{Result, anyhow};
use canted_scene::{Light, Material, Scene};

use crate::options;

/// Lights from the command line. Any of them replaces the lights of the file.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct LightArgs {
    /// Constant radiance from outside.
    #[arg(long, value_parser = options::triple, value_name = "R,G,B", allow_hyphen_values = true)]
    env: Option<[f32; 3]>,
    /// Direction in which sunlight travels, and its irradiance on a surface that faces it.
    #[arg(long, value_parser = options::sextuple, value_name = "DX,DY,DZ,R,G,B", allow_hyphen_values = true)]
    sun: Vec<[f32; 6]>,
    /// Position and radiant intensity (W/sr) of a point light.
    #[arg(long, value_parser = options::sextuple, value_name = "X,Y,Z,R,G,B", allow_hyphen_values = true)]
    point: Vec<[f32; 6]>,
}

impl LightArgs {
    /// Puts the lights into the scene; says whether they are nobody's choice but ours.
    pub(crate) fn apply(&self, scene: &mut Scene) -> Result<bool> {
        if self.env.is_none() && self.sun.is_empty() && self.point.is_empty() {
            let emits = scene.materials.iter().any(Material::emits);
            let is_dark = scene.lights.is_empty() && scene.environment.is_none() && !emits;
            if is_dark {
                set_default(scene, 1.0);
            }
            return Ok(is_dark);
        }
        let color = |name: &str, color: [f32; 3]| {
            if color.iter().all(|&c| c >= 0.0) {
                Ok(color)
            } else {
                Err(anyhow!("{name} {},{},{} has a negative colour", color[0], color[1], color[2]))
            }
        };
        scene.environment = Some(color("--env", self.env.unwrap_or([0.0; 3]))?.into());
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
        Ok(false)
    }
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
