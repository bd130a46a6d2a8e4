//! Which axis is up, where the triangles show it.

use canted_obb::Aabb;
use canted_scene::Scene;
use glam::DVec3;

use crate::wide;

/// Whether a scene clearly stands on a flat base across z, and on none across y: then z is up.
///
/// A base is made of triangles in the lowest plane of the bounding box that face down, and has an area of at least `least` of the box seen
/// from below. Across y there must be at most a quarter of it.
#[must_use]
pub fn stands_on_z(scene: &Scene, least: f64) -> bool {
    const OTHER: f64 = 0.25;
    let [y, z] = bases(scene);
    z >= least && y <= OTHER * z
}

/// The area of the bases across y and z, relative to the area of the box seen from below.
fn bases(scene: &Scene) -> [f64; 2] {
    /// Height of a base relative to the longest side, and cosine of its normal to the axis.
    const HEIGHT: f64 = 0.005;
    const COSINE: f64 = 0.98;
    let bounds: Aabb = scene.bounds_world();
    let extent = DVec3::from(bounds.extent());
    let size = extent.max_element();
    let mut areas = [0.0; 2];
    if !(size > 0.0 && size.is_finite()) {
        return areas;
    }
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let side = instance.world_from_object.determinant().signum();
        let at = |i: u32| {
            let point = wide(mesh.positions[i as usize]);
            DVec3::from(instance.world_from_object.point_f64(point.into()))
        };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(at);
            let normal = (b - a).cross(c - a) * side;
            let length = normal.length();
            for (k, area) in (1..).zip(&mut areas) {
                let highest = a[k].max(b[k]).max(c[k]);
                if -normal[k] > COSINE * length && highest <= f64::from(bounds.min[k]) + HEIGHT * size {
                    *area += 0.5 * length;
                }
            }
        }
    }
    let across = [extent.x * extent.z, extent.x * extent.y];
    [0, 1].map(|k| if across[k] > 0.0 { areas[k] / across[k] } else { 0.0 })
}
