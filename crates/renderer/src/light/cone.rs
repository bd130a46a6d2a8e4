use std::f64::consts::PI;

use crate::vector::{Vector, add, cross, dot, scale, unit};

/// Directions into which lights shine: axes within a spread about `axis`, each lighting what is within `reach` of it.
///
/// After Conty Estevez and Kulla 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit vector.
    pub(super) axis: Vector,
    /// Angle between `axis` and any light's own.
    pub(super) spread_rad: f64,
    /// Greatest angle to its axis at which a light shines.
    pub(super) reach_rad: f64,
    /// Whether the lights shine the same along the opposite directions.
    pub(super) is_two_sided: bool,
}

impl Cone {
    /// All directions.
    pub(super) const ALL: Self =
        Self { axis: [0.0, 0.0, 1.0], spread_rad: PI, reach_rad: 0.5 * PI, is_two_sided: false };

    /// One axis, lit up to a right angle: a flat light.
    pub(super) fn about(axis: Vector, is_two_sided: bool) -> Self {
        Self { axis, spread_rad: 0.0, reach_rad: 0.5 * PI, is_two_sided }
    }

    /// The least cone that holds both, but for rounding.
    pub(super) fn union(&self, other: &Self) -> Self {
        let reach_rad = self.reach_rad.max(other.reach_rad);
        let is_two_sided = self.is_two_sided || other.is_two_sided;
        let (wide, narrow) = if self.spread_rad >= other.spread_rad { (self, other) } else { (other, self) };
        // The axis of what shines to both sides may as well point the other way.
        let cosine = dot(wide.axis, narrow.axis);
        let flip = if narrow.is_two_sided && cosine < 0.0 { -1.0 } else { 1.0 };
        let towards = scale(narrow.axis, flip);
        let between = (flip * cosine).clamp(-1.0, 1.0).acos();
        if between + narrow.spread_rad <= wide.spread_rad {
            return Self { reach_rad, is_two_sided, ..*wide };
        }
        let spread_rad = 0.5 * (wide.spread_rad + between + narrow.spread_rad);
        match unit(cross(wide.axis, towards)) {
            Some(pole) if spread_rad < PI => {
                // Turned within the plane of both axes, by what the wider cone lacks.
                let (s, c) = (spread_rad - wide.spread_rad).sin_cos();
                let axis = add(scale(wide.axis, c), scale(cross(pole, wide.axis), s));
                Self { axis: unit(axis).unwrap_or(wide.axis), spread_rad, reach_rad, is_two_sided }
            }
            _ => Self { spread_rad: PI, reach_rad, is_two_sided, ..*wide },
        }
    }

    /// The measure of orientation of Conty Estevez and Kulla, section 4: solid angle weighed by the cosine beyond the spread.
    pub(super) fn measure(&self) -> f64 {
        let (spread, outer) = (self.spread_rad, (self.spread_rad + self.reach_rad).min(PI));
        let fringe =
            2.0 * outer * spread.sin() - (spread - 2.0 * outer).cos() - 2.0 * spread * spread.sin() + spread.cos();
        2.0 * PI * (1.0 - spread.cos()) + 0.5 * PI * fringe
    }
}
