//! A rotation that makes the up direction of a scene +y, so that all views are chosen for +y.

use canted_obb::Aabb;
use canted_scene::{Camera, Scene};
use glam::DVec3;

use crate::{narrow, wide};

/// World-space directions of the local axes; the second is up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn([DVec3; 3]);

impl Turn {
    /// Directions along an axis give a rotation without rounding; +y gives none.
    pub(super) fn of_up(up: [f32; 3]) -> Self {
        let up = wide(up).try_normalize().unwrap_or(DVec3::Y);
        // x stays to the right unless it is up.
        let right = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Z };
        let back = right.cross(up).try_normalize().unwrap_or(DVec3::Z);
        Self([up.cross(back), up, back])
    }

    pub(super) fn to_world(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        let [right, up, back] = self.0;
        right * x + (up * y + back * z)
    }

    /// The local coordinates of a point in world space.
    pub(super) fn to_local(self, point: DVec3) -> DVec3 {
        self.0.map(|axis| axis.dot(point)).into()
    }

    /// Local bounds of a scene: those of its box in world space.
    pub(super) fn bounds(self, scene: &Scene) -> Aabb {
        let world = scene.bounds_world();
        if world.is_empty() {
            return world;
        }
        let mut local = Aabb::EMPTY;
        for corner in 0..8 {
            let side = |k: usize| if corner >> k & 1 == 0 { world.min[k] } else { world.max[k] };
            let point = wide([0, 1, 2].map(side));
            local.grow(narrow(self.to_local(point)));
        }
        local
    }

    /// A local camera in world space.
    pub(super) fn camera(self, local: &Camera) -> Camera {
        let [eye, target, up] = [local.eye, local.target, local.up].map(|v| narrow(self.to_world(wide(v))));
        Camera { eye, target, up, ..*local }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn y_up_changes_nothing_and_z_up_permutes() {
        let point = DVec3::new(1.0, -2.5, 1e30);
        for up in [[0.0, 3.0, 0.0], [0.0; 3]] {
            assert_eq!((Turn::of_up(up).to_world(point), Turn::of_up(up).to_local(point)), (point, point));
        }
        let z = Turn::of_up([0.0, 0.0, 1.0]);
        assert_eq!(z.to_world(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, -3.0, 2.0));
        assert_eq!(z.to_local(z.to_world(point)), point);
    }

    #[test]
    fn turns_are_rotations() {
        for up in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.3, -0.7, 0.2], [-5.0, 1.0, 1.0]] {
            let Turn([x, y, z]) = Turn::of_up(up);
            let right_handed = x.cross(y);
            for k in 0..3 {
                assert!((right_handed[k] - z[k]).abs() < 1e-12, "{up:?}");
            }
            assert!((x.length() - 1.0).abs() < 1e-12, "{up:?}");
        }
    }
}
