//! Save and load a scene of instances: the file has the bottom-level BVHs and the instances, and every byte of it is checked.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Affine, Instance, Intersect, Ray, Tlas, TriangleBvh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let tetrahedron = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let bvh = TriangleBvh::build(&tetrahedron, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
    let place = |i: u16| Affine::translation([i % 10, i / 10, 0].map(|k| 2.0 * f32::from(k)));
    let instances: Vec<Instance> = (0..100).map(|i| Instance::new(0, place(i))).collect();
    let tlas = Tlas::new(vec![bvh], &instances, Default::default())?;

    let path = std::env::temp_dir().join(format!("canted-example-{}.tlas", std::process::id()));
    std::fs::write(&path, tlas.to_bytes())?;
    let bytes = std::fs::read(&path)?;
    std::fs::remove_file(&path)?;
    // The top level is built again, as the program that loads it wants.
    let loaded: Tlas<TriangleBvh> = Tlas::from_bytes(&bytes, Default::default())?;

    let ray = Ray::new([8.2, 6.2, 5.0], [0.0, 0.0, -1.0]);
    assert_eq!(loaded.closest_hit(&ray), tlas.closest_hit(&ray));
    let hit = loaded.closest_hit(&ray).ok_or("nothing is hit")?;
    println!("{} bytes, {} instances; instance {} is hit", bytes.len(), loaded.instances().len(), hit.instance.0);

    let mut damaged = bytes;
    damaged[40] ^= 1;
    let error = Tlas::<TriangleBvh>::from_bytes(&damaged, Default::default()).map(|_| ()).unwrap_err();
    println!("a damaged file: {error}");
    Ok(())
}
