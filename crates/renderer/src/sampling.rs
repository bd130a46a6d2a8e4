//! Directions over the hemisphere about a unit normal, with their densities.
//!
//! Densities are per steradian, after the rendering equation `L = ∫ (ρ/π)·L_i·cosθ dω`: with the cosine density
//! `cosθ/π` the weight of a sample is `ρ`.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// A right-handed orthonormal frame whose third axis is a given normal.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    axes: [[f32; 3]; 3],
}

impl Basis {
    /// Frame about a unit `normal`, without branches, continuous but across `z = 0`; after Duff et al. 2017,
    /// *Building an Orthonormal Basis, Revisited*.
    #[must_use]
    pub fn about(normal: [f32; 3]) -> Self {
        let [x, y, z] = normal;
        let sign = 1.0_f32.copysign(z);
        // At least 1 in absolute value for either sign, so the quotient is tame.
        let a = -1.0 / (sign + z);
        let b = x * y * a;
        Self { axes: [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y], normal] }
    }

    /// A direction given along the three axes.
    #[must_use]
    pub fn direction(&self, local: [f32; 3]) -> [f32; 3] {
        let [t, b, n] = &self.axes;
        std::array::from_fn(|k| local[0] * t[k] + local[1] * b[k] + local[2] * n[k])
    }

    /// The coordinates of a direction along the three axes.
    #[must_use]
    pub fn coordinates(&self, direction: [f32; 3]) -> [f32; 3] {
        self.axes.map(|axis| direction[0] * axis[0] + direction[1] * axis[1] + direction[2] * axis[2])
    }
}

/// A direction about +z with density `cosθ/π`, from a point of the unit square; never in the horizon's plane.
#[must_use]
pub fn cosine_hemisphere(square: [f32; 2]) -> [f32; 3] {
    // The point's projection is uniform in the disc; 1 - ξ is at least 2⁻²⁴ for the sampler's numbers.
    let (cosine, sine) = ((1.0 - square[0]).sqrt(), square[0].sqrt());
    let (s, c) = (TAU * square[1]).sin_cos();
    [sine * c, sine * s, cosine]
}

/// Density of [`cosine_hemisphere`] at a polar cosine.
#[must_use]
pub fn cosine_density(cosine: f32) -> f32 {
    cosine.max(0.0) / PI
}

/// A uniform point of the unit disc, from a point of the unit square; squares about the middle go to discs (Shirley and
/// Chiu 1997), so that strata stay compact.
#[must_use]
pub fn uniform_disk(square: [f32; 2]) -> [f32; 2] {
    let [a, b] = square.map(|x| 2.0 * x - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0; 2];
    }
    let (radius, angle) =
        if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = angle.sin_cos();
    [radius * cos, radius * sin]
}
