//! Where things are in a scene file: the camera, and placements of instances.

use canted_obb::Affine;
use canted_obb::vector::{cross, sub, to_f64};
use serde::{Deserialize, Deserializer, de::Error as _};
use serde_spanned::Spanned;

use super::tables::{Direction, FieldOfView, Finite, In, NotNegative, NotZero, Point, Positive, Source};
use super::writer::{TomlWriter, number, numbers};
use crate::{Camera, Lens, Projection, ReadError};

/// A transform as specified in a scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Scale, then rotation, then translation.
    Parts {
        /// Translation in world units.
        translation: [f32; 3],
        /// Unit rotation axis.
        axis: [f32; 3],
        /// Rotation angle, counter-clockwise when the axis points at the viewer.
        angle_degrees: f32,
        /// Scale along x, y and z; nonzero.
        scale: [f32; 3],
    },
    /// An invertible affine transform.
    Matrix(Affine),
}

impl Placement {
    /// The identity.
    pub const IDENTITY: Self =
        Self::Parts { translation: [0.0; 3], axis: [0.0, 1.0, 0.0], angle_degrees: 0.0, scale: [1.0; 3] };

    /// The transform from asset space to world space, computed in `f64` and rounded once.
    #[must_use]
    pub fn affine(&self) -> Affine {
        let (translation, axis, angle_degrees, scale) = match *self {
            Self::Matrix(affine) => return affine,
            Self::Parts { translation, axis, angle_degrees, scale } => (translation, axis, angle_degrees, scale),
        };
        let (sin, cos) = sin_cos(angle_degrees.into());
        let axis = axis.map(f64::from);
        // Rodrigues' formula, column by column.
        let column = |j: usize| {
            std::array::from_fn(|i| {
                let linear = match (i + 3 - j) % 3 {
                    0 => cos,
                    1 => sin * axis[(j + 2) % 3],
                    _ => -sin * axis[(j + 1) % 3],
                };
                let rotation = linear + (1.0 - cos) * axis[i] * axis[j];
                (rotation * f64::from(scale[j])) as f32
            })
        };
        Affine { columns: [column(0), column(1), column(2), translation] }
    }
}

/// Sine and cosine, exact at multiples of 90 degrees.
fn sin_cos(degrees: f64) -> (f64, f64) {
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarters).to_radians().sin_cos();
    match quarters.rem_euclid(4.0) {
        0.0 => (sin, cos),
        1.0 => (cos, -sin),
        2.0 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// A placement in a file, whole or what changes until the shutter closes.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlacementTable {
    pub(super) translation: Option<Spanned<Point>>,
    pub(super) axis: Option<Spanned<Direction>>,
    pub(super) angle_degrees: Option<Spanned<In<f32, Finite>>>,
    pub(super) scale: Option<Spanned<In<[f32; 3], NotZero>>>,
    pub(super) matrix: Option<Matrix>,
}

/// An invertible matrix.
pub(super) struct Matrix(Affine);

impl<'de> Deserialize<'de> for Matrix {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let rows = Vec::<In<[f32; 4], Finite>>::deserialize(deserializer);
        let rows = rows.ok().and_then(|rows| <[_; 3]>::try_from(rows).ok());
        let rows = rows.ok_or_else(|| D::Error::custom("3 rows of 4 finite numbers each"))?;
        let affine = Affine::from_rows(rows.map(|row| row.0));
        match affine.determinant() {
            0.0 => Err(D::Error::custom("an invertible matrix (the determinant is 0)")),
            _ => Ok(Self(affine)),
        }
    }
}

impl PlacementTable {
    /// The placement; `base` supplies the defaults.
    pub(super) fn placement(self, base: &Placement, source: &Source<'_>) -> Result<Placement, ReadError> {
        let starts = [
            ("translation", self.translation.as_ref().map(|value| value.span().start)),
            ("axis", self.axis.as_ref().map(|value| value.span().start)),
            ("angle_degrees", self.angle_degrees.as_ref().map(|value| value.span().start)),
            ("scale", self.scale.as_ref().map(|value| value.span().start)),
        ];
        let part = starts.into_iter().find_map(|(key, start)| Some((key, start?)));
        match (self.matrix, *base, part) {
            (Some(_), _, Some((key, at))) => Err(source.error(at, format!("use either 'matrix' or '{key}', not both"))),
            (Some(Matrix(affine)), ..) => Ok(Placement::Matrix(affine)),
            (None, Placement::Matrix(_), Some((key, at))) => {
                Err(source.error(at, format!("'{key}' cannot modify the 'matrix' of the instance")))
            }
            (None, Placement::Matrix(_), None) => Ok(*base),
            (None, Placement::Parts { translation, axis, angle_degrees, scale }, _) => Ok(Placement::Parts {
                translation: self.translation.map_or(translation, |new| new.into_inner().0),
                axis: self.axis.map_or(axis, |new| new.into_inner().0),
                angle_degrees: self.angle_degrees.map_or(angle_degrees, |new| new.into_inner().0),
                scale: self.scale.map_or(scale, |new| new.into_inner().0),
            }),
        }
    }
}

/// Writes a placement.
pub(super) fn write(placement: &Placement, out: &mut TomlWriter) {
    match placement {
        Placement::Parts { translation, axis, angle_degrees, scale } => {
            out.entry("translation", &numbers(translation), "applied after scale and rotation, world units");
            out.entry("axis", &numbers(axis), "rotation axis");
            out.entry("angle_degrees", &number(*angle_degrees), "counter-clockwise when the axis points at the viewer");
            out.entry("scale", &numbers(scale), "along x, y, z");
        }
        Placement::Matrix(affine) => {
            let rows = affine.rows().map(|row| numbers(&row)).join(", ");
            out.entry("matrix", &format!("[{rows}]"), "3 rows; the last column is the translation");
        }
    }
}

/// `outer * inner`; exact if `outer` is the identity.
pub(super) fn after(outer: &Affine, inner: &Affine) -> Affine {
    if *outer == Affine::IDENTITY { *inner } else { inner.then(outer) }
}

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

const CAMERA: &str = "[camera]";

/// Default vertical field of view in degrees.
const FOV_DEGREES: f32 = 45.0;

/// The camera of `[camera]`.
pub(super) fn camera(table: &Spanned<CameraTable>, source: &Source<'_>) -> Result<Camera, ReadError> {
    let CameraTable { eye, target, up, fov_degrees, height, aperture_radius, focus_distance } = table.get_ref();
    let (eye, to) = (eye.0, target.get_ref().0);
    if eye == to {
        return Err(source.invalid(target, "target", CAMERA, "a point other than 'eye'"));
    }
    let up_direction = up.as_ref().map_or([0.0, 1.0, 0.0], |up| up.get_ref().0);
    let [view_start, view_end, up_wide] = [eye, to, up_direction].map(to_f64);
    if cross(up_wide, sub(view_end, view_start)) == [0.0; 3] {
        let expected = "a direction that is not parallel to the view direction";
        return Err(match up {
            Some(up) => source.invalid(up, "up", CAMERA, expected),
            None => source.error(table.span().start, format!("missing key 'up' in {CAMERA}: expected {expected}")),
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
pub(super) fn write_camera(camera: &Camera, out: &mut TomlWriter) {
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
