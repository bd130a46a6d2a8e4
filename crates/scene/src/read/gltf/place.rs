//! Instances: the meshes that nodes place, once each or as often as `EXT_mesh_gpu_instancing` says.

use canted_obb::Affine;
use gltf::json::scene::Node;
use rayon::prelude::*;

use super::document::{Document, UNMORPHED};
use super::instancing;
use super::matrix::Matrix;
use super::mesh;
use super::nodes::Nodes;
use super::pose::{self, Pose};
use crate::read::ReadError;
use crate::read::remarks::Remarks;
use crate::read::repair::Repair;
use crate::{Instance, Mesh, MeshId, Scene};

/// Reads the meshes and places them by the nodes of the default scene.
///
/// Meshes that nothing places are read for the numbering of triangles, checked and dropped.
pub(super) fn read(
    document: &Document<'_>,
    nodes: &Nodes,
    repair: &mut Repair,
    remarks: &mut Remarks,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let placing = placing(document, nodes)?;
    let posed = placing.iter().filter(|&&(_, node, mesh)| is_posed(document, node, mesh)).map(|&(.., mesh)| mesh);
    let n_zeros = posed.chain(0..document.root.meshes.len()).map(|mesh| mesh::n_zeros(document, mesh));
    let n_zeros = n_zeros.fold(0, usize::saturating_add);
    if n_zeros > document.most_from_nothing() {
        return Err(document.malformed("meshes", format!("{n_zeros} vertices and indices have no buffer view")));
    }
    let (mut meshes, first_primitives) = read_unposed(document, &placing, repair, remarks, scene)?;
    let mut n_repeated = 0;
    for &(k, node, mesh_index) in &placing {
        let mut mesh = mesh_index;
        if is_posed(document, node, mesh_index) {
            let pose = pose_of(document, nodes, node, mesh_index, &format!("node {k}"))?;
            let has_own_weights = node.weights.is_some();
            let place = if has_own_weights { format!("node {k}") } else { format!("mesh {mesh_index}") };
            note_weights(document, mesh_index, pose.weights, &place, remarks);
            mesh = meshes.len();
            let read = mesh::read(document, mesh_index, &pose, &scene.materials)?;
            meshes.push(taken(read, repair, scene));
        }
        if meshes[mesh].triangles.is_empty() {
            continue;
        }
        let transforms = transforms(document, nodes, k)?;
        // Many nodes may name the same accessors.
        n_repeated += transforms.len().saturating_sub(1);
        if n_repeated > document.most_from_nothing() {
            let message = format!("{} instances, {n_repeated} with those before, are too many", transforms.len());
            return Err(document.malformed(format!("node {k}"), message));
        }
        let n_left_out = transforms.iter().filter(|transform| transform.is_none()).count();
        if n_left_out > 0 {
            let name = node.name.as_deref().unwrap_or_default();
            scene.warnings.push(format!(
                "node {k} {name:?}: {n_left_out} of {} instances have no transform with an inverse and are left out",
                transforms.len()
            ));
        }
        let mesh_id = to_id(document, mesh)?;
        scene.instances.extend(transforms.into_iter().flatten().map(|world_from_object| Instance {
            mesh: MeshId(mesh_id),
            world_from_object,
            world_from_object_close: None,
            first_primitive: first_primitives[mesh_index],
        }));
    }
    keep_placed(scene, meshes);
    Ok(())
}

/// The mesh that was read, once what was met on the way is told.
fn taken(read: mesh::Read, repair: &mut Repair, scene: &mut Scene) -> Mesh {
    repair.add(&read.repair);
    scene.warnings.extend(read.warnings);
    read.mesh
}

/// The drawn nodes that have a mesh, with that mesh.
fn placing<'a>(document: &'a Document<'_>, nodes: &Nodes) -> Result<Vec<(usize, &'a Node, usize)>, ReadError> {
    let mut placing = Vec::new();
    for &k in &nodes.drawn {
        let node = &document.root.nodes[k];
        if let Some(mesh) = node.mesh {
            document.get(&document.root.meshes, mesh.value(), "mesh", &format!("node {k}"))?;
            placing.push((k, node, mesh.value()));
        }
    }
    Ok(placing)
}

/// Whether a node bends its mesh in another way than the mesh says.
fn is_posed(document: &Document<'_>, node: &Node, mesh: usize) -> bool {
    let has_own_weights = node.weights.is_some() && node.weights != document.root.meshes[mesh].weights;
    node.skin.is_some() || has_own_weights
}

/// All meshes of the file in their own pose, read at the same time, and the number of the first triangle of each.
///
/// Only what is placed counts for the warnings.
fn read_unposed(
    document: &Document<'_>,
    placing: &[(usize, &Node, usize)],
    repair: &mut Repair,
    remarks: &mut Remarks,
    scene: &mut Scene,
) -> Result<(Vec<Mesh>, Vec<u32>), ReadError> {
    let mut is_placed = vec![false; document.root.meshes.len()];
    for &(_, node, mesh) in placing {
        is_placed[mesh] |= !is_posed(document, node, mesh);
    }
    let weights_of = |index: usize| document.root.meshes[index].weights.as_deref().unwrap_or_default();
    let read = |index: usize| {
        let pose = Pose { weights: weights_of(index), ..Pose::default() };
        mesh::read(document, index, &pose, &scene.materials)
    };
    let all: Vec<_> = (0..is_placed.len()).into_par_iter().map(read).collect();
    let (mut meshes, mut first_primitives, mut n_triangles) = (Vec::new(), Vec::new(), 0_usize);
    for (index, (read, is_placed)) in all.into_iter().zip(is_placed).enumerate() {
        let read = read?;
        if is_placed {
            note_weights(document, index, weights_of(index), &format!("mesh {index}"), remarks);
        }
        let mesh = if is_placed { taken(read, repair, scene) } else { read.mesh };
        first_primitives.push(to_id(document, n_triangles)?);
        n_triangles += mesh.triangles.len();
        meshes.push(mesh);
    }
    to_id(document, n_triangles)?;
    Ok((meshes, first_primitives))
}

/// Notes what the weights of a pose ask for and the mesh has not, or nobody moves.
fn note_weights(document: &Document<'_>, mesh: usize, weights: &[f32], place: &str, remarks: &mut Remarks) {
    let targets = document.root.meshes[mesh].primitives.iter().map(|primitive| primitive.targets.iter().flatten());
    let (n_weights, n_targets) = (weights.len(), targets.map(Iterator::count).max().unwrap_or(0));
    if n_weights > n_targets {
        let place = format!("{place}, {n_weights} weights for {n_targets} targets");
        remarks.note("weights beyond the last morph target are ignored", &place);
    }
    let Some(unmorphed) = document.left_out.unmorphed.get(&mesh) else { return };
    for name in UNMORPHED {
        let mut weighed = unmorphed.range(..(n_weights, "")).filter(|&&(target, _)| weights[target] != 0.0);
        if weighed.any(|&(_, moved)| moved == name) {
            remarks.note(&format!("{name} of morph targets is ignored"), &format!("mesh {mesh}"));
        }
    }
}

fn to_id(document: &Document<'_>, number: usize) -> Result<u32, ReadError> {
    u32::try_from(number).map_err(|_| document.malformed("meshes", format!("{number} is more than 32 bits count")))
}

/// The pose that a node gives its mesh.
fn pose_of<'a>(
    document: &'a Document<'_>,
    nodes: &Nodes,
    node: &'a Node,
    mesh: usize,
    place: &str,
) -> Result<Pose<'a>, ReadError> {
    let weights = node.weights.as_deref().or(document.root.meshes[mesh].weights.as_deref()).unwrap_or_default();
    let world_from_bind = node.skin.map(|skin| pose::joints(document, nodes, skin.value(), place)).transpose()?;
    Ok(Pose { weights, world_from_bind })
}

/// Transforms of the instances of a node, `None` for those that have no inverse.
fn transforms(document: &Document<'_>, nodes: &Nodes, k: usize) -> Result<Vec<Option<Affine>>, ReadError> {
    // The joints have taken a skinned mesh to the world already; its node has no say.
    if document.root.nodes[k].skin.is_some() {
        return Ok(vec![Some(Affine::IDENTITY)]);
    }
    let node_from_instance = instancing::read(document, k)?.unwrap_or_else(|| vec![Matrix::IDENTITY]);
    Ok(node_from_instance.iter().map(|inner| nodes.world_from_node[k].after(inner).rounded()).collect())
}

/// Moves the meshes that have instances into the scene, in their order, and renumbers the instances.
fn keep_placed(scene: &mut Scene, meshes: Vec<Mesh>) {
    let mut is_placed = vec![false; meshes.len()];
    scene.instances.iter().for_each(|instance| is_placed[instance.mesh.0 as usize] = true);
    let mut new_ids = Vec::with_capacity(meshes.len());
    let mut n_kept = 0;
    for (mesh, is_placed) in meshes.into_iter().zip(is_placed) {
        new_ids.push(MeshId(n_kept));
        if is_placed {
            scene.meshes.push(mesh);
            n_kept += 1;
        }
    }
    scene.instances.iter_mut().for_each(|instance| instance.mesh = new_ids[instance.mesh.0 as usize]);
}
