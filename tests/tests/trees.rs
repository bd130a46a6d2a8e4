//! Binary trees and their volumes: every strategy contains its subtree, the fallback never has more area, threads change no bit; the
//! checker detects each flaw that it names.
//!
//! Containment is checked by the library's checker, and in exact arithmetic. Tests of the checker break a valid tree in one way each.
//! Not covered here: how much smaller oriented volumes are (the program's `stats` reports it); traversal (`hits`); the build without the
//! feature `parallel`, which needs a separate compilation.

use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Grazing, Mesh, grazing, grid, soup};
use canted_lbvh::{
    self as lbvh, Bits, ChildKind, Corners, Domain, Flaw, NodeId, Strategy, Tree, Volume, VolumeConfig, Volumes,
};
use canted_obb::{Obb, merge};
use canted_tests::{exact, scenes};
use canted_trace::{Counts, Intersect, Ray};

fn configs() -> impl Iterator<Item = VolumeConfig> {
    Strategy::ALL.into_iter().flat_map(|strategy| [true, false].map(|fallback| VolumeConfig { strategy, fallback }))
}

fn build(mesh: &Mesh) -> (Tree, Vec<Corners>) {
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
    let tree = lbvh::radix(lbvh::sort_by_code(&codes, Bits::B63));
    let sorted = lbvh::in_leaf_order(&corners, &tree.leaves);
    (tree, sorted)
}

fn nodes(tree: &Tree) -> impl Iterator<Item = NodeId> {
    (0..).map(NodeId).take(tree.nodes.len())
}

#[test]
fn every_strategy_contains_every_vertex() {
    for case in scenes::cases() {
        let (tree, leaves) = build(&case.mesh);
        for config in configs() {
            let volumes = lbvh::volumes(&tree, &leaves, &config);
            let stats = lbvh::check(&tree, &volumes, &leaves)
                .unwrap_or_else(|flaw| panic!("{}, {config:?}: {flaw}", case.name));
            assert_eq!((stats.n_leaves, stats.n_nodes), (leaves.len(), leaves.len().saturating_sub(1)));
        }
    }
}

/// The nodes with few leaves, where boxes are tightest, and the root.
#[test]
fn exact_arithmetic_finds_every_vertex_inside() {
    let mut n_oriented = 0;
    for case in scenes::cases() {
        let (tree, leaves) = build(&case.mesh);
        for config in configs() {
            let volumes = lbvh::volumes(&tree, &leaves, &config);
            for id in nodes(&tree).filter(|id| *id == NodeId::ROOT || id.0 % 37 == 5) {
                let (node, Volume::Obb(obb)) = (tree.nodes[id.index()], volumes.of(id)) else { continue };
                n_oriented += 1;
                for &p in leaves[node.first as usize..=node.last as usize].iter().take(8).flatten() {
                    assert!(exact::contains(obb, p), "{}, {config:?}, {id:?}: {p:?} outside {obb:?}", case.name);
                }
            }
        }
    }
    assert!(n_oriented > 1000, "{n_oriented} oriented boxes");
}

#[test]
fn exact_arithmetic_detects_a_box_shrunk_by_a_millionth() {
    let (tree, leaves) = build(&scenes::shapes()[0].mesh);
    let volumes = lbvh::volumes(&tree, &leaves, &VolumeConfig { strategy: Strategy::Dop, fallback: false });
    let Volume::Obb(obb) = volumes.of(NodeId::ROOT) else { panic!("without fallback the root is oriented") };
    let short = Obb { half_extents: obb.half_extents.map(|h| h * (1.0 - 1e-6)), ..*obb };
    assert!(leaves.iter().flatten().any(|&p| !exact::contains(&short, p)));
}

#[test]
fn the_fallback_is_never_worse_than_the_axis_aligned_box() {
    let mut n_worse_without = 0;
    for case in scenes::cases() {
        let (tree, leaves) = build(&case.mesh);
        for config in configs() {
            let volumes = lbvh::volumes(&tree, &leaves, &config);
            let is_worse = |id: &NodeId| volumes.of(*id).area() > volumes.aabbs[id.index()].area();
            match (config.fallback, nodes(&tree).filter(is_worse).count()) {
                (true, 0) => {}
                (true, n) => panic!("{}, {config:?}: {n} nodes are worse", case.name),
                (false, n) => n_worse_without += n,
            }
        }
    }
    assert!(n_worse_without > 1000, "only {n_worse_without} worse nodes without fallback");
}

/// How many nodes `rule` reproduces, by number of leaves among the children, and how many it does not.
fn reproduced(
    tree: &Tree,
    leaves: &[Corners],
    volumes: &Volumes,
    rule: impl Fn([&merge::Child; 2]) -> Obb,
) -> ([usize; 3], usize) {
    let child = |child: lbvh::Child| match (child.kind(), child) {
        (ChildKind::Leaf(position), _) => merge::Child::Triangle(leaves[position as usize]),
        (ChildKind::Inner(id), _) => match volumes.of(id) {
            Volume::Obb(obb) => merge::Child::Box(*obb),
            Volume::Aabb(_) => panic!("without fallback every node is oriented"),
        },
    };
    let (mut same, mut different) = ([0; 3], 0);
    for id in nodes(tree) {
        let node = tree.nodes[id.index()];
        let children = [node.left, node.right].map(child);
        let n_leaves = children.iter().filter(|child| matches!(child, merge::Child::Triangle(_))).count();
        match volumes.of(id) == Volume::Obb(&rule([&children[0], &children[1]])) {
            true => same[n_leaves] += 1,
            false => different += 1,
        }
    }
    (same, different)
}

#[test]
fn combined_chooses_by_the_kind_of_the_children() {
    let (tree, leaves) = build(&scenes::shapes()[0].mesh);
    let volumes = lbvh::volumes(&tree, &leaves, &VolumeConfig { strategy: Strategy::Combined, fallback: false });
    let (same, different) = reproduced(&tree, &leaves, &volumes, |[a, b]| match (a, b) {
        (merge::Child::Box(a), merge::Child::Box(b)) => merge::quaternion(a, b, [a.area(), b.area()]),
        _ => merge::bounded(a, b, merge::Weight::Area),
    });
    assert_eq!(different, 0);
    assert!(same.iter().all(|&n| n > 20), "{same:?}");
    let (_, different) = reproduced(&tree, &leaves, &volumes, |[a, b]| merge::bounded(a, b, merge::Weight::Area));
    assert!(different > 20, "a single rule differs from the combined one {different} times");
}

/// The result of a build as bits: tree, volumes, and hits of its traced form.
fn build_bits(mesh: &Mesh, config: &VolumeConfig) -> (Tree, Vec<u32>) {
    let (tree, leaves) = build(mesh);
    let volumes = lbvh::volumes(&tree, &leaves, config);
    let mut bits = vec![];
    for id in nodes(&tree) {
        let aabb = volumes.aabbs[id.index()];
        bits.extend([aabb.min, aabb.max].into_iter().flatten().map(f32::to_bits));
        if let Volume::Obb(Obb { center, frame: [x, y, z], half_extents: half }) = volumes.of(id) {
            bits.extend([*center, *x, *y, *z, *half].into_iter().flatten().map(f32::to_bits));
        }
    }
    let config = Bvh2Config { volumes: *config, ..Bvh2Config::default() };
    let blas = Bvh2::build(&mesh.positions, &mesh.triangles, &config).unwrap();
    let mut counts = Counts::default();
    for ray in grazing(mesh, Grazing::Edges, 200, 8) {
        let hit = blas.closest_hit_with(&Ray::new(ray.origin, ray.direction), &mut counts);
        bits.extend(hit.iter().flat_map(|hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive.0]));
    }
    bits.extend([counts.boxes, counts.triangles].map(|n| u32::try_from(n).unwrap()));
    (tree, bits)
}

#[test]
fn threads_change_no_bit() {
    let on_threads = |n: usize, mesh: &Mesh, config: &VolumeConfig| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| build_bits(mesh, config))
    };
    // Larger than one task, so that threads share the work.
    for mesh in [grid(5, [90, 70]), soup(4, 9_001)] {
        for config in configs() {
            let serial = on_threads(1, &mesh, &config);
            assert!(serial.0.tasks.len() > 2, "{} tasks", serial.0.tasks.len());
            for n in 2..=4 {
                assert!(on_threads(n, &mesh, &config) == serial, "{config:?} on {n} threads");
            }
        }
    }
}

#[test]
fn bits_differ_between_two_builds() {
    let config = VolumeConfig { strategy: Strategy::Quaternion, fallback: true };
    let mesh = soup(4, 500);
    let mut moved = mesh.clone();
    let farthest = moved.positions.iter_mut().max_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
    farthest[0] = farthest[0].next_up();
    assert!(
        build_bits(&mesh, &config).1 != build_bits(&moved, &config).1,
        "moving one vertex by one ulp changes the bits"
    );
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
