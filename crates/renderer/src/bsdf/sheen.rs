//! Fibers of a cloth: the distribution of Estevez and Kulla 2017 (*Production Friendly Microfacet Sheen BRDF*), with the visibility
//! of Neubelt and Pettineo 2013, as `KHR_materials_sheen` recommends.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use super::vector::unit;

/// The least roughness: smoother fibers are a line at the horizon that no sampling finds.
const MIN_ROUGHNESS: f32 = 0.07;

/// Fibers of one roughness, white.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fibers {
    roughness: f32,
    inverse_alpha: f32,
}

impl Fibers {
    pub(super) fn new(roughness: f32) -> Self {
        let roughness = roughness.clamp(MIN_ROUGHNESS, 1.0);
        Self { roughness, inverse_alpha: 1.0 / (roughness * roughness) }
    }

    /// The BRDF times the cosine of `incident`; both directions are above the horizon.
    pub(super) fn evaluate(self, outgoing: [f32; 3], incident: [f32; 3]) -> f32 {
        let half = unit(std::array::from_fn(|k| outgoing[k] + incident[k]));
        let sine = (half[0] * half[0] + half[1] * half[1]).sqrt().min(1.0);
        let distribution = (2.0 + self.inverse_alpha) * sine.powf(self.inverse_alpha) / TAU;
        let (o, i) = (outgoing[2], incident[2]);
        // The quotient of cosines is at most 1, however small they are.
        distribution * (0.25 * i / (o + i - o * i))
    }

    /// The part of the light from all directions that is reflected to a direction with this cosine.
    pub(super) fn albedo(self, cosine: f32) -> f32 {
        let at = |x: f32, n: usize| {
            #[expect(clippy::cast_precision_loss, reason = "a small table")]
            let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
            let i = (x as usize).min(n - 2);
            #[expect(clippy::cast_precision_loss, reason = "a small table")]
            let rest = x - i as f32;
            (i, rest)
        };
        let (row, y) = at((self.roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS), N_ROUGHNESS);
        let (column, x) = at(cosine.max(0.0).sqrt(), N_COSINES);
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let of_row = |row: usize| mix(ALBEDO[row][column], ALBEDO[row][column + 1], x);
        mix(of_row(row), of_row(row + 1), y)
    }
}

const N_ROUGHNESS: usize = 24;
const N_COSINES: usize = 24;

/// Albedos by roughness and by the root of the cosine, which resolves grazing directions.
#[expect(clippy::cast_precision_loss, reason = "small tables")]
static ALBEDO: LazyLock<[[f32; N_COSINES]; N_ROUGHNESS]> = LazyLock::new(|| {
    std::array::from_fn(|row| {
        let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * row as f32 / (N_ROUGHNESS - 1) as f32;
        std::array::from_fn(|column| {
            let root = column as f32 / (N_COSINES - 1) as f32;
            integrated(Fibers::new(roughness), root * root)
        })
    })
});

/// The albedo by the midpoint rule. At the horizon the value stands for directions near it.
fn integrated(fibers: Fibers, cosine: f32) -> f32 {
    const N_HEIGHTS: u16 = 48;
    const N_ANGLES: u16 = 24;
    let cosine = cosine.max(1e-4);
    let outgoing = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
    let mut sum = 0.0;
    for i in 0..N_HEIGHTS {
        // Denser at the horizon: the cosine is the square of a uniform number.
        let root = (f32::from(i) + 0.5) / f32::from(N_HEIGHTS);
        let z = root * root;
        let radius = (1.0 - z * z).sqrt();
        for j in 0..N_ANGLES {
            let (sine, cosine) = (PI * (f32::from(j) + 0.5) / f32::from(N_ANGLES)).sin_cos();
            sum += 2.0 * root * fibers.evaluate(outgoing, [radius * cosine, radius * sine, z]);
        }
    }
    // Both halves of the circle.
    TAU * sum / (f32::from(N_HEIGHTS) * f32::from(N_ANGLES))
}
