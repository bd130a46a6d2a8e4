//! Cameras of nodes (glTF 2.0, section 3.10).

use canted_obb::vector::{cross, dot};
use gltf::json::camera::{Camera as Source, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use super::matrix::{Matrix, unit};
use super::nodes::Nodes;
use crate::read::ReadError;
use crate::{Camera, Projection, Scene};

/// Adds the cameras of the default scene; skips invalid ones with a warning.
pub(super) fn read(document: &Document<'_>, nodes: &Nodes, scene: &mut Scene) -> Result<(), ReadError> {
    for &k in &nodes.drawn {
        let Some(index) = document.root.nodes[k].camera else { continue };
        let source = document.get(&document.root.cameras, index.value(), "camera", &format!("node {k}"))?;
        match projection(source).and_then(|projection| placed(&nodes.world_from_node[k], projection)) {
            Ok(camera) => {
                scene.cameras.push(camera);
                let name = source.name.as_ref().or(document.root.nodes[k].name.as_ref());
                scene.camera_names.push(name.cloned().unwrap_or_default());
            }
            Err(why) => scene.warnings.push(format!("skipping camera {} of node {k}: {why}", index.value())),
        }
    }
    Ok(())
}

/// The projection; the aspect ratio is ignored.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn projection(source: &Source) -> Result<Projection, String> {
    match (source.type_, &source.perspective, &source.orthographic) {
        (Checked::Valid(Type::Perspective), Some(lens), _) => {
            let yfov_rad = lens.yfov;
            if !(yfov_rad > 0.0 && yfov_rad < std::f32::consts::PI) {
                return Err(format!("field of view of {yfov_rad} radians is not between 0 and pi"));
            }
            Ok(Projection::Perspective { fov_degrees: f64::from(yfov_rad).to_degrees() as f32 })
        }
        (Checked::Valid(Type::Orthographic), _, Some(lens)) => {
            // `ymag` is half the height.
            let height = 2.0 * lens.ymag;
            if !(height > 0.0 && height.is_finite()) {
                return Err(format!("ymag of {} is not greater than 0", lens.ymag));
            }
            Ok(Projection::Orthographic { height })
        }
        _ => Err("no projection".to_owned()),
    }
}

/// A camera at the node's origin that looks along -z, with y up; ignores scale and shear of the node.
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn placed(world_from_node: &Matrix, projection: Projection) -> Result<Camera, String> {
    let eye = world_from_node.columns[3];
    let direction = world_from_node.vector([0.0, 0.0, -1.0]);
    let up = world_from_node.vector([0.0, 1.0, 0.0]);
    let (Some(direction_unit), Some(up_unit)) = (unit(direction), unit(up)) else {
        return Err("its node has no orientation".to_owned());
    };
    // Far enough from the eye that rounding the target to `f32` hardly changes the view direction.
    let distance = eye.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
    let target = std::array::from_fn(|k| (eye[k] + distance * f64::from(direction_unit[k])) as f32);
    let eye: [f32; 3] = eye.map(|x| x as f32);
    let side = cross(direction_unit.map(f64::from), up_unit.map(f64::from));
    let is_placed = eye.iter().chain(&target).all(|x: &f32| x.is_finite()) && eye != target && dot(side, side) > 0.0;
    is_placed
        .then_some(Camera { eye, target, up: up_unit, projection, lens: None })
        .ok_or_else(|| "its node has no orientation".to_owned())
}
