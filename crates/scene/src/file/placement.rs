use canted_obb::Affine;

use super::direction::unit;
use super::table::{Bounds, Table};
use super::toml_writer::{TomlWriter, number, numbers};
use crate::ReadError;

/// Keys of a placement.
pub(super) const KEYS: [&str; 5] = ["translation", "axis", "angle_degrees", "scale", "matrix"];

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
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how transforms are stored")]
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

/// Reads a placement from a table that may have other keys; `base` supplies the defaults.
pub(super) fn read(table: &Table<'_>, base: &Placement) -> Result<Placement, ReadError> {
    if let Some(rows) = table.rows::<4, 3>("matrix")? {
        if let Some(key) = KEYS[..4].iter().find(|key| table.has(key)) {
            return Err(table.error(key, format!("use either 'matrix' or '{key}', not both")));
        }
        let affine = Affine { columns: std::array::from_fn(|j| std::array::from_fn(|i| rows[i][j])) };
        return match affine.determinant() {
            0.0 => Err(table.invalid("matrix", "an invertible matrix (the determinant is 0)")),
            _ => Ok(Placement::Matrix(affine)),
        };
    }
    let Placement::Parts { translation, axis, angle_degrees, scale } = *base else {
        return match KEYS[..4].iter().find(|key| table.has(key)) {
            Some(key) => Err(table.error(key, format!("'{key}' cannot modify the 'matrix' of the instance"))),
            None => Ok(*base),
        };
    };
    let translation = table.numbers("translation", Bounds::Finite)?.unwrap_or(translation);
    let angle_degrees = table.number("angle_degrees", Bounds::Finite)?.unwrap_or(angle_degrees);
    let scale = table.numbers("scale", Bounds::Finite)?.unwrap_or(scale);
    if scale.contains(&0.0) {
        return Err(table.invalid("scale", "3 nonzero numbers"));
    }
    let axis = match table.numbers("axis", Bounds::Finite)? {
        None => axis,
        Some(axis) => unit(axis).ok_or_else(|| table.invalid("axis", "a direction of nonzero length"))?,
    };
    Ok(Placement::Parts { translation, axis, angle_degrees, scale })
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
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how transforms are stored")]
pub(super) fn after(outer: &Affine, inner: &Affine) -> Affine {
    if *outer == Affine::IDENTITY {
        return *inner;
    }
    let [x, y, z, origin] = inner.columns;
    let vector = |v: [f32; 3]| outer.vector_f64(v.map(f64::from)).map(|x| x as f32);
    Affine { columns: [vector(x), vector(y), vector(z), outer.point(origin)] }
}
