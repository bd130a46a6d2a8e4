use crate::ReadError;

use super::table::{Bounds, Table};

/// By how much the squared length of a unit vector may differ from one when each coordinate is rounded to `f32`.
///
/// Each coordinate is off by a factor of at most 1 ± u, u half of `f32::EPSILON`, so the square by (1 + u)².
const UNIT_ERROR: f64 = HALF_EPSILON * (2.0 + HALF_EPSILON);
const HALF_EPSILON: f64 = 0.5 * f32::EPSILON as f64;

/// A direction of any length but zero, as a unit vector. One that is unit already keeps its bits.
pub(super) fn read(table: &Table<'_>, key: &str) -> Result<[f32; 3], ReadError> {
    let direction = table.required(key, table.numbers(key, Bounds::Finite)?)?;
    unit(direction).ok_or_else(|| table.refuse(key, "a direction: its length is 0"))
}

/// The vector at length one; `None` for zero.
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
        fn what_was_made_unit_stays_as_it_is(v in prop::array::uniform3(-1e30_f32..1e30)) {
            let once = unit(v).unwrap();
            prop_assert_eq!(unit(once), Some(once));
        }
    }

    #[test]
    fn lengths() {
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([0.0, -3e-45, 0.0]), Some([0.0, -1.0, 0.0]));
        assert_eq!(unit([3e38, 0.0, 0.0]), Some([1.0, 0.0, 0.0]));
        assert_eq!(unit([1.001, 0.0, 0.0]), Some([1.0, 0.0, 0.0]), "nearly unit is not unit");
    }
}
