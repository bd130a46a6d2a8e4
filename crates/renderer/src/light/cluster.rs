use super::cone::Cone;
use crate::vector::{Vector, dot, scale, sub};

/// A group of lights: bounding box, emission cone and intensity. World space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    pub(super) min: Vector,
    pub(super) max: Vector,
    pub(super) cone: Cone,
    /// Sum of the maximum radiant intensities, in W/sr of luminance.
    pub(super) intensity: f64,
}

impl Cluster {
    pub(super) fn union(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|k| self.min[k].min(other.min[k])),
            max: std::array::from_fn(|k| self.max[k].max(other.max[k])),
            cone: self.cone.union(&other.cone),
            intensity: self.intensity + other.intensity,
        }
    }

    /// Center of the bounding box.
    pub(super) fn center(&self) -> Vector {
        std::array::from_fn(|k| 0.5 * (self.min[k] + self.max[k]))
    }

    /// Squared radius of the bounding sphere: half the diagonal of the box.
    pub(super) fn radius_squared(&self) -> f64 {
        let half = scale(sub(self.max, self.min), 0.5);
        dot(half, half)
    }
}
