//! Keyframe interpolation (glTF 2.0, section 3.11 and appendix C).

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::animation::{Interpolation, Sampler};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, REALS};
use super::document::Document;
use crate::read::ReadError;

/// Key times, values and interpolation of a sampler.
pub(super) struct Keyframes<'a> {
    /// Seconds, ascending.
    times: Vec<f32>,
    values: Accessor<'a>,
    interpolation: Interpolation,
}

/// A time relative to the keyframes.
enum KeyPosition {
    /// At a key, or clamped to the first or last.
    At(usize),
    /// Between `key` and the next: the fraction and the interval in seconds.
    Between { key: usize, part: f64, seconds: f64 },
}

/// The key times of a sampler in seconds, ascending; at least one.
pub(super) fn times(document: &Document<'_>, sampler: &Sampler, location: &str) -> Result<Vec<f32>, ReadError> {
    let input = Accessor::open(document, sampler.input.value(), location, Type::Scalar, &[ComponentType::F32])?;
    let times: Vec<f32> = (0..input.count).map(|k| input.reals::<1>(k)[0]).collect();
    if times.is_empty() || !times.iter().all(|time| time.is_finite()) {
        return Err(document.malformed(location, "key times are missing or not finite"));
    }
    if let Some(pair) = times.windows(2).find(|pair| pair[0] >= pair[1]) {
        return Err(document.malformed(location, format!("key time {} after {} is not ascending", pair[1], pair[0])));
    }
    Ok(times)
}

impl<'a> Keyframes<'a> {
    /// Opens the accessors of a sampler with values of the given type.
    pub(super) fn open(
        document: &'a Document<'_>,
        sampler: &Sampler,
        element: Type,
        location: &str,
    ) -> Result<Self, ReadError> {
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err(document.malformed(location, "unknown interpolation"));
        };
        let times = times(document, sampler, location)?;
        let values = Accessor::open(document, sampler.output.value(), location, element, REALS)?;
        let keyframes = Self { times, values, interpolation };
        let needed = keyframes.times.len() * keyframes.n_parts();
        if keyframes.values.count < needed || !keyframes.values.count.is_multiple_of(needed) {
            let message = format!("{} values for {} keys", keyframes.values.count, keyframes.times.len());
            return Err(document.malformed(location, message));
        }
        Ok(keyframes)
    }

    /// Elements per key: one, or the number of weights.
    pub(super) fn width(&self) -> usize {
        self.values.count / (self.times.len() * self.n_parts())
    }

    /// Values per key: cubic splines have an in-tangent, a value and an out-tangent.
    fn n_parts(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// Element `k` at `time` seconds, clamped to the first and last key.
    pub(super) fn at<const N: usize>(&self, time: f32, k: usize) -> [f64; N] {
        self.interpolate(time, k, |a, b, part| mix(a, 1.0 - part, b, part))
    }

    /// As [`Keyframes::at`] with spherical interpolation of quaternions of nonzero length.
    pub(super) fn rotation_at(&self, time: f32) -> [f64; 4] {
        self.interpolate(time, 0, slerp)
    }

    fn interpolate<const N: usize>(
        &self,
        time: f32,
        k: usize,
        linear: impl Fn([f64; N], [f64; N], f64) -> [f64; N],
    ) -> [f64; N] {
        match (self.position(time), self.interpolation) {
            (KeyPosition::At(key) | KeyPosition::Between { key, .. }, Interpolation::Step)
            | (KeyPosition::At(key), _) => self.value(key, k),
            (KeyPosition::Between { key, part, .. }, Interpolation::Linear) => {
                linear(self.value(key, k), self.value(key + 1, k), part)
            }
            (KeyPosition::Between { key, part, seconds }, Interpolation::CubicSpline) => {
                let ends = [self.value(key, k), self.value(key + 1, k)];
                let tangents = [self.part(key, 2, k), self.part(key + 1, 0, k)];
                hermite(ends, tangents.map(|tangent| tangent.map(|x: f64| x * seconds)), part)
            }
        }
    }

    fn position(&self, time: f32) -> KeyPosition {
        match self.times.partition_point(|&key| key <= time) {
            0 => KeyPosition::At(0),
            n if n == self.times.len() => KeyPosition::At(n - 1),
            n => {
                let (start, end) = (f64::from(self.times[n - 1]), f64::from(self.times[n]));
                let part = (f64::from(time) - start) / (end - start);
                KeyPosition::Between { key: n - 1, part, seconds: end - start }
            }
        }
    }

    fn value<const N: usize>(&self, key: usize, k: usize) -> [f64; N] {
        self.part(key, self.n_parts() / 2, k)
    }

    fn part<const N: usize>(&self, key: usize, part: usize, k: usize) -> [f64; N] {
        self.values.reals::<N>((key * self.n_parts() + part) * self.width() + k).map(f64::from)
    }
}

fn mix<const N: usize>(a: [f64; N], weight_a: f64, b: [f64; N], weight_b: f64) -> [f64; N] {
    std::array::from_fn(|k| weight_a * a[k] + weight_b * b[k])
}

/// Cubic Hermite interpolation.
fn hermite<const N: usize>([p, q]: [[f64; N]; 2], [m, n]: [[f64; N]; 2], t: f64) -> [f64; N] {
    let (t2, t3) = (t * t, t * t * t);
    let ends = mix(p, 2.0 * t3 - 3.0 * t2 + 1.0, q, 3.0 * t2 - 2.0 * t3);
    let tangents = mix(m, t3 - 2.0 * t2 + t, n, t3 - t2);
    mix(ends, 1.0, tangents, 1.0)
}

/// Spherical linear interpolation along the shorter arc (Shoemake 1985).
fn slerp(a: [f64; 4], b: [f64; 4], t: f64) -> [f64; 4] {
    let unit = |q: [f64; 4]| {
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        q.map(|x| x / length)
    };
    let (a, mut b) = (unit(a), unit(b));
    let mut cos = a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    if cos < 0.0 {
        b = b.map(|x| -x);
        cos = -cos;
    }
    let angle = cos.min(1.0).acos();
    // Both weights are well conditioned except at angle zero, where the ends are equal.
    if angle == 0.0 {
        return a;
    }
    mix(a, ((1.0 - t) * angle).sin() / angle.sin(), b, (t * angle).sin() / angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn hermite_interpolates_values_and_tangents() {
        let (ends, tangents) = ([[1.0], [4.0]], [[2.0], [-3.0]]);
        assert_eq!(hermite(ends, tangents, 0.0), [1.0]);
        assert_eq!(hermite(ends, tangents, 1.0), [4.0]);
        // The mean of the ends plus an eighth of the difference of the tangents.
        assert_eq!(hermite(ends, tangents, 0.5), [2.5 + 5.0 / 8.0]);
    }

    proptest! {
        /// The angle of a rotation about one axis grows linearly along the shorter arc.
        #[test]
        fn slerp_has_constant_angular_speed(start in -3.0..3.0_f64, turn in -3.0..3.0_f64, t in 0.0..1.0_f64, flips: bool) {
            let about_z = |angle: f64| [0.0, 0.0, (angle / 2.0).sin(), (angle / 2.0).cos()];
            let end = about_z(start + turn).map(|x| if flips { -2.0 * x } else { x });
            let found = slerp(about_z(start), end, t);
            let want = about_z(start + t * turn);
            let cos = found.iter().zip(want).map(|(x, y)| x * y).sum::<f64>();
            // Computing the angle from its cosine loses half of the digits near zero.
            prop_assert!((cos.abs() - 1.0).abs() <= f64::EPSILON.sqrt(), "{found:?} for {want:?}");
        }
    }
}
