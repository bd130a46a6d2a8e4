//! The light of a scene without lights, what is behind the scene, and the ground below it.

use canted_film::srgb;
use canted_scene::{Environment, EnvironmentImage, Light, Scene};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{sky, studio};
use crate::options::{Form, Named, Numbers, Text, Value};

/// Help heading of lights.
pub(crate) const LIGHT: &str = "Light (--light, --env, --sun, --point and --sphere replace all lights of the scene)";

/// Options of the surroundings of a scene. Unlike lights they are settings of scene files.
#[derive(clap::Args, Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[command(next_help_heading = LIGHT, next_display_order = 97)]
#[serde(default)]
pub(crate) struct StageOptions {
    /// Light in place of the lights of the scene: `studio` (soft panels), `sky` (blue sky and sun) or `white` (the same from all
    /// sides) [default: the lights of the scene; without any, studio, or sky for rooms and landscapes]
    #[arg(long, value_name = "LIGHT")]
    pub(crate) light: Option<Value<Preset>>,
    /// What the camera sees behind the scene: a color (R,G,B in linear RGB, #RRGGBB, white, gray or black), `environment`, or
    /// `transparent` for .png, .webp and .exr [default: gray for
    /// objects in studio or white light; the environment for rooms, in `sky`, and in the lights of the file]
    #[arg(long, value_name = "COLOR|environment|transparent", allow_hyphen_values = true)]
    pub(crate) background: Option<Value<Background>>,
    /// Ground that receives the shadow of an object (shadow catcher): `auto` below an object in the light of --light, chosen or by default; not
    /// in rooms, nor with a transparent background.
    #[arg(long, default_value = "auto", value_name = "auto|on|off")]
    pub(crate) ground: Option<Value<Option<bool>>>,
}

/// A light that needs no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Preset {
    Studio,
    Sky,
    White,
}

impl Named for Preset {
    fn all() -> Vec<Self> {
        vec![Self::Studio, Self::Sky, Self::White]
    }

    fn name(self) -> &'static str {
        match self {
            Self::Studio => "studio",
            Self::Sky => "sky",
            Self::White => "white",
        }
    }
}

/// The value of `--background`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Background {
    /// Linear RGB.
    Color([f32; 3]),
    Environment,
    Transparent,
}

/// A gray between black surfaces and the shaded sides of gray ones.
const GRAY: [f32; 3] = [0.2; 3];

impl Background {
    /// The background of a scene in a default light.
    pub(crate) const DEFAULT: Self = Self::Color(GRAY);

    /// What camera rays see; `None` for the environment.
    pub(crate) fn color(self) -> Option<[f32; 3]> {
        match self {
            Self::Color(color) => Some(color),
            Self::Environment => None,
            Self::Transparent => Some([0.0; 3]),
        }
    }
}

impl Text for Background {
    fn text(&self) -> String {
        match self {
            Self::Color(color) => color.text(),
            Self::Environment => "environment".to_owned(),
            Self::Transparent => "transparent".to_owned(),
        }
    }
}

impl Form for Background {
    type Value = Self;

    fn parse(text: &str) -> Result<Self, String> {
        let named = match text {
            "environment" => Some(Self::Environment),
            "transparent" => Some(Self::Transparent),
            "white" => Some(Self::Color([1.0; 3])),
            "gray" | "grey" => Some(Self::DEFAULT),
            "black" => Some(Self::Color([0.0; 3])),
            _ => text.strip_prefix('#').and_then(hexadecimal).map(Self::Color),
        };
        let fail = || {
            format!(
                "'{text}' is no background; use environment, transparent, white, gray, black, #RRGGBB, or R,G,B of at least 0"
            )
        };
        if let Some(background) = named {
            return Ok(background);
        }
        let color = Numbers::<3>::parse(text).ok().filter(|color| color.iter().all(|&c| c >= 0.0));
        color.map(Self::Color).ok_or_else(fail)
    }
}

/// The linear color of six hexadecimal digits in sRGB.
fn hexadecimal(digits: &str) -> Option<[f32; 3]> {
    if digits.len() != 6 || !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let bits = u32::from_str_radix(digits, 16).ok()?;
    Some([16, 8, 0].map(|shift| srgb::decode((bits >> shift & 255) as u8)))
}

/// Where the light of the default sun travels, with +y up: it comes over the left shoulder of who looks along the default view.
const SUN: [f32; 3] = [0.35, -0.75, -0.6];

/// Sets the light of a scene, times `strength`. `up` is up in the scene, of any length.
pub(crate) fn set_light(scene: &mut Scene, preset: Preset, strength: f32, up: [f32; 3]) {
    scene.lights.clear();
    let to_local = frame(up);
    scene.environment = Some(match preset {
        Preset::White => [strength; 3].into(),
        Preset::Studio => image("studio", strength, |direction| studio::radiance(to_local(direction))),
        Preset::Sky => {
            let to_sun = -Vec3::from(SUN).as_dvec3().normalize();
            let sky = sky::Sky::new(to_sun);
            let irradiance = sky::SUN_IRRADIANCE.map(|c| c * strength);
            scene.lights.push(Light::Sun { direction: to_world(SUN, up), irradiance });
            image("sky", strength, |direction| sky.radiance(to_local(direction)))
        }
    });
}

/// An environment of a radiance by direction.
fn image(name: &str, strength: f32, radiance: impl Fn(DVec3) -> DVec3) -> Environment {
    /// Edges of panels are twenty texels wide.
    const SIZE: [u32; 2] = [256, 128];
    use std::f64::consts::{PI, TAU};
    let [width, height] = SIZE;
    let texel = |i: u32| {
        let [across, down] =
            [(i % width, width), (i / width, height)].map(|(k, n)| (f64::from(k) + 0.5) / f64::from(n));
        let (s, c) = ((across - 0.5) * TAU).sin_cos();
        let (sine, cosine) = (down * PI).sin_cos();
        radiance(DVec3::new(sine * s, cosine, -sine * c)).as_vec3().to_array()
    };
    let texels = (0..width * height).map(texel).collect();
    let (name, scale) = (name.to_owned(), [strength; 3]);
    Environment::Image(EnvironmentImage { name, width, height, texels, scale, turn_degrees: 0.0 })
}

/// The axes of a scene with this up direction: right, up and towards the viewer, as in the views that frame a scene.
pub(crate) fn axes(up: [f32; 3]) -> [DVec3; 3] {
    let up = Vec3::from(up).as_dvec3().try_normalize().unwrap_or(DVec3::Y);
    let right = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Z };
    let back = right.cross(up).try_normalize().unwrap_or(DVec3::Z);
    [up.cross(back), up, back]
}

/// From directions in a scene with this up direction to those with +y up.
fn frame(up: [f32; 3]) -> impl Fn(DVec3) -> DVec3 {
    let axes = axes(up);
    move |direction| axes.map(|axis| axis.dot(direction)).into()
}

/// A direction of a scene with +y up, of unit length, in one with this up direction.
fn to_world(direction: [f32; 3], up: [f32; 3]) -> [f32; 3] {
    let [right, up, back] = axes(up);
    let [x, y, z] = direction.map(f64::from);
    (right * x + up * y + back * z).normalize().as_vec3().into()
}

#[cfg(test)]
mod tests {
    use canted_renderer::Lights;

    use super::*;

    fn lit(preset: Preset, up: [f32; 3]) -> Scene {
        let mut scene = Scene::default();
        set_light(&mut scene, preset, 1.0, up);
        scene
    }

    /// Directions on all sides.
    fn directions() -> impl Iterator<Item = [f32; 3]> {
        (0..500_u16).map(|i| {
            let height = 1.0 - (2.0 * f64::from(i) + 1.0) / 500.0;
            let (s, c) = (2.4 * f64::from(i)).sin_cos();
            let ring = (1.0 - height * height).sqrt();
            [ring * c, height, ring * s].map(|x| x as f32)
        })
    }

    /// White surfaces are nowhere brighter than white, the brightest nearly so, and the darkest clearly darker; nothing has a color.
    #[test]
    fn the_studio_shows_white_surfaces_in_many_shades() {
        let scene = lit(Preset::Studio, [0.0, 1.0, 0.0]);
        let lights = Lights::new(&scene);
        let (mut least, mut most) = (f32::MAX, 0.0_f32);
        for normal in directions() {
            let [r, g, b] = lights.irradiance_from_afar(normal).map(|x| x / std::f32::consts::PI);
            assert!((r - g).abs() < 1e-6 && (g - b).abs() < 1e-6, "{normal:?}");
            (least, most) = (least.min(r), most.max(r));
        }
        assert!((0.85..1.0).contains(&most) && least < 0.25 * most && least > 0.1, "{least} {most}");
        // A mirror shows panels and walls.
        let seen: Vec<f32> = directions().map(|direction| lights.radiance_from_afar(direction)[0]).collect();
        assert!(seen.iter().any(|&x| x > 1.8) && seen.iter().any(|&x| x < 0.2));
    }

    #[test]
    fn light_follows_the_up_direction() {
        let [y_up, z_up] = [[0.0, 1.0, 0.0], [0.0, 0.0, 2.0]];
        for preset in [Preset::Studio, Preset::Sky, Preset::White] {
            let scenes = [y_up, z_up].map(|up| lit(preset, up));
            for [x, y, z] in directions() {
                let [a, b] = [0, 1].map(|i| {
                    // With z up, y points away from the viewer.
                    let direction = if i == 0 { [x, y, z] } else { [x, -z, y] };
                    Lights::new(&scenes[i]).irradiance_from_afar(direction)[1]
                });
                assert!((a - b).abs() < 0.01 * a, "{preset:?} {x} {y} {z}: {a} {b}");
            }
        }
    }

    #[test]
    fn backgrounds_are_colors_or_names() {
        for (text, background) in [
            ("0.5,1,0", Background::Color([0.5, 1.0, 0.0])),
            ("#ff0000", Background::Color([1.0, 0.0, 0.0])),
            ("white", Background::Color([1.0; 3])),
            ("environment", Background::Environment),
            ("transparent", Background::Transparent),
        ] {
            let parsed = Background::parse(text).unwrap();
            assert_eq!(parsed, background);
            assert_eq!(Background::parse(&parsed.text()), Ok(background), "{text}");
        }
        for text in ["", "#ff00", "#ff00zz", "1,1", "-1,0,0", "blue sky"] {
            assert!(Background::parse(text).is_err(), "{text}");
        }
    }
}
