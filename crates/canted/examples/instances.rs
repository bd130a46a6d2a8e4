//! Instances: one mesh in many places, moved and replaced without rebuilding what does not change.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;

use canted::{Affine, Hit, Instance, InstanceId, Intersect, Ray, Tlas, TriangleBvh};

/// A box from -1 to 1, 12 triangles.
fn cube() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corner = |i: u8| [0, 1, 2].map(|k| if i >> k & 1 == 0 { -1.0 } else { 1.0 });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

fn main() -> Result<(), Box<dyn Error>> {
    let (positions, triangles) = cube();
    let bvh = TriangleBvh::build(&positions, &triangles)?;

    // A thousand copies; every tenth is visible to rays with bit 1 only.
    let instances: Vec<Instance> = (0..1000_u16)
        .map(|i| {
            let place = [i % 10, i / 10 % 10, i / 100].map(|k| 3.0 * f32::from(k));
            Instance::new(0, Affine::translation(place)).with_mask(if i % 10 == 0 { 2 } else { 1 })
        })
        .collect();
    let mut tlas = Tlas::new(vec![bvh], &instances, Default::default())?;

    let ray = Ray::new([-5.0, 0.2, 0.3], [1.0, 0.0, 0.0]);
    let describe =
        |hit: Option<Hit>| hit.map_or("nothing".into(), |hit| format!("instance {} at t = {}", hit.instance.0, hit.t));
    println!("all instances: {}", describe(tlas.closest_hit(&ray)));
    println!("mask 1: {}", describe(tlas.closest_hit(&ray.with_mask(1))));

    // Move one instance in front; only the top level changes.
    let smaller = Affine::scale([0.5, 0.5, 0.5]);
    tlas.set_transform(InstanceId(999), smaller.then(&Affine::translation([-3.0, 0.0, 0.0])))?;
    let hit = tlas.closest_hit(&ray);
    println!("after moving instance 999: {}", describe(hit));
    if let Some(hit) = hit {
        let point = tlas.surface_point(&hit);
        println!("at {:?}, normal {:?}", point.position, point.normal);
    }

    // Single changes take time that grows with the depth of the top level: one instance comes, is hidden by a scale of zero, and goes.
    let near = tlas.insert(Instance::new(0, smaller.then(&Affine::translation([-4.0, 0.0, 0.0]))))?;
    println!("after inserting instance {}: {}", near.0, describe(tlas.closest_hit(&ray)));
    tlas.set_transform(near, Affine::scale([0.0; 3]))?;
    println!("hidden: {}", describe(tlas.closest_hit(&ray)));
    tlas.remove(near)?;

    // Many change at once, on all threads, with one update: a row moves back.
    let row: Vec<(InstanceId, Instance)> = (0..10_u16)
        .map(|i| {
            let place = Affine::translation([3.0 * f32::from(i) + 0.5, 0.0, 0.0]);
            (InstanceId(u32::from(i)), Instance::new(0, place))
        })
        .collect();
    let mut edit = tlas.edit();
    edit.set_each(&row)?;
    edit.set_mask(InstanceId(999), 0)?;
    edit.refit();
    println!("after moving a row: {}", describe(tlas.closest_hit(&ray)));
    if tlas.rebuild_advised() {
        tlas.rebuild();
    }

    // Replace the mesh of all instances by a smaller one.
    let smaller: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|x| 0.5 * x)).collect();
    tlas.replace_blas(0, TriangleBvh::build(&smaller, &triangles)?)?;
    println!("after replacing the mesh: {}", describe(tlas.closest_hit(&ray)));
    Ok(())
}
