use super::direction;
use super::page::{Page, number, numbers, quoted};
use super::table::{Bounds, Table};
use crate::{Light, ReadError};

/// About the least angle whose cosine is not 1 in single precision: that of 2^-12 radians is half-way to the number below 1.
const LEAST_CONE_DEGREES: f64 = 0.014;

const TYPES: [&str; 5] = ["sun", "point", "spot", "sphere", "disc"];

/// Reads one of `[[lights]]`.
pub(super) fn read(table: Table<'_>) -> Result<Light, ReadError> {
    let index = table.required("type", table.choice("type", &TYPES)?)?;
    let kind = TYPES[index];
    let table = table.called(&format!("a light of type {kind}"));
    match kind {
        "sun" => {
            table.only(&["type", "direction", "irradiance"])?;
            Ok(Light::Sun {
                direction: direction::read(&table, "direction")?,
                irradiance: color(&table, "irradiance")?,
            })
        }
        "point" => {
            table.only(&["type", "position", "intensity"])?;
            Ok(Light::Point { position: point(&table, "position")?, intensity: color(&table, "intensity")? })
        }
        "spot" => spot(&table),
        "sphere" => {
            table.only(&["type", "center", "radius", "radiance"])?;
            let (center, radius) = (point(&table, "center")?, radius(&table)?);
            Ok(Light::Sphere { center, radius, radiance: color(&table, "radiance")? })
        }
        _ => {
            table.only(&["type", "center", "normal", "radius", "radiance"])?;
            let (center, normal) = (point(&table, "center")?, direction::read(&table, "normal")?);
            Ok(Light::Disk { center, normal, radius: radius(&table)?, radiance: color(&table, "radiance")? })
        }
    }
}

fn spot(table: &Table<'_>) -> Result<Light, ReadError> {
    table.only(&["type", "position", "direction", "intensity", "inner_degrees", "outer_degrees"])?;
    let outer = table.required("outer_degrees", table.number_f64("outer_degrees", Bounds::ConeAngle)?)?;
    let inner = table.number_f64("inner_degrees", Bounds::ConeAngle)?.unwrap_or(0.0);
    let (cos_inner, cos_outer) = (cos(inner), cos(outer));
    if outer <= inner {
        return Err(table.refuse("outer_degrees", &format!("more than `inner_degrees`, {inner}")));
    }
    if cos_outer >= cos_inner {
        let wanted = format!(
            "an angle whose cosine single precision tells from that of `inner_degrees`, {inner}; \
             from 0 it tells {LEAST_CONE_DEGREES} and more"
        );
        return Err(table.refuse("outer_degrees", &wanted));
    }
    let (position, direction) = (point(table, "position")?, direction::read(table, "direction")?);
    Ok(Light::Spot { position, direction, intensity: color(table, "intensity")?, cos_inner, cos_outer })
}

/// The cosine of an angle in degrees, exactly 0 at 90.
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

/// Writes all of `[[lights]]`.
pub(super) fn write(lights: &[Light], page: &mut Page) {
    if lights.is_empty() {
        page.blank();
        page.line("lights", "[]", "none, whatever the assets bring");
    }
    for light in lights {
        page.heading("[[lights]]");
        one(light, page);
    }
}

fn one(light: &Light, page: &mut Page) {
    const IRRADIANCE: &str = "on a surface that faces it, W/m2, linear RGB";
    const INTENSITY: &str = "W/sr, linear RGB";
    const RADIANCE: &str = "W/(m2 sr), linear RGB";
    let mut kind = |name: &str| page.line("type", &quoted(name), &TYPES.join(", "));
    match light {
        Light::Sun { direction, irradiance } => {
            kind("sun");
            page.line("direction", &numbers(direction), "in which the light travels");
            page.line("irradiance", &numbers(irradiance), IRRADIANCE);
        }
        Light::Point { position, intensity } => {
            kind("point");
            page.line("position", &numbers(position), "");
            page.line("intensity", &numbers(intensity), INTENSITY);
        }
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            let degrees = |cos: f32| format!("{:?}", f64::from(cos).acos().to_degrees());
            kind("spot");
            page.line("position", &numbers(position), "");
            page.line("direction", &numbers(direction), "the axis");
            page.line("intensity", &numbers(intensity), INTENSITY);
            page.line("inner_degrees", &degrees(*cos_inner), "to the axis, up to which it is full");
            page.line("outer_degrees", &degrees(*cos_outer), "to the axis, beyond which it is dark");
        }
        Light::Sphere { center, radius, radiance } => {
            kind("sphere");
            page.line("center", &numbers(center), "");
            page.line("radius", &number(*radius), "");
            page.line("radiance", &numbers(radiance), RADIANCE);
        }
        Light::Disk { center, normal, radius, radiance } => {
            kind("disc");
            page.line("center", &numbers(center), "");
            page.line("normal", &numbers(normal), "of the side that shines");
            page.line("radius", &number(*radius), "");
            page.line("radiance", &numbers(radiance), RADIANCE);
        }
    }
}
