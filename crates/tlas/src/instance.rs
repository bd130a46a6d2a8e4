use canted_obb::{Affine, Obb};
use canted_trace::{HIT_ERROR, Ray};

/// A placed bottom level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the bottom level.
    pub blas: u32,
    /// Where it stands; any invertible affine map.
    pub world_from_object: Affine,
}

/// Why instances cannot be placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InstanceError {
    /// An instance names a bottom level that does not exist.
    NoSuchBlas {
        /// The instance.
        instance: usize,
        /// The bottom level it names.
        blas: u32,
    },
    /// A transform has a number that is not finite.
    NotFinite {
        /// The instance.
        instance: usize,
    },
    /// A transform is singular, or so nearly that object space would keep too few digits.
    IllConditioned {
        /// The instance.
        instance: usize,
        /// ‖M‖·‖M⁻¹‖ in the greatest-row-sum norm; infinite where singular.
        condition: f64,
    },
}

impl std::fmt::Display for InstanceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSuchBlas { instance, blas } => {
                write!(f, "instance {instance} names bottom level {blas}, which does not exist")
            }
            Self::NotFinite { instance } => write!(f, "the transform of instance {instance} is not finite"),
            Self::IllConditioned { instance, condition } => {
                write!(f, "the transform of instance {instance} has condition {condition:e}, beyond {MAX_CONDITION:e}")
            }
        }
    }
}

impl std::error::Error for InstanceError {}

/// Greatest condition of a transform: 2^20 leaves four of the 24 bits of an `f32` coordinate.
pub const MAX_CONDITION: f64 = 1_048_576.0;

/// Half of `f32::EPSILON`: the relative error of one rounding.
const U: f64 = 1.0 / 16_777_216.0;

/// An instance ready for rays: its inverse, computed once, and how far rounding can carry a hit in world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) blas: u32,
    /// Rows of the inverse, each with its translation last; `f64`, so only the result is rounded.
    object_from_world: [[f64; 4]; 3],
    /// The image of the bottom level's box.
    pub(crate) bounds_world: Obb,
    /// The world-space error of a hit is at most `error_per_origin · |o|∞ + error`; see [`Placed::new`].
    pub(crate) error_per_origin: f64,
    pub(crate) error: f64,
}

impl Placed {
    /// Inverts the transform and bounds the error of the way through object space.
    ///
    /// A world ray `o + t·d` is traced as the object ray `o' = fl(M⁻¹(o - c))`, `d' = fl(M⁻¹d)`: computed in `f64`, each
    /// component rounded once, by at most `u` relative. A hit accepted at `t` lies within `HIT_ERROR·(|o'| + ρ)` of its
    /// triangle in object space (all norms ∞; ρ the reach of the bottom level). The world point differs from the image
    /// of the object point by `M` times at most `u·|o'| + u·t|d'|`, where `t|d'| <= ρ + |o'|` but for a second-order
    /// term. With one `u` more for `f64` rounding, the corner rounding of the box and second-order terms, the hit lies
    /// within `‖M‖·(HIT_ERROR + 4u)·(|o'| + ρ)` of the triangle's image, and `|o'| <= ‖M⁻¹‖·(|o| + |c|)`.
    pub(crate) fn new(index: usize, instance: &Instance, bounds: &Obb) -> Result<Self, InstanceError> {
        let matrix = &instance.world_from_object;
        if !matrix.is_finite() {
            return Err(InstanceError::NotFinite { instance: index });
        }
        let inverse = invert(matrix);
        let norm_inverse = inverse.iter().map(|row| row[..3].iter().map(|x| x.abs()).sum()).fold(0.0, f64::max);
        let norm = (0..3)
            .map(|k| matrix.columns[..3].iter().map(|column| f64::from(column[k]).abs()).sum())
            .fold(0.0, f64::max);
        // A matrix of rank one has an inverse of NaNs, which a maximum passes over.
        let invertible = inverse.iter().flatten().all(|x| x.is_finite());
        let condition = if invertible { norm * norm_inverse } else { f64::INFINITY };
        if condition > MAX_CONDITION {
            return Err(InstanceError::IllConditioned { instance: index, condition });
        }
        let reach = f64::from(bounds.aabb().reach());
        let translation = matrix.columns[3].iter().map(|c| f64::from(c.abs())).fold(0.0, f64::max);
        let relative = f64::from(HIT_ERROR) + 4.0 * U;
        Ok(Self {
            blas: instance.blas,
            object_from_world: inverse,
            bounds_world: bounds.transformed(matrix),
            error_per_origin: relative * condition,
            error: relative * norm * (norm_inverse * translation + reach) + 2.0 * U * translation,
        })
    }

    /// The world ray in object space; `t` stays the same number.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is accounted for in the error")]
    pub(crate) fn ray_object(&self, ray_world: &Ray, t_max: f32) -> Ray {
        let o = ray_world.origin.map(f64::from);
        let d = ray_world.direction.map(f64::from);
        let rows = &self.object_from_world;
        let linear = |row: &[f64; 4], v: [f64; 3]| (row[0] * v[0] + row[1] * v[1]) + row[2] * v[2];
        Ray {
            origin: std::array::from_fn(|k| (linear(&rows[k], o) + rows[k][3]) as f32),
            direction: std::array::from_fn(|k| linear(&rows[k], d) as f32),
            t_min: ray_world.t_min,
            t_max,
        }
    }
}

/// Rows of the inverse map, by cofactors in `f64`; not finite where the matrix is singular.
fn invert(matrix: &Affine) -> [[f64; 4]; 3] {
    let [a, b, c, origin] = matrix.columns.map(|column| column.map(f64::from));
    let cross =
        |p: [f64; 3], q: [f64; 3]| [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let reciprocal = 1.0 / dot(a, cross(b, c));
    [cross(b, c), cross(c, a), cross(a, b)].map(|row| {
        let row = row.map(|x| x * reciprocal);
        [row[0], row[1], row[2], -dot(row, origin)]
    })
}
