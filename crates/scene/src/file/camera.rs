use super::page::{Page, number, numbers};
use super::table::{Bounds, Table};
use crate::{Camera, Lens, Projection, ReadError};

const KEYS: [&str; 7] = ["eye", "target", "up", "fov_degrees", "height", "aperture_radius", "focus_distance"];

/// Vertical field of view where nothing is said, degrees.
const FOV_DEGREES: f32 = 45.0;

/// Reads `[camera]`.
pub(super) fn read(table: &Table<'_>) -> Result<Camera, ReadError> {
    table.only(&KEYS)?;
    let eye = table.required("eye", table.numbers("eye", Bounds::Finite)?)?;
    let target = table.required("target", table.numbers("target", Bounds::Finite)?)?;
    let up = table.numbers("up", Bounds::Finite)?.unwrap_or([0.0, 1.0, 0.0]);
    if eye == target {
        return Err(table.refuse("target", "a point other than `eye`"));
    }
    if is_parallel(up, std::array::from_fn(|k| f64::from(target[k]) - f64::from(eye[k]))) {
        return Err(table.refuse("up", "a direction across the view"));
    }
    let fov_degrees = table.number("fov_degrees", Bounds::FieldOfView)?;
    let projection = match (fov_degrees, table.number("height", Bounds::Positive)?) {
        (Some(_), Some(_)) => return Err(table.error("height", "a camera with `height` has no `fov_degrees`")),
        (fov_degrees, None) => Projection::Perspective { fov_degrees: fov_degrees.unwrap_or(FOV_DEGREES) },
        (None, Some(height)) => Projection::Orthographic { height },
    };
    Ok(Camera { eye, target, up, projection, lens: lens(table, eye, target)? })
}

/// The lens; the target is sharp where nothing else is said.
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

/// Whether `up` says nothing about how a camera that looks along `view` is turned.
fn is_parallel(up: [f32; 3], view: [f64; 3]) -> bool {
    let up = up.map(f64::from);
    (0..3).all(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        up[i] * view[j] - up[j] * view[i] == 0.0
    })
}

/// Writes `[camera]`.
pub(super) fn write(camera: &Camera, page: &mut Page) {
    let Camera { eye, target, up, projection, lens } = camera;
    page.heading("[camera]");
    page.line("eye", &numbers(eye), "world space");
    page.line("target", &numbers(target), "a point in the middle of the picture");
    page.line("up", &numbers(up), "points up in the picture");
    match *projection {
        Projection::Perspective { fov_degrees } => {
            page.line("fov_degrees", &number(fov_degrees), "vertical; `height` instead makes all rays parallel");
        }
        Projection::Orthographic { height } => {
            page.line(
                "height",
                &number(height),
                "of what the picture shows; `fov_degrees` instead makes a perspective",
            );
        }
    }
    match lens {
        None => page.line("aperture_radius", "0.0", "above 0, what is not at `focus_distance` is out of focus"),
        Some(Lens { radius, focus_distance }) => {
            page.line("aperture_radius", &number(*radius), "0 makes all sharp");
            page.line("focus_distance", &number(*focus_distance), "from the eye along the view");
        }
    }
}
