//! Lights of `KHR_lights_punctual`.
//!
//! The extension uses photometric units (lux, candela), the scene radiometric ones. The numbers are not converted, which only
//! changes the exposure.

use gltf::json::extensions::scene::khr_lights_punctual::{Light as Source, Spot, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use super::matrix::{Matrix, unit};
use super::nodes::Nodes;
use crate::read::ReadError;
use crate::read::warning_groups::WarningGroups;
use crate::{Light, Scene};

/// Adds the lights of the default scene; skips invalid ones with a warning.
pub(super) fn read(
    document: &Document<'_>,
    nodes: &Nodes,
    grouped: &mut WarningGroups,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let lights: &[Source] = document.root.as_ref();
    for &k in &nodes.drawn {
        let extensions = document.root.nodes[k].extensions.as_ref();
        let Some(named) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else { continue };
        let index = named.light.value();
        let source = document.get(lights, index, "light", &format!("node {k}"))?;
        if source.range.is_some() {
            grouped.add("ignoring the range of lights (not physical)", &format!("light {index}"));
        }
        match light(source, &nodes.world_from_node[k]) {
            Ok(light) => scene.lights.push(light),
            Err(why) => scene.warnings.push(format!("skipping light {index} of node {k}: {why}")),
        }
    }
    Ok(())
}

/// A light at the node's origin, directed along its -z axis.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn light(source: &Source, world_from_node: &Matrix) -> Result<Light, String> {
    let power = source.color.map(|x| x * source.intensity);
    if !power.iter().all(|x| x.is_finite() && *x >= 0.0) {
        return Err(format!(
            "color {:?} and intensity {} must be finite and not negative",
            source.color, source.intensity
        ));
    }
    let position = world_from_node.columns[3].map(|x| x as f32);
    let is_somewhere = position.iter().all(|x| x.is_finite());
    let direction = unit(world_from_node.vector([0.0, 0.0, -1.0]));
    match source.type_ {
        Checked::Valid(Type::Directional) => {
            Ok(Light::Sun { direction: direction.ok_or("its node has no orientation")?, irradiance: power })
        }
        Checked::Valid(_) if !is_somewhere => Err("its position is not finite".to_owned()),
        Checked::Valid(Type::Point) => Ok(Light::Point { position, intensity: power }),
        Checked::Valid(Type::Spot) => {
            let direction = direction.ok_or("its node has no orientation")?;
            let [cos_inner, cos_outer] = cosines(source.spot.as_ref())?;
            Ok(Light::Spot { position, direction, intensity: power, cos_inner, cos_outer })
        }
        Checked::Invalid => Err("unknown type".to_owned()),
    }
}

/// Cosines of a spot's inner and outer angle; the defaults are 0 and pi / 4.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn cosines(spot: Option<&Spot>) -> Result<[f32; 2], String> {
    let (inner, outer) =
        spot.map_or((0.0, std::f32::consts::FRAC_PI_4), |spot| (spot.inner_cone_angle, spot.outer_cone_angle));
    let cosines = [inner, outer].map(|angle_rad| f64::from(angle_rad).cos() as f32);
    let is_cone = inner >= 0.0 && inner < outer && f64::from(outer) <= FRAC_PI_2_ROUNDED;
    if !is_cone {
        return Err(format!("cone angles {inner} and {outer} must satisfy 0 <= inner < outer <= pi/2"));
    }
    if cosines[0] == cosines[1] {
        let limit = format!("the smallest cone from 0 is {MIN_CONE_RAD}");
        return Err(format!("cosines of cone angles {inner} and {outer} are equal in single precision ({limit})"));
    }
    Ok(cosines)
}

/// Smallest angle, rounded up, whose cosine differs from 1 in single precision: 2^-12.
const MIN_CONE_RAD: f64 = 0.000245;

/// A right angle rounded to single precision, slightly larger than pi / 2.
const FRAC_PI_2_ROUNDED: f64 = std::f32::consts::FRAC_PI_2 as f64;
