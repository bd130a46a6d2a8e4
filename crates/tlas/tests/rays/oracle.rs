//! Every triangle of every instance, in exact terms.
//!
//! A `t` is an `f32` times a power of two, which `f64` holds exactly, so hits are compared without rounding. The object ray is that
//! of the crate's documentation: mapped in `f64`, scaled by a power of two, rounded once.

use canted_fixtures::Mesh;
use canted_obb::{Affine, PrimId};
use canted_tlas::{Instance, Motion};
use canted_trace::{Hit, InstanceId, Kernel, Ray, ScaledRay, Watertight};

/// Rows of the inverse at this time, each with its translation last.
fn inverse(instance: &Instance, time: f32) -> [[f64; 4]; 3] {
    let Some(close) = &instance.world_from_object_close else { return instance.object_from_world(0).unwrap() };
    let [a, b, c, origin] = Motion::new(&instance.world_from_object, close).world_from_object(time);
    let cross =
        |p: [f64; 3], q: [f64; 3]| [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let reciprocal = 1.0 / dot(a, cross(b, c));
    [cross(b, c), cross(c, a), cross(a, b)].map(|row| {
        let row = row.map(|x| x * reciprocal);
        [row[0], row[1], row[2], -dot(row, origin)]
    })
}

/// The ray in the object space of an instance, its direction scaled by a power of two and its interval unbounded; `None` for an instance
/// that it does not see.
pub(crate) fn in_object(instance: &Instance, ray: &Ray) -> Option<Ray> {
    if instance.mask & ray.mask == 0 {
        return None;
    }
    let rows = inverse(instance, ray.time);
    let apply = |row: &[f64; 4], v: [f64; 3]| (row[0] * v[0] + row[1] * v[1]) + row[2] * v[2];
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let direction = [0, 1, 2].map(|k| apply(&rows[k], d));
    let greatest = direction.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let power = greatest.log2().floor().exp2();
    let origin = [0, 1, 2].map(|k| (apply(&rows[k], o) + rows[k][3]) as f32);
    Some(Ray::new(origin, direction.map(|x| (x / power) as f32)))
}

/// All hits with their exact `t`: least `t` first, then lowest (instance, primitive).
pub(crate) fn all_hits(meshes: &[Mesh], instances: &[Instance], ray: &Ray, time: f32) -> Vec<(f64, Hit)> {
    let mut hits = vec![];
    for (number, instance) in (0..).zip(instances) {
        let rows = inverse(instance, time);
        let apply = |row: &[f64; 4], v: [f64; 3]| (row[0] * v[0] + row[1] * v[1]) + row[2] * v[2];
        let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
        let origin = [0, 1, 2].map(|k| (apply(&rows[k], o) + rows[k][3]) as f32);
        // Halved and doubled until the greatest component lies in [1, 2).
        let mut direction = [0, 1, 2].map(|k| apply(&rows[k], d));
        let mut scale = 1.0_f64;
        let greatest = |d: [f64; 3]| d.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        while greatest(direction) >= 2.0 {
            direction = direction.map(|x| 0.5 * x);
            scale *= 2.0;
        }
        while greatest(direction) < 1.0 {
            direction = direction.map(|x| 2.0 * x);
            scale *= 0.5;
        }
        let unbounded = Ray::new(origin, direction.map(|x| x as f32));
        let scaled = ScaledRay::new(&unbounded).unwrap();
        let prepared = Watertight::prepare(&scaled);
        let mesh = &meshes[instance.blas as usize];
        for (primitive, triangle) in (0..).map(PrimId).zip(&mesh.triangles) {
            let vertices = triangle.map(|v| mesh.positions[v as usize]);
            let Some(hit) = Watertight::intersect(&prepared, &scaled, &vertices, f32::INFINITY) else { continue };
            let t = f64::from(hit.t) / scaled.scale() / scale;
            if f64::from(ray.t_min) <= t && t <= f64::from(ray.t_max.min(f32::MAX)) {
                let instance = InstanceId(number);
                hits.push((t, Hit { t: t as f32, u: hit.u, v: hit.v, primitive, instance, side: hit.side }));
            }
        }
    }
    hits.sort_by(|(t_a, a), (t_b, b)| {
        (t_a, a.instance, a.primitive).partial_cmp(&(t_b, b.instance, b.primitive)).expect("no NaN")
    });
    hits
}

/// An affine map by its columns in `f64`.
pub(crate) fn affine(columns: [[f64; 3]; 4]) -> Affine {
    Affine { columns: columns.map(|column| column.map(|x| x as f32)) }
}
