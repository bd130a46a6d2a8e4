//! What a tree can hold, with limits small enough to be reached: just at them, and one above.

use canted_fixtures::{Mesh, soup};
use canted_lbvh::{GeometryError, Leaf, triangle_corners};
use canted_obb::{Aabb, PrimId};
use canted_trace::Watertight;

use super::Records;
use crate::{
    BoxTree, Config, MAX_PRIMITIVES, MAX_TRIANGLES, PrimitiveError, TriangleBvh,
    layout::{Limits, PART_LANES, PARTS},
};

/// Enough for some nodes below the root.
const N: usize = 300;

fn many() -> Mesh {
    soup(40, 300)
}

fn wide(mesh: &Mesh, limits: &Limits) -> Result<Records, GeometryError> {
    let built = TriangleBvh::<Watertight>::build_within(limits, &mesh.positions, &mesh.triangles, &Config::default());
    Ok(built?.records)
}

fn boxes(boxes: &[Aabb], limits: &Limits) -> Result<BoxTree, PrimitiveError> {
    BoxTree::build_within(limits, boxes, 1, &Config::default())
}

fn boxes_of(mesh: &Mesh) -> Vec<Aabb> {
    triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0.iter().map(Leaf::aabb).collect()
}

/// One part less, and one line less.
fn just_too_low(limits: Limits) -> [Limits; 2] {
    [Limits { n_parts: limits.n_parts - 1, ..limits }, Limits { n_lines: limits.n_lines - 1, ..limits }]
}

#[test]
fn triangles_fit_to_the_last_part_and_the_last_line() {
    let mesh = many();
    let free = wide(&mesh, &Limits::OF_WORDS).unwrap();
    let just = Limits { n_parts: PARTS * free.halves.len(), n_lines: free.lines.len() };
    let fitting = wide(&mesh, &just).unwrap();
    assert!(fitting.lines == free.lines && fitting.halves == free.halves);
    for limits in just_too_low(just) {
        assert!(limits.n_triangles() >= N, "what only the layout sees");
        assert_eq!(wide(&mesh, &limits).err(), Some(GeometryError::TooMany { n_triangles: N }), "{limits:?}");
    }
}

#[test]
fn boxes_fit_to_the_last_part_and_the_last_line() {
    let all = boxes_of(&many());
    let free = boxes(&all, &Limits::OF_WORDS).unwrap();
    let just = Limits { n_parts: N, n_lines: free.records.lines.len() };
    let fitting = boxes(&all, &just).unwrap();
    assert!(fitting.records.lines == free.records.lines && fitting.numbers == free.numbers);
    for limits in just_too_low(just) {
        assert_eq!(boxes(&all, &limits).err(), Some(PrimitiveError::TooMany { n_primitives: N }), "{limits:?}");
    }
}

/// Were anything looked at, a vertex would be missing and a box empty.
#[test]
fn more_than_leaves_can_name_are_told_before_the_work() {
    const TWO: Limits = Limits { n_parts: 2, ..Limits::OF_WORDS };
    let missing = |n: usize| {
        let triangles = vec![[7, 8, 9]; n];
        TriangleBvh::<Watertight>::build_within(&TWO, &[], &triangles, &Config::default()).err()
    };
    let first = GeometryError::IndexOutOfRange { triangle: PrimId(0), index: 7, n_vertices: 0 };
    let n = 2 * PART_LANES;
    assert_eq!([n, n + 1].map(missing), [Some(first), Some(GeometryError::TooMany { n_triangles: n + 1 })]);
    let empty = |n: usize| boxes(&vec![Aabb::EMPTY; n], &TWO).err();
    let first = PrimitiveError::Bounds { primitive: PrimId(0) };
    assert_eq!([2, 3].map(empty), [Some(first), Some(PrimitiveError::TooMany { n_primitives: 3 })]);
}

#[test]
fn limits_are_those_that_the_documents_say() {
    assert_eq!([MAX_TRIANGLES, MAX_PRIMITIVES, Limits::OF_WORDS.n_lines], [27, 26, 29].map(|bits| 1 << bits));
}
