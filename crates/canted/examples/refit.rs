//! Refit: a mesh deforms every frame; the BVH reports when a rebuild pays off.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Intersect, Ray, TriangleBvh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A tower of thin horizontal struts.
    let (mut rest, mut triangles) = (vec![], vec![]);
    for i in 0..2000_u16 {
        let z = 0.01 * f32::from(i);
        let first = u32::try_from(rest.len())?;
        rest.extend([[-1.0, 0.0, z], [1.0, 0.0, z], [1.0, 0.005, z + 0.005]]);
        triangles.push([first, first + 1, first + 2]);
    }
    let mut bvh = TriangleBvh::build(&rest, &triangles)?;

    for frame in 0..=8_u8 {
        // Twist the tower further.
        let twisted: Vec<[f32; 3]> = rest
            .iter()
            .map(|&[x, y, z]| {
                let (sin, cos) = (0.02 * f32::from(frame) * z).sin_cos();
                [cos * x - sin * y, sin * x + cos * y, z]
            })
            .collect();
        let refit = bvh.refit(&twisted, &triangles)?;
        let hit = bvh.closest_hit(&Ray::new([0.3, -9.0, 5.0025], [0.0, 1.0, 0.0]));
        println!("frame {frame}: drift {:.2}, hit {:?}", refit.drift, hit.map(|hit| (hit.primitive.0, hit.t)));
        if refit.rebuild_advised() {
            bvh = TriangleBvh::build(&twisted, &triangles)?;
            println!("frame {frame}: rebuilt");
        }
    }
    Ok(())
}
