use canted_obb::Affine;

use super::direction::unit;
use super::page::{Page, number, numbers};
use super::table::{Bounds, Table};
use crate::ReadError;

/// Keys of a placement.
pub(super) const KEYS: [&str; 5] = ["translation", "axis", "angle_degrees", "scale", "matrix"];

/// Where an asset stands, as a scene file says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Scaled, then turned, then moved.
    Parts {
        /// By how much it is moved.
        translation: [f32; 3],
        /// Unit axis about which it is turned.
        axis: [f32; 3],
        /// Angle of that, counter-clockwise seen against the axis.
        angle_degrees: f32,
        /// Factors along x, y and z; none is 0.
        scale: [f32; 3],
    },
    /// Any invertible affine map.
    Matrix(Affine),
}

impl Placement {
    /// Where the asset's own file has it.
    pub const IDENTITY: Self =
        Self::Parts { translation: [0.0; 3], axis: [0.0, 1.0, 0.0], angle_degrees: 0.0, scale: [1.0; 3] };

    /// The map from the asset's space to the world, computed in `f64` and rounded once.
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
                let turn = match (i + 3 - j) % 3 {
                    0 => cos,
                    1 => sin * axis[(j + 2) % 3],
                    _ => -sin * axis[(j + 1) % 3],
                };
                let rotation = turn + (1.0 - cos) * axis[i] * axis[j];
                (rotation * f64::from(scale[j])) as f32
            })
        };
        Affine { columns: [column(0), column(1), column(2), translation] }
    }
}

/// Sine and cosine, exact at quarter turns.
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

/// Reads a placement from a table that may hold other keys; what it does not say is as in `base`.
pub(super) fn read(table: &Table<'_>, base: &Placement) -> Result<Placement, ReadError> {
    if let Some(rows) = table.rows::<4, 3>("matrix")? {
        if let Some(key) = KEYS[..4].iter().find(|key| table.has(key)) {
            return Err(table.error(key, format!("a placement with `matrix` has no `{key}`")));
        }
        let affine = Affine { columns: std::array::from_fn(|j| std::array::from_fn(|i| rows[i][j])) };
        return match affine.determinant() {
            0.0 => Err(table.refuse("matrix", "invertible: its determinant is 0")),
            _ => Ok(Placement::Matrix(affine)),
        };
    }
    let Placement::Parts { translation, axis, angle_degrees, scale } = *base else {
        return match KEYS[..4].iter().find(|key| table.has(key)) {
            Some(key) => Err(table.error(key, format!("`{key}` cannot change a `matrix`"))),
            None => Ok(*base),
        };
    };
    let translation = table.numbers("translation", Bounds::Finite)?.unwrap_or(translation);
    let angle_degrees = table.number("angle_degrees", Bounds::Finite)?.unwrap_or(angle_degrees);
    let scale = table.numbers("scale", Bounds::Finite)?.unwrap_or(scale);
    if scale.contains(&0.0) {
        return Err(table.refuse("scale", "3 factors other than 0"));
    }
    let axis = match table.numbers("axis", Bounds::Finite)? {
        None => axis,
        Some(axis) => unit(axis).ok_or_else(|| table.refuse("axis", "a direction: its length is 0"))?,
    };
    Ok(Placement::Parts { translation, axis, angle_degrees, scale })
}

/// Writes the lines of a placement.
pub(super) fn write(placement: &Placement, page: &mut Page) {
    match placement {
        Placement::Parts { translation, axis, angle_degrees, scale } => {
            page.line("translation", &numbers(translation), "after rotation and scale, world units");
            page.line("axis", &numbers(axis), "of the rotation");
            page.line("angle_degrees", &number(*angle_degrees), "counter-clockwise seen against the axis");
            page.line("scale", &numbers(scale), "factors along x, y, z");
        }
        Placement::Matrix(affine) => {
            let rows: Vec<String> = (0..3).map(|i| numbers(&affine.columns.map(|column| column[i]))).collect();
            page.line("matrix", &format!("[{}]", rows.join(", ")), "3 rows, the translation last");
        }
    }
}

/// The map that acts first through `inner`; exact where `outer` changes nothing.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how transforms are stored")]
pub(super) fn after(outer: &Affine, inner: &Affine) -> Affine {
    if *outer == Affine::IDENTITY {
        return *inner;
    }
    let [x, y, z, origin] = inner.columns;
    let vector = |v: [f32; 3]| outer.vector_f64(v.map(f64::from)).map(|x| x as f32);
    Affine { columns: [vector(x), vector(y), vector(z), outer.point(origin)] }
}
