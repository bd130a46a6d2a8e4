//! What programs record again: nothing moves, or nothing is submitted.

use crate::buffers::{N, buffer, expected, floor, hits, opened, rays, triangles, vertices};
use crate::common::words;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::build::{BuildConfig, STRATEGIES, Topology, WideConfig};
use canted_gpu::{
    Affine, BufferScene, DeviceBvh, DeviceInstance, Gpu, InstanceBuffer, InstancedScene, MeshBuffers, wgpu,
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(updates_of_what_stands_still_change_no_word),
        needs_device(a_dropped_rebuild_is_followed_by_a_good_one),
    ]
}

/// Without movement, what is written again has the words of before: every strategy, every topology, several meshes.
fn updates_of_what_stands_still_change_no_word() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let positions = buffer(&device, bytemuck::cast_slice(&vertices(0.7)));
    let indices = buffer(&device, bytemuck::cast_slice(&triangles()));
    let mesh = floor(&positions, &indices);
    // Of odd numbers of triangles, so that trees do not start at whole blocks.
    let meshes = [1, 2 * N * N, 7, 0, 101].map(|n_triangles| MeshBuffers { n_triangles, ..mesh });
    let identity = DeviceInstance::new(1, &Affine::IDENTITY);
    let transforms = buffer(&device, bytemuck::bytes_of(&identity));
    let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 64, n_instances: 1 };
    let submit = |record: &mut dyn FnMut(&mut wgpu::CommandEncoder)| {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder);
        queue.submit([encoder.finish()]);
    };
    let words = |scene: &InstancedScene| {
        ["nodes", "triangle_blocks", "corners", "bvhs"].map(|name| words(&gpu, scene.traced(), name))
    };
    let binary = STRATEGIES.map(|strategy| DeviceBvh::from(BuildConfig { strategy, ..BuildConfig::default() }));
    let wide = [Topology::Radix, Topology::Ploc].into_iter().flat_map(|topology| {
        STRATEGIES.map(|strategy| WideConfig { topology, strategy, ..WideConfig::default() }.into())
    });
    for bvh in binary.into_iter().chain(wide) {
        let mut scene = InstancedScene::new(&gpu, &meshes, &instances, bvh).unwrap();
        let before = words(&scene);
        for (number, mesh) in (0..).zip(&meshes) {
            submit(&mut |encoder| scene.refit_mesh(&gpu, encoder, number, mesh).unwrap());
            assert!(words(&scene) == before, "{bvh:?}: refit of mesh {number}");
        }
        submit(&mut |encoder| scene.update_top(&gpu, encoder, &instances).unwrap());
        assert!(words(&scene) == before, "{bvh:?}: top level");
        // A clustered tree becomes a radix tree.
        if matches!(bvh, DeviceBvh::Wide(WideConfig { topology: Topology::Ploc, .. })) {
            continue;
        }
        for (number, mesh) in (0..).zip(&meshes) {
            submit(&mut |encoder| scene.rebuild_mesh(&gpu, encoder, number, mesh).unwrap());
            assert!(words(&scene) == before, "{bvh:?}: build of mesh {number}");
        }
        submit(&mut |encoder| scene.rebuild(&gpu, encoder, &meshes, &instances).unwrap());
        assert!(words(&scene) == before, "{bvh:?}: build of all");
    }
}

/// After a rebuild that is recorded and not submitted, a refit and rays end, and a build mends the scene. Where a driver ends long loops itself, as
/// Mesa 22 does, only the second half can fail.
fn a_dropped_rebuild_is_followed_by_a_good_one() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let positions = buffer(&device, bytemuck::cast_slice(&vertices(0.0)));
    let indices = buffer(&device, bytemuck::cast_slice(&triangles()));
    let mesh = floor(&positions, &indices);
    let encoder = || device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let binary = STRATEGIES.map(|strategy| DeviceBvh::from(BuildConfig { strategy, ..BuildConfig::default() }));
    let wide = STRATEGIES.map(|strategy| WideConfig { strategy, ..WideConfig::default() }.into());
    for bvh in binary.into_iter().chain(wide) {
        let mut scene = BufferScene::new(&gpu, &[mesh], bvh).unwrap();
        scene.rebuild(&gpu, &mut encoder(), &[mesh]).unwrap();
        let mut submitted = encoder();
        scene.refit(&gpu, &mut submitted, &[mesh]).unwrap();
        queue.submit([submitted.finish()]);
        let _ = scene.traced().closest_hits(&gpu, &rays()).unwrap();
        let mut submitted = encoder();
        scene.rebuild(&gpu, &mut submitted, &[mesh]).unwrap();
        queue.submit([submitted.finish()]);
        assert_eq!(hits(&gpu, scene.traced()), expected(&gpu, &vertices(0.0)), "{bvh:?}");
    }
}
