//! Mesh instances of nodes, including `EXT_mesh_gpu_instancing`.

use canted_obb::Affine;
use gltf::json::scene::Node;
use rayon::prelude::*;

use super::document::{Document, UNSUPPORTED_TARGETS};
use super::instancing;
use super::matrix::Matrix;
use super::mesh;
use super::nodes::Nodes;
use super::pose::{self, Pose};
use crate::read::mesh_checks::MeshChecks;
use crate::read::warning_groups::WarningGroups;
use crate::read::{ReadError, quoted};
use crate::{Instance, Mesh, MeshId, Scene};

/// Reads the meshes and adds instances for the nodes of the default scene.
///
/// Unused meshes are read for the numbering of triangles, then dropped.
pub(super) fn read(
    document: &Document<'_>,
    nodes: &Nodes,
    checks: &mut MeshChecks,
    grouped: &mut WarningGroups,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let mesh_nodes = mesh_nodes(document, nodes)?;
    let posed = mesh_nodes.iter().filter(|&&(_, node, mesh)| is_posed(document, node, mesh)).map(|&(.., mesh)| mesh);
    let n_virtual_elements =
        posed.chain(0..document.root.meshes.len()).map(|mesh| mesh::n_virtual_elements(document, mesh));
    let n_virtual_elements = n_virtual_elements.fold(0, usize::saturating_add);
    if n_virtual_elements > document.max_virtual_elements() {
        return Err(
            document.malformed("meshes", format!("{n_virtual_elements} vertices and indices without a buffer view"))
        );
    }
    let (mut meshes, first_primitives) = read_unposed(document, &mesh_nodes, checks, grouped, scene)?;
    let mut n_repeated = 0;
    for &(k, node, mesh_index) in &mesh_nodes {
        let mut mesh = mesh_index;
        if is_posed(document, node, mesh_index) {
            let pose = pose_of(document, nodes, node, mesh_index, &format!("node {k}"))?;
            let has_own_weights = node.weights.is_some();
            let location = if has_own_weights { format!("node {k}") } else { format!("mesh {mesh_index}") };
            note_weights(document, mesh_index, pose.weights, &location, grouped);
            mesh = meshes.len();
            let read = mesh::read(document, mesh_index, &pose, &scene.materials)?;
            meshes.push(finish(read, checks, scene));
        }
        if meshes[mesh].triangles.is_empty() {
            continue;
        }
        let transforms = transforms(document, nodes, k)?;
        if document.requires_finite {
            check_transform(document, &nodes.world_from_node[k], &meshes[mesh], mesh_index, k)?;
        }
        // Many nodes may share the same accessors.
        n_repeated += transforms.len().saturating_sub(1);
        if n_repeated > document.max_virtual_elements() {
            let message = format!("too many instances: {}, in total {n_repeated}", transforms.len());
            return Err(document.malformed(format!("node {k}"), message));
        }
        let n_skipped = transforms.iter().filter(|transform| transform.is_none()).count();
        if n_skipped > 0 {
            let name = node.name.as_deref().unwrap_or_default();
            scene.warnings.push(format!(
                "skipping {n_skipped} of {} instances of node {k} {}: transform is not invertible",
                transforms.len(),
                quoted(name.as_bytes())
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

/// Takes over the checks and warnings of a mesh.
fn finish(read: mesh::Read, checks: &mut MeshChecks, scene: &mut Scene) -> Mesh {
    checks.add(&read.checks);
    scene.warnings.extend(read.warnings);
    read.mesh
}

/// The drawn nodes with a mesh: node index, node, mesh index.
fn mesh_nodes<'a>(document: &'a Document<'_>, nodes: &Nodes) -> Result<Vec<(usize, &'a Node, usize)>, ReadError> {
    let mut mesh_nodes = Vec::new();
    for &k in &nodes.drawn {
        let node = &document.root.nodes[k];
        if let Some(mesh) = node.mesh {
            document.get(&document.root.meshes, mesh.value(), "mesh", &format!("node {k}"))?;
            mesh_nodes.push((k, node, mesh.value()));
        }
    }
    Ok(mesh_nodes)
}

/// Whether a node deforms its mesh differently from the mesh's defaults.
fn is_posed(document: &Document<'_>, node: &Node, mesh: usize) -> bool {
    let has_own_weights = node.weights.is_some() && node.weights != document.root.meshes[mesh].weights;
    node.skin.is_some() || has_own_weights
}

/// All meshes in their default pose, read in parallel, and the number of the first triangle of each.
///
/// Unused meshes give no warnings.
fn read_unposed(
    document: &Document<'_>,
    mesh_nodes: &[(usize, &Node, usize)],
    checks: &mut MeshChecks,
    grouped: &mut WarningGroups,
    scene: &mut Scene,
) -> Result<(Vec<Mesh>, Vec<u32>), ReadError> {
    let mut is_placed = vec![false; document.root.meshes.len()];
    for &(_, node, mesh) in mesh_nodes {
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
            note_weights(document, index, weights_of(index), &format!("mesh {index}"), grouped);
        }
        let mesh = if is_placed { finish(read, checks, scene) } else { read.mesh };
        first_primitives.push(to_id(document, n_triangles)?);
        n_triangles += mesh.triangles.len();
        meshes.push(mesh);
    }
    to_id(document, n_triangles)?;
    Ok((meshes, first_primitives))
}

/// Reports excess weights and unsupported morph targets of a pose.
fn note_weights(document: &Document<'_>, mesh: usize, weights: &[f32], location: &str, grouped: &mut WarningGroups) {
    let targets = document.root.meshes[mesh].primitives.iter().map(|primitive| primitive.targets.iter().flatten());
    let (n_weights, n_targets) = (weights.len(), targets.map(Iterator::count).max().unwrap_or(0));
    if n_weights > n_targets {
        let location = format!("{location}, {n_weights} weights for {n_targets} targets");
        grouped.add("ignoring weights without a morph target", &location);
    }
    let Some(unsupported_targets) = document.unparsed.unsupported_targets.get(&mesh) else { return };
    for name in UNSUPPORTED_TARGETS {
        let mut active = unsupported_targets.range(..(n_weights, "")).filter(|&&(target, _)| weights[target] != 0.0);
        if active.any(|&(_, attribute)| attribute == name) {
            grouped.add(&format!("ignoring {name} of morph targets (not supported)"), &format!("mesh {mesh}"));
        }
    }
}

fn to_id(document: &Document<'_>, number: usize) -> Result<u32, ReadError> {
    u32::try_from(number)
        .map_err(|_| document.malformed("meshes", format!("too many elements: {number} (limit: 2^32)")))
}

/// The pose of a node's mesh.
fn pose_of<'a>(
    document: &'a Document<'_>,
    nodes: &Nodes,
    node: &'a Node,
    mesh: usize,
    location: &str,
) -> Result<Pose<'a>, ReadError> {
    let weights = node.weights.as_deref().or(document.root.meshes[mesh].weights.as_deref()).unwrap_or_default();
    let world_from_bind = node.skin.map(|skin| pose::joints(document, nodes, skin.value(), location)).transpose()?;
    Ok(Pose { weights, world_from_bind })
}

/// Instance transforms of a node; `None` for those that are not invertible.
fn transforms(document: &Document<'_>, nodes: &Nodes, k: usize) -> Result<Vec<Option<Affine>>, ReadError> {
    // Joint transforms already map a skinned mesh to world space; the node's transform is ignored.
    if document.root.nodes[k].skin.is_some() {
        return Ok(vec![Some(Affine::IDENTITY)]);
    }
    let node_from_instance = instancing::read(document, k)?.unwrap_or_else(|| vec![Matrix::IDENTITY]);
    Ok(node_from_instance.iter().map(|inner| nodes.world_from_node[k].after(inner).rounded()).collect())
}

/// Rejects a pose whose transform moves the first vertex of a mesh out of the range of `f32`.
fn check_transform(
    document: &Document<'_>,
    world_from_node: &Matrix,
    mesh: &Mesh,
    index: usize,
    node: usize,
) -> Result<(), ReadError> {
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    let first = world_from_node.point(mesh.positions[0].map(f64::from)).map(|x| x as f32);
    // Joints replace the transform of a node with a skin.
    if document.root.nodes[node].skin.is_some() || first.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(document.not_finite(index, format!("vertex 0 at node {node}"), first))
}

/// Moves the used meshes into the scene in order, and renumbers the instances.
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
