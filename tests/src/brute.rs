//! Brute-force traversal: test every triangle.

use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Kernel, Ray, ScaledRay};

/// The closest hit, ties to the lowest primitive, by a loop over all triangles with the kernel itself.
///
/// A BVH must return the same bits, because it may skip only boxes that contain no hit.
#[must_use]
pub fn closest_hit<K: Kernel>(records: &[K::Record], ray: &Ray) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let prepared = K::prepare(&ray);
    let mut best: Option<Hit> = None;
    for (primitive, record) in (0..).map(PrimId).zip(records) {
        if let Some(hit) = K::intersect(&prepared, &ray, record, ray.t_max) {
            let hit = Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side };
            if best.is_none_or(|best| hit.before(&best)) {
                best = Some(hit);
            }
        }
    }
    best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
}

/// Records of indexed triangles, in input order.
#[must_use]
pub fn records<K: Kernel>(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<K::Record> {
    triangles.iter().map(|t| K::record(t.map(|i| positions[i as usize]))).collect()
}
