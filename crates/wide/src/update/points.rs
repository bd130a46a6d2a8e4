//! Vertices that a refit keeps for the oriented boxes above them, and the box around any range of them along any rows, with the bits of
//! [`Slabs::from_points`]: single precision, eight points at a time, finds those that can be extreme, and double precision decides.

use std::ops::Range;

use canted_trace::{ReferencePoint, Slabs};

use crate::simd::{AvailablePath, Simd, Task};

/// Points of a vector.
pub(super) const LANES: usize = 8;

/// Points relative to the reference point of a BVH, by coordinate.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    by_axis: [Vec<f32>; 3],
}

/// Up to here no projection overflows.
const MAX_REACH: f32 = 1e37;

/// A projection in `f32` differs from its [`Slabs::ends`] by less than this times the greatest coordinate. With u = 2^-24: three products and
/// two sums lose at most 3 u of the sum of the absolute terms, which is at most √3 times that coordinate for rows of length 1 + 4 u; that is
/// 5.2 u. The rest, 2.8 u, covers second-order terms, the width between the ends and the rounding of thresholds.
const ERROR: f32 = 8.0 / (1 << 24) as f32;

/// Three products below 2^-126 lose less than this.
const TINY_ERROR: f32 = 1.0 / (1_u128 << 120) as f32;

impl Points {
    pub(super) fn len(&self) -> usize {
        self.by_axis[0].len()
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
        for vertex in rows.as_chunks::<3>().0 {
            for ((all, row), from) in self.by_axis.iter_mut().zip(vertex).zip(from) {
                all.extend(row[range.clone()].iter().map(|x| x - from));
            }
        }
    }

    /// The box with these rows around a range of points, whose coordinates are at most `reach`.
    pub(super) fn slabs(&self, range: Range<usize>, rows: [[f32; 3]; 3], reach: f32) -> Slabs {
        // NaN, too, is not below.
        let error = if reach < MAX_REACH { ERROR * reach + TINY_ERROR } else { f32::INFINITY };
        self.slabs_within(AvailablePath::detect(), range, rows, error)
    }

    /// The same, where projections in `f32` are off by less than `error`.
    fn slabs_within(&self, path: AvailablePath, range: Range<usize>, rows: [[f32; 3]; 3], error: f32) -> Slabs {
        let [x, y, z] = self.by_axis.each_ref().map(|all| &all[range.clone()]);
        let (lo, hi) = path.run(Ends { by_axis: [x, y, z], rows, error });
        Slabs::from_ends(rows, lo, hi)
    }
}

/// The least and the greatest ends of all points along each row.
struct Ends<'a> {
    by_axis: [&'a [f32]; 3],
    rows: [[f32; 3]; 3],
    error: f32,
}

impl Task for Ends<'_> {
    type Output = ([f64; 3], [f64; 3]);

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Self::Output {
        let (mut lo, mut hi) = ([f64::MAX; 3], [f64::MIN; 3]);
        let n = self.by_axis[0].len();
        if n == 0 {
            return (lo, hi);
        }
        let rows = &self.rows;
        let axes = [row_in_lanes(simd, rows[0]), row_in_lanes(simd, rows[1]), row_in_lanes(simd, rows[2])];
        let mut least = [simd.splat(f32::INFINITY); 3];
        let mut greatest = [simd.splat(f32::NEG_INFINITY); 3];
        let mut first = 0;
        while first < n {
            let points = self.eight(simd, first);
            for k in 0..3 {
                let x = along(simd, &axes[k], points);
                (least[k], greatest[k]) = (simd.min(least[k], x), simd.max(greatest[k], x));
            }
            first += LANES;
        }
        // Infinite where nothing is known, and then every point is a candidate.
        let (mut low, mut high, mut wide_rows) = (least, greatest, [[0.0; 3]; 3]);
        for k in 0..3 {
            low[k] = simd.splat(least_of(simd, least[k]) + 2.0 * self.error);
            high[k] = simd.splat(greatest_of(simd, greatest[k]) - 2.0 * self.error);
            wide_rows[k] = [f64::from(rows[k][0]), f64::from(rows[k][1]), f64::from(rows[k][2])];
        }
        let mut first = 0;
        while first < n {
            let points = self.eight(simd, first);
            for k in 0..3 {
                let x = along(simd, &axes[k], points);
                // A NaN is not inside.
                let mut lanes = 0xff ^ (simd.lt(low[k], x) & simd.lt(x, high[k]));
                if lanes != 0 {
                    let [x, y, z] = [simd.store(points[0]), simd.store(points[1]), simd.store(points[2])];
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize;
                        lanes &= lanes - 1;
                        let point = [f64::from(x[lane]), f64::from(y[lane]), f64::from(z[lane])];
                        let [below, above] = Slabs::ends(wide_rows[k], point);
                        lo[k] = if below < lo[k] { below } else { lo[k] };
                        hi[k] = if above > hi[k] { above } else { hi[k] };
                    }
                }
            }
            first += LANES;
        }
        (lo, hi)
    }
}

impl Ends<'_> {
    /// Eight points by coordinate: those from `first` on, the last eight where fewer are left, and some repeated where fewer are there at
    /// all.
    #[inline(always)]
    fn eight<S: Simd>(&self, simd: S, first: usize) -> [S::F; 3] {
        let [x, y, z] = self.by_axis;
        [eight(simd, x, first), eight(simd, y, first), eight(simd, z, first)]
    }
}

#[inline(always)]
fn eight<S: Simd>(simd: S, all: &[f32], first: usize) -> S::F {
    if let Some(last) = all.len().checked_sub(LANES) {
        let lanes = &all[first.min(last)..][..LANES];
        return simd.load(lanes.try_into().expect("eight"));
    }
    let mut lanes = [all[0]; LANES];
    lanes[..all.len()].copy_from_slice(all);
    simd.load(&lanes)
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
fn least_of<S: Simd>(simd: S, x: S::F) -> f32 {
    let mut least = f32::INFINITY;
    for x in simd.store(x) {
        least = if x < least { x } else { least };
    }
    least
}

#[inline(always)]
fn greatest_of<S: Simd>(simd: S, x: S::F) -> f32 {
    let mut greatest = f32::NEG_INFINITY;
    for x in simd.store(x) {
        greatest = if x > greatest { x } else { greatest };
    }
    greatest
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::Obb;

    use super::*;
    use crate::SimdPath;

    /// Points of any kind, and the greatest coordinate.
    fn cloud(rng: &mut SplitMix64, round: usize) -> (Vec<[f32; 3]>, f32) {
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
        let points: Vec<[f32; 3]> = (0..round % 101).map(|i| [0, 1, 2].map(|axis| coordinate(3 * i + axis))).collect();
        let reach = points.as_flattened().iter().fold(0.0, |most: f32, x| most.max(x.abs()));
        (points, reach)
    }

    #[test]
    fn boxes_are_those_of_all_points_on_every_path() {
        let mut rng = SplitMix64::new(7);
        let mut n_wrong_without_error = 0;
        for round in 0..20_000 {
            let (cloud, reach) = cloud(&mut rng, round);
            let random = canted_obb::frame::orthonormal(rng.signed3(), rng.signed3());
            let rows = if round % 7 == 0 { Obb::IDENTITY_FRAME } else { random };
            let points = Points { by_axis: [0, 1, 2].map(|axis| cloud.iter().map(|point| point[axis]).collect()) };
            let range = round % 3 * cloud.len() / 8..cloud.len() - round % 2 * cloud.len() / 3;
            let want = Slabs::from_points(rows, cloud[range.clone()].iter().copied());
            assert_eq!(points.slabs(range.clone(), rows, reach), want, "{round}");
            assert_eq!(points.slabs(range.clone(), rows, f32::INFINITY), want, "{round}");
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available() && reach < MAX_REACH) {
                let found = points.slabs_within(path.available(), range.clone(), rows, ERROR * reach + TINY_ERROR);
                assert_eq!(found, want, "{round} {path:?}");
            }
            let without = points.slabs_within(AvailablePath::detect(), range, rows, 0.0);
            n_wrong_without_error += usize::from(without != want);
        }
        assert!(n_wrong_without_error > 20, "{n_wrong_without_error} boxes are wrong without the bound");
    }
}
