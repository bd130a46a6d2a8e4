use super::table::{Bounds, Table};
use super::toml_writer::{TomlWriter, number, numbers, quoted};
use crate::ReadError;

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

/// Reads `[environment]`.
pub(super) fn read(table: &Table<'_>) -> Result<EnvironmentSource, ReadError> {
    table.check_keys(&["constant", "image", "scale", "turn_degrees"])?;
    let constant = table.numbers("constant", Bounds::NotNegative)?;
    let scale = table.numbers("scale", Bounds::NotNegative)?;
    let turn_degrees = table.number("turn_degrees", Bounds::Finite)?;
    let Some(file) = table.file("image")? else {
        if let Some(key) = ["scale", "turn_degrees"].into_iter().find(|key| table.has(key)) {
            return Err(table.error(key, format!("'{key}' in [environment] requires 'image'")));
        }
        return Ok(EnvironmentSource::Constant(table.required("constant", constant)?));
    };
    if constant.is_some() {
        return Err(table.error("image", "use either 'image' or 'constant', not both"));
    }
    let (scale, turn_degrees) = (scale.unwrap_or([1.0; 3]), turn_degrees.unwrap_or(0.0));
    Ok(EnvironmentSource::Image { file: file.to_owned(), scale, turn_degrees, line: table.line() })
}

/// Writes `[environment]`.
pub(super) fn write(environment: &EnvironmentSource, out: &mut TomlWriter) {
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
