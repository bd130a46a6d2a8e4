//! Ambient occlusion: rays that continue from a hit do not hit their own triangle again.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Intersect, Preset, Ray, TriangleBvh, Triangles};

fn main() -> Result<(), canted::GeometryError> {
    // A floor and a wall.
    let positions = [
        [-5.0, 0.0, -5.0],
        [5.0, 0.0, -5.0],
        [5.0, 0.0, 5.0],
        [-5.0, 0.0, 5.0],
        [-5.0, 4.0, 0.0],
        [5.0, 4.0, 0.0],
        [5.0, 0.0, 0.0],
        [-5.0, 0.0, 0.0],
    ];
    let triangles = [[0, 2, 1], [0, 3, 2], [7, 6, 5], [7, 5, 4]];
    let bvh = TriangleBvh::build_with(&positions, &triangles, Preset::Fast)?;

    for z in [4.0_f32, 2.0, 1.0, 0.5, 0.1] {
        let hit = bvh.closest_hit(&Ray::new([0.1, 2.0, z], [0.0, -1.0, 0.0])).expect("the floor is below");
        let point = bvh.surface_point(&hit);
        // Directions of a golden spiral over the upper hemisphere.
        let n = 256_u16;
        let rays: Vec<Ray> = (0..n)
            .map(|i| {
                let y = (f32::from(i) + 0.5) / f32::from(n);
                let (sin, cos) = (2.399_963 * f32::from(i)).sin_cos();
                let r = (1.0 - y * y).sqrt();
                point.spawn_ray([r * cos, y, r * sin]).between(0.0, 3.0)
            })
            .collect();
        let mut occluded = vec![false; rays.len()];
        bvh.occluded_many(&rays, &mut occluded);
        let open = occluded.iter().filter(|&&is_occluded| !is_occluded).count();
        println!("{z} in front of the wall: {open} of {n} directions are open");
    }
    Ok(())
}
