//! Lights and environment of a scene file.

use serde::Deserialize;
use serde_spanned::Spanned;

use super::tables::{Color, ConeAngle, Direction, FileName, Finite, In, NotNegative, Point, Positive, Source};
use super::writer::{TomlWriter, number, numbers, quoted};
use crate::{Light, ReadError};

/// Smallest angle, rounded up, whose cosine differs from 1 in single precision: 2^-12 radians.
const MIN_CONE_DEGREES: f64 = 0.014;

/// A table of `[[lights]]`, by its `type`.
#[derive(Deserialize)]
#[serde(rename = "light", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum LightTable {
    Sun {
        direction: Direction,
        irradiance: Color,
    },
    Point {
        position: Point,
        intensity: Color,
    },
    Spot {
        position: Point,
        direction: Direction,
        intensity: Color,
        inner_degrees: Option<In<f64, ConeAngle>>,
        outer_degrees: Spanned<In<f64, ConeAngle>>,
    },
    Sphere {
        center: Point,
        radius: In<f32, Positive>,
        radiance: Color,
    },
    #[serde(alias = "disc")]
    Disk {
        center: Point,
        normal: Direction,
        radius: In<f32, Positive>,
        radiance: Color,
    },
}

/// The light of a table.
pub(super) fn light(table: LightTable, source: &Source<'_>) -> Result<Light, ReadError> {
    Ok(match table {
        LightTable::Sun { direction, irradiance } => Light::Sun { direction: direction.0, irradiance: irradiance.0 },
        LightTable::Point { position, intensity } => Light::Point { position: position.0, intensity: intensity.0 },
        LightTable::Spot { position, direction, intensity, inner_degrees, outer_degrees } => {
            let (inner, outer) = (inner_degrees.map_or(0.0, |inner| inner.0), outer_degrees.get_ref().0);
            let (cos_inner, cos_outer) = (cos(inner), cos(outer));
            let fail =
                |expected: &str| Err(source.invalid(&outer_degrees, "outer_degrees", "a light of type spot", expected));
            if outer <= inner {
                return fail(&format!("an angle greater than 'inner_degrees', {inner}"));
            }
            if cos_outer >= cos_inner {
                return fail(&format!(
                    "an angle whose cosine differs from that of 'inner_degrees', {inner}, in single precision \
                     (from 0 at least {MIN_CONE_DEGREES})"
                ));
            }
            let (position, direction, intensity) = (position.0, direction.0, intensity.0);
            Light::Spot { position, direction, intensity, cos_inner, cos_outer }
        }
        LightTable::Sphere { center, radius, radiance } => {
            Light::Sphere { center: center.0, radius: radius.0, radiance: radiance.0 }
        }
        LightTable::Disk { center, normal, radius, radiance } => {
            Light::Disk { center: center.0, normal: normal.0, radius: radius.0, radiance: radiance.0 }
        }
    })
}

/// Cosine of an angle in degrees; exactly 0 at 90.
fn cos(degrees: f64) -> f32 {
    (90.0 - degrees).to_radians().sin() as f32
}

/// Writes `[[lights]]`.
pub(super) fn write(lights: &[Light], out: &mut TomlWriter) {
    if lights.is_empty() {
        out.blank();
        out.entry("lights", "[]", "no lights, not even those of the assets");
    }
    for light in lights {
        out.heading("[[lights]]");
        write_one(light, out);
    }
}

fn write_one(light: &Light, out: &mut TomlWriter) {
    const IRRADIANCE: &str = "on a perpendicular surface, W/m2, linear RGB";
    const INTENSITY: &str = "W/sr, linear RGB";
    const RADIANCE: &str = "W/(m2 sr), linear RGB";
    out.entry("type", &quoted(Light::KINDS[light.kind()]), &Light::KINDS.join(", "));
    match light {
        Light::Sun { direction, irradiance } => {
            out.entry("direction", &numbers(direction), "of propagation");
            out.entry("irradiance", &numbers(irradiance), IRRADIANCE);
        }
        Light::Point { position, intensity } => {
            out.entry("position", &numbers(position), "");
            out.entry("intensity", &numbers(intensity), INTENSITY);
        }
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            let degrees = |cos: f32| format!("{:?}", f64::from(cos).acos().to_degrees());
            out.entry("position", &numbers(position), "");
            out.entry("direction", &numbers(direction), "the axis");
            out.entry("intensity", &numbers(intensity), INTENSITY);
            out.entry("inner_degrees", &degrees(*cos_inner), "full intensity inside this angle to the axis");
            out.entry("outer_degrees", &degrees(*cos_outer), "no light outside this angle");
        }
        Light::Sphere { center, radius, radiance } => {
            out.entry("center", &numbers(center), "");
            out.entry("radius", &number(*radius), "");
            out.entry("radiance", &numbers(radiance), RADIANCE);
        }
        Light::Disk { center, normal, radius, radiance } => {
            out.entry("center", &numbers(center), "");
            out.entry("normal", &numbers(normal), "of the emitting side");
            out.entry("radius", &number(*radius), "");
            out.entry("radiance", &numbers(radiance), RADIANCE);
        }
    }
}

/// Environment light as specified in a scene file.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentSource {
    /// Constant radiance, linear RGB.
    Constant([f32; 3]),
    /// An environment map, see [`crate::EnvironmentImage`].
    Image {
        /// Image file.
        file: String,
        /// Multiplier of all texels.
        scale: [f32; 3],
        /// Rotation about +y in degrees.
        turn_degrees: f32,
        /// Line in the scene file; 0 if not read from one.
        line: usize,
    },
}

/// `[environment]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EnvironmentTable {
    constant: Option<Color>,
    image: Option<Spanned<FileName>>,
    scale: Option<Spanned<In<[f32; 3], NotNegative>>>,
    turn_degrees: Option<Spanned<In<f32, Finite>>>,
}

/// The environment of `[environment]`.
pub(super) fn environment(
    table: Spanned<EnvironmentTable>,
    source: &Source<'_>,
) -> Result<EnvironmentSource, ReadError> {
    let at = table.span().start;
    let EnvironmentTable { constant, image, scale, turn_degrees } = table.into_inner();
    let Some(file) = image else {
        let of_image =
            [("scale", scale.map(|scale| scale.span())), ("turn_degrees", turn_degrees.map(|turn| turn.span()))];
        if let Some((key, span)) = of_image.into_iter().find_map(|(key, span)| Some((key, span?))) {
            return Err(source.error(span.start, format!("'{key}' in [environment] requires 'image'")));
        }
        let missing = || source.error(at, "missing key 'constant' in [environment]");
        return Ok(EnvironmentSource::Constant(constant.ok_or_else(missing)?.0));
    };
    if constant.is_some() {
        return Err(source.error(file.span().start, "use either 'image' or 'constant', not both"));
    }
    Ok(EnvironmentSource::Image {
        file: file.into_inner().0,
        scale: scale.map_or([1.0; 3], |scale| scale.into_inner().0),
        turn_degrees: turn_degrees.map_or(0.0, |turn| turn.into_inner().0),
        line: source.line(at),
    })
}

/// Writes `[environment]`.
pub(super) fn write_environment(environment: &EnvironmentSource, out: &mut TomlWriter) {
    out.heading("[environment]");
    match environment {
        EnvironmentSource::Constant(radiance) => {
            out.entry("constant", &numbers(radiance), "radiance, W/(m2 sr), linear RGB");
        }
        EnvironmentSource::Image { file, scale, turn_degrees, line: _ } => {
            out.entry("image", &quoted(file), "equirectangular, +y up");
            out.entry("scale", &numbers(scale), "multiplier of red, green and blue");
            out.entry("turn_degrees", &number(*turn_degrees), "rotation about +y, counter-clockwise from above");
        }
    }
}
