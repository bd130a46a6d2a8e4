use canted_trace::{MIN_DIRECTION, SlabRay};
use glam::{Vec4, Vec4Swizzles};

use super::child::ChildRef;

/// A ray prepared for pair tests: each number is in the lanes that use it.
///
/// Lanes are (child 0, child 1) of the lower planes, then of the upper ones. The numbers are those of [`SlabRay`], so
/// its proof that no accepted hit is lost applies unchanged.
pub(super) struct PairRay {
    origin: [Vec4; 3],
    recip: [Vec4; 3],
    origin_direction: [Vec4; 3],
    pad: Vec4,
    t_min: Vec4,
}

impl PairRay {
    pub(super) fn new(ray: &SlabRay) -> Self {
        let lanes = |a: f32, b: f32| Vec4::new(a, a, b, b);
        Self {
            origin: std::array::from_fn(|k| lanes(ray.origin_lo()[k], ray.origin_hi()[k])),
            recip: std::array::from_fn(|k| Vec4::splat(ray.recip()[k])),
            origin_direction: std::array::from_fn(|k| lanes(ray.origin()[k], ray.direction()[k])),
            pad: lanes(ray.pad_oriented(), -ray.pad_oriented()),
            t_min: Vec4::splat(ray.t_min()),
        }
    }
}

/// The boxes of two siblings that a ray enters: entry `t` of each, and bit `i` set if it enters child `i`.
pub(super) struct Entries {
    pub(super) near: Vec4,
    pub(super) mask: u32,
}

/// Combines the plane distances of the three axes. Lanes 0 and 1 hold the result.
#[inline(always)]
fn join(ray: &PairRay, [x, y, z]: [Vec4; 3], t_max: f32) -> Entries {
    let (swapped_x, swapped_y, swapped_z) = (x.zwxy(), y.zwxy(), z.zwxy());
    let near = x.min(swapped_x).max(y.min(swapped_y)).max(z.min(swapped_z).max(ray.t_min));
    let far = x.max(swapped_x).min(y.max(swapped_y)).min(z.max(swapped_z).min(Vec4::splat(t_max)));
    Entries { near, mask: near.cmple(far).bitmask() & 3 }
}

/// Two axis-aligned siblings.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct AabbPair {
    /// For each axis: lower planes of both children, then upper planes.
    pub(super) planes: [Vec4; 3],
    pub(super) children: [ChildRef; 2],
}

impl AabbPair {
    #[inline(always)]
    pub(super) fn entries(&self, ray: &PairRay, t_max: f32) -> Entries {
        let distance = |k: usize| (self.planes[k] - ray.origin[k]) * ray.recip[k];
        join(ray, [distance(0), distance(1), distance(2)], t_max)
    }
}

/// Two siblings, at least one of them with an oriented box: three unit rows each, with an interval along each row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct SlabPair {
    /// For each row: x of both children, y of both.
    pub(super) rows_xy: [Vec4; 3],
    /// z of both children, for rows 0 and 1, then row 2; the last two lanes hold the bits of the child references.
    pub(super) rows_z: [Vec4; 2],
    /// For each row: lower ends of both children, then upper ends.
    pub(super) planes: [Vec4; 3],
}

impl SlabPair {
    #[inline(always)]
    pub(super) fn children(&self) -> [ChildRef; 2] {
        [ChildRef(self.rows_z[1].z.to_bits()), ChildRef(self.rows_z[1].w.to_bits())]
    }

    #[inline(always)]
    pub(super) fn entries(&self, ray: &PairRay, t_max: f32) -> Entries {
        let [o_d_x, o_d_y, o_d_z] = ray.origin_direction;
        let distance = |k: usize, z: Vec4| {
            // Lanes: origins of both children along the row, then directions.
            let xy = self.rows_xy[k];
            let along = (xy.xyxy() * o_d_x + xy.zwzw() * o_d_y) + z * o_d_z;
            let direction = along.zwzw();
            let direction = direction.abs().max(Vec4::splat(MIN_DIRECTION)).copysign(direction);
            (self.planes[k] - (along.xyxy() + ray.pad)) / direction
        };
        let [z01, z2] = self.rows_z;
        join(ray, [distance(0, z01.xyxy()), distance(1, z01.zwzw()), distance(2, z2.xyxy())], t_max)
    }
}
