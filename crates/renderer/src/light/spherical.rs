use crate::vector::{Vector, add, cross, dot, scale, sub, unit};

/// A triangle projected onto the unit sphere around a point.
pub(super) struct SphericalTriangle {
    corners: [Vector; 3],
    pub(super) solid_angle: f64,
}

/// Solid angles that are sampled uniformly, in steradians.
///
/// Below, uniform area sampling is about as good and cheaper. Above, the triangle covers nearly a hemisphere, and the
/// formulas divide by the sine of an angle close to π.
const SAMPLED: std::ops::Range<f64> = 1e-4..6.2;

impl SphericalTriangle {
    /// `None` if uniform area sampling is used instead.
    pub(super) fn new(corners: [Vector; 3], from: Vector) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| unit(sub(corner, from)));
        let (a, b, c) = (a?, b?, c?);
        // Van Oosterom and Strackee 1983.
        let triple = dot(a, cross(b, c)).abs();
        let solid_angle = 2.0 * triple.atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a));
        SAMPLED.contains(&solid_angle).then_some(Self { corners: [a, b, c], solid_angle })
    }

    /// Samples a unit direction uniformly over the solid angle. Source: Arvo 1995, *Stratified Sampling of Spherical
    /// Triangles*.
    ///
    /// `None` for a degenerate triangle.
    pub(super) fn sample(&self, [x, y]: [f64; 2]) -> Option<Vector> {
        let [a, b, c] = self.corners;
        let (side_b, side_c) = (unit(cross(c, a))?, unit(cross(a, b))?);
        // The angle at `a`.
        let cos_alpha = -dot(side_b, side_c);
        let sin_alpha = ((1.0 - cos_alpha) * (1.0 + cos_alpha)).max(0.0).sqrt();
        // Find c' on the arc from a to c, so that the triangle a, b, c' has the fraction x of the solid angle.
        let alpha = cos_alpha.clamp(-1.0, 1.0).acos();
        let (s, t) = (x * self.solid_angle - alpha).sin_cos();
        let (u, v) = (t - cos_alpha, s + sin_alpha * dot(a, b));
        let cosine = ((v * t - u * s) * cos_alpha - v) / ((v * s + u * t) * sin_alpha);
        let third = along(a, c, cosine)?;
        // Then a point on the arc from b to c'.
        along(b, third, 1.0 - y * (1.0 - dot(third, b)))
    }
}

/// The unit vector on the arc from `from` towards `to`, at a cosine to `from`.
fn along(from: Vector, to: Vector, cosine: f64) -> Option<Vector> {
    if cosine.is_nan() {
        return None;
    }
    let cosine = cosine.clamp(-1.0, 1.0);
    // No arc if both coincide.
    let perpendicular = unit(sub(to, scale(from, dot(to, from)))).unwrap_or([0.0; 3]);
    Some(add(scale(from, cosine), scale(perpendicular, ((1.0 - cosine) * (1.0 + cosine)).sqrt())))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// An octant has a solid angle of π/2, half of it π/4.
    #[test]
    fn known_solid_angles() {
        let octant = [[3.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 1.0]];
        let half = [octant[0], octant[1], [0.0, 0.5, 0.5]];
        for (corners, expected) in [(octant, PI / 2.0), (half, PI / 4.0)] {
            let triangle = SphericalTriangle::new(corners, [0.0; 3]).unwrap();
            assert!((triangle.solid_angle - expected).abs() < 1e-14);
        }
        assert!(SphericalTriangle::new(octant, [-1000.0; 3]).is_none());
        assert!(SphericalTriangle::new(octant, octant[0]).is_none());
    }

    /// Samples fall into each of three parts of a triangle in proportion to its solid angle.
    #[test]
    fn samples_are_uniform_over_solid_angle() {
        let from = [0.2, -0.1, 0.3];
        for corners in [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[5.0, 0.0, -1.0], [0.3, 0.4, 0.0], [0.0, -2.0, 0.1]],
            [[9.0, 0.0, 0.0], [9.0, 1.0, 0.0], [9.0, 0.5, 0.2]],
        ] {
            let triangle = SphericalTriangle::new(corners, from).unwrap();
            let center = std::array::from_fn(|k| 0.2 * corners[0][k] + 0.3 * corners[1][k] + 0.5 * corners[2][k]);
            let part_of = |p: Vector| (0..3).find(|&k| is_inside([corners[k], corners[(k + 1) % 3], center], from, p));
            const N: u32 = 400;
            let mut counts = [0.0; 3];
            for i in 0..N {
                for j in 0..N {
                    let square = [i, j].map(|x| (f64::from(x) + 0.5) / f64::from(N));
                    let direction = triangle.sample(square).unwrap();
                    assert!((dot(direction, direction) - 1.0).abs() < 1e-9);
                    if let Some(k) = part_of(direction) {
                        counts[k] += 1.0 / f64::from(N * N);
                    }
                }
            }
            for (k, count) in counts.into_iter().enumerate() {
                let part = SphericalTriangle::new([corners[k], corners[(k + 1) % 3], center], from).unwrap();
                let expected = part.solid_angle / triangle.solid_angle;
                assert!((count - expected).abs() < 4.0 / f64::from(N), "{corners:?} {k}: {count} {expected}");
            }
        }
    }

    /// Whether a direction points into a triangle.
    fn is_inside(corners: [Vector; 3], from: Vector, direction: Vector) -> bool {
        let [a, b, c] = corners.map(|corner| sub(corner, from));
        let [x, y, z] = [cross(a, b), cross(b, c), cross(c, a)].map(|normal| dot(normal, direction) >= 0.0);
        x == y && y == z
    }
}
