//! Bodies against bodies: which triangles touch, how far apart meshes are, and where a sphere that moves first touches one.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::collide::{Pose, cast_sphere, distance, overlaps, pairs};
use canted::kernel::Sphere;
use canted::{Affine, GeometryError, Ray, TriangleBvh};

fn main() -> Result<(), GeometryError> {
    // An octahedron.
    let positions =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let body = TriangleBvh::build(&positions, &triangles)?;

    // A second one falls onto the first.
    let mut touching = vec![];
    for height in [3.0_f32, 2.0, 1.5] {
        let pose = Affine::rotation([0.0, 0.0, 1.0], 0.5).then(&Affine::translation([0.0, 0.0, height]));
        pairs(&body, Pose::IDENTITY, &body, pose, &mut touching);
        let near = distance(&body, Pose::IDENTITY, &body, pose, f64::INFINITY).expect("neither is empty");
        println!(
            "at {height}: {} pairs touch, {:.3} apart, nearest at {:.3?}",
            touching.len(),
            near.distance,
            near.points[0]
        );
    }
    let ball = Sphere { center: [1.5, 0.0, 0.0], radius: 0.4 };
    println!("a ball touches it: {}", overlaps(&body, Pose::IDENTITY, &ball, Pose::IDENTITY));
    let contact =
        cast_sphere(&body, &Ray::new([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]), 0.4).expect("it falls onto the body");
    println!("a falling ball touches it after {:.3}, at {:.3?}", contact.t, contact.position);
    Ok(())
}
