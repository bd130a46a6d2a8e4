//! Sampling of directions over the hemisphere and of points over the disk, with their PDFs.
//!
//! PDFs are per steradian. In the rendering equation `L = ∫ (ρ/π)·L_i·cosθ dω`, a sample of the cosine PDF `cosθ/π` has
//! the weight `ρ`.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{DVec3, Vec3};

/// A right-handed orthonormal basis around a normal.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    axes: [Vec3; 3],
}

impl Basis {
    /// The basis whose third axis is the unit vector `normal`; continuous except across `z = 0`. Source: Duff et al.
    /// 2017, *Building an Orthonormal Basis, Revisited*.
    #[inline]
    #[must_use]
    pub fn about(normal: [f32; 3]) -> Self {
        let [x, y, z] = normal;
        let sign = 1.0_f32.copysign(z);
        // At least 1 in absolute value, so the division is safe.
        let a = -1.0 / (sign + z);
        let b = x * y * a;
        let tangent = Vec3::new(1.0 + sign * x * x * a, sign * b, -sign * x);
        Self { axes: [tangent, Vec3::new(b, sign + y * y * a, -y), normal.into()] }
    }

    /// Maps local coordinates to a direction.
    #[must_use]
    pub fn direction(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [t, b, n] = self.axes;
        (x * t + y * b + z * n).into()
    }

    /// Maps a direction to local coordinates.
    #[must_use]
    pub fn coordinates(&self, direction: [f32; 3]) -> [f32; 3] {
        let ([t, b, n], direction) = (&self.axes, Vec3::from(direction));
        [t.dot(direction), b.dot(direction), n.dot(direction)]
    }
}

/// The first two axes of [`Basis::about`], in `f64`.
pub(crate) fn tangents(DVec3 { x, y, z }: DVec3) -> [DVec3; 2] {
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [DVec3::new(1.0 + sign * x * x * a, sign * b, -sign * x), DVec3::new(b, sign + y * y * a, -y)]
}

/// A direction around +z with PDF `cosθ/π`, from a point of the unit square. Its z is always positive.
#[must_use]
pub fn cosine_hemisphere(square: [f32; 2]) -> [f32; 3] {
    // The projection is uniform over the disk; 1 - ξ is at least 2⁻²⁴ for the sampler's numbers.
    let (cosine, sine) = ((1.0 - square[0]).sqrt(), square[0].sqrt());
    let [s, c] = sin_cos_of_turns(square[1]);
    [sine * c, sine * s, cosine]
}

/// PDF of [`cosine_hemisphere`] at a cosine to +z.
#[must_use]
pub fn cosine_density(cosine: f32) -> f32 {
    cosine.max(0.0) / PI
}

/// A direction around +z with PDF `1/2π`, from a point of the unit square. Its z is always positive.
#[must_use]
pub fn uniform_hemisphere(square: [f32; 2]) -> [f32; 3] {
    // 1 - z² without cancellation.
    let (cosine, sine) = (1.0 - square[0], (square[0] * (2.0 - square[0])).sqrt());
    let [s, c] = sin_cos_of_turns(square[1]);
    [sine * c, sine * s, cosine]
}

/// Sine and cosine of an angle of 0 to 1 turns, in units of full turns, to within 2⁻²³; the same bits on every machine.
///
/// The angle to the nearest quarter turn is exact. The polynomials up to an eighth of a turn are those of Cephes (Moshier 1992).
#[inline]
fn sin_cos_of_turns(turns: f32) -> [f32; 2] {
    let quarters = 4.0 * turns;
    let quarter = (quarters + 0.5) as i32;
    let x = FRAC_PI_2 * (quarters - quarter as f32);
    let square = x * x;
    let sine = x + x * square * (-1.666_665_5e-1 + square * (8.332_161e-3 - square * 1.951_529_6e-4));
    let cosine =
        1.0 - 0.5 * square + square * square * (4.166_664_6e-2 + square * (-1.388_731_6e-3 + square * 2.443_315_7e-5));
    let [s, c] = if quarter & 1 == 0 { [sine, cosine] } else { [cosine, sine] };
    [if quarter & 2 == 0 { s } else { -s }, if (quarter + 1) & 2 == 0 { c } else { -c }]
}

/// How directions of diffuse lobes, and of ambient light, are sampled. Pictures differ in their noise alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Hemisphere {
    /// In proportion to the cosine to the normal: every sample has the same weight.
    #[default]
    Cosine,
    /// Uniformly: samples have the weight of their cosine. Noisier; to compare with.
    Uniform,
}

impl Hemisphere {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Cosine, Self::Uniform];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cosine => "cosine",
            Self::Uniform => "uniform",
        }
    }

    /// A direction around +z, from a point of the unit square. Its z is always positive.
    #[must_use]
    pub fn direction(self, square: [f32; 2]) -> [f32; 3] {
        match self {
            Self::Cosine => cosine_hemisphere(square),
            Self::Uniform => uniform_hemisphere(square),
        }
    }

    /// PDF of [`Self::direction`] at a cosine to +z.
    #[must_use]
    pub fn density(self, cosine: f32) -> f32 {
        match self {
            Self::Cosine => cosine_density(cosine),
            Self::Uniform => {
                if cosine > 0.0 {
                    1.0 / TAU
                } else {
                    0.0
                }
            }
        }
    }

    /// Lambert's `cosθ/π` over [`Self::density`].
    #[must_use]
    pub fn weight(self, cosine: f32) -> f32 {
        match self {
            Self::Cosine => 1.0,
            Self::Uniform => 2.0 * cosine,
        }
    }
}

/// Maps a point of the unit square to a uniform point of the unit disk. The concentric map (Shirley and Chiu 1997)
/// keeps strata compact.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Those of the angle rounded to radians are up to 2⁻²¹ off.
    #[test]
    fn sines_and_cosines_of_turns_are_near_the_exact_ones() {
        let greatest = |of: &dyn Fn(f32) -> [f32; 2]| {
            let error = |turns: f32| {
                let (s, c) = (std::f64::consts::TAU * f64::from(turns)).sin_cos();
                let [sine, cosine] = of(turns).map(f64::from);
                (sine - s).abs().max((cosine - c).abs())
            };
            (0..=1 << 24).step_by(53).map(|k| error(k as f32 / (1 << 24) as f32)).fold(0.0, f64::max)
        };
        let bound = f64::from(f32::EPSILON);
        assert!(greatest(&sin_cos_of_turns) <= bound);
        assert!(greatest(&|turns| (TAU * turns).sin_cos().into()) > bound);
        for (quarter, want) in [[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
            assert_eq!(sin_cos_of_turns(quarter as f32 / 4.0), want, "{quarter}");
        }
    }
}
