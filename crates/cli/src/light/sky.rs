//! A clear sky with a sun.
//!
//! Source: Preetham, Shirley, Smits 1999, *A Practical Analytic Model for Daylight*, appendix A.2: the distribution of Perez et al. 1993 with
//! coefficients that are linear in turbidity. Departures: the sky is scaled so that it lights a horizontal surface with
//! [`IRRADIANCE`], the sun is a light of its own, and below the horizon is a ground that reflects a quarter of the light.

use std::f64::consts::PI;

use canted_film::srgb::luminance;
use glam::DVec3;

/// Haze: 2 is a very clear sky, 10 a misty one.
const TURBIDITY: f64 = 2.5;

/// Luminance of the irradiance of the sky alone on a horizontal surface.
const IRRADIANCE: f64 = 1.3;

/// Irradiance of the sun on a surface that faces it.
pub(super) const SUN_IRRADIANCE: [f32; 3] = [2.3, 2.15, 1.85];

/// Reflectance of the ground below the horizon.
const GROUND: DVec3 = DVec3::new(0.27, 0.25, 0.22);

/// The radiance of the sky by direction, with +y up.
pub(super) struct Sky {
    to_sun: DVec3,
    perez: [Perez; 3],
    zenith: [f64; 3],
    scale: f64,
    ground: DVec3,
}

/// Coefficients of the distribution of luminance or of a chromaticity.
struct Perez([f64; 5]);

impl Perez {
    fn at(&self, cos_zenith: f64, angle_to_sun: f64) -> f64 {
        let Self([a, b, c, d, e]) = self;
        (1.0 + a * (b / cos_zenith).exp()) * (1.0 + c * (d * angle_to_sun).exp() + e * angle_to_sun.cos().powi(2))
    }
}

impl Sky {
    /// The sky for a sun in a direction of unit length above the horizon.
    pub(super) fn new(to_sun: DVec3) -> Self {
        let t = TURBIDITY;
        let linear = |rows: [[f64; 2]; 5]| Perez(rows.map(|[slope, constant]| slope * t + constant));
        let perez = [
            linear([[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]]),
            linear([[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]]),
            linear([[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]]),
        ];
        let sun = to_sun.y.clamp(0.0, 1.0).acos();
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * sun);
        let luminance_at_zenith = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let chromaticity = |m: [[f64; 4]; 3]| {
            let [t2, t1, t0] =
                m.map(|[cubic, square, linear, constant]| ((cubic * sun + square) * sun + linear) * sun + constant);
            (t2 * t + t1) * t + t0
        };
        let zenith = [
            luminance_at_zenith,
            chromaticity([
                [0.001_66, -0.003_75, 0.002_09, 0.0],
                [-0.029_03, 0.063_77, -0.032_02, 0.003_94],
                [0.116_93, -0.211_96, 0.060_52, 0.258_86],
            ]),
            chromaticity([
                [0.002_75, -0.006_10, 0.003_17, 0.0],
                [-0.042_14, 0.089_70, -0.041_53, 0.005_16],
                [0.153_46, -0.267_56, 0.066_70, 0.266_88],
            ]),
        ];
        let mut sky = Self { to_sun, perez, zenith, scale: 1.0, ground: DVec3::ZERO };
        let irradiance = sky.irradiance();
        sky.scale = IRRADIANCE / luminance(irradiance.into());
        let of_sun = glam::Vec3::from(SUN_IRRADIANCE).as_dvec3() * to_sun.y.max(0.0);
        sky.ground = GROUND * (irradiance * sky.scale + of_sun) / PI;
        sky
    }

    /// Irradiance of the sky on a horizontal surface.
    fn irradiance(&self) -> DVec3 {
        /// Rings and steps of the sum.
        const N: u32 = 64;
        let mut sum = DVec3::ZERO;
        for i in 0..N * N {
            // Uniform in the squared sine, so that each direction has the same cosine-weighted solid angle.
            let squared_sine = (f64::from(i / N) + 0.5) / f64::from(N);
            let (s, c) = (2.0 * PI * (f64::from(i % N) + 0.5) / f64::from(N)).sin_cos();
            let sine = squared_sine.sqrt();
            sum += self.above(DVec3::new(sine * c, (1.0 - squared_sine).sqrt(), sine * s));
        }
        sum * PI / f64::from(N * N)
    }

    /// The radiance from a direction of unit length.
    pub(super) fn radiance(&self, direction: DVec3) -> DVec3 {
        /// Height of the blend between ground and sky, as a sine.
        const HORIZON: f64 = 0.01;
        let above = ((direction.y / HORIZON + 1.0) / 2.0).clamp(0.0, 1.0);
        self.ground.lerp(self.above(direction), above)
    }

    /// The radiance of the sky; at and below the horizon, that just above it.
    fn above(&self, direction: DVec3) -> DVec3 {
        let cos_zenith = direction.y.max(0.01);
        let angle_to_sun = direction.dot(self.to_sun).clamp(-1.0, 1.0).acos();
        let sun = self.to_sun.y.clamp(0.0, 1.0);
        let [luminance, x, y] = std::array::from_fn(|k| {
            let perez = &self.perez[k];
            self.zenith[k] * perez.at(cos_zenith, angle_to_sun) / perez.at(1.0, sun.acos())
        });
        let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance;
        // CIE XYZ to linear sRGB, IEC 61966-2-1.
        let rows = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        DVec3::from(rows.map(|row| DVec3::from(row).dot(xyz))).max(DVec3::ZERO) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sky is blue at the zenith and pale at the horizon, brighter around the sun, and lights as much as it should.
    #[test]
    fn a_clear_sky_looks_like_one() {
        let to_sun = DVec3::new(-0.35, 0.75, 0.6).normalize();
        let sky = Sky::new(to_sun);
        let blue = |direction: DVec3| {
            let color = sky.radiance(direction.normalize());
            color.z / color.x
        };
        let (zenith, horizon) = (blue(DVec3::new(0.3, 1.0, -0.8)), blue(DVec3::new(0.3, 0.03, -1.0)));
        assert!(zenith > 1.5 && zenith > 1.2 * horizon, "{zenith} {horizon}");
        let bright = |direction: DVec3| luminance(sky.radiance(direction.normalize()).into());
        assert!(bright(to_sun) > 2.0 * bright(DVec3::new(0.35, 0.75, -0.6)));
        assert!((luminance(sky.irradiance().into()) / IRRADIANCE - 1.0).abs() < 1e-9);
        let below = sky.radiance(DVec3::new(0.0, -1.0, 0.0));
        assert!(below.min_element() > 0.05 && below == sky.radiance(DVec3::new(0.0, -0.3, -0.954)), "{below}");
    }
}
