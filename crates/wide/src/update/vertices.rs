//! Points that a refit keeps for the oriented boxes above them, and the ends of any range of them along any rows, with the bits of
//! [`Slabs::from_points`]: few in double precision at once; of many, single precision finds those that can be extreme, and double precision
//! decides.

use std::ops::Range;

use canted_trace::{ReferencePoint, Slabs};

use super::extremes::Ends;
use crate::simd::Simd;

/// Points of a vector.
pub(super) const LANES: usize = 8;

/// The coordinates of eight points, axis by axis.
type Eight = [[f32; LANES]; 3];

/// Vertices of triangles relative to the reference point of a BVH. Those of a leaf are whole vectors, the last of which may repeat points:
/// the ends of a range do not depend on how often it has a point.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    eights: Vec<Eight>,
}

/// Up to here no projection overflows.
const MAX_REACH: f32 = 1e37;

/// A projection in `f32` differs from its [`Slabs::projection`] by less than this times the greatest coordinate. With u = 2^-24: three
/// products and two sums lose at most 3 u of the sum of the absolute terms, which is at most √3 times that coordinate for rows of length
/// 1 + 4 u; that is 5.2 u. The rest, 2.8 u, covers second-order terms, roundings in `f64` and those of thresholds.
const ERROR: f32 = 8.0 / (1 << 24) as f32;

/// Three products below 2^-126 lose less than this.
const TINY_ERROR: f32 = 1.0 / (1_u128 << 120) as f32;

/// Most vectors that double precision projects at once: in few leaves, most points can be extreme.
const FEW: usize = 18;

impl Vertices {
    /// Makes room for the vertices of so many triangles, of which each has about one of its own.
    pub(super) fn with_capacity(n: usize) -> Self {
        Self { eights: Vec::with_capacity(n.div_ceil(LANES)) }
    }

    pub(super) fn n_eights(&self) -> usize {
        self.eights.len()
    }

    /// Adds these vertices relative to this point.
    #[inline(always)]
    pub(super) fn push_vertices(
        &mut self,
        vertices: &[[u32; LANES]],
        positions: &[[f32; 3]],
        reference: ReferencePoint,
    ) {
        let from = reference.point();
        for vertices in vertices {
            let mut eight = [[0.0; LANES]; 3];
            for lane in 0..LANES {
                let [x, y, z] = positions[vertices[lane] as usize];
                (eight[0][lane], eight[1][lane], eight[2][lane]) = (x - from[0], y - from[1], z - from[2]);
            }
            self.eights.push(eight);
        }
    }

    /// Adds the vertices of a range of triangles, whose coordinates are in nine rows, relative to this point.
    #[inline(always)]
    pub(super) fn push_rows<const N: usize>(
        &mut self,
        rows: &[[f32; N]; 9],
        range: Range<usize>,
        reference: ReferencePoint,
    ) {
        let from = reference.point();
        for corner in rows.as_chunks::<3>().0 {
            for first in range.clone().step_by(LANES) {
                let mut eight = [[0.0; LANES]; 3];
                for k in 0..3 {
                    for lane in 0..LANES {
                        eight[k][lane] = corner[k][(first + lane).min(range.end - 1)] - from[k];
                    }
                }
                self.eights.push(eight);
            }
        }
    }

    /// The ends along these rows of a range of vectors, whose coordinates are at most `reach`.
    #[inline(always)]
    pub(super) fn ends<S: Simd>(&self, simd: S, range: Range<usize>, rows: [[f32; 3]; 3], reach: f32) -> Ends {
        let eights = &self.eights[range];
        let [lo, hi] = if eights.len() <= FEW {
            projections(eights, rows)
        } else {
            // NaN, too, is not below.
            let error = if reach < MAX_REACH { ERROR * reach + TINY_ERROR } else { f32::INFINITY };
            projections_within(simd, eights, rows, error)
        };
        let [lo, hi] = Slabs::ends(lo, hi, f64::from(reach));
        Ends { lo, hi }
    }
}

/// The least and the greatest projections, in double precision.
#[inline(always)]
fn projections(eights: &[Eight], rows: [[f32; 3]; 3]) -> [[f64; 3]; 2] {
    let wide_rows = wide(rows);
    let (mut lo, mut hi) = ([[f64::MAX; LANES]; 3], [[f64::MIN; LANES]; 3]);
    for points in eights {
        // A loop over the rows would be what the compiler makes vectors of.
        widen(&mut lo[0], &mut hi[0], wide_rows[0], points);
        widen(&mut lo[1], &mut hi[1], wide_rows[1], points);
        widen(&mut lo[2], &mut hi[2], wide_rows[2], points);
    }
    [[least_of(lo[0]), least_of(lo[1]), least_of(lo[2])], [greatest_of(hi[0]), greatest_of(hi[1]), greatest_of(hi[2])]]
}

/// The same, where projections in `f32` are off by less than `error`.
#[inline(always)]
fn projections_within<S: Simd>(simd: S, eights: &[Eight], rows: [[f32; 3]; 3], error: f32) -> [[f64; 3]; 2] {
    let axes = [row_in_lanes(simd, rows[0]), row_in_lanes(simd, rows[1]), row_in_lanes(simd, rows[2])];
    let mut least = [simd.splat(f32::INFINITY); 3];
    let mut greatest = [simd.splat(f32::NEG_INFINITY); 3];
    for [x, y, z] in eights {
        let points = [simd.load(x), simd.load(y), simd.load(z)];
        for k in 0..3 {
            let x = along(simd, &axes[k], points);
            (least[k], greatest[k]) = (simd.min(least[k], x), simd.max(greatest[k], x));
        }
    }
    // Infinite where nothing is known, and then every point is a candidate.
    let (mut low, mut high, wide_rows) = (least, greatest, wide(rows));
    for k in 0..3 {
        low[k] = simd.splat(least_of(simd.store(least[k])) + 2.0 * error);
        high[k] = simd.splat(greatest_of(simd.store(greatest[k])) - 2.0 * error);
    }
    let (mut lo, mut hi) = ([f64::MAX; 3], [f64::MIN; 3]);
    for [x, y, z] in eights {
        let points = [simd.load(x), simd.load(y), simd.load(z)];
        for k in 0..3 {
            let projected = along(simd, &axes[k], points);
            // A NaN is not inside.
            let mut lanes = 0xff ^ (simd.lt(low[k], projected) & simd.lt(projected, high[k]));
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let point = [f64::from(x[lane]), f64::from(y[lane]), f64::from(z[lane])];
                let x = Slabs::projection(wide_rows[k], point);
                lo[k] = if x < lo[k] { x } else { lo[k] };
                hi[k] = if x > hi[k] { x } else { hi[k] };
            }
        }
    }
    [lo, hi]
}

/// Includes the projections of eight points along a row, a step for all points at a time, as vectors have it.
#[inline(always)]
fn widen(lo: &mut [f64; LANES], hi: &mut [f64; LANES], row: [f64; 3], [x, y, z]: &[[f32; LANES]; 3]) {
    let mut along = [0.0; LANES];
    for lane in 0..LANES {
        along[lane] = Slabs::projection(row, [f64::from(x[lane]), f64::from(y[lane]), f64::from(z[lane])]);
    }
    for lane in 0..LANES {
        lo[lane] = if along[lane] < lo[lane] { along[lane] } else { lo[lane] };
        hi[lane] = if along[lane] > hi[lane] { along[lane] } else { hi[lane] };
    }
}

#[inline(always)]
fn row_in_lanes<S: Simd>(simd: S, row: [f32; 3]) -> [S::F; 3] {
    [simd.splat(row[0]), simd.splat(row[1]), simd.splat(row[2])]
}

/// Eight points along a row.
#[inline(always)]
fn along<S: Simd>(simd: S, row: &[S::F; 3], [x, y, z]: [S::F; 3]) -> S::F {
    simd.mul_add(row[2], z, simd.mul_add(row[1], y, simd.mul(row[0], x)))
}

#[inline(always)]
fn wide(rows: [[f32; 3]; 3]) -> [[f64; 3]; 3] {
    let mut wide = [[0.0; 3]; 3];
    for k in 0..3 {
        wide[k] = [f64::from(rows[k][0]), f64::from(rows[k][1]), f64::from(rows[k][2])];
    }
    wide
}

/// The least of eight numbers, the halves at once.
#[inline(always)]
fn least_of<T: Copy + PartialOrd>(x: [T; LANES]) -> T {
    let least = |a: T, b: T| if a < b { a } else { b };
    let four = [least(x[0], x[4]), least(x[1], x[5]), least(x[2], x[6]), least(x[3], x[7])];
    least(least(four[0], four[2]), least(four[1], four[3]))
}

/// The greatest of eight numbers, likewise.
#[inline(always)]
fn greatest_of<T: Copy + PartialOrd>(x: [T; LANES]) -> T {
    let greatest = |a: T, b: T| if a > b { a } else { b };
    let four = [greatest(x[0], x[4]), greatest(x[1], x[5]), greatest(x[2], x[6]), greatest(x[3], x[7])];
    greatest(greatest(four[0], four[2]), greatest(four[1], four[3]))
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::Obb;
    use canted_obb::round::{down, up};

    use super::*;
    use crate::SimdPath;
    use crate::simd::{AvailablePath, Task};

    /// Triangles of any kind.
    fn cloud(rng: &mut SplitMix64, round: usize) -> Vec<[[f32; 3]; 3]> {
        let scale: f64 = [1.0, 1e-6, 1e7, 1e-30, 1e-42, 1e36, 3e38][round % 7];
        let offset = [0.0, 1.0, 1e7][round / 7 % 3] * scale.min(1e20);
        let kind = round / 21 % 6;
        let mut coordinate = |i: usize| match if kind == 5 { i % 5 } else { kind } {
            0 => (offset + scale * rng.signed()) as f32,
            1 => offset as f32,
            2 => -0.0,
            // Many equal projections.
            3 => (offset + scale * rng.signed().round()) as f32,
            _ => (offset + scale * f64::from(f32::EPSILON) * rng.signed()) as f32,
        };
        let mut point = |i: usize| [0, 1, 2].map(|axis| coordinate(3 * i + axis));
        (0..1 + round % 41).map(|i| [0, 1, 2].map(|corner| point(3 * i + corner))).collect()
    }

    /// The ends of a range on a path, as a refit asks for them or within an error.
    struct EndsOf<'a> {
        vertices: &'a Vertices,
        range: Range<usize>,
        rows: [[f32; 3]; 3],
        reach: f32,
        error: Option<f32>,
    }

    impl Task for EndsOf<'_> {
        type Output = Slabs;

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> Slabs {
            let Self { vertices, range, rows, reach, error } = self;
            let [lo, hi] = match error {
                Some(error) => {
                    let [lo, hi] = projections_within(simd, &vertices.eights[range], rows, error);
                    Slabs::ends(lo, hi, f64::from(reach))
                }
                None => {
                    let ends = vertices.ends(simd, range, rows, reach);
                    [ends.lo, ends.hi]
                }
            };
            Slabs { rows, lo: lo.map(down), hi: hi.map(up) }
        }
    }

    #[test]
    fn boxes_are_those_of_all_points_on_every_path() {
        let mut rng = SplitMix64::new(7);
        let mut n_wrong_without_error = 0;
        for round in 0..10_000 {
            let cloud = cloud(&mut rng, round);
            let random = canted_obb::frame::orthonormal(rng.signed3(), rng.signed3());
            let rows = if round % 7 == 0 { Obb::IDENTITY_FRAME } else { random };
            let by_row = |i: usize| std::array::from_fn(|at| cloud.get(at).map_or(0.0, |t| t.as_flattened()[i]));
            let coordinates: [[f32; 41]; 9] = std::array::from_fn(by_row);
            let (mut vertices, range) = (Vertices::default(), round % 3 * cloud.len() / 8..cloud.len());
            // Points before the range, and two leaves in it.
            let inside = range.start.midpoint(range.end).max(range.start + 1);
            let mut starts = [0; 2];
            for (i, leaf) in [0..range.start, range.start..inside, inside..range.end].into_iter().enumerate() {
                vertices.push_rows(&coordinates, leaf, ReferencePoint::ORIGIN);
                starts[i.min(1)] = if i == 0 { vertices.n_eights() } else { starts[0] };
            }
            let cloud = cloud[range.clone()].as_flattened();
            let range = starts[0]..vertices.n_eights();
            let reach = cloud.as_flattened().iter().fold(0.0, |most: f32, x| most.max(x.abs()));
            let want = Slabs::from_points(rows, cloud.iter().copied());
            let found = |path: AvailablePath, error| {
                path.run(EndsOf { vertices: &vertices, range: range.clone(), rows, reach, error })
            };
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                assert_eq!(found(path.available(), None), want, "{round} {path:?}");
                let error = if reach < MAX_REACH { ERROR * reach + TINY_ERROR } else { f32::INFINITY };
                assert_eq!(found(path.available(), Some(error)), want, "{round} {path:?}");
            }
            n_wrong_without_error += usize::from(found(AvailablePath::detect(), Some(0.0)) != want);
        }
        assert!(n_wrong_without_error > 20, "{n_wrong_without_error} boxes are wrong without the bound");
    }
}
