use super::RayLanes;
use crate::layout::{Row, Word};
use crate::simd::Simd;

/// Where a ray enters eight children, and which of them it enters.
#[derive(Clone, Copy)]
pub(crate) struct Entries<S: Simd> {
    pub(crate) near: S::F,
    pub(crate) mask: u32,
}

/// The child words of a node's last row.
#[inline(always)]
pub(crate) fn words(row: &Row) -> &[Word; 8] {
    bytemuck::cast_ref(row)
}

/// Aligned node: rows lo x, hi x, lo y, hi y, lo z, hi z.
#[inline(always)]
pub(crate) fn enter_aligned<S: Simd>(simd: S, ray: &RayLanes<S>, rows: &[Row; 8], t_max: S::F) -> Entries<S> {
    let near_x = plane(simd, ray, rows, 0, ray.flipped[0], ray.near[0]);
    let near_y = plane(simd, ray, rows, 1, ray.flipped[1], ray.near[1]);
    let near_z = plane(simd, ray, rows, 2, ray.flipped[2], ray.near[2]);
    let far_x = plane(simd, ray, rows, 0, !ray.flipped[0], ray.far[0]);
    let far_y = plane(simd, ray, rows, 1, !ray.flipped[1], ray.far[1]);
    let far_z = plane(simd, ray, rows, 2, !ray.flipped[2], ray.far[2]);
    let near = simd.max(simd.max(near_x, near_y), simd.max(near_z, ray.t_min));
    let far = simd.min(simd.min(far_x, far_y), simd.min(far_z, t_max));
    Entries { near, mask: simd.le(near, far) }
}

/// Where the ray crosses the lower or upper planes of an axis.
#[inline(always)]
fn plane<S: Simd>(simd: S, ray: &RayLanes<S>, rows: &[Row; 8], k: usize, upper: bool, moved: S::F) -> S::F {
    simd.mul_sub(simd.load(&rows[2 * k + usize::from(upper)]), ray.recip[k], moved)
}

/// Oriented node: for each axis three components of the rows, the centers, the half-extents.
#[inline(always)]
pub(crate) fn enter_oriented<S: Simd>(simd: S, ray: &RayLanes<S>, rows: &[Row; 16], t_max: S::F) -> Entries<S> {
    let mut near = ray.t_min;
    let mut far = t_max;
    for k in 0..3 {
        let row = [simd.load(&rows[5 * k]), simd.load(&rows[5 * k + 1]), simd.load(&rows[5 * k + 2])];
        let center = simd.load(&rows[5 * k + 3]);
        let half = simd.add(simd.load(&rows[5 * k + 4]), ray.pad_oriented);
        let p = simd.mul_sub(row[2], ray.origin[2], center);
        let p = simd.mul_add(row[0], ray.origin[0], simd.mul_add(row[1], ray.origin[1], p));
        let direction = project(simd, row, ray.direction);
        let size = simd.max(simd.abs(direction), ray.min_direction);
        let a = simd.div(ray.one, size);
        let q = simd.mul(simd.xor_sign(p, direction), a);
        near = simd.max(simd.neg_mul_sub(half, a, q), near);
        far = simd.min(simd.mul_sub(half, a, q), far);
    }
    Entries { near, mask: simd.le(near, far) }
}

#[inline(always)]
fn project<S: Simd>(simd: S, row: [S::F; 3], v: [S::F; 3]) -> S::F {
    simd.mul_add(row[0], v[0], simd.mul_add(row[1], v[1], simd.mul(row[2], v[2])))
}
