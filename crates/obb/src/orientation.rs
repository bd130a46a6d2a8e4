//! Exact signs of areas and volumes, and of sums of products by error-free transformations (Dekker, Knuth, Shewchuk).

use core::cmp::Ordering;

use crate::{
    round::{U, two_sum},
    vector::mul_add,
};

/// Rounding of the filters, relative to the sum of absolute terms: a difference, two products and three sums touch a term,
/// one more rounding each for the sum of absolute terms and its product. Eight cover seven.
const FILTER_ERROR: f64 = 8.0 * U;

/// Sign of the area of the triangle `a`, `b`, `c` in the plane, exactly: `Greater` if counterclockwise.
///
/// Source: Shewchuk 1997, with a static filter and expansions behind it.
#[must_use]
pub fn orient_2d(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> Ordering {
    let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
    orient_2d_f64(a, b, c)
}

/// As [`orient_2d`], of points in `f64`: exact where each coordinate is zero or between 2^-250 and 2^250 in magnitude.
#[must_use]
pub fn orient_2d_f64([ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]) -> Ordering {
    let (left, right) = ((ax - cx) * (by - cy), (ay - cy) * (bx - cx));
    let area = left - right;
    if area.abs() > FILTER_ERROR * (left.abs() + right.abs()) {
        return area.total_cmp(&0.0);
    }
    let mut exact = ExactSum::<12>::new();
    for (x, y) in [(ax, by), (bx, cy), (cx, ay), (-ay, bx), (-by, cx), (-cy, ax)] {
        exact.add_product(x, y);
    }
    exact.sign()
}

/// Sign of the volume `det(a - d, b - d, c - d)`, exactly: `Greater` if `a`, `b`, `c` are clockwise seen from `d`.
#[must_use]
pub fn orient_3d(a: [f32; 3], b: [f32; 3], c: [f32; 3], d: [f32; 3]) -> Ordering {
    let [a, b, c, d] = [a, b, c, d].map(|p| p.map(f64::from));
    orient_3d_f64(a, b, c, d)
}

/// As [`orient_3d`], of points in `f64`: exact where each coordinate is zero or between 2^-250 and 2^250 in magnitude.
#[must_use]
pub fn orient_3d_f64(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> Ordering {
    let [u, v, w] = [a, b, c].map(|p| [p[0] - d[0], p[1] - d[1], p[2] - d[2]]);
    let (mut volume, mut terms) = (0.0, 0.0);
    for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
        let (left, right) = (v[y] * w[z], v[z] * w[y]);
        volume += u[x] * (left - right);
        terms += u[x].abs() * (left.abs() + right.abs());
    }
    if volume.abs() > FILTER_ERROR * terms {
        return volume.total_cmp(&0.0);
    }
    let is_exact = |p: [f64; 3]| (0..3).all(|k| two_sum(p[k], -d[k]).1 == 0.0);
    if [a, b, c].into_iter().all(is_exact) {
        let mut exact = ExactSum::<24>::new();
        exact.add_determinant(u, v, w, 1.0);
        return exact.sign();
    }
    // Four determinants of three points each.
    let mut exact = ExactSum::<96>::new();
    for (points, sign) in [([a, b, c], 1.0), ([b, c, d], -1.0), ([c, d, a], 1.0), ([d, a, b], -1.0)] {
        exact.add_determinant(points[0], points[1], points[2], sign);
    }
    exact.sign()
}

/// Whether the corners of a triangle lie on a line or in a point, exactly: whether it has no area.
#[inline]
#[must_use]
pub fn is_flat(corners: [[f32; 3]; 3]) -> bool {
    const PLANES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    // As in `orient_2d`, for all projections before any is computed exactly: those of an axis-parallel triangle are zero but one.
    let has_area = |[i, j]: [usize; 2]| {
        let (left, right) = ((a[i] - c[i]) * (b[j] - c[j]), (a[j] - c[j]) * (b[i] - c[i]));
        (left - right).abs() > FILTER_ERROR * (left.abs() + right.abs())
    };
    !PLANES.into_iter().any(has_area) && is_exactly_flat(corners, PLANES)
}

#[cold]
fn is_exactly_flat(corners: [[f32; 3]; 3], planes: [[usize; 2]; 3]) -> bool {
    planes.into_iter().all(|[i, j]| {
        let [a, b, c] = corners.map(|corner| [corner[i], corner[j]]);
        orient_2d(a, b, c).is_eq()
    })
}

/// The corners of a triangle; one without area ([`is_flat`]) becomes its longest edge: the corner between the ends, or equal to one of
/// them, is replaced by the first corner, or if it is the first by the second.
///
/// So the first corner equals another, and one of the two edges that leave it is zero. Triangle tests then compute a determinant of
/// exactly 0, and no ray hits the triangle; with three different corners on a line, the determinant would be made of roundings.
#[inline]
#[must_use]
pub fn flat_as_edge(corners: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    if is_flat(corners) { edge_of(corners) } else { corners }
}

#[cold]
fn edge_of(corners: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    let [v0, v1, v2] = corners;
    // Points of a line have one order along all axes in which they differ.
    let differ = (0..3).map(|axis| corners.map(|corner| corner[axis])).find(|[a, b, c]| a != b || b != c);
    match differ {
        None => corners,
        Some([a, b, c]) if b < a && a < c || c < a && a < b => [v1, v1, v2],
        Some([a, b, c]) if a.min(b) <= c && c <= a.max(b) => [v0, v1, v0],
        Some(_) => [v0, v0, v2],
    }
}

/// A sum of products held exactly as an unevaluated sum of `f64`, at most `N` of them.
///
/// Exact as long as no product leaves the normal range of `f64`, which products of up to four `f32` do not.
pub(crate) struct ExactSum<const N: usize> {
    /// Nonoverlapping, in increasing magnitude.
    parts: [f64; N],
    length: usize,
}

impl<const N: usize> ExactSum<N> {
    pub(crate) fn new() -> Self {
        Self { parts: [0.0; N], length: 0 }
    }

    /// Adds `a · b` as two parts: the rounded product and its exact error.
    pub(crate) fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(mul_add(a, b, -product));
        self.add(product);
    }

    /// Adds `sign · det(u, v, w)`: six products of three factors.
    fn add_determinant(&mut self, u: [f64; 3], v: [f64; 3], w: [f64; 3], sign: f64) {
        for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            for (first, second, third) in [(v[y], w[z], u[x]), (v[z], w[y], -u[x])] {
                let product = first * second;
                let rest = mul_add(first, second, -product);
                // Products of two f32 leave none.
                if rest != 0.0 {
                    self.add_product(sign * third, rest);
                }
                self.add_product(sign * third, product);
            }
        }
    }

    /// Adds a number; zero parts are dropped (Shewchuk 1997, grow expansion with zero elimination).
    fn add(&mut self, term: f64) {
        let mut carry = term;
        let mut kept = 0;
        for i in 0..self.length {
            let (sum, rest) = two_sum(carry, self.parts[i]);
            carry = sum;
            if rest != 0.0 {
                self.parts[kept] = rest;
                kept += 1;
            }
        }
        if carry != 0.0 {
            self.parts[kept] = carry;
            kept += 1;
        }
        self.length = kept;
    }

    /// Sign of the sum: that of its greatest part.
    pub(crate) fn sign(&self) -> Ordering {
        match self.length {
            0 => Ordering::Equal,
            n => self.parts[n - 1].total_cmp(&0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_of_simple_triangles_and_tetrahedra() {
        let (o, x, y, z) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        assert_eq!(orient_2d([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]), Ordering::Greater);
        assert_eq!(orient_2d([0.0, 0.0], [0.0, 1.0], [1.0, 0.0]), Ordering::Less);
        assert_eq!(orient_2d([0.1, 0.1], [0.2, 0.2], [0.7, 0.7]), Ordering::Equal);
        assert_eq!(orient_3d(x, y, z, o), Ordering::Greater);
        assert_eq!(orient_3d(y, x, z, o), Ordering::Less);
        assert_eq!(orient_3d(x, y, [0.5, 0.5, 0.0], o), Ordering::Equal);
    }

    /// One unit in the last place off the line or the plane decides, whatever the other coordinates' size.
    #[test]
    fn the_last_place_decides() {
        for scale in [1e-30_f32, 1.0, 1e7, 1e15] {
            let line = |t: f32| [t * scale, t * scale];
            let c = [7.0 * scale, (7.0 * scale).next_up()];
            assert_eq!(orient_2d(line(1.0), line(3.0), c), Ordering::Greater);
            assert_eq!(orient_2d(line(1.0), line(3.0), [c[1], c[0]]), Ordering::Less);
            assert_eq!(orient_2d(line(1.0), line(3.0), line(7.0)), Ordering::Equal);
            let plane = |x: f32, y: f32| [x * scale, y * scale, x * scale];
            let d = [5.0 * scale, 2.0 * scale, (5.0 * scale).next_up()];
            let sign = orient_3d(plane(0.0, 0.0), plane(3.0, 1.0), plane(1.0, 4.0), d);
            let other = orient_3d(plane(0.0, 0.0), plane(3.0, 1.0), plane(1.0, 4.0), [d[2], d[1], d[0]]);
            assert!(sign != Ordering::Equal && sign == other.reverse(), "{scale}: {sign:?} {other:?}");
            assert_eq!(orient_3d(plane(0.0, 0.0), plane(3.0, 1.0), plane(1.0, 4.0), plane(5.0, 2.0)), Ordering::Equal);
        }
    }

    #[test]
    fn flat_triangles_become_their_longest_edge() {
        let line = |t: f32| [0.1 * 3.0 * t, 0.7 * t, -0.3 * t];
        let (o, p) = ([0.0; 3], [1.0, 2.0, 3.0]);
        let (a, b, c) = (line(1.0), line(2.0), line(4.0));
        for (corners, want) in [
            ([a, b, c], [a, a, c]),
            ([b, a, c], [a, a, c]),
            ([a, c, b], [a, c, a]),
            ([c, b, a], [c, c, a]),
            ([a, b, b], [a, b, a]),
            ([a, a, b], [a, a, b]),
            ([a, b, a], [a, b, a]),
            ([o, o, o], [o, o, o]),
        ] {
            assert!(is_flat(corners), "{corners:?}");
            let edge = flat_as_edge(corners);
            assert_eq!(edge, want, "{corners:?}");
            assert!(edge[0] == edge[1] || edge[0] == edge[2], "{edge:?}");
        }
        // The slightest area is one.
        for scale in [1e-30_f32, 1.0, 1e7] {
            let mut thin = [line(1.0), line(2.0), line(4.0)].map(|p| p.map(|x| x * scale));
            thin[1][2] = thin[1][2].next_up();
            assert!(!is_flat(thin), "{thin:?}");
            assert_eq!(flat_as_edge(thin), thin);
        }
        assert!(!is_flat([o, p, [1.0, 2.0, 3.0_f32.next_up()]]));
        assert!(!is_flat([o, [1e38, 0.0, 0.0], [-1e38, f32::from_bits(1), 0.0]]));
        for axis in 0..3 {
            let mut plane = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
            plane.iter_mut().for_each(|corner| corner.rotate_right(axis));
            assert!(!is_flat(plane), "{plane:?}");
        }
    }

    /// Sizes that `f64` differences cannot hold exactly.
    #[test]
    fn mixed_scales_are_exact() {
        let tiny = 1e-38;
        assert_eq!(orient_2d([0.0, 0.0], [1e38, 1e38], [1.0, 1.0 - f32::EPSILON]), Ordering::Less);
        assert_eq!(orient_2d([0.0, 0.0], [1e38, 0.0], [-1e38, tiny]), Ordering::Greater);
        assert_eq!(orient_3d([0.0; 3], [1e30, 0.0, 0.0], [0.0, 1e30, 0.0], [1e30, 1e30, tiny]), Ordering::Less);
        assert_eq!(orient_3d([0.0; 3], [1e30, 0.0, 0.0], [0.0, 1e30, 0.0], [1e30, 1e30, -tiny]), Ordering::Greater);
        assert_eq!(orient_3d([0.0; 3], [1e30, 0.0, 0.0], [0.0, 1e30, 0.0], [1e30, 1e30, 0.0]), Ordering::Equal);
    }

    /// Numbers of 53 bits: neither differences nor products of two are exact.
    #[test]
    fn the_last_place_of_f64_decides() {
        let up = |x: f64| x.next_up();
        for scale in [1e-60, 1.0 / 3.0, 1e7, 1e60] {
            let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|p: [f64; 3]| p.map(|x| scale * x));
            // In the plane of the others, as powers of two of one number.
            let d = [0.25, 0.25, 0.5].map(|x| scale * x);
            assert_eq!(orient_3d_f64(a, b, c, d), Ordering::Equal, "{scale}");
            assert_eq!(orient_3d_f64(a, b, c, [d[0], d[1], up(d[2])]), Ordering::Less, "{scale}");
            assert_eq!(orient_3d_f64(a, b, c, [d[0], d[1], d[2].next_down()]), Ordering::Greater, "{scale}");
            let shifted = [a, b, c, d].map(|p| p.map(|x| x + 1e9 * scale));
            let [a, b, c, d] = shifted;
            let sign = orient_3d_f64(a, b, c, d);
            assert_eq!([orient_3d_f64(b, a, c, d), orient_3d_f64(a, b, d, c)], [sign.reverse(); 2], "{scale}");
            assert_eq!(
                orient_2d_f64([scale, scale], [3.0 * scale, 3.0 * scale], [scale, up(scale)]),
                Ordering::Greater
            );
        }
    }

    #[test]
    fn signs_are_exact_where_f64_loses_terms() {
        let mut sum = ExactSum::<10>::new();
        sum.add_product(1e30, 1e30);
        sum.add_product(1e-30, 1e-30);
        sum.add_product(-1e30, 1e30);
        assert_eq!(sum.sign(), Ordering::Greater);
        sum.add_product(1e-30, -1e-30);
        assert_eq!(sum.sign(), Ordering::Equal);
        sum.add_product(f64::from(f32::from_bits(1)), -f64::from(f32::from_bits(1)));
        assert_eq!(sum.sign(), Ordering::Less);
    }
}
