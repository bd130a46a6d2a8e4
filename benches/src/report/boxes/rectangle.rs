//! Candidates for the smallest rectangle around points in a plane.
//!
//! Between two rotations at which a side lies on the hull, width and length are cosines of the angle, so concave. Then
//! `w + h` and `l + h` are positive and concave for any height `h` of a box above, and their product has no minimum
//! between its ends. Therefore neither has the area of the box, `2((w + h)(l + h) − h²)`, nor its volume, `hwl` (for
//! rectangles Freeman and Shapira 1975). So rotations along the sides of the hull suffice.

/// Cosine and sine of the direction of each side of the hull, with the extents along and across it.
pub(super) fn turns(points: Vec<[f64; 2]>) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    let hull = hull(points);
    let n = hull.len();
    (0..n).map(move |i| {
        let side = sub(hull[(i + 1) % n], hull[i]);
        let length = side[0].hypot(side[1]);
        // A single point has a side of zero length and any direction.
        let [c, s] = if length > 0.0 { side.map(|x| x / length) } else { [1.0, 0.0] };
        let sizes = [[c, s], [-s, c]].map(|axis| extent(hull.iter().map(|p| p[0] * axis[0] + p[1] * axis[1])));
        ([c, s], sizes)
    })
}

/// Maximum minus minimum.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> f64 {
    let (least, greatest) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, g), x| (l.min(x), g.max(x)));
    greatest - least
}

/// Corners of the convex hull, counter-clockwise (Andrew 1979).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull = chain(points.iter().copied());
    let upper = chain(points.iter().rev().copied());
    // Each chain begins where the other ends.
    hull.pop();
    hull.extend_from_slice(&upper[..upper.len() - 1]);
    hull
}

/// Points in order, without those at which the chain does not turn left.
fn chain(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut chain: Vec<[f64; 2]> = vec![];
    for point in points {
        while let [.., a, b] = chain[..]
            && turn(sub(b, a), sub(point, b)) <= 0.0
        {
            chain.pop();
        }
        chain.push(point);
    }
    chain
}

fn sub(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Positive if `b` turns left of `a`.
fn turn(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    #[test]
    fn a_hull_contains_only_its_corners() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let inside = [[0.5, 0.5], [0.5, 0.0], [0.0, 0.0], [0.25, 0.75]];
        assert_eq!(hull([square, inside].concat()), square);
        assert_eq!(hull(vec![[1.0, 2.0]; 3]), [[1.0, 2.0]]);
        assert_eq!(hull(vec![[0.0, 0.0], [2.0, 2.0], [1.0, 1.0]]), [[0.0, 0.0], [2.0, 2.0]]);
    }

    /// The claim of this file, against a thousand rotations.
    #[test]
    fn no_other_rotation_has_a_smaller_box() {
        let mut rng = SplitMix64::new(5);
        for _ in 0..20 {
            let points: Vec<[f64; 2]> = (0..12).map(|_| [rng.signed(), 0.3 * rng.signed()]).collect();
            for height in [0.0, 0.1, 1.0, 30.0] {
                let area = |[w, l]: [f64; 2]| (w + height) * (l + height) - height * height;
                let least = turns(points.clone()).map(|(_, sizes)| area(sizes)).fold(f64::INFINITY, f64::min);
                for i in 0..1000 {
                    let (s, c) = (f64::from(i) * 1e-3 * std::f64::consts::FRAC_PI_2).sin_cos();
                    let sizes =
                        [[c, s], [-s, c]].map(|axis| extent(points.iter().map(|p| p[0] * axis[0] + p[1] * axis[1])));
                    // Rounding of a few sums of numbers of at most 30.
                    assert!(area(sizes) >= least - 1e-12, "{height} {} {least}", area(sizes));
                }
            }
        }
    }
}
