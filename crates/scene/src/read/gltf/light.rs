//! Lights of `KHR_lights_punctual` that nodes place.
//!
//! The extension counts photons as eyes do, in lux and candela; the scene counts energy. The numbers are carried over as
//! they are, which fixes one unit of exposure for all lights alike.

use gltf::json::extensions::scene::khr_lights_punctual::{Light as Source, Spot, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use super::matrix::{Matrix, unit};
use super::nodes::Nodes;
use crate::read::ReadError;
use crate::read::remarks::Remarks;
use crate::{Light, Scene};

/// Adds the lights of the default scene; one that cannot be used is left out with a warning.
pub(super) fn read(
    document: &Document<'_>,
    nodes: &Nodes,
    remarks: &mut Remarks,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let lights: &[Source] = document.root.as_ref();
    for &k in &nodes.drawn {
        let extensions = document.root.nodes[k].extensions.as_ref();
        let Some(named) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else { continue };
        let index = named.light.value();
        let source = document.get(lights, index, "light", &format!("node {k}"))?;
        if source.range.is_some() {
            remarks.note("the range of lights is ignored, as light has none", &format!("light {index}"));
        }
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
    let position = world_from_node.columns[3].map(|x| x as f32);
    let is_somewhere = position.iter().all(|x| x.is_finite());
    let direction = unit(world_from_node.vector([0.0, 0.0, -1.0]));
    match source.type_ {
        Checked::Valid(Type::Directional) => {
            Ok(Light::Sun { direction: direction.ok_or("has no direction")?, irradiance: power })
        }
        Checked::Valid(_) if !is_somewhere => Err("is nowhere".to_owned()),
        Checked::Valid(Type::Point) => Ok(Light::Point { position, intensity: power }),
        Checked::Valid(Type::Spot) => {
            let direction = direction.ok_or("has no direction")?;
            let [cos_inner, cos_outer] = cosines(source.spot.as_ref())?;
            Ok(Light::Spot { position, direction, intensity: power, cos_inner, cos_outer })
        }
        Checked::Invalid => Err("has an unknown type".to_owned()),
    }
}

/// Cosines of a spot's inner and outer angle; the extension's defaults are 0 and a quarter of pi.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn cosines(spot: Option<&Spot>) -> Result<[f32; 2], String> {
    let (inner, outer) =
        spot.map_or((0.0, std::f32::consts::FRAC_PI_4), |spot| (spot.inner_cone_angle, spot.outer_cone_angle));
    let cosines = [inner, outer].map(|angle_rad| f64::from(angle_rad).cos() as f32);
    let what = format!("is a spot of {inner} to {outer} radians");
    let is_cone = inner >= 0.0 && inner < outer && f64::from(outer) <= FRAC_PI_2_ROUNDED;
    if is_cone && cosines[0] == cosines[1] {
        let why = format!("whose cosines are one in single precision ({LEAST_CONE_RAD} is told from 0)");
        return Err(format!("{what}, {why},"));
    }
    is_cone.then_some(cosines).ok_or(what)
}

/// About the least angle whose cosine is not 1 in single precision: that of 2^-12 is half-way to the number below 1.
const LEAST_CONE_RAD: f64 = 0.000245;

/// A right angle as files hold it, in single precision, which is a little more than one.
const FRAC_PI_2_ROUNDED: f64 = std::f32::consts::FRAC_PI_2 as f64;
