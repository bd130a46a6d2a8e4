//! What a picture is about: a scene without the floor that it stands on and without small things far away.
//!
//! ```text
//! triangles -> connected pieces, with box and area -> without floors -> without strays -> box
//! ```

use std::collections::HashMap;

use canted_obb::Aabb;
use canted_scene::{Mesh, Scene};
use glam::DVec3;

use super::fit::for_each_vertex;
use super::turn::Turn;
use crate::{narrow, wide};

/// What is left of a scene without floors and strays.
pub(super) struct Rest {
    /// Local bounds.
    pub(super) bounds: Aabb,
    /// Whether the scene has a floor that is wider than what stands on it.
    pub(super) has_floor: bool,
    /// Connected pieces of the whole scene.
    pub(super) n_pieces: usize,
}

/// Finds what a scene is about.
pub(super) fn rest(scene: &Scene, turn: Turn) -> Rest {
    let pieces = pieces(scene, turn);
    let n_pieces = pieces.len();
    let (rest, floors) = without_floors(pieces);
    let has_floor = !floors.is_empty();
    let bounds = bounds_of(&without_strays(rest));
    Rest { bounds, has_floor, n_pieces }
}

/// Connected triangles of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    /// Local bounds.
    bounds: Aabb,
    /// Area of all triangles in square world units; of a sheared instance approximately.
    area: f64,
}

fn bounds_of(pieces: &[Piece]) -> Aabb {
    pieces.iter().fold(Aabb::EMPTY, |all, piece| all.union(piece.bounds))
}

fn longest(bounds: &Aabb) -> f64 {
    DVec3::from(bounds.extent()).max_element()
}

/// Triangles up to which a mesh is divided into connected pieces, and vertices up to which equal positions connect.
const MAX_TRIANGLES: usize = 1 << 21;
const MAX_WELDED: usize = 1 << 18;

/// The pieces of all instances, in local coordinates.
fn pieces(scene: &Scene, turn: Turn) -> Vec<Piece> {
    let meshes: Vec<Connected> = scene.meshes.iter().map(Connected::new).collect();
    let mut first = Vec::with_capacity(scene.instances.len());
    let mut pieces = Vec::new();
    for instance in &scene.instances {
        first.push(pieces.len());
        // The mean factor of areas.
        let scale = instance.world_from_object.determinant().abs().cbrt().powi(2);
        let areas = &meshes[instance.mesh.0 as usize].areas;
        pieces.extend(areas.iter().map(|area| Piece { bounds: Aabb::EMPTY, area: area * scale }));
    }
    for_each_vertex(scene, |(instance, vertex), point| {
        let label = meshes[scene.instances[instance].mesh.0 as usize].labels[vertex] as usize;
        pieces[first[instance] + label].bounds.grow(narrow(turn.to_local(point)));
    });
    // Of the ground that was added, no vertex is visited.
    pieces.retain(|piece| !piece.bounds.is_empty());
    pieces
}

/// A mesh divided into connected pieces.
struct Connected {
    /// The piece of each vertex that triangles use.
    labels: Vec<u32>,
    /// The area of each piece in square object units.
    areas: Vec<f64>,
}

impl Connected {
    fn new(mesh: &Mesh) -> Self {
        let mut parents: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        // Curves are one piece.
        let is_divided = mesh.triangles.len() <= MAX_TRIANGLES && mesh.curves.is_none();
        if !is_divided {
            parents.fill(0);
        } else if mesh.positions.len() <= MAX_WELDED {
            // Vertices are separate where normals or texture coordinates differ.
            let mut known = HashMap::with_capacity(mesh.positions.len());
            for (vertex, position) in (0..).zip(&mesh.positions) {
                // The sum makes negative zero positive.
                let first = *known.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(vertex);
                parents[vertex as usize] = first;
            }
        }
        if is_divided {
            for &[a, b, c] in &mesh.triangles {
                join(&mut parents, a, b);
                join(&mut parents, a, c);
            }
        }
        let mut labels = vec![u32::MAX; parents.len()];
        let mut areas = Vec::new();
        for &triangle in &mesh.triangles {
            let root = root(&mut parents, triangle[0]) as usize;
            if labels[root] == u32::MAX {
                labels[root] = areas.len() as u32;
                areas.push(0.0);
            }
            let label = labels[root];
            let [a, b, c] = triangle.map(|i| wide(mesh.positions[i as usize]));
            areas[label as usize] += 0.5 * (b - a).cross(c - a).length();
        }
        if let Some(curves) = &mesh.curves {
            labels.fill(0);
            // The area of the shadow of each chord, twice: that of a cylinder but for pi.
            let is_surface = mesh.has_patches();
            let radius = |i: u32| f64::from(curves.radii[i as usize]);
            let chord = |i: u32, k: u32| wide(mesh.positions[i as usize]).distance(wide(mesh.positions[k as usize]));
            let indices = curves.segments.indices().windows(2).map(|pair| chord(pair[0], pair[1]) * radius(pair[0]));
            // Patches have an area instead: about that of the square over the mean step of their control points.
            let rows = curves.segments.indices().chunks(4);
            let steps = rows.flat_map(|row| row.windows(2)).map(|pair| chord(pair[0], pair[1]).powi(2));
            areas.push(if is_surface { steps.sum() } else { indices.sum() });
            return Self { labels, areas };
        }
        for vertex in 0..parents.len() as u32 {
            labels[vertex as usize] = labels[root(&mut parents, vertex) as usize];
        }
        Self { labels, areas }
    }
}

/// The representative of a vertex; halves the path to it.
fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        let above = parents[parents[vertex as usize] as usize];
        parents[vertex as usize] = above;
        vertex = above;
    }
    vertex
}

/// Joins the sets of two vertices; the lower representative stays.
fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

/// The pieces without floors, and the floors: flat pieces below all others, and wider. A wall is skipped only together with a floor.
fn without_floors(pieces: Vec<Piece>) -> (Vec<Piece>, Vec<Piece>) {
    /// Thickness of a flat piece relative to its longest side.
    const FLAT: f64 = 0.03;
    /// How much longer than all others a floor is.
    const WIDE: f64 = 3.0;
    /// The part of the height of the others up to which a floor may reach.
    const LOW: f64 = 0.25;
    let extent = |piece: &Piece| DVec3::from(piece.bounds.extent());
    let is_flat = |piece: &Piece| extent(piece).min_element() <= FLAT * longest(&piece.bounds);
    let (mut flat, mut rest): (Vec<Piece>, Vec<Piece>) = pieces.into_iter().partition(is_flat);
    // Text and signs are flat, too.
    flat.sort_by(|a, b| longest(&a.bounds).total_cmp(&longest(&b.bounds)));
    let (mut floors, mut walls) = (Vec::new(), Vec::new());
    let mut all = bounds_of(&rest);
    for piece in flat {
        let is_horizontal = extent(&piece).y <= FLAT * longest(&piece.bounds);
        let is_low = f64::from(piece.bounds.max[1]) <= f64::from(all.min[1]) + LOW * all.extent()[1];
        let is_wide = !rest.is_empty() && longest(&piece.bounds) >= WIDE * longest(&all);
        match (is_wide, is_horizontal) {
            (true, true) if is_low => floors.push(piece),
            (true, false) => walls.push(piece),
            _ => {
                all = all.union(piece.bounds);
                rest.push(piece);
            }
        }
    }
    if floors.is_empty() {
        rest.append(&mut walls);
    }
    (rest, floors)
}

/// The pieces without those that are far from the piece with the greatest area and all that is near it, if they are small.
fn without_strays(pieces: Vec<Piece>) -> Vec<Piece> {
    /// Distance relative to the diagonal of what is near, up to which a piece is near, too.
    const NEAR: f64 = 0.75;
    /// How much larger the scene is with strays, and their greatest part of the area: the smaller they make the rest in the picture, the more.
    const STRAYS: [(f64, f64); 2] = [(3.0, 0.1), (10.0, 0.4)];
    let Some(greatest) = pieces.iter().copied().max_by(|a, b| a.area.total_cmp(&b.area)) else { return pieces };
    let all = bounds_of(&pieces);
    let mut near = greatest.bounds;
    let (mut kept, mut far) = (Vec::new(), pieces.clone());
    loop {
        let reach = NEAR * DVec3::from(near.extent()).length();
        let n_before = far.len();
        let (next, others): (Vec<Piece>, Vec<Piece>) =
            far.into_iter().partition(|piece| distance(&near, &piece.bounds) <= reach);
        near = near.union(bounds_of(&next));
        kept.extend(next);
        far = others;
        if far.len() == n_before || far.is_empty() {
            break;
        }
    }
    let area = |pieces: &[Piece]| pieces.iter().map(|piece| piece.area).sum::<f64>();
    let part = area(&far) / area(&pieces).max(f64::MIN_POSITIVE);
    let grows = longest(&all) / longest(&near).max(f64::MIN_POSITIVE);
    if STRAYS.iter().any(|&(least, most)| grows >= least && part <= most) {
        return kept;
    }
    pieces
}

/// Distance between two boxes.
fn distance(a: &Aabb, b: &Aabb) -> f64 {
    let [gap, opposite] = [wide(b.min) - wide(a.max), wide(a.min) - wide(b.max)];
    gap.max(opposite).max(DVec3::ZERO).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(min: [f32; 3], max: [f32; 3]) -> Piece {
        let bounds = Aabb { min, max };
        Piece { bounds, area: bounds.area() }
    }

    /// A cube of side 1 on the plane y = 0.
    fn cube() -> Piece {
        piece([0.0; 3], [1.0; 3])
    }

    #[test]
    fn floors_are_flat_low_and_wide() {
        let floor = |half: f32, y: f32, thickness: f32| piece([-half, y - thickness, -half], [half, y, half]);
        for (flat, is_floor) in [
            (floor(50.0, 0.0, 0.0), true),
            (floor(50.0, 0.0, 1.0), true),
            (floor(5.0, -3.0, 0.0), true),
            // A base plate, a terrain, and a roof.
            (floor(0.7, 0.0, 0.0), false),
            (floor(50.0, 0.0, 10.0), false),
            (floor(50.0, 1.0, 0.0), false),
        ] {
            let (rest, floors) = without_floors(vec![flat, cube()]);
            assert_eq!((rest.len(), floors.len()), if is_floor { (1, 1) } else { (2, 0) }, "{flat:?}");
        }
        let wall = piece([-50.0, 0.0, -9.0], [50.0, 30.0, -9.0]);
        assert_eq!(without_floors(vec![wall, cube()]).0.len(), 2, "a poster");
        assert_eq!(without_floors(vec![wall, floor(50.0, 0.0, 0.0), cube()]).0, [cube()], "a studio");
        assert_eq!(without_floors(vec![floor(50.0, 0.0, 0.0)]).0.len(), 1, "nothing else is there");
    }

    #[test]
    fn strays_are_far_and_small() {
        let other = |x: f32, size: f32| piece([x, 0.0, 0.0], [x + size, size, size]);
        for (other, is_stray) in [
            (other(200.0, 0.1), true),
            (other(5.0, 0.1), true),
            (other(200.0, 0.7), true),
            // Near, as large, and larger than a stray at its distance.
            (other(2.0, 0.1), false),
            (other(200.0, 1.0), false),
            (other(4.0, 0.7), false),
        ] {
            let left = without_strays(vec![cube(), other]);
            assert_eq!(left.len(), if is_stray { 1 } else { 2 }, "{other:?}");
        }
        // A row, each near the last one.
        let row: Vec<Piece> = (0_u8..40).map(|i| other(2.0 * f32::from(i), 1.0)).collect();
        assert_eq!(without_strays(row.clone()), row);
    }

    /// Two tetrahedra in one mesh, with a vertex for each corner of each triangle.
    #[test]
    fn pieces_connect_at_equal_positions() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -0.0]];
        let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
        let of = |x: f32| faces.into_iter().flatten().map(move |i: usize| [corners[i][0] + x, corners[i][1], i as f32]);
        let positions: Vec<[f32; 3]> = of(0.0).chain(of(9.0)).collect();
        let triangles = (0..8).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let connected = Connected::new(&Mesh { positions, triangles, ..Mesh::default() });
        assert_eq!(connected.areas.len(), 2);
        assert!(
            connected.labels[..12].iter().all(|&label| label == 0) && connected.labels[12..].iter().all(|&l| l == 1)
        );
        assert!((connected.areas[0] - connected.areas[1]).abs() < 1e-9);
    }
}
