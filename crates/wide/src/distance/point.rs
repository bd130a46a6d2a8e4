use canted_trace::lanes::{SQRT_3, UNIT_ROUNDOFF as U};

use crate::layout::Row;
use crate::simd::Simd;
use crate::traverse::MeshFrame;

/// What roundings may add to a squared lower bound.
const SHRINK: f32 = 1.0 - 32.0 * U;

/// A query point in all lanes.
#[derive(Clone, Copy)]
pub(crate) struct PointLanes<S: Simd> {
    /// In the mesh frame, relative to the reference point.
    rotated: [S::F; 3],
    rotated_pad: S::F,
    /// Scale of squared bounds in the mesh frame.
    rotated_scale: S::F,
    /// In object space, relative to the reference point.
    point: [S::F; 3],
    oriented_pad: S::F,
    shrink: S::F,
    zero: S::F,
    one: S::F,
    greatest: S::F,
}

impl<S: Simd> PointLanes<S> {
    /// Lanes of `point`.
    #[inline(always)]
    pub(crate) fn new(simd: S, point: [f32; 3], frame: &MeshFrame) -> Self {
        let point = frame.reference.moved(point);
        let [x, y, z] = point.map(f32::abs);
        let scale = x.max(y).max(z);
        let pad = |roundings: f32| simd.splat(roundings * U * scale + f32::MIN_POSITIVE);
        let splat = |[x, y, z]: [f32; 3]| [simd.splat(x), simd.splat(y), simd.splat(z)];
        let (rotated, rotated_pad) =
            if frame.is_identity { (point, pad(3.0)) } else { (frame.rotate(point), pad(5.0 * SQRT_3)) };
        let [a, b, c] = frame.rows;
        let skew = dot(a, b).abs() + dot(b, c).abs() + dot(c, a).abs();
        Self {
            rotated: splat(rotated),
            rotated_pad,
            rotated_scale: simd.splat(SHRINK / (1.0 + skew)),
            point: splat(point),
            oriented_pad: pad(17.0 * SQRT_3),
            shrink: simd.splat(SHRINK),
            zero: simd.splat(0.0),
            one: simd.splat(1.0),
            greatest: simd.splat(f32::MAX),
        }
    }

    /// Lower bounds of the squared distances to eight boxes of an aligned node.
    #[inline(always)]
    pub(crate) fn aligned(&self, simd: S, rows: &[Row; 8]) -> S::F {
        let mut sum = self.zero;
        for k in 0..3 {
            let below = simd.sub(simd.load(&rows[2 * k]), self.rotated[k]);
            let above = simd.sub(self.rotated[k], simd.load(&rows[2 * k + 1]));
            let gap = simd.max(simd.sub(simd.max(below, above), self.rotated_pad), self.zero);
            sum = simd.add(sum, simd.mul(gap, gap));
        }
        simd.min(simd.mul(sum, self.rotated_scale), self.greatest)
    }

    /// Lower bounds of the squared distances to eight boxes of an oriented node.
    #[inline(always)]
    pub(crate) fn oriented(&self, simd: S, rows: &[Row; 16]) -> S::F {
        let row = |k: usize| [simd.load(&rows[5 * k]), simd.load(&rows[5 * k + 1]), simd.load(&rows[5 * k + 2])];
        let dot = |a: [S::F; 3], b: [S::F; 3]| {
            simd.add(simd.add(simd.mul(a[0], b[0]), simd.mul(a[1], b[1])), simd.mul(a[2], b[2]))
        };
        let axes = [row(0), row(1), row(2)];
        let mut sum = self.zero;
        for (k, &axis) in axes.iter().enumerate() {
            let along = simd.sub(dot(axis, self.point), simd.load(&rows[5 * k + 3]));
            let gap = simd.sub(simd.abs(along), simd.load(&rows[5 * k + 4]));
            let gap = simd.max(simd.sub(gap, self.oriented_pad), self.zero);
            sum = simd.add(sum, simd.mul(gap, gap));
        }
        let [a, b, c] = axes;
        let skew = simd.add(simd.abs(dot(a, b)), simd.add(simd.abs(dot(b, c)), simd.abs(dot(c, a))));
        let bound = simd.div(simd.mul(sum, self.shrink), simd.add(self.one, skew));
        simd.min(bound, self.greatest)
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
