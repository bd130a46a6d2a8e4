//! Closed meshes, their placements, and rays that must not pass through the surface without a hit.

use canted_fixtures::{Mesh, Rotation, SplitMix64, displaced_icosphere, icosphere, thin_box, torus};
use canted_obb::Affine;
use canted_trace::Ray;

use crate::vector::{cross, dot};

/// A closed mesh, star-shaped around `inner_point` except for the torus.
pub struct Closed {
    /// Name for messages.
    pub name: &'static str,
    /// The mesh.
    pub mesh: Mesh,
    /// A point inside.
    pub inner_point: [f64; 3],
    /// Every point within this distance of `inner_point`, along each axis, is inside.
    pub clearance: [f64; 3],
    /// Whether the surface does not intersect itself, so that crossings alternate between entering and leaving.
    pub is_simple: bool,
}

/// One mesh of each closed shape.
#[must_use]
pub fn closed() -> Vec<Closed> {
    let origin = [0.0; 3];
    vec![
        Closed { name: "icosphere", mesh: icosphere(2), inner_point: origin, clearance: [0.5; 3], is_simple: true },
        Closed {
            name: "displaced icosphere",
            mesh: displaced_icosphere(3, 2),
            inner_point: origin,
            clearance: [0.4; 3],
            is_simple: true,
        },
        Closed {
            name: "torus",
            mesh: torus(24, 8),
            inner_point: [1.0, 0.0, 0.0],
            clearance: [0.2; 3],
            is_simple: true,
        },
        Closed {
            name: "thin box",
            mesh: thin_box(0.01),
            inner_point: origin,
            clearance: [0.4, 0.4, 0.004],
            is_simple: true,
        },
    ]
}

/// A transform of a closed mesh.
pub struct Placement {
    /// Name for messages.
    pub name: &'static str,
    /// The transform.
    pub world_from_object: Affine,
}

/// Identity, rotated, tiny, huge, far away, sheared and mirrored.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
pub fn placements() -> Vec<Placement> {
    let placement = |name, turn: Rotation, scale: [f64; 3], shift: f32| {
        let column = |j: usize| turn.rows.map(|row| (row[j] * scale[j]) as f32);
        Placement {
            name,
            world_from_object: Affine { columns: [column(0), column(1), column(2), [shift, -shift, shift]] },
        }
    };
    let mut sheared = placement("sheared and mirrored", Rotation::off_axis(), [1.0, -0.5, 2.0], 0.3);
    sheared.world_from_object.columns[1][0] += 0.7;
    vec![
        placement("unchanged", Rotation::IDENTITY, [1.0; 3], 0.0),
        placement("at 1e-6, rotated", Rotation::off_axis(), [1e-6; 3], 0.0),
        placement("at 1e6, rotated", Rotation::off_axis(), [1e6; 3], 0.0),
        // Adjacent f32 values are 1 apart here, and the thin box is 20 thick.
        placement("at 1e7", Rotation::off_axis(), [2e3; 3], 1e7),
        sheared,
    ]
}

/// The mesh in world space with rounded vertices; neighbors still share them.
#[must_use]
pub fn baked(mesh: &Mesh, world_from_object: &Affine) -> Mesh {
    let positions = mesh.positions.iter().map(|&p| world_from_object.point(p)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

/// Whether a transform swaps inside and outside.
#[must_use]
pub fn mirrors(placement: &Affine) -> bool {
    let [a, b, c, _] = placement.columns.map(|column| column.map(f64::from));
    dot(a, cross(b, c)) < 0.0
}

/// `a + by·(b - a)`.
fn between(a: [f64; 3], b: [f64; 3], by: f64) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + by * (b[k] - a[k]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Rays through a vertex or an edge of `mesh` (in world space). Even rays start inside; odd ones start far outside and pass
/// through the edge to a point inside.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "rays are rounded like everything")]
pub fn rays(mesh: &Mesh, closed: &Closed, world_from_object: &Affine, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    // Computed once, because it visits every triangle.
    let diagonal = mesh.diagonal();
    (0..n)
        .map(|i| {
            // A third start at the inner point itself, where coordinates repeat and rays hit vertices exactly.
            let offset = if i % 3 == 0 { [0.0; 3] } else { rng.signed3() };
            let inside_object = std::array::from_fn(|k| closed.inner_point[k] + offset[k] * closed.clearance[k]);
            let inside = world_from_object.point_f64(inside_object);
            let corners = mesh.corners(rng.below(mesh.triangles.len()));
            let first = rng.below(3);
            let along_edge = [0.0, 0.5, rng.unit()][i / 2 % 3];
            let target = between(corners[first], corners[(first + 1) % 3], along_edge);
            // The mesh ends within a diagonal of the target.
            let outside = between(inside, target, 1.0 + diagonal / distance(inside, target));
            let (from, to) = if i % 2 == 0 { (inside, target) } else { (outside, inside) };
            let origin = from.map(|x| x as f32);
            let direction = std::array::from_fn(|k| (to[k] - f64::from(origin[k])) as f32);
            Ray::new(origin, direction)
        })
        .collect()
}
