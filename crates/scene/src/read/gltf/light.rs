//! Lights of `KHR_lights_punctual` that nodes place.
//!
//! The extension counts photons as eyes do, in lux and candela; the scene counts energy. The numbers are carried over as
//! they are, which fixes one unit of exposure for all lights alike.

use gltf::json::extensions::scene::khr_lights_punctual::{Light as Source, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use super::matrix::{Matrix, unit};
use super::nodes::Nodes;
use crate::read::ReadError;
use crate::{Light, Scene};

/// Adds the directional and point lights of the default scene; others are left out with a warning.
pub(super) fn read(document: &Document<'_>, nodes: &Nodes, scene: &mut Scene) -> Result<(), ReadError> {
    let lights: &[Source] = document.root.as_ref();
    for &k in &nodes.drawn {
        let extensions = document.root.nodes[k].extensions.as_ref();
        let Some(named) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else { continue };
        let index = named.light.value();
        let source = document.get(lights, index, "light", &format!("node {k}"))?;
        match light(source, &nodes.world_from_node[k]) {
            Ok(light) => scene.lights.push(light),
            Err(why) => scene.warnings.push(format!("light {index} of node {k} {why} and is left out")),
        }
    }
    Ok(())
}

/// A light at the node's origin, or along its -z.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn light(source: &Source, world_from_node: &Matrix) -> Result<Light, String> {
    let power = source.color.map(|x| x * source.intensity);
    if !power.iter().all(|x| x.is_finite() && *x >= 0.0) {
        return Err(format!("has color {:?} and intensity {}", source.color, source.intensity));
    }
    match source.type_ {
        Checked::Valid(Type::Directional) => {
            let direction = unit(world_from_node.vector([0.0, 0.0, -1.0])).ok_or("has no direction")?;
            Ok(Light::Sun { direction, irradiance: power })
        }
        Checked::Valid(Type::Point) => {
            let position = world_from_node.columns[3].map(|x| x as f32);
            let is_finite = position.iter().all(|x| x.is_finite());
            is_finite.then_some(Light::Point { position, intensity: power }).ok_or_else(|| "is nowhere".to_owned())
        }
        Checked::Valid(Type::Spot) => Err("is a spot".to_owned()),
        Checked::Invalid => Err("has an unknown type".to_owned()),
    }
}
