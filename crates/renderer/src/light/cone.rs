use std::f64::consts::PI;

use crate::vector::{Vector, add, cross, dot, scale, unit};

/// Directions of emission: axes within `spread` of `axis`, each light emitting within `reach` of its axis.
///
/// Source: Conty Estevez and Kulla 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit vector.
    pub(super) axis: Vector,
    /// Maximum angle between `axis` and the axis of a light, θo in the source.
    pub(super) spread_rad: f64,
    /// Maximum angle of emission to a light's axis, θe in the source.
    pub(super) emission_rad: f64,
    /// Whether the lights also emit along the opposite directions.
    pub(super) is_two_sided: bool,
}

impl Cone {
    /// All directions.
    pub(super) const ALL: Self =
        Self { axis: [0.0, 0.0, 1.0], spread_rad: PI, emission_rad: 0.5 * PI, is_two_sided: false };

    /// A flat light: one axis, emission up to 90 degrees.
    pub(super) fn about(axis: Vector, is_two_sided: bool) -> Self {
        Self { axis, spread_rad: 0.0, emission_rad: 0.5 * PI, is_two_sided }
    }

    /// The smallest cone that contains both, up to rounding.
    pub(super) fn union(&self, other: &Self) -> Self {
        let emission_rad = self.emission_rad.max(other.emission_rad);
        let is_two_sided = self.is_two_sided || other.is_two_sided;
        let (wide, narrow) = if self.spread_rad >= other.spread_rad { (self, other) } else { (other, self) };
        // The axis of two-sided lights may be flipped.
        let cosine = dot(wide.axis, narrow.axis);
        let flip = if narrow.is_two_sided && cosine < 0.0 { -1.0 } else { 1.0 };
        let towards = scale(narrow.axis, flip);
        let between = (flip * cosine).clamp(-1.0, 1.0).acos();
        if between + narrow.spread_rad <= wide.spread_rad {
            return Self { emission_rad, is_two_sided, ..*wide };
        }
        let spread_rad = 0.5 * (wide.spread_rad + between + narrow.spread_rad);
        match unit(cross(wide.axis, towards)) {
            Some(pole) if spread_rad < PI => {
                // Rotate the wider cone's axis towards the other, in the plane of both.
                let (s, c) = (spread_rad - wide.spread_rad).sin_cos();
                let axis = add(scale(wide.axis, c), scale(cross(pole, wide.axis), s));
                Self { axis: unit(axis).unwrap_or(wide.axis), spread_rad, emission_rad, is_two_sided }
            }
            _ => Self { spread_rad: PI, emission_rad, is_two_sided, ..*wide },
        }
    }

    /// The orientation measure of Conty Estevez and Kulla, section 4: solid angle, weighted by the cosine beyond the
    /// spread.
    pub(super) fn measure(&self) -> f64 {
        let (spread, outer) = (self.spread_rad, (self.spread_rad + self.emission_rad).min(PI));
        let fringe =
            2.0 * outer * spread.sin() - (spread - 2.0 * outer).cos() - 2.0 * spread * spread.sin() + spread.cos();
        2.0 * PI * (1.0 - spread.cos()) + 0.5 * PI * fringe
    }
}
