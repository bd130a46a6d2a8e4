//! Applies an animation of a file at a given time (glTF 2.0, section 3.11).
//!
//! Animated values replace translation, rotation, scale and weights of nodes, so that later stages need no special cases.
//! Multiple animations are usually alternatives (walk, run); viewers show the first by default, and so does this reader.

use gltf::json::accessor::Type;
use gltf::json::animation::{Channel, Property, Sampler};
use gltf::json::scene::{Node, UnitQuaternion};
use gltf::json::validation::Checked;

use super::document::Document;
use super::keyframes::{self, Keyframes};
use crate::read::ReadError;
use crate::read::warning_groups::WarningGroups;

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
    let n_without_node = document.unparsed.n_channels_without_node.get(number).copied().unwrap_or(0);
    if n_without_node > 0 {
        let location = format!("animation {number}, {n_without_node} channels");
        grouped.add("ignoring channels without a target node", &location);
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
        keyframes::times(document, sampler, "").ok()
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

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn narrow<const N: usize>(values: [f64; N]) -> [f32; N] {
    values.map(|x| x as f32)
}
