//! Lines and points of glTF (modes of primitives 0 to 3), in world space: node after node, primitive after primitive.
//!
//! Radii are in world units; transforms move points and leave radii as they are.

use gltf::json::mesh::Mode;
use gltf::json::validation::Checked;

use super::document::Document;
use super::instances::{matrices, mesh_nodes, pose_of};
use super::nodes::Nodes;
use super::primitive::PrimitiveReader;
use crate::Material;
use crate::read::error::{ReadError, WarningGroups};
use crate::read::input::ReadOptions;
use crate::read::strands::{Strands, point_index};

/// Reads the lines and, with a radius of points, the points of all nodes.
pub(super) fn read(
    document: &Document<'_>,
    nodes: &Nodes,
    options: &ReadOptions,
    grouped: &mut WarningGroups,
) -> Result<Strands, ReadError> {
    let mut strands = Strands::default();
    let mut colors = Vec::new();
    // Many nodes may share a mesh.
    let mut n_left = document.max_virtual_elements();
    let material = Material::default();
    for (k, node, mesh) in mesh_nodes(document, nodes)? {
        let pose = pose_of(document, nodes, node, mesh, &format!("node {k}"))?;
        let world_from_mesh = matrices(document, nodes, k)?;
        for (number, primitive) in document.root.meshes[mesh].primitives.iter().enumerate() {
            let location = format!("mesh {mesh} primitive {number}");
            let Checked::Valid(mode) = primitive.mode else {
                return Err(document.malformed(location, "unknown mode"));
            };
            match mode {
                Mode::Points if options.point_radius.is_none() => {
                    grouped.add("skipping points, which --point-radius makes balls", &location);
                    continue;
                }
                Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => {}
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {
                    grouped.add("skipping triangles, as lines are read", &location);
                    continue;
                }
            }
            let reader =
                PrimitiveReader { document, pose: &pose, material: &material, mesh, number, location: &location };
            let (positions, own_colors) = reader.polyline(primitive, n_left)?;
            let own_color = base_color(document, primitive.material.map(|index| index.value()));
            for transform in &world_from_mesh {
                n_left = n_left
                    .checked_sub(positions.len())
                    .ok_or_else(|| document.malformed(&location, "too many instances of lines"))?;
                let first = point_index(document.path(), strands.points.len())?;
                strands.points.extend(positions.iter().map(|&point| transform.point(point).map(|x| x as f32)));
                let end = point_index(document.path(), strands.points.len())?;
                colors.extend((0..positions.len()).map(|i| {
                    let [r, g, b, _] = own_colors.as_ref().map_or([1.0; 4], |colors| colors[i]);
                    [r * own_color[0], g * own_color[1], b * own_color[2]]
                }));
                match mode {
                    Mode::Points => strands.segments.extend((first..end).map(|point| [point; 2])),
                    Mode::Lines => {
                        strands.segments.extend((first..end - (end - first) % 2).step_by(2).map(|a| [a, a + 1]))
                    }
                    _ => strands.add_polyline(first..end),
                }
                if mode == Mode::LineLoop && end - first > 1 {
                    strands.segments.push([end - 1, first]);
                }
            }
        }
    }
    strands.colors = Some(colors);
    if let Some(radius) = options.point_radius {
        strands.thicken_points(radius, options.line_radius.unwrap_or(radius));
    }
    Ok(strands)
}

/// The factor of the base color of a material; that of none is white.
fn base_color(document: &Document<'_>, material: Option<usize>) -> [f32; 3] {
    let material = material.and_then(|index| document.root.materials.get(index));
    material.map_or([1.0; 3], |material| {
        let [r, g, b, _] = material.pbr_metallic_roughness.base_color_factor.0;
        [r, g, b].map(super::material::fraction)
    })
}
