//! Applies an animation of a file at a given time (glTF 2.0, section 3.11).
//!
//! Animated values replace translation, rotation, scale and weights of nodes, so that later stages need no special cases.
//! Multiple animations are usually alternatives (walk, run); viewers show the first by default, and so does this reader.
//!
//! Keyframe interpolation follows appendix C.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::animation::{Channel, Interpolation, Property, Sampler};
use gltf::json::scene::{Node, UnitQuaternion};
use gltf::json::validation::Checked;

use super::accessor::{Accessor, REALS};
use super::document::Document;
use crate::read::error::{ReadError, WarningGroups};
use crate::read::text::quoted;

/// A new value for a node property.
enum Change {
    Translation([f32; 3]),
    Rotation([f32; 4]),
    Scale([f32; 3]),
    Weights(Vec<f32>),
}

/// Applies the animation of this name or number at `time` seconds, clamped to its range; the first one for `None`.
///
/// # Errors
/// [`ReadError::UnknownAnimation`] if there is none, [`ReadError::Malformed`] if it has invalid references or keyframes.
pub(super) fn pose(
    document: &mut Document<'_>,
    wanted: Option<&str>,
    time: f32,
    grouped: &mut WarningGroups,
) -> Result<(), ReadError> {
    let Some(number) = document.animation(wanted)? else {
        grouped.add("ignoring the time, the file has no animation", &format!("time {time}"));
        return Ok(());
    };
    let animations = &document.root.animations;
    let animation = &animations[number];
    if animations.len() > 1 && wanted.is_none() {
        let name = animation.name.as_deref().unwrap_or_default();
        grouped.add("using only the first of several animations", &format!("animation 0 {name:?}"));
    }
    if let Some(dropped) = document.unparsed.dropped_channels.get(number) {
        if dropped.n_without_node > 0 {
            let location = format!("animation {number}, {} channels", dropped.n_without_node);
            grouped.add("ignoring channels without a target node", &location);
        }
        let others = "ignoring animated properties other than transforms and weights of nodes";
        let absent = "ignoring animated properties of absent nodes";
        let pointers = dropped.pointers.iter().map(|pointer| (others, pointer));
        for (what, pointer) in pointers.chain(dropped.absent_nodes.iter().map(|pointer| (absent, pointer))) {
            grouped.add(what, &format!("animation {number}, {}", quoted(pointer.as_bytes())));
        }
    }
    let mut changes = Vec::new();
    for (k, channel) in animation.channels.iter().enumerate() {
        let location = format!("animation {number} channel {k}");
        let node = channel.target.node.value();
        let has_matrix = document.get(&document.root.nodes, node, "node", &location)?.matrix.is_some();
        if has_matrix {
            grouped.add("ignoring the animation of a node with a matrix", &format!("node {node}"));
            continue;
        }
        match change(document, channel, &animation.samplers, time, &location)? {
            Some(change) => changes.push((node, change)),
            None => grouped.add("ignoring an animation channel with an unsupported target", &location),
        }
    }
    for (node, change) in changes {
        apply(&mut document.root.nodes[node], change);
    }
    Ok(())
}

/// First and last key time in seconds of the channels of the animation of this name or number; the first one for `None`. Channels that
/// are malformed, which posing reports, are skipped.
pub(super) fn time_range(document: &Document<'_>, wanted: Option<&str>) -> Option<[f32; 2]> {
    let animation = &document.root.animations[document.animation(wanted).ok()??];
    let times = animation.channels.iter().filter_map(|channel| {
        let sampler = animation.samplers.get(channel.sampler.value())?;
        times(document, sampler, "").ok()
    });
    times.map(|times| [times[0], times[times.len() - 1]]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// The value of a channel at `time`; `None` for an unsupported target.
fn change(
    document: &Document<'_>,
    channel: &Channel,
    samplers: &[Sampler],
    time: f32,
    location: &str,
) -> Result<Option<Change>, ReadError> {
    let sampler = document.get(samplers, channel.sampler.value(), "sampler", location)?;
    let open = |element: Type| Keyframes::open(document, sampler, element, location);
    let Checked::Valid(path) = channel.target.path else { return Ok(None) };
    Ok(Some(match path {
        Property::Translation => Change::Translation(narrow(open(Type::Vec3)?.at(time, 0))),
        Property::Rotation => Change::Rotation(narrow(open(Type::Vec4)?.rotation_at(time))),
        Property::Scale => Change::Scale(narrow(open(Type::Vec3)?.at(time, 0))),
        Property::MorphTargetWeights => {
            let keyframes = open(Type::Scalar)?;
            Change::Weights((0..keyframes.width()).map(|k| narrow::<1>(keyframes.at(time, k))[0]).collect())
        }
    }))
}

fn apply(node: &mut Node, change: Change) {
    match change {
        Change::Translation(translation) => node.translation = Some(translation),
        Change::Rotation(rotation) => node.rotation = Some(UnitQuaternion(rotation)),
        Change::Scale(scale) => node.scale = Some(scale),
        Change::Weights(weights) => node.weights = Some(weights),
    }
}

fn narrow<const N: usize>(values: [f64; N]) -> [f32; N] {
    values.map(|x| x as f32)
}

/// Key times, values and interpolation of a sampler.
struct Keyframes<'a> {
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
fn times(document: &Document<'_>, sampler: &Sampler, location: &str) -> Result<Vec<f32>, ReadError> {
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
    fn open(document: &'a Document<'_>, sampler: &Sampler, element: Type, location: &str) -> Result<Self, ReadError> {
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
    fn width(&self) -> usize {
        self.values.count / (self.times.len() * self.n_parts())
    }

    /// Values per key: cubic splines have an in-tangent, a value and an out-tangent.
    fn n_parts(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// Element `k` at `time` seconds, clamped to the first and last key.
    fn at<const N: usize>(&self, time: f32, k: usize) -> [f64; N] {
        self.interpolate(time, k, |a, b, part| mix(a, 1.0 - part, b, part))
    }

    /// As [`Keyframes::at`] with spherical interpolation of quaternions of nonzero length.
    fn rotation_at(&self, time: f32) -> [f64; 4] {
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
    use proptest::prelude::*;

    use super::*;

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
