use super::direction;
use super::table::{Bounds, Table};
use super::toml_writer::{TomlWriter, number, numbers, quoted};
use crate::{Light, ReadError};

/// Smallest angle, rounded up, whose cosine differs from 1 in single precision: 2^-12 radians.
const MIN_CONE_DEGREES: f64 = 0.014;

const TYPES: [&str; 5] = ["sun", "point", "spot", "sphere", "disc"];

/// Reads one table of `[[lights]]`.
pub(super) fn read(table: Table<'_>) -> Result<Light, ReadError> {
    let index = table.required("type", table.choice("type", &TYPES)?)?;
    let kind = TYPES[index];
    let table = table.with_name(&format!("a light of type {kind}"));
    match kind {
        "sun" => {
            table.check_keys(&["type", "direction", "irradiance"])?;
            Ok(Light::Sun {
                direction: direction::read(&table, "direction")?,
                irradiance: color(&table, "irradiance")?,
            })
        }
        "point" => {
            table.check_keys(&["type", "position", "intensity"])?;
            Ok(Light::Point { position: point(&table, "position")?, intensity: color(&table, "intensity")? })
        }
        "spot" => spot(&table),
        "sphere" => {
            table.check_keys(&["type", "center", "radius", "radiance"])?;
            let (center, radius) = (point(&table, "center")?, radius(&table)?);
            Ok(Light::Sphere { center, radius, radiance: color(&table, "radiance")? })
        }
        _ => {
            table.check_keys(&["type", "center", "normal", "radius", "radiance"])?;
            let (center, normal) = (point(&table, "center")?, direction::read(&table, "normal")?);
            Ok(Light::Disk { center, normal, radius: radius(&table)?, radiance: color(&table, "radiance")? })
        }
    }
}

fn spot(table: &Table<'_>) -> Result<Light, ReadError> {
    table.check_keys(&["type", "position", "direction", "intensity", "inner_degrees", "outer_degrees"])?;
    let outer = table.required("outer_degrees", table.number_f64("outer_degrees", Bounds::ConeAngle)?)?;
    let inner = table.number_f64("inner_degrees", Bounds::ConeAngle)?.unwrap_or(0.0);
    let (cos_inner, cos_outer) = (cos(inner), cos(outer));
    if outer <= inner {
        return Err(table.invalid("outer_degrees", &format!("an angle greater than 'inner_degrees', {inner}")));
    }
    if cos_outer >= cos_inner {
        let wanted = format!(
            "an angle whose cosine differs from that of 'inner_degrees', {inner}, in single precision \
             (from 0 at least {MIN_CONE_DEGREES})"
        );
        return Err(table.invalid("outer_degrees", &wanted));
    }
    let (position, direction) = (point(table, "position")?, direction::read(table, "direction")?);
    Ok(Light::Spot { position, direction, intensity: color(table, "intensity")?, cos_inner, cos_outer })
}

/// Cosine of an angle in degrees; exactly 0 at 90.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn cos(degrees: f64) -> f32 {
    (90.0 - degrees).to_radians().sin() as f32
}

fn point(table: &Table<'_>, key: &str) -> Result<[f32; 3], ReadError> {
    table.required(key, table.numbers(key, Bounds::Finite)?)
}

fn color(table: &Table<'_>, key: &str) -> Result<[f32; 3], ReadError> {
    table.required(key, table.numbers(key, Bounds::NotNegative)?)
}

fn radius(table: &Table<'_>) -> Result<f32, ReadError> {
    table.required("radius", table.number("radius", Bounds::Positive)?)
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
    let mut kind = |name: &str| out.entry("type", &quoted(name), &TYPES.join(", "));
    match light {
        Light::Sun { direction, irradiance } => {
            kind("sun");
            out.entry("direction", &numbers(direction), "of propagation");
            out.entry("irradiance", &numbers(irradiance), IRRADIANCE);
        }
        Light::Point { position, intensity } => {
            kind("point");
            out.entry("position", &numbers(position), "");
            out.entry("intensity", &numbers(intensity), INTENSITY);
        }
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            let degrees = |cos: f32| format!("{:?}", f64::from(cos).acos().to_degrees());
            kind("spot");
            out.entry("position", &numbers(position), "");
            out.entry("direction", &numbers(direction), "the axis");
            out.entry("intensity", &numbers(intensity), INTENSITY);
            out.entry("inner_degrees", &degrees(*cos_inner), "full intensity inside this angle to the axis");
            out.entry("outer_degrees", &degrees(*cos_outer), "no light outside this angle");
        }
        Light::Sphere { center, radius, radiance } => {
            kind("sphere");
            out.entry("center", &numbers(center), "");
            out.entry("radius", &number(*radius), "");
            out.entry("radiance", &numbers(radiance), RADIANCE);
        }
        Light::Disk { center, normal, radius, radiance } => {
            kind("disc");
            out.entry("center", &numbers(center), "");
            out.entry("normal", &numbers(normal), "of the emitting side");
            out.entry("radius", &number(*radius), "");
            out.entry("radiance", &numbers(radiance), RADIANCE);
        }
    }
}
