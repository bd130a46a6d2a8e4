use crate::ReadError;

use super::table::{Bounds, Table};

/// Largest deviation from 1 of the squared length of a unit vector rounded to `f32`.
///
/// Each coordinate has a relative error of at most u, half of `f32::EPSILON`, so the square has at most (1 + u)² - 1.
const UNIT_ERROR: f64 = HALF_EPSILON * (2.0 + HALF_EPSILON);
const HALF_EPSILON: f64 = 0.5 * f32::EPSILON as f64;

/// Reads a direction and normalizes it. A vector that is already of unit length keeps its bits.
pub(super) fn read(table: &Table<'_>, key: &str) -> Result<[f32; 3], ReadError> {
    let direction = table.required(key, table.numbers(key, Bounds::Finite)?)?;
    unit(direction).ok_or_else(|| table.invalid(key, "a direction of nonzero length"))
}

/// The normalized vector; `None` for zero.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
pub(super) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let wide = v.map(f64::from);
    let square: f64 = wide.iter().map(|x| x * x).sum();
    if square == 0.0 {
        return None;
    }
    if (square - 1.0).abs() <= UNIT_ERROR {
        return Some(v);
    }
    Some(wide.map(|x| (x / square.sqrt()) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn normalizing_twice_changes_nothing(v in prop::array::uniform3(-1e30_f32..1e30)) {
            let once = unit(v).unwrap();
            prop_assert_eq!(unit(once), Some(once));
        }
    }

    #[test]
    fn normalizes_vectors_of_any_length() {
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([0.0, -3e-45, 0.0]), Some([0.0, -1.0, 0.0]));
        assert_eq!(unit([3e38, 0.0, 0.0]), Some([1.0, 0.0, 0.0]));
        assert_eq!(unit([1.001, 0.0, 0.0]), Some([1.0, 0.0, 0.0]), "nearly unit length is normalized");
    }
}
