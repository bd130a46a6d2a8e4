use canted_lbvh::Corners;
use canted_obb::Aabb;
use canted_obb::round::down;

/// Rounding of a crossing in `f64`, relative to the greatest absolute coordinate of the edge.
///
/// Three roundings reach the parameter and two more its product with the edge, which is at most twice that coordinate;
/// one more touches the sum: `5 * 2 + 1` units, and one for the products of units.
const CROSSING_ERROR: f64 = 12.0 * (0.5 * f64::EPSILON);

/// Bounds of the parts of a fragment on both sides of a plane perpendicular to `axis`; `None` for an empty part.
///
/// The fragment is the part of the triangle in `aabb`. Holds: every point of the triangle in `aabb` is in one of the two
/// boxes. Corners are copied; crossings are computed in `f64` and rounded outward by their error bound.
pub(crate) fn clip(corners: &Corners, aabb: &Aabb, axis: usize, plane: f32) -> [Option<Aabb>; 2] {
    let mut sides = [Aabb::EMPTY; 2];
    for (i, &corner) in corners.iter().enumerate() {
        let next = corners[(i + 1) % 3];
        if corner[axis] <= plane {
            sides[0].grow(corner);
        }
        if corner[axis] >= plane {
            sides[1].grow(corner);
        }
        if (corner[axis] < plane && plane < next[axis]) || (next[axis] < plane && plane < corner[axis]) {
            let crossing = crossing(corner, next, axis, plane);
            sides = sides.map(|side| side.union(crossing));
        }
    }
    sides.map(|side| intersection(&side, aabb))
}

/// The intersection of both.
pub(crate) fn intersection(a: &Aabb, b: &Aabb) -> Option<Aabb> {
    let both = Aabb {
        min: std::array::from_fn(|k| a.min[k].max(b.min[k])),
        max: std::array::from_fn(|k| a.max[k].min(b.max[k])),
    };
    (!both.is_empty()).then_some(both)
}

/// A box that contains the point where an edge crosses the plane; its ends are on different sides.
fn crossing(a: [f32; 3], b: [f32; 3], axis: usize, plane: f32) -> Aabb {
    let (from, to) = (a.map(f64::from), b.map(f64::from));
    let along = (f64::from(plane) - from[axis]) / (to[axis] - from[axis]);
    let mut aabb = Aabb { min: [plane; 3], max: [plane; 3] };
    for k in (0..3).filter(|&k| k != axis) {
        let at = from[k] + along * (to[k] - from[k]);
        let error = CROSSING_ERROR * from[k].abs().max(to[k].abs());
        // The point is between the ends, which are exact.
        aabb.min[k] = down(at - error).max(a[k].min(b[k]));
        aabb.max[k] = -down(-(at + error)).max(-a[k].max(b[k]));
    }
    aabb
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Fraction bits that represent every bit of an `f32` of at least 2^-36, and none beyond `i128` for integers to 2^10.
    const FRACTION_BITS: i32 = 60;

    #[expect(clippy::cast_possible_truncation, reason = "an integer by construction")]
    fn fixed(x: f32) -> i128 {
        let scaled = f64::from(x) * f64::from(FRACTION_BITS).exp2();
        assert_eq!(scaled.fract(), 0.0);
        scaled as i128
    }

    /// Whether the box holds the exact crossing `from + (plane - from) / run * rise`, on another axis.
    fn contains_crossing(aabb: &Aabb, k: usize, [from, to]: [i128; 2], [start, end]: [i128; 2], plane: i128) -> bool {
        let (mut run, mut crossed) = (end - start, plane - start);
        if run < 0 {
            (run, crossed) = (-run, -crossed);
        }
        let exact = (from * run + crossed * (to - from)) << FRACTION_BITS;
        fixed(aabb.min[k]) * run <= exact && exact <= fixed(aabb.max[k]) * run
    }

    fn edge() -> impl Strategy<Value = ([i16; 3], [i16; 3], i16)> {
        let point = || prop::array::uniform3(-1000i16..=1000);
        (point(), point(), -999i16..1000)
    }

    proptest! {
        #[test]
        fn crossings_contain_the_exact_point((a, b, plane) in edge()) {
            prop_assume!((a[0] < plane && plane < b[0]) || (b[0] < plane && plane < a[0]));
            let mut aabb = crossing(a.map(f32::from), b.map(f32::from), 0, f32::from(plane));
            let check = |aabb: &Aabb, k: usize| {
                contains_crossing(aabb, k, [a[k], b[k]].map(i128::from), [a[0], b[0]].map(i128::from), plane.into())
            };
            for k in 1..3 {
                prop_assert!(check(&aabb, k), "{aabb:?}");
                // The check can fail: a box one step beyond does not contain the point.
                let beyond = aabb.max[k].next_up();
                aabb.min[k] = beyond;
                aabb.max[k] = beyond;
                prop_assert!(!check(&aabb, k), "{aabb:?}");
            }
        }
    }

    #[test]
    fn an_empty_side_is_none() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let aabb = Aabb::from_points(corners);
        assert_eq!(clip(&corners, &aabb, 0, 2.0), [Some(aabb), None]);
        // In the plane itself it is on both.
        assert_eq!(clip(&corners, &aabb, 2, 0.0), [Some(aabb); 2]);
    }
}
