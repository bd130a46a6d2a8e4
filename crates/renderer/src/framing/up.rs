//! Which axis is up, where the triangles show it.

use std::collections::HashSet;

use canted_obb::Aabb;
use canted_scene::Scene;
use glam::DVec3;

use crate::wide;

/// How clearly a scene must stand on a flat base across z, so that z is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatBase {
    /// Least area of the base, relative to the box seen from below.
    pub least: f64,
    /// Greatest area of a base across y, relative to its own box seen from below, and to `least` or more across z.
    pub other: f64,
    /// Greatest area of a flat top relative to the base: prisms also stand on other sides.
    pub top: f64,
}

/// Whether a scene clearly stands on a flat base across z, and on none across y, by one of these measures: then z is up.
///
/// A base is made of triangles in the lowest plane of the bounding box that face down, or is the opening in that plane of a scan that is cut
/// off there.
#[must_use]
pub fn stands_on_z(scene: &Scene, clear: &[FlatBase]) -> bool {
    if clear.is_empty() {
        return false;
    }
    let [y, z] = bases(scene);
    clear.iter().any(|&FlatBase { least, other, top }| {
        z.bottom >= least && y.bottom <= other * z.bottom && z.top <= top * z.bottom
    })
}

/// Areas relative to the area of the box seen along an axis.
#[derive(Clone, Copy, Debug, Default)]
struct Ends {
    bottom: f64,
    top: f64,
}

/// The flat ends of a scene across y and z.
fn bases(scene: &Scene) -> [Ends; 2] {
    /// Height of a base relative to the longest side, and cosine of its normal to the axis.
    const HEIGHT: f64 = 0.005;
    const COSINE: f64 = 0.98;
    /// Height of a scene relative to its longest side from which it may be open below: lower ones are reliefs and charts.
    const FLAT: f64 = 0.15;
    let bounds: Aabb = scene.bounds_world();
    let extent = DVec3::from(bounds.extent());
    let size = extent.max_element();
    let mut ends = [Ends::default(); 2];
    if !(size > 0.0 && size.is_finite()) {
        return ends;
    }
    let (min, max) = (wide(bounds.min), wide(bounds.max));
    let mut edges = [(); 2].map(|()| Edges::default());
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
            for ((k, ends), edges) in (1..).zip(&mut ends).zip(&mut edges) {
                let is_low = [a, b, c].map(|point| point[k] <= min[k] + HEIGHT * size);
                let is_high = a[k].min(b[k]).min(c[k]) >= max[k] - HEIGHT * size;
                if -normal[k] > COSINE * length && is_low == [true; 3] {
                    ends.bottom += 0.5 * length;
                } else if normal[k] > COSINE * length && is_high {
                    ends.top += 0.5 * length;
                }
                let corners = if side < 0.0 { [c, b, a] } else { [a, b, c] };
                let is_low = if side < 0.0 { [is_low[2], is_low[1], is_low[0]] } else { is_low };
                if extent[k] > FLAT * size {
                    (0..3)
                        .filter(|&i| is_low[i] && is_low[(i + 1) % 3])
                        .for_each(|i| edges.add(corners[i], corners[(i + 1) % 3]));
                }
            }
        }
    }
    let across = [extent.x * extent.z, extent.x * extent.y];
    [0, 1].map(|i| {
        let Ends { bottom, top } = ends[i];
        let relative = |area: f64| if across[i] > 0.0 { area / across[i] } else { 0.0 };
        Ends { bottom: relative(bottom + edges[i].opening(i + 1)), top: relative(top) }
    })
}

/// Edges that one triangle has, with their direction in it.
#[derive(Default)]
struct Edges(HashSet<[[u64; 3]; 2]>);

impl Edges {
    fn add(&mut self, a: DVec3, b: DVec3) {
        // The sum makes negative zero positive. Scans have a vertex for each corner of a triangle where they come from STL.
        let [a, b] = [a, b].map(|point| point.to_array().map(|x| (x + 0.0).to_bits()));
        if !self.0.remove(&[b, a]) {
            self.0.insert([a, b]);
        }
    }

    /// The area that they go round, seen along an axis (Stokes): that of what would close the surface below.
    fn opening(&self, axis: usize) -> f64 {
        let point = |bits: [u64; 3]| DVec3::from(bits.map(f64::from_bits));
        let mut edges: Vec<[[u64; 3]; 2]> = self.0.iter().copied().collect();
        // The order of a set is random.
        edges.sort_unstable();
        let first = edges.first().map_or(DVec3::ZERO, |[a, _]| point(*a));
        let sum: f64 = edges.iter().map(|&[a, b]| (point(a) - first).cross(point(b) - first)[axis]).sum();
        (0.5 * sum).max(0.0)
    }
}
