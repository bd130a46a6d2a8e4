use super::{Cone, Lod};
use crate::vector::{Vector, cross, dot, length, scale, sub, unit};

/// Most lookups along the longer axis.
const MAX_PROBES: f64 = 16.0;

/// The plane of a triangle, world space, as far as texture coordinates hang on it.
pub(crate) struct Plane {
    /// From the first vertex to the second and to the third.
    pub(crate) edges: [Vector; 2],
    /// Their cross product.
    pub(crate) normal: Vector,
}

impl Plane {
    /// How much texture coordinates change along a vector in the plane, where they change by `along` along the edges.
    ///
    /// Not finite where the triangle has no area.
    fn change(&self, vector: Vector, along: [[f64; 2]; 2]) -> [f64; 2] {
        let square = dot(self.normal, self.normal);
        let s = dot(cross(vector, self.edges[1]), self.normal) / square;
        let t = dot(cross(self.edges[0], vector), self.normal) / square;
        std::array::from_fn(|k| s * along[0][k] + t * along[1][k])
    }
}

/// Which part of a texture is averaged about a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Footprint {
    /// Binary logarithm of the width in texels; at 0 and below it is a point.
    pub(super) level: f64,
    /// From end to end, in texture coordinates; looked up at `n_probes` places.
    pub(super) along: [f64; 2],
    pub(super) n_probes: u32,
}

impl Footprint {
    /// The texels about a point.
    pub(crate) const POINT: Self = Self { level: 0.0, along: [0.0; 2], n_probes: 1 };

    fn round(level: f64) -> Self {
        Self { level, ..Self::POINT }
    }

    /// What a ray along `direction` sees of a texture of this size, whose coordinates change by `along` along the edges of
    /// the plane; `cone` is that of the ray where it hits.
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

    /// As wide as the longer axis: `½·log2(texels over area of the triangle) + log2(w / cosine)`.
    fn square(cone: &Cone, direction: Vector, plane: &Plane, along: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = along;
        let n_texels = (a * d - b * c).abs() * size[0] * size[1];
        let area = length(plane.normal);
        // The cosine times the area; both ends of the range are left to the clamp of the lookup.
        let seen = dot(plane.normal, direction).abs() / length(direction);
        let stretch = cone.width() / seen;
        Self::round(0.5 * (n_texels * area * stretch * stretch).log2())
    }

    /// The ellipse in which a cone cuts the plane (Akenine-Möller et al. 2021), for one so narrow that its sides are parallel.
    fn ellipse(cone: &Cone, direction: Vector, plane: &Plane, along: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let (Some(normal), Some(direction)) = (unit(plane.normal), unit(direction)) else { return Self::POINT };
        let cosine = dot(normal, direction);
        let down = sub(direction, scale(normal, cosine));
        // The longer axis runs down the slope; seen from straight above all axes are equal.
        let [long, short] = match unit(down) {
            Some(down) => [scale(down, cone.width() / cosine.abs()), scale(cross(normal, down), cone.width())],
            None => [plane.edges[0], cross(normal, plane.edges[0])].map(|v| scale(v, cone.width() / length(v))),
        };
        Self::of_axes([long, short].map(|axis| plane.change(axis, along)), size)
    }

    /// The ellipse with these conjugate diameters in texture coordinates.
    fn of_axes(diameters: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = diameters.map(|v| [v[0] * size[0], v[1] * size[1]]);
        // Squares of its axes are the eigenvalues of the sum of outer products; their product is that of the determinant.
        let [xx, xy, yy] = [a * a + c * c, a * b + c * d, b * b + d * d];
        let half_gap = (0.5 * (xx - yy)).hypot(xy);
        let greatest = 0.5 * (xx + yy) + half_gap;
        let (longest, width) = (greatest.sqrt(), (a * d - b * c).abs() / greatest.sqrt());
        // Texels are the least there is to see. A longer ellipse than the probes cover is widened, not cut.
        let width = width.max(1.0).max(longest / MAX_PROBES);
        if !longest.is_finite() || longest <= width {
            return Self::round(longest.log2());
        }
        let (x, y) = if xx >= yy { (0.5 * (xx - yy) + half_gap, xy) } else { (xy, 0.5 * (yy - xx) + half_gap) };
        let stretch = longest / x.hypot(y);
        // Rounded, so that a circle is one probe; probes then widen until they touch.
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

    /// A plane that carries one texture over one unit, turned about the x axis by `lean_rad`.
    fn leaning(lean_rad: f64) -> Plane {
        plane([[1.0, 0.0, 0.0], [0.0, lean_rad.cos(), lean_rad.sin()]])
    }

    const UNIT: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const SIZE: [f64; 2] = [1024.0, 1024.0];
    const DOWN: Vector = [0.0, 0.0, -2.0];

    fn at(lod: Lod, width: f64, lean_rad: f64) -> Footprint {
        let cone = Cone::of_pixel(width, 0.0, 0);
        Footprint::new(lod, &cone, DOWN, &leaning(lean_rad), UNIT, SIZE)
    }

    /// Roundings of a logarithm of a quotient of a few products.
    const BOUND: f64 = 64.0 * f64::EPSILON;

    #[test]
    fn levels_are_the_width_in_texels() {
        for lod in [Lod::Cone, Lod::Aniso] {
            let seen = at(lod, 8.0 / 1024.0, 0.0);
            assert!((seen.level - 3.0).abs() < BOUND && seen.n_probes == 1, "{lod:?} {seen:?}");
        }
        assert_eq!(at(Lod::None, 1.0, 0.0), Footprint::POINT);
    }

    #[test]
    fn a_leaning_plane_is_seen_in_an_ellipse() {
        // Cosine 1/4: four times as long as wide, down the slope.
        let lean = 0.25_f64.acos();
        let seen = at(Lod::Aniso, 8.0 / 1024.0, lean);
        assert!((seen.level - 3.0).abs() < BOUND, "{seen:?}");
        assert!(seen.n_probes == 4 && seen.along[0].abs() < BOUND);
        assert!((seen.along[1].abs() - 32.0 / 1024.0).abs() < BOUND);
        assert!((at(Lod::Cone, 8.0 / 1024.0, lean).level - 5.0).abs() < BOUND);
    }

    #[test]
    fn nothing_depends_on_the_unit_of_length_or_the_side_seen() {
        for lod in [Lod::Cone, Lod::Aniso] {
            let cone = |width| Cone::of_pixel(width, 0.0, 0);
            let small = leaning(1.0);
            let seen = Footprint::new(lod, &cone(0.5), DOWN, &small, UNIT, SIZE);
            let large = plane(small.edges.map(|e| scale(e, 1024.0)));
            assert_eq!(seen, Footprint::new(lod, &cone(512.0), DOWN, &large, UNIT, SIZE));
            let behind = Footprint::new(lod, &cone(0.5), [0.0, 0.0, 2.0], &small, UNIT, SIZE);
            assert_eq!((seen.level, seen.n_probes), (behind.level, behind.n_probes));
        }
    }

    #[test]
    fn grazing_planes_have_a_bounded_number_of_probes() {
        for lean in [1.5, 1.57, std::f64::consts::FRAC_PI_2] {
            let seen = at(Lod::Aniso, 8.0 / 1024.0, lean);
            assert!(seen.n_probes <= 16 && !seen.level.is_nan(), "{seen:?}");
        }
    }
}
