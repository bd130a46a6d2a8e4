use canted_obb::vector::{cross, sub, to_f64};
use serde::Deserialize;
use serde_spanned::Spanned;

use super::tables::{FieldOfView, In, NotNegative, Point, Positive, Source};
use super::write::{TomlWriter, number, numbers};
use crate::{Camera, Lens, Projection, ReadError};

/// `[camera]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    eye: Point,
    target: Spanned<Point>,
    up: Option<Spanned<Point>>,
    fov_degrees: Option<In<f32, FieldOfView>>,
    height: Option<Spanned<In<f32, Positive>>>,
    aperture_radius: Option<In<f32, NotNegative>>,
    focus_distance: Option<In<f32, Positive>>,
}

const NAME: &str = "[camera]";

/// Default vertical field of view in degrees.
const FOV_DEGREES: f32 = 45.0;

/// The camera of `[camera]`.
pub(super) fn camera(table: &Spanned<CameraTable>, source: &Source<'_>) -> Result<Camera, ReadError> {
    let CameraTable { eye, target, up, fov_degrees, height, aperture_radius, focus_distance } = table.get_ref();
    let (eye, to) = (eye.0, target.get_ref().0);
    if eye == to {
        return Err(source.invalid(target, "target", NAME, "a point other than 'eye'"));
    }
    let up_direction = up.as_ref().map_or([0.0, 1.0, 0.0], |up| up.get_ref().0);
    let [view_start, view_end, up_wide] = [eye, to, up_direction].map(to_f64);
    if cross(up_wide, sub(view_end, view_start)) == [0.0; 3] {
        let expected = "a direction that is not parallel to the view direction";
        return Err(match up {
            Some(up) => source.invalid(up, "up", NAME, expected),
            None => source.error(table.span().start, format!("missing key 'up' in {NAME}: expected {expected}")),
        });
    }
    let projection = match (fov_degrees, height) {
        (Some(_), Some(height)) => {
            return Err(source.error(height.span().start, "use either 'height' or 'fov_degrees', not both"));
        }
        (fov_degrees, None) => {
            Projection::Perspective { fov_degrees: fov_degrees.as_ref().map_or(FOV_DEGREES, |fov| fov.0) }
        }
        (None, Some(height)) => Projection::Orthographic { height: height.get_ref().0 },
    };
    // By default the lens is focused on the target.
    let square: f64 = eye.iter().zip(to).map(|(&a, b)| (f64::from(b) - f64::from(a)).powi(2)).sum();
    let distance = || (square.sqrt() as f32).clamp(f32::MIN_POSITIVE, f32::MAX);
    let lens = aperture_radius.as_ref().filter(|radius| radius.0 > 0.0).map(|radius| Lens {
        radius: radius.0,
        focus_distance: focus_distance.as_ref().map_or_else(distance, |distance| distance.0),
    });
    Ok(Camera { eye, target: to, up: up_direction, projection, lens })
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
