//! The tree checker detects each flaw that it names.
//!
//! Each test breaks a valid tree in one way. Not covered here: whether built trees are valid (`volumes.rs`).

use canted_fixtures::{Mesh, soup};
use canted_lbvh::{
    self as lbvh, Bits, ChildKind, Corners, Domain, Flaw, NodeId, Strategy, Tree, Volume, VolumeConfig, Volumes,
};

fn build(mesh: &Mesh) -> (Tree, Vec<Corners>) {
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
    let tree = lbvh::radix(lbvh::sort_by_code(&codes, Bits::B63));
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    (tree, sorted)
}

/// A valid tree for a test to break.
struct Sound {
    tree: Tree,
    volumes: Volumes,
    leaves: Vec<Corners>,
}

impl Sound {
    fn new(strategy: Strategy) -> Self {
        let (tree, leaves) = build(&soup(11, 40));
        let volumes = lbvh::volumes(&tree, &leaves, &VolumeConfig { strategy, fallback: false });
        let sound = Self { tree, volumes, leaves };
        assert!(sound.check().is_ok());
        sound
    }

    fn check(&self) -> Result<lbvh::Stats, Flaw> {
        lbvh::check(&self.tree, &self.volumes, &self.leaves)
    }
}

#[test]
fn check_detects_arrays_of_wrong_length() {
    let flaw = Err(Flaw::WrongCount { n_leaves: 40, n_nodes: 39 });
    let mut sound = Sound::new(Strategy::Aabb);
    sound.tree.bottom_up.pop();
    assert_eq!(sound.check(), flaw);
    let mut sound = Sound::new(Strategy::Aabb);
    sound.volumes.aabbs.pop();
    assert_eq!(sound.check(), flaw);
    let mut sound = Sound::new(Strategy::Aabb);
    sound.leaves.pop();
    assert_eq!(sound.check(), flaw);
}

#[test]
fn check_detects_a_primitive_in_two_leaves() {
    let mut sound = Sound::new(Strategy::Aabb);
    let twice = sound.tree.leaves[3];
    sound.tree.leaves[30] = twice;
    assert_eq!(sound.check(), Err(Flaw::NotOnce { primitive: twice }));
}

#[test]
fn check_detects_swapped_leaves() {
    let mut sound = Sound::new(Strategy::Aabb);
    sound.leaves.swap(0, 39);
    assert!(matches!(sound.check(), Err(Flaw::Escapes { .. })), "{:?}", sound.check());
}

#[test]
fn check_detects_nodes_without_a_parent() {
    let mut sound = Sound::new(Strategy::Aabb);
    // The root now covers only its left child's range; the right side has no parent.
    let ChildKind::Inner(left) = sound.tree.nodes[0].left.kind() else { panic!("40 leaves, 1 on the left") };
    sound.tree.nodes[0] = sound.tree.nodes[left.index()];
    assert!(matches!(sound.check(), Err(Flaw::NotOneParent { .. })), "{:?}", sound.check());
}

#[test]
fn check_detects_references_out_of_range() {
    let flaw = Err(Flaw::OutOfRange { node: NodeId::ROOT });
    for outside in [lbvh::Child::leaf(40), lbvh::Child::inner(NodeId(39))] {
        let mut sound = Sound::new(Strategy::Aabb);
        sound.tree.nodes[0].right = outside;
        assert_eq!(sound.check(), flaw);
    }
    let mut sound = Sound::new(Strategy::Aabb);
    sound.tree.bottom_up[38] = NodeId(39);
    assert_eq!(sound.check(), Err(Flaw::OutOfRange { node: NodeId(39) }));
}

#[test]
fn check_detects_ranges_that_differ_from_the_children() {
    for i in 0..39 {
        let mut sound = Sound::new(Strategy::Aabb);
        sound.tree.nodes[i].last += 1;
        assert!(matches!(sound.check(), Err(Flaw::WrongRange { .. })), "node {i}: {:?}", sound.check());
    }
}

#[test]
fn check_detects_wrong_node_order_and_repeated_nodes() {
    let mut sound = Sound::new(Strategy::Aabb);
    sound.tree.bottom_up.swap(0, 38);
    assert_eq!(sound.check(), Err(Flaw::WrongOrder { node: NodeId::ROOT }));
    let mut sound = Sound::new(Strategy::Aabb);
    let twice = sound.tree.bottom_up[0];
    sound.tree.bottom_up[1] = twice;
    assert_eq!(sound.check(), Err(Flaw::WrongOrder { node: twice }));
}

#[test]
fn check_detects_a_wrong_depth() {
    for step in [-1, 1] {
        let mut sound = Sound::new(Strategy::Aabb);
        let actual = sound.tree.depth;
        sound.tree.depth = actual.wrapping_add_signed(step);
        assert_eq!(sound.check(), Err(Flaw::WrongDepth { stated: sound.tree.depth, actual }));
    }
}

#[test]
fn check_detects_each_plane_of_each_node_shrunk_by_one_ulp() {
    let sound = Sound::new(Strategy::Aabb);
    for id in (0..39).map(NodeId) {
        for k in 0..3 {
            for shrink in [
                |aabb: &mut canted_obb::Aabb, k: usize| aabb.min[k] = aabb.min[k].next_up(),
                |aabb: &mut canted_obb::Aabb, k: usize| aabb.max[k] = aabb.max[k].next_down(),
            ] {
                let mut volumes = sound.volumes.clone();
                shrink(&mut volumes.aabbs[id.index()], k);
                let flaw = lbvh::check(&sound.tree, &volumes, &sound.leaves);
                assert!(matches!(flaw, Err(Flaw::Escapes { node, .. }) if node == id), "{id:?}, axis {k}: {flaw:?}");
            }
        }
    }
}

/// A vertex moved to a corner of the axis-aligned box stays inside that box but leaves the oriented one.
#[test]
fn check_detects_a_point_outside_only_the_oriented_box() {
    let diagonal = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [7.0, 7.0, 7.0], [7.1, 7.0, 7.0]];
    let mesh = Mesh { positions: diagonal.to_vec(), triangles: vec![[0, 1, 2], [1, 2, 3]] };
    let (tree, mut leaves) = build(&mesh);
    let oriented = lbvh::volumes(&tree, &leaves, &VolumeConfig { strategy: Strategy::Dop, fallback: true });
    let straight = lbvh::volumes(&tree, &leaves, &VolumeConfig::default());
    assert!(matches!(oriented.of(NodeId::ROOT), Volume::Obb(_)));
    leaves[0][0] = [0.0, 7.0, 0.0];
    assert!(lbvh::check(&tree, &straight, &leaves).is_ok());
    assert_eq!(lbvh::check(&tree, &oriented, &leaves), Err(Flaw::Escapes { node: NodeId::ROOT, leaf: 0 }));
}
