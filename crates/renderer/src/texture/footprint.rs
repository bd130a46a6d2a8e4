use super::{Cone, Lod};
use crate::vector::{Vector, cross, dot, length, scale, sub, unit};

/// Maximum number of probes along the longer axis.
const MAX_PROBES: f64 = 16.0;

/// The plane of a triangle, world space, for texture derivatives.
pub(crate) struct Plane {
    /// From the first vertex to the second and to the third.
    pub(crate) edges: [Vector; 2],
    /// The cross product of the edges.
    pub(crate) normal: Vector,
}

impl Plane {
    /// Change of texture coordinates along a vector in the plane, given their changes `along` the edges.
    ///
    /// Not finite if the triangle has no area.
    fn change(&self, vector: Vector, along: [[f64; 2]; 2]) -> [f64; 2] {
        let square = dot(self.normal, self.normal);
        let s = dot(cross(vector, self.edges[1]), self.normal) / square;
        let t = dot(cross(self.edges[0], vector), self.normal) / square;
        std::array::from_fn(|k| s * along[0][k] + t * along[1][k])
    }
}

/// The region of a texture that a lookup filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Footprint {
    /// Mip level: binary logarithm of the width in texels; unfiltered at 0 and below.
    pub(super) level: f64,
    /// Longer axis from end to end, in texture coordinates, sampled with `n_probes` probes.
    pub(super) along: [f64; 2],
    pub(super) n_probes: u32,
}

impl Footprint {
    /// No filter.
    pub(crate) const POINT: Self = Self { level: 0.0, along: [0.0; 2], n_probes: 1 };

    fn round(level: f64) -> Self {
        Self { level, ..Self::POINT }
    }

    /// The footprint of a ray along `direction` in a texture of `size`, whose coordinates change by `along` along the
    /// edges of the plane. `cone` is the ray cone at the hit.
    pub(crate) fn new(
        lod: Lod,
        cone: &Cone,
        direction: Vector,
        plane: &Plane,
        along: [[f64; 2]; 2],
        size: [f64; 2],
    ) -> Self {
        match lod {
            Lod::None => Self::POINT,
            Lod::Aniso if cone.is_direct() => Self::ellipse(cone, direction, plane, along, size),
            Lod::Cone | Lod::Aniso => Self::square(cone, direction, plane, along, size),
        }
    }

    /// Isotropic, as wide as the longer axis: `½·log2(texel area over triangle area) + log2(w / cosine)`.
    fn square(cone: &Cone, direction: Vector, plane: &Plane, along: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = along;
        let n_texels = (a * d - b * c).abs() * size[0] * size[1];
        let area = length(plane.normal);
        // The cosine times the area; the lookup clamps infinities.
        let projected = dot(plane.normal, direction).abs() / length(direction);
        let stretch = cone.width() / projected;
        Self::round(0.5 * (n_texels * area * stretch * stretch).log2())
    }

    /// The ellipse in which a narrow cone intersects the plane (Akenine-Möller et al. 2021).
    fn ellipse(cone: &Cone, direction: Vector, plane: &Plane, along: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let (Some(normal), Some(direction)) = (unit(plane.normal), unit(direction)) else { return Self::POINT };
        let cosine = dot(normal, direction);
        let down = sub(direction, scale(normal, cosine));
        // The longer axis is along the projected ray; at normal incidence all axes are equal.
        let [long, short] = match unit(down) {
            Some(down) => [scale(down, cone.width() / cosine.abs()), scale(cross(normal, down), cone.width())],
            None => [plane.edges[0], cross(normal, plane.edges[0])].map(|v| scale(v, cone.width() / length(v))),
        };
        Self::of_axes([long, short].map(|axis| plane.change(axis, along)), size)
    }

    /// The ellipse with these conjugate diameters in texture coordinates.
    fn of_axes(diameters: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = diameters.map(|v| [v[0] * size[0], v[1] * size[1]]);
        // The squared axes are the eigenvalues of the sum of outer products; the product of the axes is the
        // determinant.
        let [xx, xy, yy] = [a * a + c * c, a * b + c * d, b * b + d * d];
        let half_difference = (0.5 * (xx - yy)).hypot(xy);
        let largest = 0.5 * (xx + yy) + half_difference;
        let (longest, width) = (largest.sqrt(), (a * d - b * c).abs() / largest.sqrt());
        // At least one texel wide. An ellipse longer than the maximum number of probes is widened.
        let width = width.max(1.0).max(longest / MAX_PROBES);
        if !longest.is_finite() || longest <= width {
            return Self::round(longest.log2());
        }
        let (x, y) =
            if xx >= yy { (0.5 * (xx - yy) + half_difference, xy) } else { (xy, 0.5 * (yy - xx) + half_difference) };
        let stretch = longest / x.hypot(y);
        // Rounded, so that a circle needs one probe; then the probes are widened until they touch.
        let n_probes = (longest / width).round();
        let level = width.max(longest / n_probes).log2();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1 and 16")]
        let n_probes = n_probes as u32;
        Self { level, along: [x * stretch / size[0], y * stretch / size[1]], n_probes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(edges: [Vector; 2]) -> Plane {
        Plane { edges, normal: cross(edges[0], edges[1]) }
    }

    /// A plane with one texture repeat per unit, rotated around the x axis.
    fn tilted(tilt_rad: f64) -> Plane {
        plane([[1.0, 0.0, 0.0], [0.0, tilt_rad.cos(), tilt_rad.sin()]])
    }

    const UNIT: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const SIZE: [f64; 2] = [1024.0, 1024.0];
    const DOWN: Vector = [0.0, 0.0, -2.0];

    fn at(lod: Lod, width: f64, tilt_rad: f64) -> Footprint {
        let cone = Cone::of_pixel(width, 0.0, 0);
        Footprint::new(lod, &cone, DOWN, &tilted(tilt_rad), UNIT, SIZE)
    }

    /// Rounding error of a logarithm of a quotient of a few products.
    const BOUND: f64 = 64.0 * f64::EPSILON;

    #[test]
    fn level_is_log2_of_width_in_texels() {
        for lod in [Lod::Cone, Lod::Aniso] {
            let footprint = at(lod, 8.0 / 1024.0, 0.0);
            assert!((footprint.level - 3.0).abs() < BOUND && footprint.n_probes == 1, "{lod:?} {footprint:?}");
        }
        assert_eq!(at(Lod::None, 1.0, 0.0), Footprint::POINT);
    }

    #[test]
    fn tilted_plane_has_elliptical_footprint() {
        // Cosine 1/4: four times as long as wide, down the slope.
        let tilt = 0.25_f64.acos();
        let footprint = at(Lod::Aniso, 8.0 / 1024.0, tilt);
        assert!((footprint.level - 3.0).abs() < BOUND, "{footprint:?}");
        assert!(footprint.n_probes == 4 && footprint.along[0].abs() < BOUND);
        assert!((footprint.along[1].abs() - 32.0 / 1024.0).abs() < BOUND);
        assert!((at(Lod::Cone, 8.0 / 1024.0, tilt).level - 5.0).abs() < BOUND);
    }

    #[test]
    fn footprint_is_independent_of_scale_and_side() {
        for lod in [Lod::Cone, Lod::Aniso] {
            let cone = |width| Cone::of_pixel(width, 0.0, 0);
            let small = tilted(1.0);
            let footprint = Footprint::new(lod, &cone(0.5), DOWN, &small, UNIT, SIZE);
            let large = plane(small.edges.map(|e| scale(e, 1024.0)));
            assert_eq!(footprint, Footprint::new(lod, &cone(512.0), DOWN, &large, UNIT, SIZE));
            let behind = Footprint::new(lod, &cone(0.5), [0.0, 0.0, 2.0], &small, UNIT, SIZE);
            assert_eq!((footprint.level, footprint.n_probes), (behind.level, behind.n_probes));
        }
    }

    #[test]
    fn grazing_planes_have_at_most_16_probes() {
        for tilt in [1.5, 1.57, std::f64::consts::FRAC_PI_2] {
            let footprint = at(Lod::Aniso, 8.0 / 1024.0, tilt);
            assert!(footprint.n_probes <= 16 && !footprint.level.is_nan(), "{footprint:?}");
        }
    }
}
