//! Instances of meshes in a program's own buffers.

use crate::buffers::{N, buffer, opened, soup, soup_mesh, triangles, vertices};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::build::{BuildConfig, Topology, WideConfig};
use canted_gpu::{
    DeviceBvh, DeviceHit, DeviceInstance, Gpu, GpuError, IndexBuffer, InstanceBuffer, InstancedScene, MeshBuffers,
    NOT_PLACED, Options, Outcome, Source, TracedScene, block_on, wgpu,
};
use canted_lbvh::{Bits, Strategy};
use canted_obb::Affine;
use canted_tlas::Instance;
use canted_trace::Ray;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(every_recorded_change_equals_a_fresh_build),
        needs_device(a_forgotten_update_is_seen),
        needs_device(updates_of_two_levels_take_few_dispatches),
        needs_device(many_small_meshes_take_the_dispatches_of_few),
        needs_device(few_instances_and_empty_scenes_are_traced),
        needs_device(faults_of_meshes_and_layouts_of_instances_are_reported),
        needs_device(a_lost_device_of_the_program_is_reported),
    ]
}

type Corners = [[f32; 3]; 3];

/// A wavy floor, and a pyramid of other size.
struct Program {
    device: wgpu::Device,
    queue: wgpu::Queue,
    positions: [wgpu::Buffer; 2],
    indices: [wgpu::Buffer; 2],
    transforms: wgpu::Buffer,
}

const PYRAMID: [[f32; 3]; 5] =
    [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.1, 0.0, 1.5]];
const SIDES: [[u16; 3]; 4] = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];

/// Words before the first transform, and words of each: the program has other data there.
const FIRST: usize = 3;
const STRIDE: usize = 20;

impl Program {
    fn new((device, queue): (wgpu::Device, wgpu::Queue), placed: &[(u32, Affine)]) -> Self {
        let bytes = |contents: &[u8]| buffer(&device, contents);
        let positions = [bytes(bytemuck::cast_slice(&vertices(0.0))), bytes(bytemuck::cast_slice(&PYRAMID))];
        let indices = [bytes(bytemuck::cast_slice(&triangles())), bytes(bytemuck::cast_slice(&SIDES))];
        let transforms = bytes(bytemuck::cast_slice(&words(placed)));
        Self { positions, indices, transforms, device, queue }
    }

    fn meshes(&self) -> [MeshBuffers<'_>; 2] {
        let mesh = |k: usize, format, n_vertices, n_triangles| MeshBuffers {
            vertices: &self.positions[k],
            first_byte: 0,
            stride: 12,
            n_vertices,
            indices: Some(IndexBuffer { buffer: &self.indices[k], format, first_byte: 0 }),
            n_triangles,
        };
        [mesh(0, wgpu::IndexFormat::Uint32, (N + 1) * (N + 1), 2 * N * N), mesh(1, wgpu::IndexFormat::Uint16, 5, 4)]
    }

    fn instances(&self, n_instances: u32) -> InstanceBuffer<'_> {
        let (first_byte, stride) = (4 * FIRST as u64, 4 * STRIDE as u64);
        InstanceBuffer { buffer: &self.transforms, first_byte, stride, n_instances, has_masks: false }
    }

    /// Submits what `record` records.
    fn submit(&self, record: impl FnOnce(&mut wgpu::CommandEncoder)) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder);
        self.queue.submit([encoder.finish()]);
    }
}

/// Transforms in the layout of the program.
fn words(placed: &[(u32, Affine)]) -> Vec<u32> {
    let mut words = vec![u32::MAX; FIRST + STRIDE * placed.len()];
    for ((mesh, map), words) in placed.iter().zip(words[FIRST..].chunks_exact_mut(STRIDE)) {
        let instance = DeviceInstance::new(*mesh, map);
        words[..12].copy_from_slice(bytemuck::cast_slice(&instance.rows));
        words[12] = instance.mesh;
    }
    words
}

/// Instances in rows, turned, scaled and mirrored in turn; every seventh in the place of the one before.
fn placed(n: u32, time: f32) -> Vec<(u32, Affine)> {
    let one = |i: u32| {
        let place = if i % 7 == 6 { i - 1 } else { i };
        let (s, c) = (0.3 * place as f32 + time).sin_cos();
        let size = [1.0, 0.25, -0.5][place as usize % 3];
        let [x, y] = [(place % 8) as f32 * 9.0, (place / 8) as f32 * 11.0 - time];
        let columns = [[size * c, size * s, 0.0], [-s, c, 0.2], [0.0, 0.1 * s, 0.7], [x, y, 0.5 * s]];
        (place % 2, Affine { columns })
    };
    (0..n).map(one).collect()
}

fn rays() -> Vec<Ray> {
    let ray =
        |i: u32| Ray::new([(i % 90) as f32 * 0.87 - 4.0, (i / 90) as f32 * 1.13 - 9.0, 30.0], [0.05, -0.04, -2.0]);
    (0..3600).map(ray).collect()
}

fn hits(gpu: &Gpu, scene: &TracedScene) -> Vec<Option<DeviceHit>> {
    let answers = block_on(scene.closest_hits(gpu, &rays())).unwrap().into_iter().map(|answer| match answer {
        Outcome::Complete(hit) => hit,
        Outcome::Incomplete => panic!("no traversal here is long"),
    });
    answers.collect()
}

/// The hits of instances that the CPU places.
fn expected(gpu: &Gpu, floor: &[[f32; 3]], placed: &[(u32, Affine)]) -> Vec<Option<DeviceHit>> {
    let floor: Vec<Corners> = triangles().iter().map(|t| t.map(|i| floor[i as usize])).collect();
    let pyramid: Vec<Corners> = SIDES.iter().map(|t| t.map(|i| PYRAMID[usize::from(i)])).collect();
    let instances: Vec<Instance> = placed.iter().map(|&(mesh, map)| Instance::new(mesh, map)).collect();
    let config = BuildConfig::default();
    hits(
        gpu,
        &block_on(TracedScene::new(
            gpu,
            Source::build(&[&floor, &pyramid], config).with_instances(&instances),
            Options::default(),
        ))
        .unwrap(),
    )
}

/// Updates of two meshes over 63-bit codes and of their instances take few dispatches and download nothing.
fn updates_of_two_levels_take_few_dispatches() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let n = 100;
    let program = Program::new((device.clone(), queue), &placed(n, 0.0));
    let soup = soup(&device, 35_000);
    let meshes = [soup_mesh(&soup, 35_000), soup_mesh(&soup, 34_000)];
    let instances = program.instances(n);
    for (strategy, of_binary, of_wide) in
        [(Strategy::Aabb, [25, 12, 7], [35, 16, 10]), (Strategy::Combined, [30, 17, 9], [40, 20, 10])]
    {
        let config = BuildConfig { bits: Bits::B63, strategy };
        for (bvh, most) in [(DeviceBvh::from(config), of_binary), (WideConfig::from(config).into(), of_wide)] {
            let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &instances, bvh)).unwrap();
            let found = [0, 1, 2].map(|update| {
                let before = gpu.traffic();
                program.submit(|encoder| match update {
                    0 => scene.rebuild(&gpu, encoder, &meshes, &instances).unwrap(),
                    1 => scene.refit(&gpu, encoder, &meshes, &instances).unwrap(),
                    _ => scene.update_top(&gpu, encoder, &instances).unwrap(),
                });
                let traffic = gpu.traffic() - before;
                assert_eq!(traffic.downloaded_bytes, 0, "{bvh:?}");
                traffic.n_dispatches
            });
            assert!(found.iter().zip(most).all(|(&found, most)| found <= most), "{bvh:?}: {found:?}, not {most:?}");
        }
    }
}

/// Any number of small meshes of different layouts take the dispatches of a few, and have the BVHs of each by itself: hits are those of a build from
/// the host. Meshes that cannot be copied take one more each.
fn many_small_meshes_take_the_dispatches_of_few() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let config = WideConfig::from(BuildConfig { bits: Bits::B63, strategy: Strategy::Combined });
    // Mesh k has 3 + k % 4 sides of a cone, in a buffer of its own, behind other words: with indices of 16 or 32 bits, or none.
    let cone = |k: u32| -> Vec<Corners> {
        let n = 3 + k % 4;
        let rim = |i: u32| {
            let (s, c) = (6.3 * (i % n) as f32 / n as f32).sin_cos();
            [2.0 * c, 2.0 * s, 0.0]
        };
        (0..n).map(|i| [rim(i), rim(i + 1), [0.1, 0.0, 1.0 + (k % 5) as f32]]).collect()
    };
    let words = |k: u32| -> Vec<f32> {
        let points = cone(k).into_iter().flatten().flat_map(|p| [p[0], p[1], p[2], 9.0]);
        std::iter::repeat_n(7.0, 1 + (k % 90) as usize).chain(points).collect()
    };
    let in_order: Vec<u32> = std::iter::once(99).chain(0..18).collect();
    let short: Vec<u16> = in_order.iter().map(|&i| u16::try_from(i).unwrap()).chain([0]).collect();
    let indices = [buffer(&device, bytemuck::cast_slice(&short)), buffer(&device, bytemuck::cast_slice(&in_order))];
    let formats = [wgpu::IndexFormat::Uint16, wgpu::IndexFormat::Uint32];
    let rays_at = |n: u32| -> Vec<Ray> {
        let ray = |i: u32| {
            let [x, y] = [(i % 60) as f32 * 0.66 - 2.0, (i / 60) as f32 * 0.7 - 2.0];
            Ray::new([x, y, 9.0], [0.03, -0.02, -1.0])
        };
        (0..60 * n.div_ceil(10) * 6).map(ray).collect()
    };
    let mut found = vec![];
    for (n, can_copy) in [(3, true), (60, true), (20, false)] {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let vertices: Vec<wgpu::Buffer> = (0..n)
            .map(|k| {
                let contents = words(k);
                let contents: &[u8] = bytemuck::cast_slice(&contents);
                if can_copy {
                    return buffer(&device, contents);
                }
                let size = contents.len() as u64;
                let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
                let own = device.create_buffer(&descriptor);
                queue.write_buffer(&own, 0, contents);
                own
            })
            .collect();
        let meshes: Vec<MeshBuffers<'_>> = (0..n)
            .map(|k| {
                let n_triangles = 3 + k % 4;
                let number = k as usize % 3;
                let index = |number: usize| IndexBuffer {
                    buffer: &indices[number],
                    format: formats[number],
                    first_byte: formats[number].byte_size() as u64,
                };
                MeshBuffers {
                    vertices: &vertices[k as usize],
                    first_byte: 4 * u64::from(1 + k % 90),
                    stride: 16,
                    n_vertices: 3 * n_triangles,
                    indices: (number < 2).then(|| index(number)),
                    n_triangles,
                }
            })
            .collect();
        let placed: Vec<(u32, Affine)> = (0..n)
            .map(|k| {
                let [x, y] = [(k % 10) as f32 * 4.0, (k / 10) as f32 * 4.0];
                (k, Affine { columns: [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.2, 1.0], [x, y, 0.0]] })
            })
            .collect();
        let transforms = buffer(&device, bytemuck::cast_slice(&self::words(&placed)));
        let (first_byte, stride) = (4 * FIRST as u64, 4 * STRIDE as u64);
        let instances = InstanceBuffer { buffer: &transforms, first_byte, stride, n_instances: n, has_masks: false };
        let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &instances, config)).unwrap();
        let before = gpu.traffic();
        let mut encoder = gpu.encoder();
        scene.rebuild(&gpu, &mut encoder, &meshes, &instances).unwrap();
        gpu.submit(encoder).unwrap();
        found.push((gpu.traffic() - before).n_dispatches);
        block_on(scene.check(&gpu)).unwrap();
        let corners: Vec<Vec<Corners>> = (0..n).map(cone).collect();
        let instances: Vec<Instance> = placed.iter().map(|&(mesh, map)| Instance::new(mesh, map)).collect();
        let source = Source::build(&corners, config).with_instances(&instances);
        let expected = block_on(TracedScene::new(&gpu, source, Options::default())).unwrap();
        let hits = |scene: &TracedScene| block_on(scene.closest_hits(&gpu, &rays_at(n))).unwrap();
        let (hits, expected) = (hits(scene.traced()), hits(&expected));
        assert!(hits == expected, "{n} meshes");
        let n_hits = hits.iter().filter(|hit| matches!(hit, Outcome::Complete(Some(_)))).count();
        assert!(n_hits > 10 * n as usize && n_hits < hits.len(), "{n} meshes: {n_hits} hits");
    }
    assert!(found[1] <= 40 && found[1] == found[0] && found[2] == found[0] + 19, "{found:?}");
}

fn every_recorded_change_equals_a_fresh_build() {
    let opened = opened();
    let binary = [Strategy::Aabb, Strategy::Combined, Strategy::Dop]
        .map(|strategy| DeviceBvh::from(BuildConfig { strategy, bits: Bits::B63 }));
    let wide =
        [(Strategy::Aabb, Topology::Radix), (Strategy::Combined, Topology::Radix), (Strategy::Dop, Topology::Ploc)]
            .map(|(strategy, topology)| DeviceBvh::from(WideConfig { bits: Bits::B63, topology, strategy }));
    for bvh in binary.into_iter().chain(wide) {
        let n = 60;
        let program = Program::new(opened.clone(), &placed(n, 0.0));
        let gpu = Gpu::from_wgpu(program.device.clone(), program.queue.clone());
        let (meshes, instances) = (program.meshes(), program.instances(n));
        let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &instances, bvh)).unwrap();
        let first = hits(&gpu, scene.traced());
        assert_eq!(first, expected(&gpu, &vertices(0.0), &placed(n, 0.0)), "{bvh:?}");
        assert!(first.iter().flatten().count() > 500 && first.iter().any(Option::is_none));

        // Only instances move.
        program.queue.write_buffer(&program.transforms, 0, bytemuck::cast_slice(&words(&placed(n, 0.4))));
        program.submit(|encoder| scene.update_top(&gpu, encoder, &instances).unwrap());
        let moved = hits(&gpu, scene.traced());
        assert_eq!(moved, expected(&gpu, &vertices(0.0), &placed(n, 0.4)), "{bvh:?}: instances moved");
        assert_ne!(moved, first);

        // One mesh deforms: a refit, then a build of its own, then everything built, then everything refitted.
        for (change, time) in [1.5_f32, 3.0, 4.5, 6.0].into_iter().enumerate() {
            let floor = vertices(time);
            program.queue.write_buffer(&program.positions[0], 0, bytemuck::cast_slice(&floor));
            program.submit(|encoder| match change {
                0 => scene.refit_mesh(&gpu, encoder, 0, &meshes[0]).unwrap(),
                1 => scene.rebuild_mesh(&gpu, encoder, 0, &meshes[0]).unwrap(),
                3 => scene.refit(&gpu, encoder, &meshes, &instances).unwrap(),
                _ => scene.rebuild(&gpu, encoder, &meshes, &instances).unwrap(),
            });
            if change < 2 {
                program.submit(|encoder| scene.update_top(&gpu, encoder, &instances).unwrap());
            }
            block_on(scene.check(&gpu)).unwrap();
            let expected = expected(&gpu, &floor, &placed(n, 0.4));
            assert_eq!(hits(&gpu, scene.traced()), expected, "{bvh:?}: change {change}");
        }
        // A refit after a build of one mesh follows the new tree.
        program.queue.write_buffer(&program.positions[0], 0, bytemuck::cast_slice(&vertices(0.0)));
        program.submit(|encoder| {
            scene.rebuild_mesh(&gpu, encoder, 1, &meshes[1]).unwrap();
            scene.refit_mesh(&gpu, encoder, 0, &meshes[0]).unwrap();
            scene.update_top(&gpu, encoder, &instances).unwrap();
        });
        let expected = expected(&gpu, &vertices(0.0), &placed(n, 0.4));
        assert_eq!(hits(&gpu, scene.traced()), expected, "{bvh:?}: refit after builds");
    }
}

/// The comparison sees a top level that does not follow.
fn a_forgotten_update_is_seen() {
    let opened = opened();
    let program = Program::new(opened, &placed(20, 0.0));
    let gpu = Gpu::from_wgpu(program.device.clone(), program.queue.clone());
    let (meshes, instances) = (program.meshes(), program.instances(20));
    let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &instances, BuildConfig::default())).unwrap();
    let mut higher = vertices(0.0);
    higher.iter_mut().for_each(|vertex| vertex[0] += 20.0);
    program.queue.write_buffer(&program.positions[0], 0, bytemuck::cast_slice(&higher));
    let expected = expected(&gpu, &higher, &placed(20, 0.0));
    program.submit(|encoder| scene.rebuild_mesh(&gpu, encoder, 0, &meshes[0]).unwrap());
    assert_ne!(hits(&gpu, scene.traced()), expected);
    program.submit(|encoder| scene.update_top(&gpu, encoder, &instances).unwrap());
    assert_eq!(hits(&gpu, scene.traced()), expected);
}

fn few_instances_and_empty_scenes_are_traced() {
    let opened = opened();
    let lone = [(1, Affine::IDENTITY)];
    let program = Program::new(opened, &lone);
    let gpu = Gpu::from_wgpu(program.device.clone(), program.queue.clone());
    let (meshes, one) = (program.meshes(), program.instances(1));
    let scene = block_on(InstancedScene::new(&gpu, &meshes, &one, BuildConfig::default())).unwrap();
    let found = hits(&gpu, scene.traced());
    assert_eq!(found, expected(&gpu, &vertices(0.0), &lone));
    // A node of two children for each triangle and instance; a header for each level, each mesh and the empty BVH.
    let n_nodes = u64::from(2 * N * N) + 4 + 1;
    for (name, bytes) in
        [("nodes", 64 * n_nodes), ("corners", 36 * (n_nodes - 1)), ("bvhs", 4 * 64), ("instances", 160)]
    {
        assert_eq!(scene.traced().buffer(name).unwrap().size.unwrap().get(), bytes, "{name}");
    }
    assert!(scene.traced().buffer("motions").is_none());
    assert!(found.iter().any(Option::is_some));
    for (meshes, n_instances) in [(&meshes[..], 0), (&[], 0)] {
        let none = InstanceBuffer { n_instances, ..one };
        let scene = block_on(InstancedScene::new(&gpu, meshes, &none, BuildConfig::default())).unwrap();
        assert!(hits(&gpu, scene.traced()).iter().all(Option::is_none));
    }
    program.queue.write_buffer(&program.transforms, 0, bytemuck::cast_slice(&words(&[(NOT_PLACED, Affine::IDENTITY)])));
    let mut scene = scene;
    program.submit(|encoder| scene.update_top(&gpu, encoder, &one).unwrap());
    block_on(scene.check(&gpu)).unwrap();
    assert!(hits(&gpu, scene.traced()).iter().all(Option::is_none));
}

fn faults_of_meshes_and_layouts_of_instances_are_reported() {
    let opened = opened();
    let program = Program::new(opened, &placed(6, 0.0));
    let gpu = Gpu::from_wgpu(program.device.clone(), program.queue.clone());
    let (meshes, six) = (program.meshes(), program.instances(6));
    let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &six, BuildConfig::default())).unwrap();
    let good = hits(&gpu, scene.traced());
    let message = |scene: &InstancedScene| block_on(scene.check(&gpu)).unwrap_err().to_string();
    // An index out of range in the second mesh; the first is hit as before.
    program.queue.write_buffer(&program.indices[1], 8, bytemuck::cast_slice(&[700_u16, 0]));
    program.submit(|encoder| scene.rebuild_mesh(&gpu, encoder, 1, &meshes[1]).unwrap());
    assert!(message(&scene).contains("mesh 1: triangle 1 has an index out of range"), "{}", message(&scene));
    let is_first = |hit: &Option<DeviceHit>| hit.filter(|hit| hit.instance % 2 == 0);
    let found: Vec<_> = hits(&gpu, scene.traced()).iter().map(is_first).collect();
    assert!(good.iter().zip(&found).all(|(good, found)| is_first(good).is_none_or(|hit| *found == Some(hit))));
    // Once repaired, nothing is reported.
    program.queue.write_buffer(&program.indices[1], 0, bytemuck::cast_slice(&SIDES));
    program.submit(|encoder| {
        scene.rebuild_mesh(&gpu, encoder, 1, &meshes[1]).unwrap();
        scene.update_top(&gpu, encoder, &six).unwrap();
    });
    assert_eq!(block_on(scene.check(&gpu)), Ok(()));
    assert_eq!(hits(&gpu, scene.traced()), good);
    let refused = |instances: InstanceBuffer<'_>| {
        let scene = InstancedScene::new(&gpu, &meshes, &instances, BuildConfig::default());
        block_on(scene).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refused(InstanceBuffer { stride: 48, ..six }).contains("stride 48"));
    assert!(refused(InstanceBuffer { first_byte: 2, ..six }).contains("first byte 2"));
    assert!(refused(InstanceBuffer { n_instances: 7, ..six }).contains("the instances end at byte"));
    let mut encoder = program.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let of = |error: Result<(), GpuError>| error.unwrap_err().to_string();
    assert!(of(scene.update_top(&gpu, &mut encoder, &program.instances(5))).contains("5 instances, and 6"));
    assert!(of(scene.rebuild_mesh(&gpu, &mut encoder, 2, &meshes[1])).contains("mesh 2 of 2"));
    assert!(of(scene.refit_mesh(&gpu, &mut encoder, 0, &meshes[1])).contains("[4] triangles"));
}

fn a_lost_device_of_the_program_is_reported() {
    let opened = opened();
    let program = Program::new(opened, &placed(6, 0.0));
    let gpu = Gpu::from_wgpu(program.device.clone(), program.queue.clone());
    program.device.set_device_lost_callback(gpu.lost_handler());
    let (meshes, six) = (program.meshes(), program.instances(6));
    let mut scene = block_on(InstancedScene::new(&gpu, &meshes, &six, BuildConfig::default())).unwrap();
    program.device.destroy();
    let _ = program.device.poll(wgpu::PollType::Poll);
    let mut encoder = program.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for _ in 0..2 {
        let error = scene.update_top(&gpu, &mut encoder, &six).unwrap_err();
        assert!(matches!(error, GpuError::Lost { .. }), "{error}");
        assert!(matches!(block_on(scene.check(&gpu)), Err(GpuError::Lost { .. })));
        assert!(matches!(block_on(scene.traced().occluded(&gpu, &rays())), Err(GpuError::Lost { .. })));
    }
}
