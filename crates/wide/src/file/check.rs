//! Whether records read from a file are those that a build makes.

use canted_lbvh::Corners;
use canted_obb::vector::{dot, to_f64};
use canted_obb::{Aabb, PrimId};
use canted_trace::{ReferencePoint, TriangleTest};

use super::error::LoadError;
use super::header::Header;
use crate::build::item::Item;
use crate::build::{PrimitiveError, bounds_of, reference_of_triangles};
use crate::leaf::{self, Primitive, Shapes, StoredTriangles};
use crate::node::checked::{CheckedNode, Hierarchy};
use crate::node::{CacheLine, Flaw, HalfBlock, LeafLayout, NodeBox, NodeKind, Nodes, Row, checked};
use crate::traverse::{BoxPads, MeshFrame, Pads};
use crate::update::{self, by_place, ids_by_place};

/// How many oriented boxes may hold a primitive, on average: more than the depth of any binary tree that a builder makes,
/// few enough that a file is checked in time proportional to its length.
const MOST_NESTED: u64 = 4_096;

/// What the header states about the records.
pub(super) struct Expected {
    pub(super) n_primitives: usize,
    depth: u32,
    pub(super) bounds: Aabb,
    pub(super) frame: MeshFrame,
    /// With which the file was written, and with which it is traced.
    pads: [BoxPads; 2],
}

impl Expected {
    /// `hit_error` is that of the primitives, `is_local` whether it holds relative to every point.
    pub(super) fn of(header: &Header, hit_error: f32, is_local: bool) -> Result<Self, LoadError> {
        header.frame.iter().try_for_each(|&row| update::check_row(row, None))?;
        let Ok(n_primitives) = usize::try_from(header.n_primitives) else {
            return Err(LoadError::Count { n_expected: header.n_primitives, n_found: 0 });
        };
        let error = header.hit_error;
        // Also rejects NaN.
        if !(0.0..=0.125).contains(&error) {
            return Err(LoadError::HitError { found: error });
        }
        let reference = ReferencePoint::new(header.reference).filter(|reference| is_local || reference.is_origin());
        let frame = MeshFrame::new(header.frame, reference.ok_or(LoadError::Reference { found: header.reference })?);
        let pads = [error, hit_error].map(|error| BoxPads::new(Pads::of(error), frame.is_identity));
        Ok(Self { n_primitives, depth: header.depth, bounds: header.bounds, frame, pads })
    }
}

/// Rejects records that could panic, loop, lose a hit, or report one that does not exist.
///
/// References reach every record once. Boxes are compared with those that a refit writes for the same primitives: it writes
/// those of a build, so they are equal, and what is proven of built boxes holds for loaded ones.
pub(super) fn check_triangles(nodes: &mut Nodes, blocks: &[HalfBlock], expected: &Expected) -> Result<(), LoadError> {
    let hierarchy = hierarchy(nodes, blocks.len(), &LeafLayout::BLOCKS, expected)?;
    if let Some(leaf) = hierarchy.leaves.iter().find(|leaf| !leaf::unused_lanes_are_zero(leaf, blocks)) {
        return Err(Flaw::Lane { block: leaf.unit(&LeafLayout::BLOCKS) }.into());
    }
    let StoredTriangles { corners, ids } = StoredTriangles::read(&hierarchy, blocks);
    if let Some((&primitive, _)) = ids.iter().zip(&corners).find(|(_, corners)| !is_finite(corners)) {
        return Err(Flaw::NotFinite { primitive }.into());
    }
    let bits = |corners: &Corners| corners.map(|vertex| vertex.map(f32::to_bits));
    check_ids(&ids, expected, |a, b| bits(&corners[a]) == bits(&corners[b]))?;
    let bounds = Aabb::from_points(corners.iter().flatten().copied());
    check_boxes(&hierarchy, &corners, bounds, expected, nodes)
}

/// The same for primitives of the caller.
pub(super) fn check_shapes<P: Primitive>(
    nodes: &mut Nodes,
    leaves: &Shapes<P>,
    expected: &Expected,
) -> Result<(), LoadError> {
    let hierarchy = hierarchy(nodes, leaves.order.len(), &LeafLayout::IDS, expected)?;
    let ids = ids_by_place(&hierarchy, &leaves.order);
    check_ids(&ids, expected, |_, _| true)?;
    let bounds = match bounds_of(&leaves.primitives) {
        Ok(bounds) => bounds,
        Err(PrimitiveError::Bounds { primitive }) => return Err(Flaw::NotFinite { primitive }.into()),
        Err(PrimitiveError::TooMany { .. }) => unreachable!("leaves hold as many"),
    };
    check_boxes(&hierarchy, &by_place(&ids, &leaves.primitives), bounds, expected, nodes)
}

/// The hierarchy of the records; completes `nodes` by it.
fn hierarchy(
    nodes: &mut Nodes,
    n_units: usize,
    layout: &LeafLayout,
    expected: &Expected,
) -> Result<Hierarchy, LoadError> {
    let hierarchy = completed(nodes, n_units, layout)?;
    if hierarchy.depth != expected.depth {
        return Err(LoadError::Depth { expected: expected.depth, found: hierarchy.depth });
    }
    Ok(hierarchy)
}

/// The hierarchy of the records; completes `nodes` by it, except for the depth.
fn completed(nodes: &mut Nodes, n_units: usize, layout: &LeafLayout) -> Result<Hierarchy, LoadError> {
    let hierarchy = Hierarchy::of(nodes, n_units, layout)?;
    let oriented = hierarchy.nodes.iter().filter(|node| node.kind == NodeKind::Oriented);
    let n_inside = oriented.map(|node| node.places.len() as u64).sum();
    let most = MOST_NESTED.saturating_mul(hierarchy.n_places as u64);
    if n_inside > most {
        return Err(Flaw::Nested { n_inside, most }.into());
    }
    nodes.has_oriented = hierarchy.nodes.iter().any(|node| node.kind == NodeKind::Oriented);
    nodes.pieces = checked::subtrees_of(&hierarchy, layout, nodes.root, nodes.lines.len(), n_units);
    Ok(hierarchy)
}

fn is_finite(corners: &Corners) -> bool {
    corners.as_flattened().iter().all(|x| x.is_finite())
}

/// Every id is in a leaf, and `is_same` for all places that hold it.
fn check_ids(ids: &[PrimId], expected: &Expected, is_same: impl Fn(usize, usize) -> bool) -> Result<(), LoadError> {
    let Expected { n_primitives, .. } = *expected;
    // Before anything of a size that only the header gives is allocated.
    if n_primitives > ids.len() {
        return Err(LoadError::Count { n_expected: n_primitives as u64, n_found: ids.len() });
    }
    let mut first_places: Vec<Option<usize>> = vec![None; n_primitives];
    for (place, &primitive) in ids.iter().enumerate() {
        let Some(first) = first_places.get_mut(primitive.index()) else {
            return Err(Flaw::Primitive { primitive, n_primitives }.into());
        };
        if first.is_some_and(|first| !is_same(first, place)) {
            return Err(Flaw::Different { primitive }.into());
        }
        *first = Some(place);
    }
    match (0..).map(PrimId).zip(&first_places).find(|(_, place)| place.is_none()) {
        Some((primitive, _)) => Err(Flaw::Missing { primitive }.into()),
        None => Ok(()),
    }
}

fn check_boxes<I: Item>(
    hierarchy: &Hierarchy,
    items: &[I],
    bounds: Aabb,
    expected: &Expected,
    nodes: &mut Nodes,
) -> Result<(), LoadError> {
    if bounds != expected.bounds {
        return Err(LoadError::Bounds { expected: expected.bounds, found: bounds });
    }
    hierarchy.nodes.iter().try_for_each(|node| update::check_frame(node, &nodes.lines))?;
    let mut right = nodes.lines.to_vec();
    let [written, traced] = &expected.pads;
    update::write_boxes(hierarchy, items, &expected.frame, written, &mut right);
    hierarchy.nodes.iter().try_for_each(|node| update::compare(node, &nodes.lines, &right))?;
    if traced != written {
        update::write_boxes(hierarchy, items, &expected.frame, traced, &mut nodes.lines);
    }
    Ok(())
}

/// Completes records that were made elsewhere, in object space and without the pads of this crate.
///
/// Boxes must hold the triangles below them. Then they are written as a refit writes them, along the same axes.
pub(super) fn complete_made(
    nodes: &mut Nodes,
    blocks: &[HalfBlock],
    frame: [[f32; 3]; 3],
    test: TriangleTest,
) -> Result<Expected, LoadError> {
    frame.iter().try_for_each(|&row| update::check_row(row, None))?;
    let hierarchy = completed(nodes, blocks.len(), &LeafLayout::BLOCKS)?;
    nodes.depth = hierarchy.depth;
    let StoredTriangles { corners, ids } = StoredTriangles::read(&hierarchy, blocks);
    if let Some((&primitive, _)) = ids.iter().zip(&corners).find(|(_, corners)| !is_finite(corners)) {
        return Err(Flaw::NotFinite { primitive }.into());
    }
    let bounds = Aabb::from_points(corners.iter().flatten().copied());
    hierarchy
        .nodes
        .iter()
        .try_for_each(|node| check_held(&hierarchy, node, (&nodes.lines, frame), &corners, &bounds))?;
    hierarchy.nodes.iter().for_each(|node| shorten_rows(node, &mut nodes.lines));
    hierarchy.nodes.iter().try_for_each(|node| update::check_frame(node, &nodes.lines))?;
    let reference = reference_of_triangles(corners.len(), |i| corners[i]);
    let frame = MeshFrame::new(frame, reference);
    let pads = BoxPads::new(Pads::of(test.hit_error()), frame.is_identity);
    let mut sorted = ids.clone();
    sorted.sort_unstable();
    sorted.dedup();
    if let Some((primitive, _)) = (0..).map(PrimId).zip(&sorted).find(|(primitive, found)| primitive != *found) {
        return Err(Flaw::Missing { primitive }.into());
    }
    let n_primitives = sorted.len();
    update::write_boxes(&hierarchy, &corners, &frame, &pads, &mut nodes.lines);
    let expected = Expected { n_primitives, depth: hierarchy.depth, bounds, frame, pads: [pads; 2] };
    let bits = |corners: &Corners| corners.map(|vertex| vertex.map(f32::to_bits));
    check_ids(&ids, &expected, |a, b| bits(&corners[a]) == bits(&corners[b]))?;
    Ok(expected)
}

/// Whether the boxes of a node hold the triangles below them, but for a rounding of their numbers.
fn check_held(
    hierarchy: &Hierarchy,
    node: &CheckedNode,
    (lines, frame): (&[CacheLine], [[f32; 3]; 3]),
    corners: &[Corners],
    bounds: &Aabb,
) -> Result<(), Flaw> {
    let slack = f64::from(f32::EPSILON) * f64::from(bounds.reach());
    for (i, &slot) in node.slots.iter().enumerate() {
        let NodeBox { rows, lo, hi } = NodeBox::of_slot(lines, node.kind, node.line as u32, i, frame);
        let holds = |vertex: &[f32; 3]| {
            (0..3).all(|k| {
                let at = dot(to_f64(rows[k]), to_f64(*vertex));
                // False for NaN, too.
                lo[k] - slack <= at && at <= hi[k] + slack
            })
        };
        if !corners[hierarchy.places(slot)].iter().flatten().all(holds) {
            return Err(Flaw::Box { line: node.line, slot: i });
        }
    }
    Ok(())
}

/// Divides rows that are longer than those of a build by their length: devices divide less exactly.
fn shorten_rows(node: &CheckedNode, lines: &mut [CacheLine]) {
    if node.kind == NodeKind::Aligned {
        return;
    }
    let rows: &mut [Row] = bytemuck::cast_slice_mut(&mut lines[node.line..node.line + node.kind.n_lines()]);
    #[expect(clippy::needless_range_loop, reason = "a lane of several rows")]
    for i in 0..8 {
        for k in 0..3 {
            let row: [f32; 3] = std::array::from_fn(|axis| rows[5 * k + axis][i]);
            let length = dot(to_f64(row), to_f64(row)).sqrt();
            if update::check_row(row, None).is_err() && length.is_finite() {
                (0..3).for_each(|axis| rows[5 * k + axis][i] = (f64::from(row[axis]) / length) as f32);
            }
        }
    }
}
