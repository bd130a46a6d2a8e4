//! Limits of a BVH, made small enough to be reached: exactly, and exceeded by one.

use canted_fixtures::{Mesh, soup};
use canted_lbvh::{GeometryError, triangle_corners};
use canted_obb::{Aabb, PrimId};
use canted_trace::{Intersect, Ray};

use super::{Built, over_indexed};
use crate::leaf::{Blocks, Shapes};
use crate::node::{Limits, PART_LANES, PARTS};
use crate::{Config, MAX_PRIMITIVES, MAX_TRIANGLES, PrimitiveError, TriangleBvh, WideBvh};

/// Enough for some nodes below the root.
const N: usize = 300;

fn many() -> Mesh {
    soup(40, 300)
}

fn build(mesh: &Mesh, limits: &Limits) -> Result<Built<Blocks>, GeometryError> {
    over_indexed(limits, &mesh.positions, &mesh.triangles, &Config::default())
}

fn build_boxes(boxes: &[Aabb], limits: &Limits) -> Result<WideBvh<Aabb>, PrimitiveError> {
    WideBvh::over_within(limits, boxes.to_vec(), &Config::default())
}

fn boxes_of(mesh: &Mesh) -> Vec<Aabb> {
    let corners = triangle_corners(&mesh.positions, &mesh.triangles).unwrap().0;
    corners.into_iter().map(Aabb::from_points).collect()
}

/// One part less, and one line less.
fn just_too_low(limits: Limits) -> [Limits; 2] {
    [Limits { n_parts: limits.n_parts - 1, ..limits }, Limits { n_lines: limits.n_lines - 1, ..limits }]
}

#[test]
fn triangles_fit_exactly_at_the_limits() {
    let mesh = many();
    let free = build(&mesh, &Limits::OF_WORDS).unwrap();
    let just = Limits { n_parts: PARTS * free.leaves.halves.len(), n_lines: free.nodes.lines.len() };
    let fitting = build(&mesh, &just).unwrap();
    assert!(fitting.nodes.lines == free.nodes.lines && fitting.leaves.halves == free.leaves.halves);
    for limits in just_too_low(just) {
        assert!(limits.n_triangles() >= N, "only the layout can notice");
        assert_eq!(build(&mesh, &limits).err(), Some(GeometryError::TooMany { n_triangles: N }), "{limits:?}");
    }
}

#[test]
fn boxes_fit_exactly_at_the_limits() {
    let all = boxes_of(&many());
    let free = build_boxes(&all, &Limits::OF_WORDS).unwrap();
    let just = Limits { n_parts: N, n_lines: free.nodes.lines.len() };
    let fitting = build_boxes(&all, &just).unwrap();
    assert!(fitting.nodes.lines == free.nodes.lines && fitting.leaves.order == free.leaves.order);
    for limits in just_too_low(just) {
        assert_eq!(build_boxes(&all, &limits).err(), Some(PrimitiveError::TooMany { n_primitives: N }), "{limits:?}");
    }
}

/// Triangles without vertices and empty boxes would be other errors, if they were read.
#[test]
fn too_many_primitives_are_rejected_before_they_are_read() {
    const TWO: Limits = Limits { n_parts: 2, ..Limits::OF_WORDS };
    let missing = |n: usize| {
        let mesh = Mesh { positions: vec![], triangles: vec![[7, 8, 9]; n] };
        build(&mesh, &TWO).err()
    };
    let first = GeometryError::IndexOutOfRange { triangle: PrimId(0), index: 7, n_vertices: 0 };
    let n = 2 * PART_LANES;
    assert_eq!([n, n + 1].map(missing), [Some(first), Some(GeometryError::TooMany { n_triangles: n + 1 })]);
    let empty = |n: usize| build_boxes(&vec![Aabb::EMPTY; n], &TWO).err();
    let first = PrimitiveError::Bounds { primitive: PrimId(0) };
    assert_eq!([2, 3].map(empty), [Some(first), Some(PrimitiveError::TooMany { n_primitives: 3 })]);
}

#[test]
fn limits_are_the_documented_ones() {
    assert_eq!([MAX_TRIANGLES, MAX_PRIMITIVES, Limits::OF_WORDS.n_lines], [27, 26, 29].map(|bits| 1 << bits));
}

#[test]
fn parts_of_triangles_lose_no_hit_and_cost_less() {
    let mut n_extra = 0;
    for mesh in [soup(4, 2_000), canted_fixtures::scaffold_of(1, true, 4), canted_fixtures::scaffold_of(2, false, 4)] {
        let whole = TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap();
        let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
        let spatial = canted_sah::SpatialConfig { extra_references: 1.0, min_overlap: 0.0, ..Default::default() };
        let (mut tree, references) = canted_sah::spatial(&corners, &spatial);
        n_extra += references.primitives.len() - corners.len();
        let parts: Vec<Aabb> = tree.leaves.iter().map(|part| references.boxes[part.index()]).collect();
        tree.leaves.iter_mut().for_each(|leaf| *leaf = references.primitives[leaf.index()]);
        let config = Config { oriented: false, ..Config::default() };
        let of_whole = TriangleBvh::from_tree(&tree, &corners, &bounds, config).unwrap();
        let of_parts = TriangleBvh::from_tree_of_parts(&tree, parts, &corners, &bounds, config).unwrap();
        assert!(of_parts.predicted().chosen <= 1.001 * of_whole.predicted().chosen);
        let mut n_hits = 0;
        for view in canted_fixtures::object_views(&mesh) {
            for ray in view.rays(32) {
                let ray = Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) };
                let hit = whole.closest_hit(&ray);
                assert_eq!(of_parts.closest_hit(&ray), hit);
                n_hits += usize::from(hit.is_some());
            }
        }
        assert!(n_hits > 100, "{n_hits}");
    }
    assert!(n_extra > 100, "{n_extra} splits");
}

#[test]
fn primitives_have_the_order_of_the_leaves_and_answer_by_number() {
    let all = boxes_of(&many());
    let bvh = build_boxes(&all, &Limits::OF_WORDS).unwrap();
    assert!(bvh.leaves.order.iter().enumerate().any(|(place, id)| place != id.index()), "the order is another one");
    let check = |leaves: &Shapes<Aabb>| {
        let by_place = |(place, id): (usize, &PrimId)| *leaves.at(place) == all[id.index()];
        leaves.order.iter().enumerate().all(by_place)
            && leaves.in_input_order().into_iter().eq(&all)
            && leaves.eight(1).is_none_or(|eight| eight.iter().eq(leaves.order[1..9].iter().map(|id| &all[id.index()])))
    };
    let mut leaves = bvh.leaves.clone();
    assert!(leaves.is_sorted() && leaves.eight(N - 8).is_some() && leaves.eight(N - 7).is_none() && check(&leaves));
    leaves.unsort();
    assert!(!leaves.is_sorted() && leaves.primitives == all && check(&leaves));
    // Where memory of leaves is unused.
    leaves.order.push(PrimId(0));
    leaves.sort();
    assert!(!leaves.is_sorted() && check(&leaves));
    // The check finds an order that is not that of the primitives.
    let mut wrong = bvh.leaves;
    wrong.order.swap(0, 1);
    assert!(!check(&wrong));
}
