//! Volumes: every strategy contains its subtree, the fallback never has more area, threads change no bit.
//!
//! Containment is checked by the library's checker, which `checker.rs` tests, and in exact arithmetic. Not covered here: how much
//! smaller oriented volumes are (the program's `stats` reports it); traversal (`lost_hits.rs`); the build without the feature
//! `parallel`, which needs a separate compilation.

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, grazing, grid, soup};
use canted_lbvh::{
    self as lbvh, Bits, ChildKind, Corners, Domain, NodeId, Strategy, Tree, Volume, VolumeConfig, Volumes,
};
use canted_obb::{Obb, merge};
use canted_tests::{exact, scenes};
use canted_trace::{Counts, InstanceId, Ray, Watertight};

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
    let config = BuildConfig { bits: Bits::B63, volumes: *config };
    let blas = Bvh2::<Watertight>::build(&mesh.positions, &mesh.triangles, &config).unwrap();
    let mut counts = Counts::default();
    for ray in grazing(mesh, Grazing::Edges, 200, 8) {
        let hit = blas.closest_hit_with(&Ray::new(ray.origin, ray.direction), InstanceId(0), &mut counts);
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
