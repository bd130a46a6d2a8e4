//! Whether records read from a file are such as a build makes.

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};

use super::LoadError;
use crate::emit::Records;
use crate::layout::NodeKind;
use crate::refit::{self, Flaw, Outline, Triangles};
use crate::traverse::MeshFrame;

/// How often, on average, a triangle may lie in leaning boxes: more than the depth of any tree that a builder makes,
/// few enough that a file is checked in time proportional to its length.
const MOST_NESTED: u64 = 4_096;

/// What the header promises of the records.
pub(super) struct Promise {
    pub(super) n_triangles: usize,
    pub(super) depth: u32,
    pub(super) bounds: Aabb,
    pub(super) frame: [[f32; 3]; 3],
}

/// Refuses records that could panic, loop, lose a hit, or report one that is not there.
///
/// Words lead to every record once. Boxes are compared with those that a refit writes for the same vertices: it does so
/// as a build does, so they are equal, and what is proven of built boxes holds for loaded ones.
pub(super) fn check(records: &Records, promise: &Promise) -> Result<(), LoadError> {
    let frame = MeshFrame::new(promise.frame);
    promise.frame.iter().try_for_each(|&row| refit::check_row(row, None))?;
    let outline = Outline::of(records)?;
    if outline.depth != promise.depth {
        return Err(LoadError::Depth { told: promise.depth, found: outline.depth });
    }
    check_nested(&outline)?;
    check_lanes(&outline, records)?;
    let triangles = Triangles::read(&outline, &records.halves);
    check_triangles(&triangles, promise.n_triangles)?;
    let bounds = Aabb::from_points(triangles.corners.iter().flatten().copied());
    if bounds != promise.bounds {
        return Err(LoadError::Bounds { told: promise.bounds, found: bounds });
    }
    check_boxes(&outline, &triangles.corners, &frame, records)
}

fn check_nested(outline: &Outline) -> Result<(), Flaw> {
    let leaning = outline.nodes.iter().filter(|node| node.kind != NodeKind::Aligned);
    let n_inside = leaning.map(|node| node.places.len() as u64).sum();
    let most = MOST_NESTED.saturating_mul(outline.n_places as u64);
    if n_inside > most { Err(Flaw::Nested { n_inside, most }) } else { Ok(()) }
}

fn check_lanes(outline: &Outline, records: &Records) -> Result<(), Flaw> {
    match outline.leaves.iter().find(|leaf| !refit::unused_lanes_are_zero(leaf, &records.halves)) {
        Some(leaf) => Err(Flaw::Lane { block: leaf.half() }),
        None => Ok(()),
    }
}

/// Vertices are finite; every number is there, and always with the same vertices.
fn check_triangles(triangles: &Triangles, n_triangles: usize) -> Result<(), LoadError> {
    let n_places = triangles.primitives.len();
    // Before anything of a size that only the header tells is allocated.
    if n_triangles > n_places {
        return Err(LoadError::Count { n_told: n_triangles as u64, n_places });
    }
    let mut seen: Vec<Option<&Corners>> = vec![None; n_triangles];
    for (&primitive, corners) in triangles.primitives.iter().zip(&triangles.corners) {
        let Some(first) = seen.get_mut(primitive.index()) else {
            return Err(Flaw::Primitive { primitive, n_triangles }.into());
        };
        if !corners.as_flattened().iter().all(|x| x.is_finite()) {
            return Err(Flaw::NotFinite { primitive }.into());
        }
        let bits = |corners: &Corners| corners.map(|vertex| vertex.map(f32::to_bits));
        if first.is_some_and(|first| bits(first) != bits(corners)) {
            return Err(Flaw::Different { primitive }.into());
        }
        *first = Some(corners);
    }
    match (0..).map(PrimId).zip(&seen).find(|(_, seen)| seen.is_none()) {
        Some((primitive, _)) => Err(Flaw::Missing { primitive }.into()),
        None => Ok(()),
    }
}

fn check_boxes(outline: &Outline, corners: &[Corners], frame: &MeshFrame, records: &Records) -> Result<(), LoadError> {
    for node in &outline.nodes {
        refit::check_frame(node, &records.lines)?;
    }
    let mut right = records.lines.clone();
    refit::write_boxes(outline, corners, frame, &mut right);
    for node in &outline.nodes {
        refit::compare(node, &records.lines, &right)?;
    }
    Ok(())
}
