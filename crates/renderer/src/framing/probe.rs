//! Rays that explore a scene.

use canted_obb::{Aabb, PrimId};
use canted_scene::Scene;
use canted_trace::{Hit, InstanceId, Intersect, Ray};
use glam::DVec3;

use super::turn::Turn;
use crate::surface::hit_filter::is_single_sided;
use crate::{narrow, wide};

/// Casts rays in the bounding box of a scene whose up direction was turned to +y.
pub(super) struct Probe<'a> {
    scene: &'a Scene,
    bvh: &'a dyn Intersect,
    /// Local bounds of what is viewed.
    pub(super) bounds: Aabb,
    turn: Turn,
}

/// The closest hit of a ray.
pub(super) enum RayResult {
    /// The front of a triangle.
    Front {
        /// Distance in world units.
        distance: f64,
        /// The triangle.
        triangle: (InstanceId, PrimId),
    },
    /// The back of a triangle.
    Back {
        /// Whether its material is single-sided, so that it is not drawn.
        is_hidden: bool,
    },
    /// No hit.
    Miss,
}

impl<'a> Probe<'a> {
    pub(super) fn new(scene: &'a Scene, bvh: &'a dyn Intersect, bounds: Aabb, turn: Turn) -> Self {
        Self { scene, bvh, bounds, turn }
    }

    /// The point at relative coordinates in 0..=1.
    pub(super) fn point_at(&self, relative: DVec3) -> DVec3 {
        DVec3::from(self.bounds.center()) + (relative - 0.5) * self.extent()
    }

    pub(super) fn extent(&self) -> DVec3 {
        self.bounds.extent().into()
    }

    /// Casts a ray.
    pub(super) fn cast(&self, from: DVec3, direction: DVec3) -> RayResult {
        let [from, towards] = [from, direction].map(|v| narrow(self.turn.to_world(v)));
        match self.bvh.closest_hit(&Ray::new(from, towards)) {
            None => RayResult::Miss,
            Some(hit) if Some(hit.instance.0) == self.scene.ground => RayResult::Miss,
            Some(hit) if !is_front(self.scene, &hit, towards) => {
                let mesh = &self.scene.meshes[self.scene.instances[hit.instance.0 as usize].mesh.0 as usize];
                let material = mesh.material_of(hit.primitive.0);
                let is_hidden = is_single_sided(&self.scene.materials[material.0 as usize], false);
                RayResult::Back { is_hidden }
            }
            Some(hit) => RayResult::Front {
                distance: f64::from(hit.t) * direction.length(),
                triangle: (hit.instance, hit.primitive),
            },
        }
    }

    /// Whether anything that is drawn is seen from far away in a direction; true where rays meet nothing.
    pub(super) fn is_drawn_from(&self, direction: DVec3) -> bool {
        const N_RAYS: u32 = 24;
        let (right, up) = direction.normalize().any_orthonormal_pair();
        let radius = 0.5 * self.extent().length();
        let mut is_hidden = false;
        for i in 0..N_RAYS * N_RAYS {
            let [x, y] = [i % N_RAYS, i / N_RAYS].map(|k| (2.0 * f64::from(k) + 1.0) / f64::from(N_RAYS) - 1.0);
            let from = DVec3::from(self.bounds.center()) + (right * x + up * y + direction.normalize() * 2.0) * radius;
            match self.cast(from, -direction) {
                RayResult::Miss => {}
                RayResult::Back { is_hidden: true } => is_hidden = true,
                RayResult::Front { .. } | RayResult::Back { .. } => return true,
            }
        }
        !is_hidden
    }
}

/// Whether a ray along `direction` hits the front of a triangle. Mirroring transforms reverse the winding, and structures of one level and
/// of two report sides in different spaces, so the side is that of the vertices in world space.
pub(super) fn is_front(scene: &Scene, hit: &Hit, direction: [f32; 3]) -> bool {
    let instance = &scene.instances[hit.instance.0 as usize];
    let mesh = &scene.meshes[instance.mesh.0 as usize];
    // Curves are solids.
    if mesh.curves.is_some() {
        return hit.side == canted_trace::Side::Front;
    }
    let corner = |i: u32| {
        let position = wide(mesh.positions[i as usize]);
        DVec3::from(instance.world_from_object.point_f64(position.into()))
    };
    let [a, b, c] = mesh.triangles[hit.primitive.0 as usize].map(corner);
    let is_mirrored = instance.world_from_object.determinant() < 0.0;
    ((b - a).cross(c - a).dot(wide(direction)) <= 0.0) != is_mirrored
}

/// Point `i` of a low-discrepancy sequence in the unit cube, the R₃ sequence of Roberts 2018, *The Unreasonable
/// Effectiveness of Quasirandom Sequences*.
pub(super) fn quasirandom(i: u32) -> DVec3 {
    /// The root of x⁴ = x + 1 above 1.
    const ROOT: f64 = 1.220_744_084_605_759_5;
    let component = |k: usize| {
        let step = (0..=k).fold(1.0, |step, _| step / ROOT);
        (0.5 + f64::from(i) * step).fract()
    };
    DVec3::from([0, 1, 2].map(component))
}
