use super::page::{Page, number, numbers, quoted};
use super::table::{Bounds, Table};
use crate::ReadError;

/// Radiance from outside, as a scene file says it.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentSource {
    /// The same from everywhere, linear RGB.
    Constant([f32; 3]),
    /// A picture by longitude and latitude, see [`crate::EnvironmentImage`].
    Image {
        /// The file.
        file: String,
        /// Factor of all texels.
        scale: [f32; 3],
        /// Angle by which it is turned about +y.
        turn_degrees: f32,
        /// Line of the scene file, 0 where it was not read.
        line: usize,
    },
}

/// Reads `[environment]`.
pub(super) fn read(table: &Table<'_>) -> Result<EnvironmentSource, ReadError> {
    table.only(&["constant", "image", "scale", "turn_degrees"])?;
    let constant = table.numbers("constant", Bounds::NotNegative)?;
    let scale = table.numbers("scale", Bounds::NotNegative)?;
    let turn_degrees = table.number("turn_degrees", Bounds::Finite)?;
    let Some(file) = table.file("image")? else {
        if let Some(key) = ["scale", "turn_degrees"].into_iter().find(|key| table.has(key)) {
            return Err(table.error(key, format!("`{key}` of the environment needs an `image`")));
        }
        return Ok(EnvironmentSource::Constant(table.required("constant", constant)?));
    };
    if constant.is_some() {
        return Err(table.error("image", "an environment with an `image` has no `constant`"));
    }
    let (scale, turn_degrees) = (scale.unwrap_or([1.0; 3]), turn_degrees.unwrap_or(0.0));
    Ok(EnvironmentSource::Image { file: file.to_owned(), scale, turn_degrees, line: table.line() })
}

/// Writes `[environment]`.
pub(super) fn write(environment: &EnvironmentSource, page: &mut Page) {
    page.heading("[environment]");
    match environment {
        EnvironmentSource::Constant(radiance) => {
            page.line("constant", &numbers(radiance), "radiance, W/(m2 sr), linear RGB");
        }
        EnvironmentSource::Image { file, scale, turn_degrees, line: _ } => {
            page.line("image", &quoted(file), "by longitude and latitude, +y up");
            page.line("scale", &numbers(scale), "factor of red, green and blue");
            page.line("turn_degrees", &number(*turn_degrees), "about +y, counter-clockwise from above");
        }
    }
}
