use canted_obb::Affine;
use serde::{Deserialize, Deserializer, de::Error as _};
use serde_spanned::Spanned;

use super::tables::{Direction, Finite, In, NotZero, Point, Source};
use super::write::{TomlWriter, number, numbers};
use crate::ReadError;

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
        let affine = Affine { columns: std::array::from_fn(|j| std::array::from_fn(|i| rows[i].0[j])) };
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
            let rows: Vec<String> = (0..3).map(|i| numbers(&affine.columns.map(|column| column[i]))).collect();
            out.entry("matrix", &format!("[{}]", rows.join(", ")), "3 rows; the last column is the translation");
        }
    }
}

/// `outer * inner`; exact if `outer` is the identity.
pub(super) fn after(outer: &Affine, inner: &Affine) -> Affine {
    if *outer == Affine::IDENTITY {
        return *inner;
    }
    let [x, y, z, origin] = inner.columns;
    let vector = |v: [f32; 3]| outer.vector_f64(v.map(f64::from)).map(|x| x as f32);
    Affine { columns: [vector(x), vector(y), vector(z), outer.point(origin)] }
}
