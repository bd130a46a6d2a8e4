use canted_fixtures::{Mesh, equal_centroids, fan, identical, outlier, slivers, soup, torus};

use super::*;
use crate::node::{Node, Reference};
use crate::{KdNodes, KdTreeConfig};

fn corners(mesh: &Mesh) -> Vec<Corners> {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect()
}

fn deep() -> KdTreeConfig {
    KdTreeConfig { traversal: KdTraversal::Ropes, traversal_cost: 0.01, ..KdTreeConfig::default() }
}

#[test]
fn built_trees_pass() {
    let mut meshes = vec![Mesh::default(), soup(1, 1), soup(2, 400), torus(12, 9), identical(50), equal_centroids(90)];
    meshes.extend([outlier(200), slivers(3, 200), fan(100)]);
    meshes.extend([1e7, 3e3].map(|offset| soup(4, 200).placed(|p| p.map(|x| x + offset))));
    meshes.extend([1e-40, 1e-20, 1e15].map(|scale| soup(4, 200).placed(|p| p.map(|x| x * scale))));
    for (i, mesh) in meshes.iter().enumerate() {
        let corners = corners(mesh);
        for config in [deep(), KdTreeConfig::default(), KdTreeConfig { max_references: 2.0, ..deep() }] {
            let tree = KdNodes::new(&corners, &config);
            let stats = tree.check(&corners).unwrap_or_else(|flaw| panic!("mesh {i}, {config:?}: {flaw}"));
            assert_eq!((stats.n_leaves, stats.n_references), (tree.n_leaves(), tree.n_references()));
            assert_eq!(stats.depth, tree.depth());
            assert!(stats.depth <= config.depth_limit(corners.len()), "mesh {i}: {stats:?}");
            assert!(stats.n_references + stats.n_empty <= config.reference_limit(corners.len()).max(1));
        }
    }
}

/// The flaw that the checker finds after a tree of many leaves is spoiled.
fn spoiled(spoil: impl FnOnce(&mut KdNodes)) -> KdTreeFlaw {
    let corners = corners(&soup(2, 100));
    let mut tree = KdNodes::new(&corners, &deep());
    assert!(tree.check(&corners).unwrap().n_leaves > 50);
    spoil(&mut tree);
    let flaw = tree.check(&corners).unwrap_err();
    assert!(!flaw.to_string().is_empty());
    flaw
}

/// Number of the first node that is a leaf with triangles, and of its first reference.
fn full_leaf(tree: &KdNodes) -> (usize, usize, u32) {
    let mut nodes = tree.nodes.iter().enumerate();
    nodes
        .find_map(|(i, node)| match node.kind() {
            NodeKind::Leaf { first: Some(first), number } => Some((i, first as usize, number)),
            _ => None,
        })
        .unwrap()
}

fn inner(tree: &KdNodes, node: usize) -> (usize, f32, u32) {
    let NodeKind::Inner { axis, plane, upper } = tree.nodes[node].kind() else { panic!("node {node} is a leaf") };
    (axis, plane, upper)
}

#[test]
fn flaws_of_nodes_are_seen() {
    let wrong_child = spoiled(|tree| {
        let (.., upper) = inner(tree, 0);
        tree.nodes[0] = tree.nodes[0].with_number(upper + 1);
    });
    assert_eq!(wrong_child, KdTreeFlaw::WrongChild { node: 0 });
    let cut = spoiled(|tree| tree.nodes.truncate(tree.nodes.len() - 1));
    assert!(matches!(cut, KdTreeFlaw::WrongChild { .. }), "{cut:?}");
    assert!(matches!(spoiled(|tree| tree.nodes.push(Node::leaf(None))), KdTreeFlaw::WrongChild { .. }));
    let outside = spoiled(|tree| {
        let (axis, _, upper) = inner(tree, 0);
        tree.nodes[0] = Node::inner(axis, tree.cell.max[axis]).with_number(upper);
    });
    assert_eq!(outside, KdTreeFlaw::PlaneOutside { node: 0 });
    let (mut node, number) = (0, 77);
    let flaw = spoiled(|tree| {
        node = full_leaf(tree).0;
        tree.nodes[node] = tree.nodes[node].with_number(number);
    });
    assert_eq!(flaw, KdTreeFlaw::WrongNumber { node: u32::try_from(node).unwrap() });
    assert!(matches!(spoiled(|tree| tree.depth -= 1), KdTreeFlaw::TooDeep { .. }));
}

#[test]
fn flaws_of_references_are_seen() {
    let flaw = spoiled(|tree| {
        let first = full_leaf(tree).1;
        tree.references[first] = Reference::new(100, tree.references[first].is_last());
    });
    assert!(matches!(flaw, KdTreeFlaw::NoTriangle { .. }), "{flaw:?}");
    let last = spoiled(|tree| {
        let reference = tree.references.last_mut().unwrap();
        *reference = Reference::new(reference.triangle(), false);
    });
    assert!(matches!(last, KdTreeFlaw::NoTriangle { .. }), "{last:?}");
    let repeated = spoiled(|tree| {
        let at = (0..tree.references.len()).find(|&i| !tree.references[i].is_last()).unwrap();
        tree.references[at] = Reference::new(tree.references[at + 1].triangle(), false);
    });
    assert!(matches!(repeated, KdTreeFlaw::Repeated { .. }), "{repeated:?}");
    // Every triangle of every leaf is needed by some leaf; here the first leaf loses its own.
    let missing = spoiled(|tree| {
        let (node, _, number) = full_leaf(tree);
        tree.nodes[node] = Node::leaf(None).with_number(number);
    });
    assert!(matches!(missing, KdTreeFlaw::Missing { .. }), "{missing:?}");
    assert_eq!(spoiled(|tree| tree.references.push(Reference::new(0, true))), KdTreeFlaw::Unused { n_references: 1 });
    let escapes = spoiled(|tree| tree.cell.max[1] = tree.cell.max[1].next_down().next_down());
    assert!(matches!(escapes, KdTreeFlaw::Escapes { .. }), "{escapes:?}");
}

#[test]
fn flaws_of_ropes_are_seen() {
    assert!(matches!(spoiled(|tree| tree.ropes.truncate(5)), KdTreeFlaw::NoRopes { n_ropes: 5 }));
    assert!(matches!(spoiled(|tree| tree.traversal = KdTraversal::Stack), KdTreeFlaw::NoRopes { .. }));
    let flaw = spoiled(|tree| tree.ropes[3].cell.min[0] = tree.ropes[3].cell.min[0].next_down());
    assert_eq!(flaw, KdTreeFlaw::WrongCell { leaf: 3 });
    // A rope to the far cell covers the face too, but is not the smallest.
    let larger = spoiled(|tree| {
        let is_smaller = |r: &Ropes| (0..6).find(|&face| r.depths[face] == 1 && !is_root_child(tree, r.targets[face]));
        let (leaf, face) = tree.ropes.iter().enumerate().find_map(|(i, r)| Some((i, is_smaller(r)?))).unwrap();
        let (.., upper) = inner(tree, 0);
        tree.ropes[leaf].targets[face] = if face & 1 == 1 { upper } else { 1 };
    });
    assert!(matches!(larger, KdTreeFlaw::WrongRope { .. }), "{larger:?}");
    let deeper = spoiled(|tree| {
        let face = (0..6).find(|&face| tree.ropes[9].depths[face] > 0).unwrap();
        tree.ropes[9].depths[face] += 1;
    });
    assert!(matches!(deeper, KdTreeFlaw::WrongRope { leaf: 9, .. }), "{deeper:?}");
}

fn is_root_child(tree: &KdNodes, node: u32) -> bool {
    node == 1 || node == inner(tree, 0).2
}

/// The check can fail by little: a tree without the padding lacks references.
#[test]
fn a_tree_over_unpadded_triangles_lacks_references() {
    // Triangles in planes between others: without padding they are on one side only.
    let mesh = torus(16, 12);
    let padded = corners(&mesh);
    let mut n_flawed = 0;
    for shift in 0..20u8 {
        let moved: Vec<Corners> =
            padded.iter().map(|c| c.map(|p| p.map(|x| x + 1e-6 * f32::from(shift + 1)))).collect();
        let tree = KdNodes::new(&moved, &deep());
        n_flawed += usize::from(tree.check(&padded).is_err());
    }
    assert!(n_flawed > 15, "{n_flawed} of 20 trees over moved triangles are flawed");
}
