//! Save and load: building takes longer than reading bytes. Loading checks every byte.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::{Intersect, Preset, Ray, TriangleBvh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions: Vec<[f32; 3]> = (0..3000_u16)
        .map(|i| {
            let t = 0.01 * f32::from(i);
            [t.sin() * t, t.cos() * t, 0.3 * f32::from(i % 3)]
        })
        .collect();
    let triangles: Vec<[u32; 3]> = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let bvh = TriangleBvh::build_with(&positions, &triangles, Preset::Quality)?;

    let path = std::env::temp_dir().join("canted-example.bvh");
    std::fs::write(&path, bvh.to_bytes())?;
    let loaded = TriangleBvh::from_bytes(&std::fs::read(&path)?)?;

    let ray = Ray::new([0.0, 0.0, 5.0], [1.0, 2.0, -1.0]);
    assert_eq!(loaded.closest_hit(&ray), bvh.closest_hit(&ray));
    println!("{} bytes, {} triangles", bvh.to_bytes().len(), loaded.n_primitives());

    // A damaged file is an error.
    let mut bytes = bvh.to_bytes();
    bytes[100] ^= 1;
    println!("a damaged file: {}", TriangleBvh::from_bytes(&bytes).unwrap_err());
    std::fs::remove_file(&path)?;
    Ok(())
}
