//! Filters: rays that pass through the holes of a texture, and rays that leave out the triangle they start from.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Accept, Hit, Intersect, Ray, TriangleBvh};

fn main() -> Result<(), canted::GeometryError> {
    // A fence of two triangles before a wall of two, 2 units apart.
    let square = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
    let positions = [square(2.0), square(0.0)].concat();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let bvh = TriangleBvh::build(&positions, &triangles)?;

    // The fence has bars of a tenth: texture coordinates are interpolated by the weights of the hit.
    let is_opaque = |hit: &Hit| {
        let corners = triangles[hit.primitive.index()].map(|vertex| positions[vertex as usize]);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let x: f32 = (0..3).map(|k| weights[k] * corners[k][0]).sum();
        hit.primitive.0 >= 2 || ((10.0 * x) as u32).is_multiple_of(2)
    };
    for x in [0.05, 0.15] {
        let ray = Ray::new([x, 0.4, 5.0], [0.0, 0.0, -1.0]);
        let Some(hit) = bvh.closest_hit_with(&ray, &mut Accept(is_opaque)) else { continue };
        println!("at x = {x}: triangle {} at t = {}", hit.primitive.0, hit.t);

        // A ray back that starts exactly on the hit triangle: a filter leaves that one out.
        let back = Ray::new(ray.at(f64::from(hit.t)).map(|x| x as f32), [0.0, 0.0, 1.0]);
        let mut others = Accept(|other: &Hit| other.primitive != hit.primitive && is_opaque(other));
        println!("  seen from there: {}", if bvh.occluded_with(&back, &mut others) { "a bar" } else { "the sky" });
    }

    // Slices of rays take the number of the ray, too: here every other ray sees the wall alone.
    let rays: Vec<Ray> = (0..10_u8).map(|i| Ray::new([0.1 * f32::from(i), 0.4, 5.0], [0.0, 0.0, -1.0])).collect();
    let mut hits = vec![None; rays.len()];
    bvh.closest_hits_with(&rays, &mut hits, &|i, _, hit| i % 2 == 0 || hit.primitive.0 >= 2);
    println!("{} of {} rays hit the fence", hits.iter().flatten().filter(|hit| hit.t < 4.0).count(), rays.len());
    Ok(())
}
