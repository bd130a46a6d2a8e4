//! Unit vectors whose rounding is bounded.

use glam::Vec3A;

/// Vectors whose square is below this have lost digits to underflow, or all of them.
const LEAST_SQUARE: f32 = 1e-30;

/// Square of the sine of 30 degrees, below which two directions make no frame.
///
/// The normal of a needle is rounding: it may even lie along the needle.
const LEAST_ACROSS: f32 = 0.25;

/// `v` at length one, at most 1 + 4u; `None` where it is too short to have a direction, or not finite.
///
/// Three roundings reach a term of the square, so the root errs by 1.5 u and its own; the quotient by one more: 3.5 u.
#[inline]
pub(super) fn unit(v: Vec3A) -> Option<Vec3A> {
    let square = v.length_squared();
    (square > LEAST_SQUARE && square < f32::MAX).then(|| v / square.sqrt())
}

/// The frame whose first row is along `first` and whose third is nearest to `normal`; `None` where one of them has no
/// direction, or both have nearly the same.
#[inline]
pub(super) fn frame(first: Vec3A, normal: Vec3A) -> Option<[Vec3A; 3]> {
    let across = normal.cross(first);
    // Negated, so that NaN makes no frame.
    let is_apart = across.length_squared() >= LEAST_ACROSS * normal.length_squared() * first.length_squared();
    if !is_apart {
        return None;
    }
    let (first, second) = (unit(first)?, unit(across)?);
    Some([first, second, unit(first.cross(second))?])
}

/// Rows as glam vectors.
#[inline]
pub(super) fn to_glam(rows: [[f32; 3]; 3]) -> [Vec3A; 3] {
    rows.map(Vec3A::from_array)
}

/// Rows as arrays.
#[inline]
pub(super) fn from_glam(rows: [Vec3A; 3]) -> [[f32; 3]; 3] {
    rows.map(|row| row.to_array())
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::{frame, unit};

    /// Half a unit in the last place of one.
    const U: f64 = f32::EPSILON as f64 / 2.0;

    /// Rounding of a cross product that is at least half as long as its factors, and of the unit vectors.
    const ORTHOGONAL: f32 = 16.0 * f32::EPSILON;

    fn length(v: Vec3A) -> f64 {
        v.to_array().map(|x| f64::from(x) * f64::from(x)).iter().sum::<f64>().sqrt()
    }

    /// Directions all over the cube, at several sizes.
    fn directions() -> impl Iterator<Item = Vec3A> {
        let mut rng = canted_fixtures::SplitMix64::new(1);
        (0..100_000).map(move |i| Vec3A::from_array(rng.signed3().map(|x| x as f32)) * [1.0, 1e-6, 3e5][i % 3])
    }

    #[test]
    fn unit_vectors_are_no_longer_than_promised() {
        let mut longest = 0.0f64;
        for v in directions() {
            let error = length(unit(v).unwrap()) - 1.0;
            assert!(error.abs() <= 4.0 * U, "{v} {error:e}");
            longest = longest.max(error);
        }
        // The bound is tight: one unit in the last place would not do.
        assert!(longest > U);
    }

    #[test]
    fn frames_are_orthogonal_or_none() {
        for (first, normal) in directions().zip(directions().skip(1)) {
            let Some([x, y, z]) = frame(first, normal) else { continue };
            for dot in [x.dot(y), y.dot(z), z.dot(x)] {
                assert!(dot.abs() < ORTHOGONAL, "{first} {normal}");
            }
            assert!(x.cross(y).dot(z) > 0.999);
        }
        assert_eq!(frame(Vec3A::X, Vec3A::X), None);
        assert_eq!(frame(Vec3A::X, Vec3A::new(1.0, 1e-3, 0.0)), None);
        assert_eq!(frame(Vec3A::ZERO, Vec3A::X), None);
        assert_eq!(frame(Vec3A::X, Vec3A::NAN), None);
    }
}
