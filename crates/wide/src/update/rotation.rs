//! How the content of a subtree has turned, and the frames of oriented boxes turned with it.
//!
//! Of two edges of each triangle, `M` is the sum of the products `after · beforeᵀ`. Where all edges turn by one rotation `R`, `M = R·S`
//! with `S` symmetric; otherwise the orthogonal factor of `M` is the rotation that fits the edges best, by the squares of distances (Kabsch
//! 1976). Long edges weigh more, as they do in a box. The factor is found by steps: `M - Mᵀ` of what is left is the cross product with
//! `(tr(S)·I - S)·w`, `w` the axis, and `M` is turned back by it (after Müller et al. 2016, who take more steps along that vector without
//! the inverse).
//!
//! A frame is a guess: boxes are computed from all vertices for whatever frame there is. So nothing here needs a bound on its errors.

use crate::node::Row;
use crate::simd::Simd;

/// Sums of products of edges after and before a motion, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct EdgeProducts {
    first: [f32; 8],
    last: f32,
}

impl EdgeProducts {
    pub(super) const ZERO: Self = Self { first: [0.0; 8], last: 0.0 };

    /// Writes those of eight triangles, by their coordinates after and before the motion.
    #[inline(always)]
    pub(super) fn of_triangles<S: Simd>(simd: S, after: &[S::F; 9], before: &[S::F; 9], all: &mut [Self]) {
        let mut products = [simd.splat(0.0); 9];
        for corner in 1..3 {
            let (mut to, mut from) = ([simd.splat(0.0); 3], [simd.splat(0.0); 3]);
            for k in 0..3 {
                to[k] = simd.sub(after[3 * corner + k], after[k]);
                from[k] = simd.sub(before[3 * corner + k], before[k]);
            }
            for i in 0..3 {
                for j in 0..3 {
                    // Not by `mul_add`: frames are the same bits on every path.
                    products[3 * i + j] = simd.add(products[3 * i + j], simd.mul(to[i], from[j]));
                }
            }
        }
        let [a, b, c, d, e, f, g, h, last] = products;
        let (first, last) = (simd.transpose([a, b, c, d, e, f, g, h]), simd.store(last));
        for ((one, first), last) in all.iter_mut().zip(first).zip(last) {
            *one = Self { first: simd.store(first), last };
        }
    }

    /// Together.
    #[inline(always)]
    pub(super) fn sum<'a, S: Simd>(simd: S, all: impl Iterator<Item = &'a Self>) -> Self {
        let (mut first, mut last) = (simd.splat(0.0), 0.0);
        for one in all {
            (first, last) = (simd.add(first, simd.load(&one.first)), last + one.last);
        }
        Self { first: simd.store(first), last }
    }
}

/// Turns the frames of an oriented node with the content of its slots.
#[inline(always)]
pub(super) fn turn_frames<S: Simd>(simd: S, rows: &mut [Row], slots: [&EdgeProducts; 8]) {
    let lanes = simd.transpose(slots.map(|slot| simd.load(&slot.first)));
    let mut products = [[0.0; 8]; 9];
    for (row, lanes) in products.iter_mut().zip(lanes) {
        *row = simd.store(lanes);
    }
    products[8] = slots.map(|slot| slot.last);
    let [_, xy, xz, yx, _, yz, zx, zy, _] = products;
    if [xy, xz, yz] == [yx, zx, zy] {
        return;
    }
    for lane in 0..8 {
        let mut product = [0.0; 9];
        let mut frame = [[0.0; 3]; 3];
        for i in 0..9 {
            product[i] = products[i][lane];
            frame[i / 3][i % 3] = rows[5 * (i / 3) + i % 3][lane];
        }
        let frame = turned(frame, rotation(product));
        for i in 0..9 {
            rows[5 * (i / 3) + i % 3][lane] = frame[i / 3][i % 3];
        }
    }
}

/// Steps towards the rotation after the first one.
const STEPS: usize = 2;

/// A quaternion, scalar first.
type Quaternion = [f32; 4];

const IDENTITY: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// The rotation closest to a sum of products; none where that is not determined, or beyond about a right angle.
#[inline(always)]
fn rotation(products: [f32; 9]) -> Quaternion {
    let mut greatest = 0.0;
    for x in products {
        greatest = if x.abs() > greatest { x.abs() } else { greatest };
    }
    let is_usable = greatest > f32::MIN_POSITIVE && greatest < f32::INFINITY;
    let scale = if is_usable { 1.0 / greatest } else { 0.0 };
    let mut left = [0.0; 9];
    for i in 0..9 {
        left[i] = if is_usable { products[i] * scale } else { 0.0 };
    }
    let mut all = first_step(&left);
    left = turned_back(&matrix(all), &left);
    for _ in 0..STEPS {
        let step = step(&left);
        left = turned_back(&matrix(step), &left);
        all = product(all, step);
    }
    all
}

/// The step for which `tr(S)·I` stands for `tr(S)·I - S`: all of the rotation where edges are along one line, two thirds of a small one
/// where they are along all. That matrix itself may be indefinite before long edges are about where they belong.
#[inline(always)]
fn first_step([xx, xy, xz, yx, yy, yz, zx, zy, zz]: &[f32; 9]) -> Quaternion {
    let trace = xx + yy + zz;
    let scale = if trace > 1e-3 { 1.0 / trace } else { 0.0 };
    by_tangent([(zy - yz) * scale, (xz - zx) * scale, (yx - xy) * scale])
}

/// The rotation about an axis whose length is the tangent of the angle, less than a quarter turn.
#[inline(always)]
fn by_tangent([x, y, z]: [f32; 3]) -> Quaternion {
    let square = x * x + y * y + z * z;
    // 1 + cos and sin, both divided by cos: half the angle.
    let w = 1.0 + (1.0 + square).sqrt();
    let length = (w * w + square).sqrt();
    if length < f32::INFINITY { [w / length, x / length, y / length, z / length] } else { IDENTITY }
}

/// A step towards the rotation in products of which the greatest is about one; none where they have no axis.
#[inline(always)]
fn step([xx, xy, xz, yx, yy, yz, zx, zy, zz]: &[f32; 9]) -> Quaternion {
    // tr(S)·I - S: a sum of two diagonal elements where all edges are along a line would be zero.
    let tiny = 1e-6;
    let (a, b, c) = (yy + zz + tiny, xx + zz + tiny, xx + yy + tiny);
    let (d, e, f) = (-0.5 * (yz + zy), -0.5 * (xz + zx), -0.5 * (xy + yx));
    let (aa, ab, ac) = (b * c - d * d, e * d - f * c, f * d - e * b);
    let (bb, bc, cc) = (a * c - e * e, f * e - a * d, a * b - f * f);
    let determinant = a * aa + f * ab + e * ac;
    let is_regular = determinant > 0.0 && a > 0.0 && aa > 0.0;
    let scale = if is_regular { 1.0 / determinant } else { 0.0 };
    let [x, y, z] = [(zy - yz) * scale, (xz - zx) * scale, (yx - xy) * scale];
    by_tangent([aa * x + ab * y + ac * z, ab * x + bb * y + bc * z, ac * x + bc * y + cc * z])
}

/// The matrix of a unit quaternion, row by row.
#[inline(always)]
fn matrix([w, x, y, z]: Quaternion) -> [f32; 9] {
    let (xx, yy, zz) = (2.0 * x * x, 2.0 * y * y, 2.0 * z * z);
    let (xy, xz, yz) = (2.0 * x * y, 2.0 * x * z, 2.0 * y * z);
    let (wx, wy, wz) = (2.0 * w * x, 2.0 * w * y, 2.0 * w * z);
    [1.0 - yy - zz, xy - wz, xz + wy, xy + wz, 1.0 - xx - zz, yz - wx, xz - wy, yz + wx, 1.0 - xx - yy]
}

/// The transpose of `by`, times `matrix`.
#[inline(always)]
fn turned_back(by: &[f32; 9], matrix: &[f32; 9]) -> [f32; 9] {
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = by[i] * matrix[j] + by[3 + i] * matrix[3 + j] + by[6 + i] * matrix[6 + j];
        }
    }
    out
}

#[inline(always)]
fn product([aw, ax, ay, az]: Quaternion, [bw, bx, by, bz]: Quaternion) -> Quaternion {
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

/// A frame turned by a quaternion, its rows unit vectors at right angles but for roundings; the frame itself where there is no rotation,
/// and where its rows are far from such vectors.
#[inline(always)]
fn turned(frame: [[f32; 3]; 3], by: Quaternion) -> [[f32; 3]; 3] {
    let mut wide = [[0.0; 3]; 3];
    let q = [f64::from(by[0]), f64::from(by[1]), f64::from(by[2]), f64::from(by[3])];
    let twice = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for k in 0..3 {
        let [x, y, z] = [f64::from(frame[k][0]), f64::from(frame[k][1]), f64::from(frame[k][2])];
        // v + 2 w (u × v) + 2 u × (u × v)
        let c = [q[2] * z - q[3] * y, q[3] * x - q[1] * z, q[1] * y - q[2] * x];
        wide[k] = [
            x + twice * (q[0] * c[0] + q[2] * c[2] - q[3] * c[1]),
            y + twice * (q[0] * c[1] + q[3] * c[0] - q[1] * c[2]),
            z + twice * (q[0] * c[2] + q[1] * c[1] - q[2] * c[0]),
        ];
    }
    let [x, y, z] = wide;
    let (x, of_x) = unit(x);
    let (y, of_y) = unit(without(y, x));
    let (z, of_z) = unit(without(without(z, x), y));
    // Half a length: false for empty slots, for NaN and for rows of files that are no frames.
    let is_frame = of_x > 0.25 && of_y > 0.25 && of_z > 0.25 && of_x < 2.0 && of_y < 2.0 && of_z < 2.0;
    let keeps = !is_frame || by == IDENTITY;
    let mut out = [[0.0; 3]; 3];
    for i in 0..9 {
        let (k, axis) = (i / 3, i % 3);
        out[k][axis] = if keeps { frame[k][axis] } else { [x, y, z][k][axis] as f32 };
    }
    out
}

/// A vector of length one, and the square of the length that it had.
#[inline(always)]
fn unit([x, y, z]: [f64; 3]) -> ([f64; 3], f64) {
    let square = x * x + y * y + z * z;
    let scale = 1.0 / square.sqrt();
    ([x * scale, y * scale, z * scale], square)
}

/// What is left of a vector without its part along a unit vector.
#[inline(always)]
fn without([x, y, z]: [f64; 3], along: [f64; 3]) -> [f64; 3] {
    let part = x * along[0] + y * along[1] + z * along[2];
    [x - part * along[0], y - part * along[1], z - part * along[2]]
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::Obb;

    use super::*;
    use crate::simd::Scalar;

    fn random_rotation(rng: &mut SplitMix64, degrees: f64) -> Quaternion {
        let [x, y, z] = rng.signed3();
        let length = (x * x + y * y + z * z).sqrt();
        let (sin, cos) = (0.5 * degrees.to_radians()).sin_cos();
        [cos, x / length * sin, y / length * sin, z / length * sin].map(|x| x as f32)
    }

    fn apply(by: Quaternion, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let m = matrix(by);
        [0, 1, 2].map(|i| m[3 * i] * x + m[3 * i + 1] * y + m[3 * i + 2] * z)
    }

    fn products(before: &[[f32; 9]; 8], after: &[[f32; 9]; 8]) -> EdgeProducts {
        let rows = |all: &[[f32; 9]; 8]| std::array::from_fn(|i| std::array::from_fn(|lane| all[lane][i]));
        let mut all = [EdgeProducts::ZERO; 8];
        EdgeProducts::of_triangles(Scalar, &rows(after), &rows(before), &mut all);
        EdgeProducts::sum(Scalar, all.iter())
    }

    /// Rows of an oriented node with one frame in all slots.
    fn node(frame: [[f32; 3]; 3]) -> [Row; 16] {
        let mut rows = [[0.0; 8]; 16];
        for i in 0..9 {
            rows[5 * (i / 3) + i % 3] = [frame[i / 3][i % 3]; 8];
        }
        rows
    }

    fn frame_in(rows: &[Row; 16], slot: usize) -> [[f32; 3]; 3] {
        [0, 1, 2].map(|k| [0, 1, 2].map(|axis| rows[5 * k + axis][slot]))
    }

    fn difference(a: [[f32; 3]; 3], b: [[f32; 3]; 3]) -> f32 {
        a.as_flattened().iter().zip(b.as_flattened()).fold(0.0, |most: f32, (a, b)| most.max((a - b).abs()))
    }

    #[test]
    fn frames_turn_with_triangles() {
        let mut rng = SplitMix64::new(1);
        let mut n_kept = 0;
        for round in 0..2_000 {
            let (degrees, bound) = [(1.0, 1e-5), (10.0, 1e-5), (30.0, 1e-4), (60.0, 0.02)][round % 4];
            // Needles as well as round ones, of all sizes, and anywhere.
            let size = [1.0, 1e-9, 1e9][round % 3];
            let shape = [[1.0, 1.0, 1.0], [1.0, 0.03, 0.03], [1.0, 1.0, 0.0]][round / 3 % 3];
            let mut corner = || {
                let [x, y, z] = rng.signed3();
                [x * shape[0], y * shape[1], z * shape[2]].map(|x| (size * x) as f32)
            };
            let before: [[f32; 9]; 8] = std::array::from_fn(|_| {
                let corners = [corner(), corner(), corner()];
                std::array::from_fn(|i| corners[i / 3][i % 3])
            });
            let by = random_rotation(&mut rng, degrees);
            let after = before.map(|corners| {
                let [ax, ay, az, bx, by_, bz, cx, cy, cz] = corners;
                let turned = [[ax, ay, az], [bx, by_, bz], [cx, cy, cz]].map(|p| apply(by, p));
                std::array::from_fn(|i| turned[i / 3][i % 3])
            });
            let products = products(&before, &after);
            let frame = canted_obb::frame::orthonormal(rng.signed3(), rng.signed3());
            let mut rows = node(frame);
            let slots = std::array::from_fn(|slot| if slot == 5 { &EdgeProducts::ZERO } else { &products });
            turn_frames(Scalar, &mut rows, slots);
            let want = frame.map(|row| apply(by, row));
            let found = frame_in(&rows, 3);
            assert!(difference(found, want) < bound, "{round} {degrees}: {found:?} {want:?}");
            for row in found {
                let length = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
                assert!((length - 1.0).abs() < 2.0 * f64::from(f32::EPSILON), "{length}");
            }
            assert_eq!(frame_in(&rows, 5), frame, "a slot whose content is not known to turn");
            n_kept += usize::from(difference(frame, want) < bound);
        }
        assert!(n_kept < 20, "{n_kept} would pass without a rotation");
    }

    #[test]
    fn what_does_not_turn_keeps_its_frame() {
        let mut rng = SplitMix64::new(2);
        for round in 0..200 {
            let before: [[f32; 9]; 8] = std::array::from_fn(|_| std::array::from_fn(|_| rng.signed() as f32));
            let scale = [1.0, 3.0, 1e30, 1e-30, f32::INFINITY, f32::NAN][round % 6];
            let products = products(&before, &before.map(|corners| corners.map(|x| x * scale)));
            let frame = canted_obb::frame::orthonormal(rng.signed3(), rng.signed3());
            let mut rows = node(frame);
            turn_frames(Scalar, &mut rows, [&products; 8]);
            assert!(difference(frame_in(&rows, round % 8), frame) < 1e-6, "{scale}");
        }
        // Mirrored, all along one line, and rows that are no frame.
        let mirrored = [-1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let line = [0.6, 0.0, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0];
        for products in [mirrored, line] {
            let [first @ .., last] = products;
            for frame in [Obb::IDENTITY_FRAME, [[0.0; 3]; 3], [[1.0, 0.0, 0.0]; 3]] {
                let mut rows = node(frame);
                turn_frames(Scalar, &mut rows, [&EdgeProducts { first, last }; 8]);
                let rows = frame_in(&rows, 0);
                let lengths = rows.map(|row| row.iter().map(|x| x * x).sum::<f32>());
                assert!(lengths.iter().all(|&x| x <= 1.0 + 4.0 * f32::EPSILON), "{rows:?}");
                assert!(frame == Obb::IDENTITY_FRAME || rows == frame);
            }
        }
    }
}
