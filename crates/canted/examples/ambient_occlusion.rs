//! Ambient occlusion: rays that continue from a hit do not hit their own triangle again.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Config, Preset, Ray, SurfacePoint, Triangle, WideBvh};

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
    let bvh = WideBvh::<Triangle>::build(&positions, &triangles, &Config::preset(Preset::Fast))?;
    let reach = bvh.aabb().reach();

    for z in [4.0_f32, 2.0, 1.0, 0.5, 0.1] {
        let hit = bvh.closest_hit(&Ray::new([0.1, 2.0, z], [0.0, -1.0, 0.0])).expect("the floor is below");
        let point =
            SurfacePoint::new(&hit, triangles[hit.primitive.index()].map(|i: u32| positions[i as usize]), reach);
        // Directions of a golden spiral over the upper hemisphere.
        let n = 256_u16;
        let rays: Vec<Ray> = (0..n)
            .map(|i| {
                let y = (f32::from(i) + 0.5) / f32::from(n);
                let (sin, cos) = (2.399_963 * f32::from(i)).sin_cos();
                let r = (1.0 - y * y).sqrt();
                Ray { t_max: 3.0, ..point.spawn_ray([r * cos, y, r * sin]) }
            })
            .collect();
        let mut occluded = vec![false; rays.len()];
        bvh.occluded_many(&rays, &mut occluded);
        let open = occluded.iter().filter(|&&is_occluded| !is_occluded).count();
        println!("{z} in front of the wall: {open} of {n} directions are open");
    }
    Ok(())
}
