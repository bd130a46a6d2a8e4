//! The oracle of every BVH: a loop over all triangles, and over all instances.
//!
//! Rays are transformed as `canted-tlas` documents it.

use std::cmp::Ordering;

use canted_fixtures::Mesh;
use canted_obb::{
    Affine, PrimId,
    vector::{Vector, cross, dot, length, sub},
};
use canted_trace::{
    BaldwinWeber, HIT_ERROR, Hit, InstanceId, Kernel, MollerTrumbore, Ray, ScaledRay, TriangleTest, Watertight,
};

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

/// Every hit, least `t` first, ties to the lowest primitive.
#[must_use]
pub fn all_hits<K: Kernel>(records: &[K::Record], ray: &Ray) -> Vec<Hit> {
    let Some(ray) = ScaledRay::new(ray) else { return vec![] };
    let prepared = K::prepare(&ray);
    let hits = (0..).map(PrimId).zip(records).filter_map(|(primitive, record)| {
        let hit = K::intersect(&prepared, &ray, record, ray.t_max)?;
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side })
    });
    // By the scaled `t`: that of the caller may be rounded to equal numbers.
    in_order(hits.collect()).into_iter().map(|hit| Hit { t: ray.caller_t(hit.t), ..hit }).collect()
}

/// The answer for a ray on one mesh.
pub type Loop<A> = Box<dyn Fn(&Ray) -> A + Send + Sync>;

/// The closest hit of the loop over the triangles of a mesh.
#[must_use]
pub fn of_mesh(mesh: &Mesh, test: TriangleTest) -> Loop<Option<Hit>> {
    match test {
        TriangleTest::Watertight => of::<Watertight, _>(mesh, closest_hit::<Watertight>),
        TriangleTest::MollerTrumbore => of::<MollerTrumbore, _>(mesh, closest_hit::<MollerTrumbore>),
        TriangleTest::BaldwinWeber => of::<BaldwinWeber, _>(mesh, closest_hit::<BaldwinWeber>),
    }
}

/// Every hit of the loop over the triangles of a mesh.
#[must_use]
pub fn all_of_mesh(mesh: &Mesh, test: TriangleTest) -> Loop<Vec<Hit>> {
    match test {
        TriangleTest::Watertight => of::<Watertight, _>(mesh, all_hits::<Watertight>),
        TriangleTest::MollerTrumbore => of::<MollerTrumbore, _>(mesh, all_hits::<MollerTrumbore>),
        TriangleTest::BaldwinWeber => of::<BaldwinWeber, _>(mesh, all_hits::<BaldwinWeber>),
    }
}

fn of<K: Kernel<Record: Send + Sync + 'static>, A: 'static>(mesh: &Mesh, ask: fn(&[K::Record], &Ray) -> A) -> Loop<A> {
    let records = records::<K>(&mesh.positions, &mesh.triangles);
    Box::new(move |ray| ask(&records, ray))
}

/// Half of `f32::EPSILON`: the relative error of one rounding.
const U: f64 = 0.5 * f32::EPSILON as f64;

/// Rows of the inverse, translation last: cofactors divided by the determinant, in `f64`.
#[must_use]
pub fn object_from_world(world_from_object: &Affine) -> [[f64; 4]; 3] {
    let [a, b, c, shift] = world_from_object.columns.map(|column| column.map(f64::from));
    let reciprocal = 1.0 / dot(a, cross(b, c));
    [cross(b, c), cross(c, a), cross(a, b)].map(|cofactors| {
        let row = cofactors.map(|x| x * reciprocal);
        [row[0], row[1], row[2], -dot(row, shift)]
    })
}

/// The ray in object space: each component computed in `f64` and rounded once; `t` stays the same number.
#[must_use]
pub fn ray_object(world_from_object: &Affine, ray_world: &Ray) -> Ray {
    let rows = object_from_world(world_from_object);
    let (o, d) = (ray_world.origin.map(f64::from), ray_world.direction.map(f64::from));
    Ray {
        origin: rows.map(|[x, y, z, shift]| (dot([x, y, z], o) + shift) as f32),
        direction: rows.map(|[x, y, z, _]| dot([x, y, z], d) as f32),
        ..*ray_world
    }
}

/// The closest hit, ties to the lowest (instance, primitive), by testing every instance.
///
/// `trace(instance, ray_object)` returns the closest hit in one instance.
pub fn closest_hit_of_instances(
    world_from_objects: &[Affine],
    ray_world: &Ray,
    trace: impl Fn(usize, &Ray) -> Option<Hit>,
) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for (i, (id, world_from_object)) in (0..).map(InstanceId).zip(world_from_objects).enumerate() {
        if let Some(hit) = trace(i, &ray_object(world_from_object, ray_world)) {
            let hit = Hit { instance: id, ..hit };
            if best.is_none_or(|best| hit.before(&best)) {
                best = Some(hit);
            }
        }
    }
    best
}

/// Greatest distance, along each world axis, of a hit from the image of its triangle.
///
/// All norms are greatest absolute components or row sums of matrices. In object space a hit lies within
/// `HIT_ERROR·(|o'| + ρ)` of its triangle. Rounding the origin moves it by `u·|o'|`, rounding the direction by
/// `u·t|d'|`, and `t|d'| <= |o'| + ρ`. The transform multiplies their sum by at most `‖M‖`, and
/// `|o'| <= ‖M⁻¹‖·(|o| + |c|)`. One more unit covers second-order terms.
#[must_use]
pub fn hit_error(world_from_object: &Affine, reach_object: f32, ray_world: &Ray) -> f64 {
    let [forward, backward] = norms(world_from_object);
    let shift = world_from_object.columns[3].map(f64::from);
    let origin_object = backward * (greatest(ray_world.origin.map(f64::from)) + greatest(shift));
    forward * (f64::from(HIT_ERROR) + 3.0 * U) * (origin_object + f64::from(reach_object))
}

/// The same for a device: twice its error for the transform, amplified; `HitError::with` in `canted-gpu` derives it.
#[must_use]
pub fn device_hit_error(ray_world: &Ray, world_from_object: &Affine, reach_object: f64) -> f64 {
    let [forward, backward] = norms(world_from_object);
    let [origin, shift] = [ray_world.origin, world_from_object.columns[3]].map(|v| greatest(v.map(f64::from)));
    2.0 * f64::from(canted_gpu::HIT_ERROR) * forward * backward * (origin + shift + forward * reach_object)
}

/// Length bound of a vector with components of at most 1, including `f64` rounding here.
pub const SQRT_3: f64 = 1.733;

/// Condition number `‖M‖·‖M⁻¹‖`, by which instances are rejected.
#[must_use]
pub fn condition(world_from_object: &Affine) -> f64 {
    let [forward, backward] = norms(world_from_object);
    forward * backward
}

/// Row sums of the linear part and of its inverse.
fn norms(world_from_object: &Affine) -> [f64; 2] {
    let norm = |rows: [Vector; 3]| rows.iter().map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max);
    let [a, b, c, _] = world_from_object.columns.map(|column| column.map(f64::from));
    let inverse = object_from_world(world_from_object).map(|[x, y, z, _]| [x, y, z]);
    [norm(std::array::from_fn(|k| [a[k], b[k], c[k]])), norm(inverse)]
}

fn greatest(v: Vector) -> f64 {
    v.iter().fold(0.0, |all: f64, x| all.max(x.abs()))
}

/// The hits, least `t` first, ties by (instance, primitive); equal ones once.
#[must_use]
pub fn in_order(mut hits: Vec<Hit>) -> Vec<Hit> {
    hits.sort_by(|a, b| if a.before(b) { Ordering::Less } else { Ordering::Greater });
    hits.dedup();
    hits
}

/// Distance of a point from a triangle, including degenerate ones: from its plane if the projection is inside, else from its edges.
#[must_use]
pub fn distance(p: Vector, corners: [Vector; 3]) -> f64 {
    let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
    let edges = [0, 1, 2].map(|i| (corners[i], sub(corners[(i + 1) % 3], corners[i])));
    if dot(normal, normal) > 0.0 && edges.iter().all(|(start, edge)| dot(cross(*edge, sub(p, *start)), normal) >= 0.0) {
        return dot(sub(p, corners[0]), normal).abs() / length(normal);
    }
    let to_edge = |(start, edge): &(Vector, Vector)| {
        let squared = dot(*edge, *edge);
        let along = if squared > 0.0 { (dot(sub(p, *start), *edge) / squared).clamp(0.0, 1.0) } else { 0.0 };
        length(sub(p, std::array::from_fn(|k| start[k] + along * edge[k])))
    };
    edges.iter().map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_to_plane_edge_corner_and_degenerate_triangle() {
        let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        assert_eq!(distance([0.5, 0.5, 3.0], corners), 3.0);
        assert_eq!(distance([1.0, -4.0, 3.0], corners), 5.0);
        assert_eq!(distance([-3.0, -4.0, 0.0], corners), 5.0);
        assert_eq!(distance([1.0, 1.0, 0.0], [[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 1.0);
        assert_eq!(distance([3.0, 4.0, 0.0], [[0.0; 3]; 3]), 5.0);
    }
}
