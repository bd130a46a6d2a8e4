//! Which of eight triangles may be near a point: a filter that rejects only triangles that certainly are not.

use canted_trace::lanes::UNIT_ROUNDOFF as U;

use super::block::{Block, SHRINK, cross, dot, norm, sub};
use crate::simd::Simd;

/// Bounds of the errors.
#[derive(Clone, Copy)]
struct Bounds {
    /// What distances of triangles may fall short of the true ones, relative to the coordinates.
    pad: f32,
    /// What products with a direction may be off by, relative to their terms.
    rounding: f32,
    /// What is left of a square.
    shrink: f32,
}

const BOUNDS: Bounds = Bounds { pad: f32::from_bits((127 - 40) << 23), rounding: 8.0 * U, shrink: SHRINK };

/// The least square of a direction that triangles are rejected along: 2^-100.
const LEAST: f32 = f32::from_bits((127 - 100) << 23);

/// Triangles that may be near a point.
pub(crate) struct Near {
    pub(crate) lanes: u32,
    /// Lower bounds of their squared distances, or NaN.
    pub(crate) bounds: [f32; 8],
}

impl Block<'_> {
    /// Lanes whose triangle may be at most the root of `limit` away from `point`. What overflows or is NaN is among them.
    #[inline(always)]
    pub(crate) fn near<S: Simd>(&self, simd: S, point: [S::F; 3], limit: f32) -> Near {
        let lanes = Lanes::new(simd, self, point, BOUNDS);
        let by_boxes = lanes.by_boxes();
        let near = lanes.within(by_boxes, limit);
        // The test itself of one triangle takes as long.
        if near & near.wrapping_sub(1) == 0 {
            return Near { lanes: near, bounds: simd.store(by_boxes) };
        }
        let by_closest = lanes.by_closest();
        Near { lanes: near & lanes.within(by_closest, limit), bounds: simd.store(by_closest) }
    }
}

/// Triangles and a point.
struct Lanes<S: Simd> {
    simd: S,
    bounds: Bounds,
    point: [S::F; 3],
    vertices: [[S::F; 3]; 3],
    /// What distances of the triangles may fall short of the true ones.
    pad: S::F,
    zero: S::F,
    least: S::F,
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    fn new(simd: S, block: &Block<'_>, point: [S::F; 3], bounds: Bounds) -> Self {
        let vertex = |first: usize| [block.row(simd, first), block.row(simd, first + 1), block.row(simd, first + 2)];
        let vertices = [vertex(0), vertex(3), vertex(6)];
        let mut size = simd.splat(0.0);
        for k in 0..3 {
            for vertex in [point, vertices[0], vertices[1], vertices[2]] {
                size = simd.max(size, simd.abs(vertex[k]));
            }
        }
        let least = simd.splat(f32::MIN_POSITIVE);
        let pad = simd.add(simd.mul(simd.splat(2.0 * bounds.pad), size), least);
        Self { simd, bounds, point, vertices, pad, zero: simd.splat(0.0), least }
    }

    /// By the distance to the box around a triangle.
    ///
    /// # Error
    /// A gap `lo - p` or `p - hi` is rounded once, so by u of itself; three squares and their sum by fewer than 8 u of themselves, which [`SHRINK`] covers.
    /// Distances of triangles, in f64, fall short of the true ones by less than 2^-46 of the coordinates; each gap is shortened by 2^-40 of them, and so is the length of
    /// all three, or more.
    #[inline(always)]
    fn by_boxes(&self) -> S::F {
        let (simd, [a, b, c]) = (self.simd, self.vertices);
        let mut sum = self.zero;
        for k in 0..3 {
            let (lo, hi) = (simd.min(simd.min(a[k], b[k]), c[k]), simd.max(simd.max(a[k], b[k]), c[k]));
            let gap = simd.max(simd.sub(lo, self.point[k]), simd.sub(self.point[k], hi));
            let gap = simd.max(simd.sub(gap, self.pad), self.zero);
            sum = simd.add(sum, simd.mul(gap, gap));
        }
        self.greatest(simd.mul(sum, simd.splat(self.bounds.shrink)))
    }

    /// What overflows is within any limit that does; NaN stays, and is within any.
    #[inline(always)]
    fn greatest(&self, bound: S::F) -> S::F {
        self.simd.min(self.simd.splat(f32::MAX), bound)
    }

    #[inline(always)]
    fn within(&self, bounds: S::F, limit: f32) -> u32 {
        !self.simd.lt(self.simd.splat(limit), bounds) & 0xff
    }

    /// By the plane across the direction `w` to the closest point: a triangle is no nearer than the vertex that is nearest along any direction,
    /// so it does not matter how exact `w` is.
    ///
    /// # Error
    /// Four roundings touch a term of `w·(v - p)`, which with that of the difference from its bound are less than the 8 u of the terms' absolute sum that are subtracted.
    /// The pad is that of [`Lanes::by_boxes`], times the sum of `|w|`, which is at least its length. [`SHRINK`] covers the fewer than 8 roundings of `w²`,
    /// the square and the quotient. The smallest normal number covers products that are not normal, where `w²` is at least 2^-100; shorter ones are kept.
    /// A quotient that is not normal may be rounded up by half the least number, as other lower bounds.
    #[inline(always)]
    fn by_closest(&self) -> S::F {
        let (simd, [a, b, c]) = (self.simd, self.vertices);
        let (a, b, c) = (sub(simd, a, self.point), sub(simd, b, self.point), sub(simd, c, self.point));
        let w = self.closest([a, b, c]);
        let size = abs(simd, w);
        let least = simd.min(simd.min(dot(simd, w, a), dot(simd, w, b)), dot(simd, w, c));
        let (a, b, c) = (abs(simd, a), abs(simd, b), abs(simd, c));
        let terms = simd.max(simd.max(dot(simd, size, a), dot(simd, size, b)), dot(simd, size, c));
        let error =
            simd.mul_add(self.pad, norm(simd, w), simd.mul_add(simd.splat(self.bounds.rounding), terms, self.least));
        let along = simd.max(simd.sub(least, error), self.zero);
        let squared = dot(simd, w, w);
        // The square of `along` would overflow first.
        let bound = simd.mul(simd.mul(along, simd.splat(self.bounds.shrink)), simd.div(along, squared));
        // Short ones are kept.
        self.greatest(simd.pick(squared, simd.splat(LEAST), self.zero, bound))
    }

    /// About the closest point to zero of the triangles: that of the nearest edge, or of the plane where it is inside.
    #[inline(always)]
    fn closest(&self, [a, b, c]: [[S::F; 3]; 3]) -> [S::F; 3] {
        let simd = self.simd;
        let (ab, ac) = (sub(simd, b, a), sub(simd, c, a));
        let (mut best, mut least) = self.on_edge(a, ab);
        for (position, squared) in [self.on_edge(a, ac), self.on_edge(b, sub(simd, c, b))] {
            best = pick(simd, [squared, least], position, best);
            least = simd.min(squared, least);
        }
        let normal = cross(simd, ab, ac);
        let area = dot(simd, normal, normal);
        let (u, v) = (dot(simd, cross(simd, ac, a), normal), dot(simd, cross(simd, a, ab), normal));
        let inside = simd.min(simd.min(u, v), simd.sub(area, simd.add(u, v)));
        let height = simd.div(dot(simd, a, normal), simd.max(area, self.least));
        let foot = [simd.mul(height, normal[0]), simd.mul(height, normal[1]), simd.mul(height, normal[2])];
        pick(simd, [self.zero, inside], foot, best)
    }

    /// The point of an edge that is closest to zero, and its square.
    #[inline(always)]
    fn on_edge(&self, start: [S::F; 3], edge: [S::F; 3]) -> ([S::F; 3], S::F) {
        let simd = self.simd;
        let along = simd.div(dot(simd, start, edge), simd.max(dot(simd, edge, edge), self.least));
        let along = simd.min(simd.max(simd.sub(self.zero, along), self.zero), simd.splat(1.0));
        let position = mul_add(simd, along, edge, start);
        (position, dot(simd, position, position))
    }
}

// Written out: closures are not always compiled for the instructions of a path.

#[inline(always)]
fn abs<S: Simd>(simd: S, a: [S::F; 3]) -> [S::F; 3] {
    [simd.abs(a[0]), simd.abs(a[1]), simd.abs(a[2])]
}

/// `a` times `b`, plus `c`.
#[inline(always)]
fn mul_add<S: Simd>(simd: S, a: S::F, b: [S::F; 3], c: [S::F; 3]) -> [S::F; 3] {
    [simd.mul_add(a, b[0], c[0]), simd.mul_add(a, b[1], c[1]), simd.mul_add(a, b[2], c[2])]
}

/// Lanes of `x` where `a < b`, else those of `y`.
#[inline(always)]
fn pick<S: Simd>(simd: S, [a, b]: [S::F; 2], x: [S::F; 3], y: [S::F; 3]) -> [S::F; 3] {
    [simd.pick(a, b, x[0], y[0]), simd.pick(a, b, x[1], y[1]), simd.pick(a, b, x[2], y[2])]
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;
    use crate::simd::{SimdPath, Task};

    /// Whether a triangle may be near a point, by its box and by the closest point.
    struct IsNear<'a>(&'a [[f32; 3]; 3], [f32; 3], f32, Bounds);

    impl Task for IsNear<'_> {
        type Output = [bool; 2];

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> [bool; 2] {
            let Self(vertices, [x, y, z], limit, bounds) = self;
            let mut rows = [[0.0; 8]; 10];
            for (row, x) in rows.iter_mut().zip(vertices.as_flattened()) {
                *row = [*x; 8];
            }
            let point = [simd.splat(x), simd.splat(y), simd.splat(z)];
            let lanes = Lanes::new(simd, &Block::Eight(&rows), point, bounds);
            [lanes.by_boxes(), lanes.by_closest()].map(|bounds| lanes.within(bounds, limit) != 0)
        }
    }

    /// Above a vertex the weights of the plane are small where its square overflows: what is not a number is kept.
    #[test]
    fn nothing_that_overflows_is_skipped() {
        let mut n_finite = 0;
        for (edge, height, offset) in [(8e12, 8e12, 0.1), (1e13, 1e13, 0.1), (1e15, 1e9, 1e-8), (1e18, 1e5, 1e-20)] {
            let vertices = [[0.0, 0.0, 0.0], [edge, 0.0, 0.0], [0.0, edge, 0.0]];
            let point = [offset, offset, height];
            let limit = canted_obb::round::up(f64::from(height) * f64::from(height));
            n_finite += usize::from(limit < f32::MAX);
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let near = path.available().run(IsNear(&vertices, point, limit, BOUNDS));
                assert_eq!(near, [true; 2], "{} {edge:e} {height:e}", path.name());
            }
        }
        assert_eq!(n_finite, 4);
    }

    /// Of triangles across an axis the distance is that from the box, so that every rounding counts; those in any position are beyond by the closest point alone.
    #[test]
    fn no_triangle_at_the_limit_is_skipped_and_those_beyond_it_are() {
        const NO_BOUNDS: Bounds = Bounds { pad: 0.0, rounding: 0.0, shrink: 1.0 };
        let mut rng = SplitMix64::new(6);
        let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        let (mut n_near, mut n_beyond) = (0, [0; 2]);
        // How many are skipped without the factor, and without all bounds. The pad is for errors of distances in `f64`, which these triangles do not have.
        let (mut n_lost, mut n_lost_closest) = ([0; 2], 0);
        for round in 0..30_000 {
            let far = [0.0, 1.0, 1e4, 1e7, 1e30][round % 5];
            let size = [1.0, 1e-3, 1e4][round / 5 % 3] * if far > 1e20 { 1e28 } else { 1.0 };
            let is_across = round / 15 % 2 == 0;
            let plane = far * unit();
            let mut vertex =
                || [if is_across { plane } else { far + size * unit() }, far + size * unit(), size * unit()];
            let vertices = [vertex(), vertex(), vertex()];
            let inside: [f32; 3] = [0, 1, 2].map(|k| (0..3).map(|i| [0.3, 0.3, 0.4][i] * vertices[i][k]).sum());
            let away = if is_across { [unit(), 0.0, 0.0] } else { [unit(), unit(), 3.0 * unit()] };
            let point: [f32; 3] = std::array::from_fn(|k| inside[k] + size * away[k]);
            let distance = canted_trace::closest_point_on_triangle(point, &vertices).distance_squared;
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let is_near_by = |limit: f32, bounds| path.available().run(IsNear(&vertices, point, limit, bounds));
                let least = canted_obb::round::up(distance);
                assert_eq!(is_near_by(least, BOUNDS), [true; 2], "{}: {vertices:?} {point:?}", path.name());
                n_near += 1;
                for (n, bounds) in n_lost.iter_mut().zip([Bounds { shrink: 1.0, ..BOUNDS }, NO_BOUNDS]) {
                    let [by_box, by_closest] = is_near_by(least, bounds);
                    *n += usize::from(!by_box);
                    n_lost_closest += usize::from(!by_closest && bounds.pad == 0.0);
                }
                // Beyond by more than roundings of coordinates.
                if distance.sqrt() > 1e-3 * f64::from(far) && distance > 1e-20 && distance < 1e36 {
                    let [by_box, by_closest] = is_near_by((0.99 * distance) as f32, BOUNDS);
                    assert!(!by_box || !is_across, "{}: {vertices:?} {point:?}", path.name());
                    // Products of coordinates above 2^60 overflow.
                    assert!(!by_closest || far > 1e20, "{}: {vertices:?} {point:?}", path.name());
                    n_beyond[0] += usize::from(!by_box);
                    n_beyond[1] += usize::from(!by_closest);
                }
            }
        }
        assert!(n_near > 50_000 && n_beyond.iter().all(|&n| n > 10_000), "{n_near} {n_beyond:?}");
        assert!(n_lost.iter().all(|&n| n > 0) && n_lost_closest > 0, "{n_lost:?} {n_lost_closest} without bounds");
    }
}
