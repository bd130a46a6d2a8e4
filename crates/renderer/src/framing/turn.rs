//! A rotation that makes the up direction of a scene +y, so that all views are chosen for +y.

use canted_obb::Aabb;
use canted_scene::{Camera, Scene};

use crate::vector::{Vector, add, cross, narrow, scale, unit, wide};

/// World-space directions of the local axes; the second is up.
#[derive(Clone, Copy)]
pub(super) struct Turn([Vector; 3]);

impl Turn {
    /// Directions along an axis give a rotation without rounding; +y gives none.
    pub(super) fn of_up(up: [f32; 3]) -> Self {
        let up = unit(wide(up)).unwrap_or([0.0, 1.0, 0.0]);
        // x stays to the right unless it is up.
        let right: Vector = if up[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let back = unit(cross(right, up)).unwrap_or([0.0, 0.0, 1.0]);
        Self([cross(up, back), up, back])
    }

    pub(super) fn to_world(self, [x, y, z]: Vector) -> Vector {
        let [right, up, back] = self.0;
        add(scale(right, x), add(scale(up, y), scale(back, z)))
    }

    /// The local coordinates of a point in world space.
    pub(super) fn to_local(self, point: Vector) -> Vector {
        self.0.map(|axis| crate::vector::dot(axis, point))
    }

    /// Local bounds of a scene: those of its box in world space.
    pub(super) fn bounds(self, scene: &Scene) -> Aabb {
        let world = scene.bounds_world();
        if world.is_empty() {
            return world;
        }
        let mut local = Aabb::EMPTY;
        for corner in 0..8 {
            let point: Vector =
                std::array::from_fn(|k| f64::from(if corner >> k & 1 == 0 { world.min[k] } else { world.max[k] }));
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
        let point = [1.0, -2.5, 1e30];
        for up in [[0.0, 3.0, 0.0], [0.0; 3]] {
            assert_eq!((Turn::of_up(up).to_world(point), Turn::of_up(up).to_local(point)), (point, point));
        }
        let z = Turn::of_up([0.0, 0.0, 1.0]);
        assert_eq!(z.to_world([1.0, 2.0, 3.0]), [1.0, -3.0, 2.0]);
        assert_eq!(z.to_local(z.to_world(point)), point);
    }

    #[test]
    fn turns_are_rotations() {
        for up in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.3, -0.7, 0.2], [-5.0, 1.0, 1.0]] {
            let Turn([x, y, z]) = Turn::of_up(up);
            let right_handed = cross(x, y);
            for k in 0..3 {
                assert!((right_handed[k] - z[k]).abs() < 1e-12, "{up:?}");
            }
            assert!((crate::vector::length(x) - 1.0).abs() < 1e-12, "{up:?}");
        }
    }
}
