//! Builds on devices with too little memory. The package of tests compares whole builds with the CPU.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{
    Affine, BufferScene, DeviceBvh, DeviceInstance, Gpu, GpuError, InstanceBuffer, InstancedScene, MeshBuffers,
    block_on,
    build::{BuildConfig, BuildEncoder, Built, Passes, Primitives, STRATEGIES, Topology, WideBvhs, WideConfig},
    wgpu::{self, CommandEncoderDescriptor},
};
use canted_lbvh::{Bits, Corners, Strategy};

use crate::{
    buffers::{N, buffer, expected, floor, hits, opened, rays, triangles, vertices},
    gpu, lowered, words,
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(stages_that_fit_are_timed_when_others_do_not_fit),
        needs_device(recorded_builds_equal_builds_at_once),
        needs_device(oriented_nodes_do_not_depend_on_the_unit_of_length),
        needs_device(updates_of_what_stands_still_change_no_word),
        needs_device(a_dropped_rebuild_is_followed_by_a_good_one),
    ]
}

fn stages_that_fit_are_timed_when_others_do_not_fit() {
    let gpu = lowered(48 << 10);
    // Per triangle, 36 bytes of vertices and 24 of an axis-aligned box fit; 60 of an oriented box do not.
    let triangle = |i: u16| {
        let x = f32::from(i);
        [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, f32::from(i % 7)]]
    };
    let corners: Vec<Corners> = (0..1000).map(triangle).collect();
    let primitives = Primitives::triangles(&gpu, [&corners[..]]).unwrap();
    let passes = block_on(Passes::measure(&gpu, &primitives, Bits::B63, 1)).unwrap();
    let fit = [passes.domain, passes.codes, passes.sort, passes.tree, passes.boxes[0]];
    assert!(fit.iter().all(Option::is_some) && passes.total(Strategy::Aabb).is_some(), "{passes:?}");
    assert_eq!((&passes.boxes[1..], passes.total(Strategy::Combined)), (&[None; 5][..], None));
    match passes.error {
        Some(GpuError::Limit { need: 60_000, most: 49_152, .. }) => {}
        other => panic!("{other:?}"),
    }
    // A build that fits reports no error.
    let few = Primitives::triangles(&gpu, [&corners[..500]]).unwrap();
    let passes = block_on(Passes::measure(&gpu, &few, Bits::B63, 1)).unwrap();
    assert!(passes.error.is_none() && passes.boxes.iter().all(Option::is_some), "{passes:?}");
}

/// No build reads anything back: what a program's encoder records is what is built at once.
fn recorded_builds_equal_builds_at_once() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let triangle = |i: u16| {
        let [x, y, z] = [7, 11, 13].map(|k| f32::from(i.wrapping_mul(k * 4099) >> 6));
        [[x, y, z], [x + 9.0, y, z + 1.0], [x, y + 9.0, z]]
    };
    let corners: Vec<Corners> = (0..5000).map(triangle).collect();
    for (topology, strategy) in [Topology::Radix, Topology::Ploc]
        .into_iter()
        .flat_map(|topology| STRATEGIES.map(|strategy| (topology, strategy)))
    {
        let words = |build: &mut BuildEncoder<'_>| {
            let before = gpu.traffic();
            let config = WideConfig { topology, strategy, ..WideConfig::default() };
            let primitives = Primitives::triangles(&gpu, [&corners[..], &corners[..9]]).unwrap();
            let built = Built::new(build, primitives, config).unwrap();
            let wide = WideBvhs::new(build, &built, None).unwrap();
            assert_eq!((gpu.traffic() - before).downloaded_bytes, 0, "{topology:?}, {strategy:?}");
            (built, wide)
        };
        let read = |(built, wide): (Built, WideBvhs)| {
            let [nodes, triangles] = [&wide.nodes, &wide.triangles].map(|words| block_on(gpu.read(words)).unwrap());
            (nodes, triangles, wide.levels.clone(), block_on(wide.depths(&gpu)), block_on(built.depth(&gpu)))
        };
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        let recorded = words(&mut BuildEncoder::recorded(&gpu, &mut encoder));
        queue.submit([encoder.finish()]);
        let (recorded, at_once) = (read(recorded), read(words(&mut BuildEncoder::new(&gpu))));
        assert!(recorded == at_once && recorded.4.is_ok(), "{topology:?}, {strategy:?}");
    }
}

/// Numbers of aligned and oriented nodes below the root of one tree.
fn kinds(gpu: &Gpu, bvhs: &WideBvhs) -> [usize; 2] {
    let nodes = block_on(gpu.read(&bvhs.nodes)).unwrap();
    let (mut waiting, mut found) = (bvhs.levels[0].roots.clone(), [0; 2]);
    while let Some(word) = waiting.pop() {
        if word >> 31 == 0 && word != 0x7fff_ffff {
            let kind = (word >> 29) as usize;
            found[kind] += 1;
            let at = 2 * (word & 0x1fff_ffff) as usize;
            waiting.extend(nodes[at..at + 2].as_flattened());
        }
    }
    found
}

/// Squares of areas overflow and underflow long before coordinates do.
fn oriented_nodes_do_not_depend_on_the_unit_of_length() {
    let gpu = gpu();
    // Thin, diagonal triangles.
    let triangle = |i: u16| {
        let [x, y] = [f32::from(i % 32), f32::from(i / 32)];
        [[x, y, 0.0], [x + 4.0, y + 4.0, 4.0], [x + 4.0, y + 4.01, 4.0]]
    };
    let of_scale = |exponent: i32| {
        let scaled = |i| triangle(i).map(|vertex| vertex.map(|x| x * 2.0_f32.powi(exponent)));
        let corners: Vec<Corners> = (0..1000).map(scaled).collect();
        let mut build = BuildEncoder::new(&gpu);
        let config = BuildConfig { strategy: Strategy::Combined, ..BuildConfig::default() };
        let built = Built::new(&mut build, Primitives::triangles(&gpu, [&corners[..]]).unwrap(), config).unwrap();
        kinds(&gpu, &WideBvhs::new(&mut build, &built, None).unwrap())
    };
    let expected = of_scale(0);
    assert!(expected[1] > 50, "{expected:?}");
    for exponent in [-50, -36, 36, 54] {
        assert_eq!(of_scale(exponent), expected, "2^{exponent}");
    }
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
    let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 64, n_instances: 1, has_masks: false };
    let submit = |record: &mut dyn FnMut(&mut wgpu::CommandEncoder)| {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder);
        queue.submit([encoder.finish()]);
    };
    let words = |scene: &InstancedScene| {
        ["nodes", "leaf_triangles", "corners", "bvhs"].map(|name| words(&gpu, scene.traced(), name))
    };
    let binary = STRATEGIES.map(|strategy| DeviceBvh::from(BuildConfig { strategy, ..BuildConfig::default() }));
    let wide = [Topology::Radix, Topology::Ploc].into_iter().flat_map(|topology| {
        STRATEGIES.map(|strategy| WideConfig { topology, strategy, ..WideConfig::default() }.into())
    });
    for bvh in binary.into_iter().chain(wide) {
        let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &instances, bvh)).unwrap();
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
        let mut scene = block_on(BufferScene::new(&gpu, &[mesh], bvh)).unwrap();
        scene.rebuild(&gpu, &mut encoder(), &[mesh]).unwrap();
        let mut submitted = encoder();
        scene.refit(&gpu, &mut submitted, &[mesh]).unwrap();
        queue.submit([submitted.finish()]);
        let _ = block_on(scene.traced().closest_hits(&gpu, &rays())).unwrap();
        let mut submitted = encoder();
        scene.rebuild(&gpu, &mut submitted, &[mesh]).unwrap();
        queue.submit([submitted.finish()]);
        assert_eq!(hits(&gpu, scene.traced()), expected(&gpu, &vertices(0.0)), "{bvh:?}");
    }
}
