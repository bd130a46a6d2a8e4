//! Poses: nodes put where the file's first animation has them at a time (glTF 2.0, section 3.11).
//!
//! What moves nodes replaces their own translation, rotation, scale and weights, so that the stations behind need not
//! know of it. Several animations of a file are as a rule alternatives (to walk, to run), of which the first is what
//! viewers show unasked.

use gltf::json::accessor::Type;
use gltf::json::animation::{Channel, Property, Sampler};
use gltf::json::scene::{Node, UnitQuaternion};
use gltf::json::validation::Checked;

use super::document::Document;
use super::keyframes::Keyframes;
use crate::read::ReadError;
use crate::read::remarks::Remarks;

/// What a channel puts in place of a node's own.
enum Change {
    Translation([f32; 3]),
    Rotation([f32; 4]),
    Scale([f32; 3]),
    Weights(Vec<f32>),
}

/// Poses the nodes as they are `time` seconds into the first animation. Beyond its ends they stand still.
///
/// # Errors
/// [`ReadError::Malformed`] where the animation names what is not there, or its keys are no keys.
pub(super) fn pose(document: &mut Document<'_>, time: f32, remarks: &mut Remarks) -> Result<(), ReadError> {
    let animations = &document.root.animations;
    let Some(animation) = animations.first() else {
        remarks.note("there is no animation, the time changes nothing", &format!("time {time}"));
        return Ok(());
    };
    if animations.len() > 1 {
        let name = animation.name.as_deref().unwrap_or_default();
        remarks.note("only the first of several animations poses the scene", &format!("animation 0 {name:?}"));
    }
    if document.left_out.n_channels_without_node > 0 {
        let place = format!("animation 0, {} channels", document.left_out.n_channels_without_node);
        remarks.note("what animates no node is ignored", &place);
    }
    let mut changes = Vec::new();
    for (k, channel) in animation.channels.iter().enumerate() {
        let place = format!("animation 0 channel {k}");
        let node = channel.target.node.value();
        let has_matrix = document.get(&document.root.nodes, node, "node", &place)?.matrix.is_some();
        if has_matrix {
            remarks.note("a node with a matrix cannot be animated", &format!("node {node}"));
            continue;
        }
        match change(document, channel, &animation.samplers, time, &place)? {
            Some(change) => changes.push((node, change)),
            None => remarks.note("an animation of something else than nodes and weights is ignored", &place),
        }
    }
    for (node, change) in changes {
        apply(&mut document.root.nodes[node], change);
    }
    Ok(())
}

/// What a channel does at a time; `None` for what it does to something unknown.
fn change(
    document: &Document<'_>,
    channel: &Channel,
    samplers: &[Sampler],
    time: f32,
    place: &str,
) -> Result<Option<Change>, ReadError> {
    let sampler = document.get(samplers, channel.sampler.value(), "sampler", place)?;
    let open = |element: Type| Keyframes::open(document, sampler, element, place);
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
