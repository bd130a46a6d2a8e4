use canted_obb::vector::{cross, sub, to_f64};

use super::table::{Bounds, Table};
use super::toml_writer::{TomlWriter, number, numbers};
use crate::{Camera, Lens, Projection, ReadError};

const KEYS: [&str; 7] = ["eye", "target", "up", "fov_degrees", "height", "aperture_radius", "focus_distance"];

/// Default vertical field of view in degrees.
const FOV_DEGREES: f32 = 45.0;

/// Reads `[camera]`.
pub(super) fn read(table: &Table<'_>) -> Result<Camera, ReadError> {
    table.check_keys(&KEYS)?;
    let eye = table.required("eye", table.numbers("eye", Bounds::Finite)?)?;
    let target = table.required("target", table.numbers("target", Bounds::Finite)?)?;
    let up = table.numbers("up", Bounds::Finite)?.unwrap_or([0.0, 1.0, 0.0]);
    if eye == target {
        return Err(table.invalid("target", "a point other than 'eye'"));
    }
    let [view_start, view_end, up_wide] = [eye, target, up].map(to_f64);
    if cross(up_wide, sub(view_end, view_start)) == [0.0; 3] {
        return Err(table.invalid("up", "a direction that is not parallel to the view direction"));
    }
    let fov_degrees = table.number("fov_degrees", Bounds::FieldOfView)?;
    let projection = match (fov_degrees, table.number("height", Bounds::Positive)?) {
        (Some(_), Some(_)) => return Err(table.error("height", "use either 'height' or 'fov_degrees', not both")),
        (fov_degrees, None) => Projection::Perspective { fov_degrees: fov_degrees.unwrap_or(FOV_DEGREES) },
        (None, Some(height)) => Projection::Orthographic { height },
    };
    Ok(Camera { eye, target, up, projection, lens: lens(table, eye, target)? })
}

/// The lens, by default focused on the target.
#[expect(clippy::cast_possible_truncation, reason = "a distance of points in f32")]
fn lens(table: &Table<'_>, eye: [f32; 3], target: [f32; 3]) -> Result<Option<Lens>, ReadError> {
    let radius = table.number("aperture_radius", Bounds::NotNegative)?.unwrap_or(0.0);
    let focus_distance = table.number("focus_distance", Bounds::Positive)?;
    if radius == 0.0 {
        return Ok(None);
    }
    let square: f64 = eye.iter().zip(target).map(|(&a, b)| (f64::from(b) - f64::from(a)).powi(2)).sum();
    let focus_distance = focus_distance.unwrap_or_else(|| (square.sqrt() as f32).clamp(f32::MIN_POSITIVE, f32::MAX));
    Ok(Some(Lens { radius, focus_distance }))
}

/// Writes `[camera]`.
pub(super) fn write(camera: &Camera, out: &mut TomlWriter) {
    let Camera { eye, target, up, projection, lens } = camera;
    out.heading("[camera]");
    out.entry("eye", &numbers(eye), "world space");
    out.entry("target", &numbers(target), "at the image center");
    out.entry("up", &numbers(up), "up direction in the image");
    match *projection {
        Projection::Perspective { fov_degrees } => {
            out.entry("fov_degrees", &number(fov_degrees), "vertical; use height instead for an orthographic camera");
        }
        Projection::Orthographic { height } => {
            out.entry("height", &number(height), "of the visible region; use fov_degrees instead for perspective");
        }
    }
    match lens {
        None => out.entry("aperture_radius", "0.0", "above 0 for depth of field; then set focus_distance"),
        Some(Lens { radius, focus_distance }) => {
            out.entry("aperture_radius", &number(*radius), "0 disables depth of field");
            out.entry("focus_distance", &number(*focus_distance), "from the eye along the view direction");
        }
    }
}
