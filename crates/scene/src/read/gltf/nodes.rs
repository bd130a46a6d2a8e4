//! The node hierarchy, traversed without recursion (glTF 2.0, section 3.5).

use gltf::json::scene::Node;

use super::document::Document;
use super::matrix::Matrix;
use crate::read::ReadError;
use crate::read::warning_groups::WarningGroups;

/// The nodes of a file.
pub(super) struct Nodes {
    /// World transform of each node.
    pub(super) world_from_node: Vec<Matrix>,
    /// Nodes of the default scene, ascending.
    pub(super) drawn: Vec<usize>,
}

/// Computes world transforms and finds the nodes of the default scene.
///
/// The default scene is `scene`, else the first one; a file without scenes draws all nodes.
///
/// # Errors
/// [`ReadError::Malformed`] if an index is invalid, or a node has two parents or is its own ancestor.
pub(super) fn read(document: &Document<'_>, grouped: &mut WarningGroups) -> Result<Nodes, ReadError> {
    let nodes = &document.root.nodes;
    let parents = parents(document)?;
    let mut world_from_node = nodes
        .iter()
        .enumerate()
        .map(|(k, node)| local(node).ok_or_else(|| last_row_error(document, k)))
        .collect::<Result<Vec<Matrix>, _>>()?;

    let roots: Vec<usize> = (0..nodes.len()).filter(|&k| parents[k].is_none()).collect();
    let mut is_reached: Vec<bool> = parents.iter().map(Option::is_none).collect();
    descend(nodes, &roots, |parent, child| {
        is_reached[child] = true;
        world_from_node[child] = world_from_node[parent].after(&world_from_node[child]);
    });
    if let Some(unreached) = is_reached.iter().position(|is_reached| !is_reached) {
        return Err(cycle_error(document, &parents, unreached));
    }

    let scene_roots = match default_scene(document)? {
        Some(scene) => scene_roots(document, scene, &parents, grouped)?,
        None => roots,
    };
    let mut is_drawn = vec![false; nodes.len()];
    let mut stack = scene_roots;
    while let Some(node) = stack.pop() {
        // A root may be below another.
        if !std::mem::replace(&mut is_drawn[node], true) {
            stack.extend(children(&nodes[node]));
        }
    }
    let drawn = (0..nodes.len()).filter(|&k| is_drawn[k]).collect();
    Ok(Nodes { world_from_node, drawn })
}

/// Visits all descendants of `roots`, parents first.
fn descend(nodes: &[Node], roots: &[usize], mut visit: impl FnMut(usize, usize)) {
    let mut stack = roots.to_vec();
    while let Some(parent) = stack.pop() {
        for child in children(&nodes[parent]) {
            visit(parent, child);
            stack.push(child);
        }
    }
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

/// The parent of each node.
fn parents(document: &Document<'_>) -> Result<Vec<Option<usize>>, ReadError> {
    let nodes = &document.root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for child in children(node) {
            document.get(nodes, child, "node", &format!("node {parent}"))?;
            if let Some(first) = parents[child].replace(parent) {
                return Err(
                    document.malformed(format!("node {child}"), format!("child of two nodes, {first} and {parent}"))
                );
            }
        }
    }
    Ok(parents)
}

/// Local transform of a node; `None` for a matrix that is not affine.
fn local(node: &Node) -> Option<Matrix> {
    if let Some(matrix) = &node.matrix {
        return Matrix::from_4x4(matrix);
    }
    let rotation = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0);
    Some(Matrix::from_parts(node.translation.unwrap_or_default(), rotation, node.scale.unwrap_or([1.0; 3])))
}

/// Index of the scene to draw.
fn default_scene(document: &Document<'_>) -> Result<Option<usize>, ReadError> {
    let scenes = &document.root.scenes;
    let Some(scene) = document.root.scene else { return Ok((!scenes.is_empty()).then_some(0)) };
    document.get(scenes, scene.value(), "scene", "default scene")?;
    Ok(Some(scene.value()))
}

/// The distinct root nodes of a scene. A root that has a parent is drawn once, placed as the parent's child.
fn scene_roots(
    document: &Document<'_>,
    scene: usize,
    parents: &[Option<usize>],
    grouped: &mut WarningGroups,
) -> Result<Vec<usize>, ReadError> {
    let location = format!("scene {scene}");
    let mut roots: Vec<usize> = document.root.scenes[scene].nodes.iter().map(|node| node.value()).collect();
    roots.sort_unstable();
    roots.dedup();
    for &root in &roots {
        let parent = document.get(parents, root, "node", &location)?;
        if let Some(parent) = parent {
            grouped.add(
                &format!("placing a root of {location} as a child of its parent"),
                &format!("node {root} of {parent}"),
            );
        }
    }
    Ok(roots)
}

fn last_row_error(document: &Document<'_>, node: usize) -> ReadError {
    document.malformed(format!("node {node}"), "the last row of its matrix is not 0 0 0 1")
}

/// The error for a cycle above the node `unreached`. Each node has at most one parent.
fn cycle_error(document: &Document<'_>, parents: &[Option<usize>], unreached: usize) -> ReadError {
    // Without a root above, as many steps up as there are nodes end inside the cycle.
    let in_cycle = parents.iter().fold(unreached, |node, _| parents[node].unwrap_or(node));
    document.malformed(format!("node {in_cycle}"), "node is its own ancestor")
}
