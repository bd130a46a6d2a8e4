//! Boxes after a refit, compared with exact sums; broken references.

use canted_fixtures::{self as fixtures, Mesh, SplitMix64, sum_is_positive};
use canted_lbvh::Corners;
use canted_obb::Aabb;
use canted_trace::{Intersect, Ray};

use super::*;
use crate::leaf::StoredTriangles;
use crate::node::checked::{CheckedNode, Slot, subtrees_of};
use crate::node::{ChildWord, LeafLayout, NodeKind, Row, SubtreeSlots, node_words};
use crate::{Flaw, SimdPath, TriangleBvh};

fn build(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

fn outline_or_flaw(bvh: &TriangleBvh) -> Result<Hierarchy, Flaw> {
    Hierarchy::of(&bvh.nodes, bvh.leaves.halves.len(), &LeafLayout::BLOCKS)
}

fn hierarchy(bvh: &TriangleBvh) -> Hierarchy {
    outline_or_flaw(bvh).unwrap()
}

/// Every vertex moved by a random step of up to `size` on each axis.
fn shaken(mesh: &Mesh, size: f64, seed: u64) -> Mesh {
    let mut rng = SplitMix64::new(seed);
    let shake = |p: &[f32; 3]| p.map(|x| (f64::from(x) + size * rng.signed()) as f32);
    Mesh { positions: mesh.positions.iter().map(shake).collect(), triangles: mesh.triangles.clone() }
}

/// Number of boxes that do not contain all vertices below them, by exact sums of exact products.
fn n_too_small(bvh: &TriangleBvh) -> usize {
    let hierarchy = hierarchy(bvh);
    // Boxes contain moved vertices exactly; the pads cover their rounding.
    let moved = |corners: &Corners| corners.map(|vertex| bvh.frame.reference.moved(vertex));
    let corners: Vec<Corners> =
        StoredTriangles::read(&hierarchy, &bvh.leaves.halves).corners.iter().map(moved).collect();
    let mut n = 0;
    for node in &hierarchy.nodes {
        let rows: &[Row] = bytemuck::cast_slice(&bvh.nodes.lines[node.line..node.line + node.kind.n_lines()]);
        for (i, &slot) in node.slots.iter().enumerate() {
            let inside =
                corners[hierarchy.places(slot)].iter().flatten().all(|v| holds(node.kind, rows, &bvh.frame.rows, i, v));
            n += usize::from(!inside);
        }
    }
    n
}

fn holds(kind: NodeKind, rows: &[Row], mesh_frame: &[[f32; 3]; 3], i: usize, vertex: &[f32; 3]) -> bool {
    (0..3).all(|k| {
        let (row, lo, hi) = match kind {
            NodeKind::Aligned => (mesh_frame[k], [rows[2 * k][i], 0.0], [rows[2 * k + 1][i], 0.0]),
            NodeKind::Oriented => {
                let (center, half) = (rows[5 * k + 3][i], rows[5 * k + 4][i]);
                ([0, 1, 2].map(|axis| rows[5 * k + axis][i]), [center, -half], [center, half])
            }
        };
        let place: [f64; 3] = [0, 1, 2].map(|axis| f64::from(row[axis]) * f64::from(vertex[axis]));
        let [a, b, c] = place;
        let ([lo, below], [hi, above]) = (lo.map(f64::from), hi.map(f64::from));
        sum_is_positive(&[a, b, c, -lo, -below]) && sum_is_positive(&[-a, -b, -c, hi, above])
    })
}

fn motions(mesh: &Mesh) -> Vec<Mesh> {
    let moved = |f: fn([f32; 3]) -> [f32; 3]| {
        let positions = mesh.positions.iter().copied().map(f).collect();
        Mesh { positions, triangles: mesh.triangles.clone() }
    };
    vec![
        mesh.clone(),
        shaken(mesh, 0.05, 1),
        shaken(mesh, 10.0, 2),
        mesh.off_axis(),
        moved(|p| p.map(|x| x + 1e7)),
        moved(|[x, y, z]| [-x, y, z]),
        moved(|[x, y, _]| [x, y, 0.25]),
        moved(|_| [0.1, 0.2, 0.3]),
        moved(|p| p.map(|x| x * 1e-6)),
        moved(|p| p.map(|x| x * 1e12)),
    ]
}

#[test]
fn boxes_contain_their_vertices_exactly_after_any_motion() {
    for mesh in
        [fixtures::scaffold_of(1, true, 4), fixtures::soup(2, 2_000), fixtures::scaffold_of(1, false, 3).off_axis()]
    {
        let mut bvh = build(&mesh);
        assert_eq!(n_too_small(&bvh), 0);
        for moved in motions(&mesh) {
            bvh.refit(&moved.positions, &moved.triangles).unwrap();
            assert_eq!(n_too_small(&bvh), 0);
            let used = moved.triangles.iter().flatten().map(|&i| moved.positions[i as usize]);
            assert_eq!(bvh.bounds, Aabb::from_points(used));
        }
    }
}

#[test]
fn the_oracle_detects_boxes_that_are_too_small() {
    let mesh = fixtures::scaffold_of(1, true, 4);
    let bvh = build(&mesh);
    let hierarchy = hierarchy(&bvh);
    let oriented =
        hierarchy.nodes.iter().find(|node| node.kind == NodeKind::Oriented).expect("struts are in oriented nodes");
    for row in [3, 4] {
        let mut bvh = bvh.clone();
        let rows: &mut [Row] = bytemuck::cast_slice_mut(&mut bvh.nodes.lines[oriented.line..oriented.line + 8]);
        rows[row][0] *= 0.999;
        assert_eq!(n_too_small(&bvh), 1, "row {row}");
    }
    // Vertices that moved without a refit.
    let mut bvh = bvh.clone();
    let moved: Vec<_> = mesh.positions.iter().map(|p| p.map(|x| x * 1.01)).collect();
    let (triangles, frames, path) = (&mesh.triangles[..], [bvh.frame; 2], bvh.path);
    let leaves: Vec<_> =
        hierarchy.leaves.iter().map(|leaf| LeafSlots { first: leaf.first, n: leaf.places.len() }).collect();
    let moved = MovedTriangles { positions: &moved, triangles, frames, path };
    moved.after(&mut bvh.leaves.halves, &leaves, &mut LeafStates::new(leaves.len(), Some(0), false));
    assert!(n_too_small(&bvh) > 10);
}

#[test]
fn the_cost_is_remembered_from_refit_to_refit() {
    for mesh in [fixtures::scaffold_of(1, true, 4), fixtures::scaffold_of(1, false, 3).off_axis()] {
        let mut bvh = build(&mesh);
        let first = bvh.refit(&shaken(&mesh, 0.05, 1).positions, &mesh.triangles).unwrap();
        let mut forgetful = bvh.clone();
        forgetful.baseline.now = None;
        let moved = shaken(&mesh, 0.2, 2);
        let second = bvh.refit(&moved.positions, &mesh.triangles).unwrap();
        assert_eq!(second.cost_before, first.cost_now);
        assert_ne!(second.cost_now, first.cost_now);
        assert_eq!(forgetful.refit(&moved.positions, &mesh.triangles), Ok(second));
    }
}

#[test]
fn only_vertices_of_triangles_must_be_finite() {
    let mesh = fixtures::soup(3, 100);
    let mut bvh = build(&mesh);
    let mut positions = mesh.positions.clone();
    positions.push([f32::NAN; 3]);
    assert!(bvh.refit(&positions, &mesh.triangles).is_ok());
    let mut triangles = mesh.triangles.clone();
    triangles[7][1] = u32::try_from(mesh.positions.len()).unwrap();
    let (vertex, position) = (triangles[7][1], [f32::NAN; 3].into());
    let error = GeometryError::NotFinite { triangle: PrimId(7), vertex, position };
    assert_eq!(bvh.refit(&positions, &triangles), Err(RefitError::Geometry(error)));
    positions.pop();
    let index = triangles[7][1];
    let error = GeometryError::IndexOutOfRange { triangle: PrimId(7), index, n_vertices: positions.len() };
    assert_eq!(bvh.refit(&positions, &triangles), Err(RefitError::Geometry(error)));
}

/// Records with one word changed.
fn with_word(bvh: &TriangleBvh, node: usize, slot: usize, word: ChildWord) -> TriangleBvh {
    let mut bvh = bvh.clone();
    let hierarchy = hierarchy(&bvh);
    set_word(&mut bvh, &hierarchy.nodes[node], slot, word);
    bvh
}

fn set_word(bvh: &mut TriangleBvh, node: &CheckedNode, slot: usize, word: ChildWord) {
    let row = node.kind.n_lines() * 2 - 1 - usize::from(node.kind == NodeKind::Aligned);
    let rows: &mut [Row] = bytemuck::cast_slice_mut(&mut bvh.nodes.lines[node.line..]);
    rows[row][slot] = f32::from_bits(word.0);
}

#[test]
fn every_broken_reference_is_detected() {
    let bvh = build(&fixtures::soup(1, 500));
    let hierarchy = hierarchy(&bvh);
    let n_lines = bvh.nodes.lines.len();
    let flaw = |word| outline_or_flaw(&with_word(&bvh, 0, 0, word)).unwrap_err();
    assert_eq!(flaw(bvh.nodes.root), Flaw::Twice { unit: "line", at: 0 }, "a cycle");
    assert_eq!(flaw(ChildWord(0x6000_0000)), Flaw::Word { word: 0x6000_0000 });
    assert_eq!(
        flaw(ChildWord::node(NodeKind::Oriented, n_lines)),
        Flaw::Outside { unit: "line", at: n_lines + 7, n_units: n_lines }
    );
    assert!(matches!(flaw(ChildWord::EMPTY), Flaw::Unreached { unit: "line" | "part of a block", .. }));
    // Two slots that hold the same.
    let first = node_words(&bvh.nodes.lines, hierarchy.nodes[0].kind, 0)[1];
    assert!(matches!(flaw(first), Flaw::Twice { .. }));
    let deepest = hierarchy.nodes.len() - 1;
    let outside = outline_or_flaw(&with_word(&bvh, deepest, 0, ChildWord::leaf(PARTS * bvh.leaves.halves.len(), 1)));
    assert!(matches!(outside, Err(Flaw::Outside { unit: "part of a block", .. })), "{outside:?}");
}

/// Quads far apart: a leaf each.
fn quads(n: u8) -> Mesh {
    let corners = |i: u8| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x, y, 100.0 * f32::from(i)]);
    let triangles = |i: u8| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|corner| 4 * u32::from(i) + corner));
    Mesh { positions: (0..n).flat_map(corners).collect(), triangles: (0..n).flat_map(triangles).collect() }
}

#[test]
fn leaves_of_two_share_a_block() {
    let bvh = build(&quads(5));
    let hierarchy = hierarchy(&bvh);
    assert_eq!(hierarchy.leaves.iter().map(|leaf| leaf.places.len()).collect::<Vec<_>>(), [2; 5]);
    let mut firsts: Vec<usize> = hierarchy.leaves.iter().map(|leaf| leaf.first).collect();
    firsts.sort_unstable();
    assert_eq!(firsts, [0, 1, 2, 3, 4]);
    assert_eq!(hierarchy.leaves.iter().filter(|leaf| leaf.is_shared).count(), 4);
    assert_eq!(bvh.leaves.halves.len(), 3);
    for path in SimdPath::ALL {
        let bvh = bvh.clone().with_path(path);
        for ray in quads(5).positions.iter().map(|&[_, _, z]| Ray::new([0.75, 0.5, z + 1.0], [0.0, 0.0, -1.0])) {
            assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.t), Some(1.0), "{path:?} {ray:?}");
        }
    }
}

#[test]
fn parts_of_blocks_are_reached_once() {
    let bvh = build(&quads(5));
    let slot_of = |first: usize| {
        let words = node_words(&bvh.nodes.lines, NodeKind::Aligned, 0);
        words.iter().position(|&word| word == ChildWord::leaf(first, 2)).expect("the root holds all leaves")
    };
    let flaw = |slot, word| outline_or_flaw(&with_word(&bvh, 0, slot, word)).err();
    assert_eq!(
        flaw(slot_of(4), ChildWord::leaf(4, 1)),
        None,
        "another number of triangles is detected by the unused lanes"
    );
    assert_eq!(flaw(slot_of(4), ChildWord::leaf(3, 2)), Some(Flaw::Twice { unit: "part of a block", at: 3 }));
    assert_eq!(flaw(slot_of(4), ChildWord::leaf(5, 2)), Some(Flaw::Unreached { unit: "part of a block", at: 4 }));
    assert_eq!(flaw(slot_of(4), ChildWord::leaf(5, 3)), Some(Flaw::Word { word: ChildWord::leaf(5, 3).0 }));
    assert_eq!(flaw(slot_of(0), ChildWord::leaf(0, 3)), Some(Flaw::Twice { unit: "part of a block", at: 1 }));
}

/// A build states its pieces; those of a loaded BVH are found again. Where records are scattered, one piece has the same boxes.
#[test]
fn pieces_are_found_again_and_change_no_box() {
    let large = fixtures::scaffold_of(1, true, 8);
    assert!(large.triangles.len() > 4 * crate::node::MAX_SUBTREE);
    for mesh in [large, fixtures::soup(2, 20_000), fixtures::soup(1, 3), quads(5), quads(1)] {
        let bvh = build(&mesh);
        let (n_lines, n_units) = (bvh.nodes.lines.len(), bvh.leaves.halves.len());
        let found = subtrees_of(&hierarchy(&bvh), &LeafLayout::BLOCKS, bvh.nodes.root, n_lines, n_units);
        assert_eq!(found, bvh.nodes.pieces);
        assert_eq!(found.len() > 1, mesh.triangles.len() > crate::node::MAX_SUBTREE);
        let moved = shaken(&mesh, 0.05, 1).positions;
        let refitted = |pieces| {
            let mut bvh = bvh.clone();
            bvh.nodes.pieces = pieces;
            let refit = bvh.refit(&moved, &mesh.triangles).unwrap();
            (bvh, refit)
        };
        let whole = SubtreeSlots { root: bvh.nodes.root, lines: 0..n_lines, units: 0..n_units, is_above: false };
        let ((many, of_many), (one, of_one)) = (refitted(found), refitted(vec![whole]));
        assert!(many.nodes.lines == one.nodes.lines && many.leaves.halves == one.leaves.halves);
        assert_eq!(many.bounds, one.bounds);
        assert!((of_many.drift - of_one.drift).abs() <= 1e-6 * of_one.drift, "{of_many:?}, {of_one:?}");
    }
}

/// A BVH whose subtrees share their runs of memory, as no build makes it but a file may, is refitted as one piece.
#[test]
fn scattered_subtrees_are_one_piece() {
    let mesh = fixtures::scaffold_of(1, true, 8);
    let mut bvh = build(&mesh);
    let before = hierarchy(&bvh);
    let slots = before.nodes.iter().flat_map(|node| (0..8).map(move |slot| (node, slot)));
    let leaves: Vec<_> = slots.filter(|(node, slot)| matches!(node.slots[*slot], Slot::Leaf(_))).collect();
    // The first leaf and the last one belong to different pieces.
    let ((first, i), (last, j)) = (leaves[0], leaves[leaves.len() - 1]);
    let word = |node: &CheckedNode, slot: usize| {
        node_words(&bvh.nodes.lines, node.kind, u32::try_from(node.line).unwrap())[slot]
    };
    let (of_first, of_last) = (word(first, i), word(last, j));
    set_word(&mut bvh, first, i, of_last);
    set_word(&mut bvh, last, j, of_first);
    let (n_lines, n_units) = (bvh.nodes.lines.len(), bvh.leaves.halves.len());
    let found = subtrees_of(&hierarchy(&bvh), &LeafLayout::BLOCKS, bvh.nodes.root, n_lines, n_units);
    let whole = SubtreeSlots { root: bvh.nodes.root, lines: 0..n_lines, units: 0..n_units, is_above: false };
    assert_eq!(found, [whole]);
    bvh.nodes.pieces = found;
    let moved = shaken(&mesh, 0.05, 1);
    assert!(n_too_small(&bvh) > 0, "the exchanged leaves are outside of their boxes");
    bvh.refit(&moved.positions, &moved.triangles).unwrap();
    assert_eq!(n_too_small(&bvh), 0);
}
