use super::*;
use crate::node::Node;
use crate::{BihConfig, LeafSize};
use canted_fixtures::soup;

/// Random triangles in two clusters, so that there are clip nodes.
fn boxes(n: u32) -> Vec<Aabb> {
    let mesh = soup(1, n);
    let mut boxes: Vec<Aabb> =
        mesh.triangles.iter().map(|t| Aabb::from_points(t.map(|v| mesh.positions[v as usize]))).collect();
    for aabb in boxes.iter_mut().skip(n as usize / 2) {
        aabb.min[0] += 20.0;
        aabb.max[0] += 20.0;
    }
    boxes
}

fn build(boxes: &[Aabb], leaf_size: u32) -> BoxBih {
    BoxBih::build(boxes, &BihConfig { leaf_size: LeafSize::AtMost(leaf_size), ..BihConfig::default() }).unwrap()
}

/// The flaw after a change.
fn flaw(change: impl FnOnce(&mut BoxBih)) -> BihFlaw {
    let boxes = boxes(40);
    let mut bih = build(&boxes, 2);
    check(&bih, &boxes).unwrap();
    change(&mut bih);
    check(&bih, &boxes).unwrap_err()
}

/// The first node of a kind.
fn find(bih: &BoxBih, is_it: impl Fn(NodeKind) -> bool) -> usize {
    bih.nodes.iter().position(|node| is_it(node.kind())).expect("there is one of each kind")
}

fn find_leaf(bih: &BoxBih) -> usize {
    find(bih, |kind| matches!(kind, NodeKind::Leaf { .. }))
}

fn find_clip(bih: &BoxBih) -> usize {
    find(bih, |kind| matches!(kind, NodeKind::Clip { .. }))
}

#[test]
fn valid_bihs_have_no_flaw() {
    for n in [0, 1, 2, 3, 40, 1000] {
        for leaf_size in [1, 2, 7] {
            let boxes = boxes(n);
            let bih = build(&boxes, leaf_size);
            let stats = check(&bih, &boxes).unwrap();
            assert!(stats.largest_leaf <= leaf_size as usize, "{stats:?}");
            assert_eq!(stats.n_leaves + stats.n_splits + stats.n_clips, bih.n_nodes());
            assert_eq!(stats.n_leaves.saturating_sub(1), stats.n_splits);
            assert_eq!(stats.depth, bih.depth());
        }
    }
}

#[test]
fn primitives_in_two_leaves_or_none_are_detected() {
    let repeated = flaw(|bih| bih.primitives[3] = bih.primitives[4]);
    assert!(matches!(repeated, BihFlaw::NotOnce { .. }), "{repeated}");
    assert_eq!(flaw(|bih| bih.primitives[3] = PrimId(99)), BihFlaw::NotOnce { primitive: PrimId(99) });
    let missing = flaw(|bih| bih.primitives.truncate(39));
    assert!(matches!(missing, BihFlaw::NotOnce { .. }), "{missing}");
}

#[test]
fn leaves_that_do_not_continue_the_references_are_detected() {
    for replacement in [Node::leaf(1, 2), Node::leaf(0, 1000), Node::leaf(0, 1)] {
        let found = flaw(|bih| {
            let leaf = find_leaf(bih);
            bih.nodes[leaf] = replacement;
        });
        assert!(matches!(found, BihFlaw::WrongReferences { .. }), "{found}");
    }
}

#[test]
fn references_in_no_leaf_are_detected() {
    let boxes = boxes(2);
    let mut bih = build(&boxes, 2);
    bih.nodes[0] = Node::leaf(0, 1);
    assert_eq!(check(&bih, &boxes), Err(BihFlaw::WrongReferences { node: 0 }));
}

#[test]
fn empty_leaves_are_detected() {
    let found = flaw(|bih| {
        let leaf = find_leaf(bih);
        bih.nodes[leaf] = Node::leaf(0, 0);
    });
    assert!(matches!(found, BihFlaw::EmptyLeaf { .. }), "{found}");
}

#[test]
fn wrong_and_missing_children_are_detected() {
    for change in [1, u32::MAX] {
        let found = flaw(|bih| {
            let at = find(bih, |kind| matches!(kind, NodeKind::Split { .. }));
            let NodeKind::Split { axis, second } = bih.nodes[at].kind() else { unreachable!("a split was found") };
            bih.nodes[at] = Node::split(axis, second.wrapping_add(change), bih.nodes[at].planes);
        });
        assert!(matches!(found, BihFlaw::WrongChild { .. }), "{found}");
    }
    let found = flaw(|bih| bih.nodes.truncate(bih.nodes.len() - 1));
    assert!(matches!(found, BihFlaw::WrongChild { .. }), "{found}");
    assert_eq!(flaw(|bih| bih.nodes.clear()), BihFlaw::WrongChild { node: 0 });
}

#[test]
fn unreached_nodes_are_detected() {
    let mut n = 0;
    let found = flaw(|bih| {
        n = bih.nodes.len();
        bih.nodes.push(Node::leaf(0, 1));
    });
    assert_eq!(found, BihFlaw::Unreached { node: n });
}

/// One step of the least unit is enough.
#[test]
fn planes_that_cut_content_are_detected() {
    for plane in [0, 1] {
        for is_clip in [true, false] {
            let mut at = 0;
            let found = flaw(|bih| {
                at = find(bih, |kind| match kind {
                    NodeKind::Clip { .. } => is_clip,
                    NodeKind::Split { .. } => !is_clip,
                    NodeKind::Leaf { .. } => false,
                });
                let planes = &mut bih.nodes[at].planes;
                planes[plane] = if plane == 0 { planes[0].next_down() } else { planes[1].next_up() };
            });
            assert_eq!(found, BihFlaw::Escapes { node: at }, "plane {plane}, clip node: {is_clip}");
        }
    }
}

#[test]
fn a_root_box_that_cuts_content_is_detected() {
    for k in 0..3 {
        assert_eq!(
            flaw(|bih| bih.padded_bounds.min[k] = bih.padded_bounds.min[k].next_up()),
            BihFlaw::Escapes { node: 0 }
        );
        assert_eq!(
            flaw(|bih| bih.padded_bounds.max[k] = bih.padded_bounds.max[k].next_down()),
            BihFlaw::Escapes { node: 0 }
        );
        assert_eq!(flaw(|bih| bih.bounds.max[k] = bih.bounds.max[k].next_down()), BihFlaw::Escapes { node: 0 });
    }
}

#[test]
fn a_wrong_depth_is_detected() {
    let mut actual = 0;
    let found = flaw(|bih| {
        actual = bih.depth;
        bih.depth += 1;
    });
    assert_eq!(found, BihFlaw::WrongDepth { stated: actual + 1, actual });
}

#[test]
fn excessive_depth_is_detected() {
    let found = flaw(|bih| {
        let clip = find_clip(bih);
        let node = bih.nodes[clip];
        bih.nodes.splice(0..0, std::iter::repeat_n(Node::clip(0, [f32::MAX, f32::MIN]), BoxBih::MAX_DEPTH as usize));
        assert!(bih.nodes.contains(&node));
    });
    assert_eq!(found, BihFlaw::TooDeep { node: BoxBih::MAX_DEPTH as usize });
}
