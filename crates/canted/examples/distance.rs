//! Distances: nearest point, containment, signed distance, and all triangles in a region.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::TriangleBvh;
use canted::distance::{Convex, Overlaps};

fn main() -> Result<(), canted::GeometryError> {
    // An octahedron.
    let positions =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let bvh = TriangleBvh::build(&positions, &triangles)?;

    for point in [[0.0, 0.0, 0.0], [0.2, 0.3, 0.1], [1.0, 1.0, 1.0], [0.0, 0.0, 1.0]] {
        let nearest = bvh.nearest_point(point, f32::INFINITY).expect("the mesh is not empty");
        println!(
            "{point:?}: inside {}, signed distance {:.3}, nearest triangle {} at {:.3?}",
            bvh.contains(point),
            bvh.signed_distance(point),
            nearest.primitive,
            nearest.position,
        );
    }

    let mut found = vec![];
    bvh.overlapping_sphere([1.0, 0.0, 0.0], 0.1, &mut found);
    println!("near the first vertex: {found:?}");
    let face = |size: f32, z: f32| [[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]];
    bvh.overlapping(&Convex::from_frustum(face(0.1, 3.0), face(0.5, 0.5)), &mut found);
    println!("in a frustum from above: {found:?}");
    Ok(())
}
