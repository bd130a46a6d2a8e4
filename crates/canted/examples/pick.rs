//! Picking: which triangle is under the mouse cursor?
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Intersect, Preset, Ray, TriangleBvh, Triangles};

fn main() -> Result<(), canted::GeometryError> {
    // A wavy sheet of 2 x 100 x 100 triangles.
    let n = 100_u16;
    let height = |x: f32, y: f32| 0.1 * (9.0 * x).sin() * (7.0 * y).cos();
    let at = |i: u16| f32::from(i) / f32::from(n);
    let positions: Vec<[f32; 3]> =
        (0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), at(j), height(at(i), at(j))])).collect();
    let vertex = |i: u16, j: u16| u32::from(j) * (u32::from(n) + 1) + u32::from(i);
    let triangles: Vec<[u32; 3]> = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let bvh = TriangleBvh::build_with(&positions, &triangles, Preset::Balanced)?;

    // A camera above the sheet; the cursor is at a third of the width and half of the height of its image.
    let eye = glam::Vec3::new(0.5, -1.0, 1.5);
    let target = glam::Vec3::new(0.33, 0.5, 0.0);
    let ray = Ray::new(eye, target - eye);
    match bvh.closest_hit(&ray) {
        None => println!("nothing under the cursor"),
        Some(hit) => {
            let point = bvh.surface_point(&hit);
            println!("triangle {} at {:.3?}, normal {:.3?}", hit.primitive, point.position, point.normal);
        }
    }
    Ok(())
}
