//! Mesh instances of nodes, including `EXT_mesh_gpu_instancing`, and their meshes, which join primitives as parts.

use std::ops::Range;

use canted_obb::Affine;
use gltf::json::accessor::Type;
use gltf::json::mesh::Semantic;
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use rayon::prelude::*;

use super::accessor::{Accessor, REALS};
use super::document::{Document, MESH_GPU_INSTANCING, UNSUPPORTED_TARGETS};
use super::nodes::{Matrix, Nodes};
use super::primitive::{self, Pose, PrimitiveReader, Warnings};
use crate::read::error::{ReadError, WarningGroups};
use crate::read::mesh::MeshChecks;
use crate::read::text::quoted;
use crate::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene};

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
    let n_virtual_elements = posed.chain(0..document.root.meshes.len()).map(|mesh| n_virtual_elements(document, mesh));
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
            let read = read_mesh(document, mesh_index, &pose, &scene.materials)?;
            meshes.push(finish(read, checks, grouped));
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
            let n = transforms.len();
            let which = format!("skipping {n_skipped} of {n} instances of node {k} {}", quoted(name.as_bytes()));
            let why = "transform is not invertible";
            grouped.add_sentence(why, &format!("{which}: {why}"));
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
fn finish(read: ReadMesh, checks: &mut MeshChecks, grouped: &mut WarningGroups) -> Mesh {
    checks.add(&read.checks);
    read.warnings.iter().for_each(|(what, location)| grouped.add(what, location));
    read.mesh
}

/// The visible nodes with a mesh: node index, node, mesh index.
pub(super) fn mesh_nodes<'a>(
    document: &'a Document<'_>,
    nodes: &Nodes,
) -> Result<Vec<(usize, &'a Node, usize)>, ReadError> {
    let mut mesh_nodes = Vec::new();
    for &k in &nodes.visible {
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
    scene: &Scene,
) -> Result<(Vec<Mesh>, Vec<u32>), ReadError> {
    let mut is_placed = vec![false; document.root.meshes.len()];
    for &(_, node, mesh) in mesh_nodes {
        is_placed[mesh] |= !is_posed(document, node, mesh);
    }
    let weights_of = |index: usize| document.root.meshes[index].weights.as_deref().unwrap_or_default();
    let read = |index: usize| {
        let pose = Pose { weights: weights_of(index), ..Pose::default() };
        read_mesh(document, index, &pose, &scene.materials)
    };
    let all: Vec<_> = (0..is_placed.len()).into_par_iter().map(read).collect();
    let (mut meshes, mut first_primitives, mut n_triangles) = (Vec::new(), Vec::new(), 0_usize);
    for (index, (read, is_placed)) in all.into_iter().zip(is_placed).enumerate() {
        let read = read?;
        if is_placed {
            note_weights(document, index, weights_of(index), &format!("mesh {index}"), grouped);
        }
        let mesh = if is_placed { finish(read, checks, grouped) } else { read.mesh };
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
pub(super) fn pose_of<'a>(
    document: &'a Document<'_>,
    nodes: &Nodes,
    node: &'a Node,
    mesh: usize,
    location: &str,
) -> Result<Pose<'a>, ReadError> {
    let weights = node.weights.as_deref().or(document.root.meshes[mesh].weights.as_deref()).unwrap_or_default();
    let world_from_bind =
        node.skin.map(|skin| primitive::joints(document, nodes, skin.value(), location)).transpose()?;
    Ok(Pose { weights, world_from_bind })
}

/// Instance transforms of a node; `None` for those that are not invertible.
fn transforms(document: &Document<'_>, nodes: &Nodes, k: usize) -> Result<Vec<Option<Affine>>, ReadError> {
    Ok(matrices(document, nodes, k)?.iter().map(Matrix::rounded).collect())
}

/// Instance transforms of a node in double precision.
pub(super) fn matrices(document: &Document<'_>, nodes: &Nodes, k: usize) -> Result<Vec<Matrix>, ReadError> {
    // Joint transforms already map a skinned mesh to world space; the node's transform is ignored.
    if document.root.nodes[k].skin.is_some() {
        return Ok(vec![Matrix::IDENTITY]);
    }
    let node_from_instance = gpu_instances(document, k)?.unwrap_or_else(|| vec![Matrix::IDENTITY]);
    Ok(node_from_instance.iter().map(|inner| nodes.world_from_node[k].after(inner)).collect())
}

/// Rejects a pose whose transform moves the first vertex of a mesh out of the range of `f32`.
fn check_transform(
    document: &Document<'_>,
    world_from_node: &Matrix,
    mesh: &Mesh,
    index: usize,
    node: usize,
) -> Result<(), ReadError> {
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

/// Instance transforms relative to the node; `None` without the extension.
fn gpu_instances(document: &Document<'_>, node_index: usize) -> Result<Option<Vec<Matrix>>, ReadError> {
    let extensions = document.root.nodes[node_index].extensions.as_ref();
    let Some(extension) = extensions.and_then(|extensions| extensions.others.get(MESH_GPU_INSTANCING)) else {
        return Ok(None);
    };
    let location = format!("node {node_index} {MESH_GPU_INSTANCING}");
    let open = |name: &str, element_type: Type| {
        let Some(index) = extension.get("attributes").and_then(|attributes| attributes.get(name)) else {
            return Ok(None);
        };
        let location = format!("{location} {name}");
        let index = index.as_u64().and_then(|index| usize::try_from(index).ok());
        let index = index.ok_or_else(|| document.malformed(&location, "expected an accessor index"))?;
        Accessor::open(document, index, &location, element_type, REALS).map(Some)
    };
    let translations = open("TRANSLATION", Type::Vec3)?;
    let rotations = open("ROTATION", Type::Vec4)?;
    let scales = open("SCALE", Type::Vec3)?;

    let mut counts = [&translations, &rotations, &scales].into_iter().flatten().map(|accessor| accessor.count);
    let Some(count) = counts.next() else {
        return Err(document.malformed(location, "missing TRANSLATION, ROTATION or SCALE"));
    };
    if let Some(other) = counts.find(|&other| other != count) {
        return Err(document.malformed(location, format!("attributes have different counts, {count} and {other}")));
    }
    let instance = |i: usize| {
        Matrix::from_parts(
            translations.as_ref().map_or([0.0; 3], |accessor| accessor.reals(i)),
            rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |accessor| accessor.reals(i)),
            scales.as_ref().map_or([1.0; 3], |accessor| accessor.reals(i)),
        )
    };
    Ok(Some((0..count).map(instance).collect()))
}

/// A mesh with its checks and warnings.
#[derive(Default)]
struct ReadMesh {
    mesh: Mesh,
    checks: MeshChecks,
    warnings: Warnings,
}

/// Reads mesh `index` in a pose; primitives without triangles add no part.
///
/// The last of `materials` is the default material, if a primitive uses it.
fn read_mesh(
    document: &Document<'_>,
    index: usize,
    pose: &Pose<'_>,
    materials: &[Material],
) -> Result<ReadMesh, ReadError> {
    let source = &document.root.meshes[index];
    let mut read = ReadMesh::default();
    read.mesh.name = source.name.clone().unwrap_or_else(|| format!("mesh {index}"));
    for (k, primitive) in source.primitives.iter().enumerate() {
        let location = format!("mesh {index} primitive {k}");
        let material = match primitive.material {
            Some(material) => {
                document.get(&document.root.materials, material.value(), "material", &location)?;
                material.value()
            }
            None => document.root.materials.len(),
        };
        let reader = PrimitiveReader {
            document,
            pose,
            material: &materials[material],
            mesh: index,
            number: k,
            location: &location,
        };
        let primitive_mesh = reader.read(primitive, &mut read.checks, &mut read.warnings)?;
        join(&mut read.mesh, primitive_mesh, material)
            .ok_or_else(|| document.malformed(location, "more than 2^32 vertices or triangles in a mesh"))?;
    }
    Ok(read)
}

/// Number of vertices and indices of mesh `index` without a buffer view.
fn n_virtual_elements(document: &Document<'_>, index: usize) -> usize {
    let n_virtual_elements = |accessor: usize| {
        let accessor = document.root.accessors.get(accessor).filter(|accessor| accessor.buffer_view.is_none());
        accessor.map_or(0, |accessor| usize::try_from(accessor.count.0).unwrap_or(usize::MAX))
    };
    let read = document.root.meshes[index].primitives.iter().flat_map(|primitive| {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        [positions, primitive.indices.as_ref()].into_iter().flatten()
    });
    read.map(|accessor| n_virtual_elements(accessor.value())).fold(0, usize::saturating_add)
}

/// Appends a primitive; `None` for more than 2^32 vertices or triangles.
///
/// If only some primitives have an attribute, the others get zeros, or white for colors.
fn join(mesh: &mut Mesh, primitive_mesh: Mesh, material: usize) -> Option<()> {
    if primitive_mesh.triangles.is_empty() {
        return Some(());
    }
    let first_triangle = u32::try_from(mesh.triangles.len()).ok()?;
    let (before, after) = (mesh.positions.len(), mesh.positions.len() + primitive_mesh.positions.len());
    let first_vertex = u32::try_from(before).ok().filter(|_| u32::try_from(after).is_ok())?;
    mesh.parts.push(Part { first_triangle, material: MaterialId(u32::try_from(material).ok()?) });
    append(&mut mesh.positions, primitive_mesh.positions);
    let mut triangles = primitive_mesh.triangles;
    triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner += first_vertex);
    append(&mut mesh.triangles, triangles);
    let vertices = before..after;
    extend(&mut mesh.normals, primitive_mesh.normals, &vertices, [0.0; 3]);
    extend(&mut mesh.tangents, primitive_mesh.tangents, &vertices, [0.0; 4]);
    extend(&mut mesh.uvs, primitive_mesh.uvs, &vertices, [0.0; 2]);
    extend(&mut mesh.second_uvs, primitive_mesh.second_uvs, &vertices, [0.0; 2]);
    extend(&mut mesh.colors, primitive_mesh.colors, &vertices, [1.0; 4]);
    Some(())
}

/// Appends a list, without a copy if `list` is empty: most meshes have one primitive.
fn append<T>(list: &mut Vec<T>, mut values: Vec<T>) {
    if list.is_empty() { *list = values } else { list.append(&mut values) }
}

/// Appends an optional attribute; the list exists once any primitive has values.
fn extend<T: Copy>(list: &mut Option<Vec<T>>, values: Option<Vec<T>>, vertices: &Range<usize>, missing: T) {
    if list.is_none() && values.is_none() {
        return;
    }
    let list = list.get_or_insert_with(|| vec![missing; vertices.start]);
    append(list, values.unwrap_or_default());
    list.resize(vertices.end, missing);
}
