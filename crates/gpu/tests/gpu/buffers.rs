//! A program's own device, buffers and encoder.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::build::{BuildConfig, STRATEGIES, Topology, WideConfig};
use canted_gpu::wgpu::util::{BufferInitDescriptor, DeviceExt};
use canted_gpu::{
    Bits, BufferConfig, BufferScene, DeviceBvh, DeviceHit, Gpu, GpuError, IndexBuffer, MeshBuffers, Options, Outcome,
    Source, TracedScene, block_on, wgpu,
};
use canted_gpu::{InstanceBuffer, InstancedScene};
use canted_lbvh::Strategy;
use canted_trace::Ray;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(rebuilds_take_few_dispatches),
        needs_device(buffers_of_any_layout_give_the_same_hits),
        needs_device(recorded_rebuilds_and_refits_equal_a_fresh_build),
        needs_device(a_buffer_above_the_binding_limit_holds_a_small_mesh),
        needs_device(faults_are_reported_and_hit_nothing),
        needs_device(layouts_that_do_not_fit_are_rejected),
        needs_device(counts_that_no_buffer_holds_are_errors),
    ]
}

pub(crate) type Corners = [[f32; 3]; 3];

pub(crate) const N: u32 = 12;

/// A device that a program opened for itself.
pub(crate) fn opened() -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 8, ..wgpu::Limits::defaults() };
    let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
    pollster::block_on(adapters[0].request_device(&descriptor)).unwrap()
}

/// Heights of a wavy floor of `N` by `N` squares at a time, as vertices.
pub(crate) fn vertices(time: f32) -> Vec<[f32; 3]> {
    let vertex = |i: u32| {
        let [x, y] = [(i % (N + 1)) as f32, (i / (N + 1)) as f32];
        [x, y, (x * 0.7 + time).sin() * (y * 0.4).cos()]
    };
    (0..(N + 1) * (N + 1)).map(vertex).collect()
}

pub(crate) fn triangles() -> Vec<[u32; 3]> {
    let corner = (0..N).flat_map(|y| (0..N).map(move |x| y * (N + 1) + x));
    corner.flat_map(|i| [[i, i + 1, i + N + 2], [i, i + N + 2, i + N + 1]]).collect()
}

pub(crate) fn corners(vertices: &[[f32; 3]]) -> Vec<Corners> {
    triangles().iter().map(|triangle| triangle.map(|i| vertices[i as usize])).collect()
}

pub(crate) fn rays() -> Vec<Ray> {
    let ray = |i: u32| {
        let x = (i % 40) as f32 * 0.31 - 0.1;
        Ray::new([x, (i / 40) as f32 * 0.47, 5.0], [0.02, -0.01, -2.0])
    };
    (0..1000).map(ray).collect()
}

pub(crate) fn buffer(device: &wgpu::Device, contents: &[u8]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
    device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
}

pub(crate) fn hits(gpu: &Gpu, scene: &TracedScene) -> Vec<Option<DeviceHit>> {
    let answers = block_on(scene.closest_hits(gpu, &rays())).unwrap().into_iter().map(|answer| match answer {
        Outcome::Complete(hit) => hit,
        Outcome::Incomplete => panic!("no traversal here is long"),
    });
    answers.collect()
}

/// The wavy floor in buffers without gaps.
pub(crate) fn floor<'a>(positions: &'a wgpu::Buffer, indices: &'a wgpu::Buffer) -> MeshBuffers<'a> {
    MeshBuffers {
        vertices: positions,
        first_byte: 0,
        stride: 12,
        n_vertices: (N + 1) * (N + 1),
        indices: Some(IndexBuffer { buffer: indices, format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
        n_triangles: 2 * N * N,
    }
}

/// The hits of a BVH that is built over the same triangles at once.
pub(crate) fn expected(gpu: &Gpu, vertices: &[[f32; 3]]) -> Vec<Option<DeviceHit>> {
    hits(
        gpu,
        &block_on(TracedScene::new(
            gpu,
            Source::build([&corners(vertices)], BuildConfig::default()),
            Options::default(),
        ))
        .unwrap(),
    )
}

/// Vertices of `n` triangles that fill a cube.
pub(crate) fn soup(device: &wgpu::Device, n: u32) -> wgpu::Buffer {
    let corner = |i: u32| [1, 7, 49].map(|k| ((i * k).wrapping_mul(2_654_435_761) >> 8) as f32);
    let corners: Vec<[f32; 3]> = (0..3 * n).map(corner).collect();
    buffer(device, bytemuck::cast_slice(&corners))
}

/// The mesh of these triangles.
pub(crate) fn soup_mesh(soup: &wgpu::Buffer, n_triangles: u32) -> MeshBuffers<'_> {
    MeshBuffers { vertices: soup, first_byte: 0, stride: 12, n_vertices: 3 * n_triangles, indices: None, n_triangles }
}

/// Dispatches and downloaded bytes of a rebuild and of a refit of such triangles.
fn updates_of(gpu: &Gpu, device: &wgpu::Device, n: u32, bvh: DeviceBvh) -> [(u64, u64); 2] {
    let soup = soup(device, n);
    let mesh = soup_mesh(&soup, n);
    let mut scene = block_on(BufferScene::new(gpu, &[mesh], bvh)).unwrap();
    [true, false].map(|is_rebuild| {
        let before = gpu.traffic();
        let mut encoder = gpu.encoder();
        match is_rebuild {
            true => scene.rebuild(gpu, &mut encoder, &[mesh]).unwrap(),
            false => scene.refit(gpu, &mut encoder, &[mesh]).unwrap(),
        }
        gpu.submit(encoder).unwrap();
        let traffic = gpu.traffic() - before;
        (traffic.n_dispatches, traffic.downloaded_bytes)
    })
}

/// Rebuilds and refits over 63-bit codes take few dispatches and download nothing: for one tile of keys, for tiles that sum the counts of
/// all others, and for more.
fn rebuilds_take_few_dispatches() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    for n in [1000, 60_000, 70_000] {
        let few = n == 1000;
        for (strategy, of_binary, of_wide) in [
            (Strategy::Aabb, [if few { 10 } else { 16 }, 4], [if few { 14 } else { 23 }, 5]),
            (Strategy::Combined, [if few { 13 } else { 19 }, 7], [if few { 19 } else { 28 }, 9]),
        ] {
            let config = BuildConfig { bits: Bits::B63, strategy };
            for (bvh, most) in [(DeviceBvh::from(config), of_binary), (WideConfig::from(config).into(), of_wide)] {
                let found = updates_of(&gpu, &device, n, bvh);
                assert!(found[0].0 <= most[0] && found[1].0 <= most[1], "{n} triangles, {bvh:?}: {found:?}");
                assert_eq!(found.map(|(_, downloaded)| downloaded), [0; 2], "{n} triangles, {bvh:?}");
            }
        }
    }
}

fn buffers_of_any_layout_give_the_same_hits() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    let vertices = vertices(0.0);
    let expected = expected(&gpu, &vertices);
    assert!(expected.iter().flatten().count() > 500);
    // Positions after eight other bytes, every 32.
    let mut spread = vec![0.0_f32; 2];
    spread.extend(vertices.iter().flat_map(|&[x, y, z]| [x, y, z, 9.0, 9.0, 9.0, 9.0, 9.0]));
    let spread = buffer(&device, bytemuck::cast_slice(&spread));
    let wide = buffer(&device, bytemuck::cast_slice(&triangles()));
    let mut narrow = vec![7_u16];
    narrow.extend(triangles().iter().flatten().map(|&i| u16::try_from(i).unwrap()));
    narrow.push(7);
    let narrow = buffer(&device, bytemuck::cast_slice(&narrow));
    let soup: Vec<[f32; 3]> = corners(&vertices).into_iter().flatten().collect();
    let soup = buffer(&device, bytemuck::cast_slice(&soup));
    let n_triangles = 2 * N * N;
    let mesh = MeshBuffers {
        vertices: &spread,
        first_byte: 8,
        stride: 32,
        n_vertices: (N + 1) * (N + 1),
        indices: Some(IndexBuffer { buffer: &wide, format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
        n_triangles,
    };
    let narrow = Some(IndexBuffer { buffer: &narrow, format: wgpu::IndexFormat::Uint16, first_byte: 2 });
    let plain = MeshBuffers {
        vertices: &soup,
        first_byte: 0,
        stride: 12,
        n_vertices: 3 * n_triangles,
        indices: None,
        n_triangles,
    };
    for mesh in [mesh, MeshBuffers { indices: narrow, ..mesh }, plain] {
        for strategy in STRATEGIES {
            let config = BuildConfig { strategy, ..BuildConfig::default() };
            let scene = block_on(BufferScene::new(&gpu, &[mesh], config)).unwrap();
            assert_eq!(hits(&gpu, scene.traced()), expected, "{strategy:?}");
            let wide = WideConfig { strategy, ..WideConfig::default() };
            let scene = block_on(BufferScene::new(&gpu, &[mesh], wide)).unwrap();
            assert_eq!(hits(&gpu, scene.traced()), expected, "wide, {strategy:?}");
        }
    }
    // A second mesh in the same place is another instance, and ties go to the first.
    let scene = block_on(BufferScene::new(&gpu, &[plain, mesh], BuildConfig::default())).unwrap();
    assert_eq!(hits(&gpu, scene.traced()), expected);
    // Without triangles nothing is hit.
    for bvh in [DeviceBvh::default(), WideConfig::default().into()] {
        let none = block_on(BufferScene::new(&gpu, &[MeshBuffers { n_triangles: 0, ..mesh }], bvh)).unwrap();
        assert!(hits(&gpu, none.traced()).iter().all(Option::is_none));
    }
}

fn recorded_rebuilds_and_refits_equal_a_fresh_build() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let positions = buffer(&device, bytemuck::cast_slice(&vertices(0.0)));
    let indices = buffer(&device, bytemuck::cast_slice(&triangles()));
    let mesh = floor(&positions, &indices);
    let binary = [Strategy::Aabb, Strategy::Combined, Strategy::PcaUnbounded, Strategy::Dop]
        .map(|strategy| DeviceBvh::from(BuildConfig { strategy, ..BuildConfig::default() }));
    let wide =
        [(Strategy::Aabb, Topology::Ploc), (Strategy::Combined, Topology::Ploc), (Strategy::Dop, Topology::Radix)]
            .map(|(strategy, topology)| WideConfig { topology, strategy, ..WideConfig::default() }.into());
    for bvh in binary.into_iter().chain(wide) {
        queue.write_buffer(&positions, 0, bytemuck::cast_slice(&vertices(0.0)));
        let mut scene = block_on(BufferScene::new(&gpu, &[mesh], bvh)).unwrap();
        for (frame, time) in [0.5_f32, 1.0, 40.0].into_iter().enumerate() {
            let moved = vertices(time);
            queue.write_buffer(&positions, 0, bytemuck::cast_slice(&moved));
            let before = hits(&gpu, scene.traced());
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            if frame % 2 == 0 {
                scene.rebuild(&gpu, &mut encoder, &[mesh]).unwrap();
            } else {
                scene.refit(&gpu, &mut encoder, &[mesh]).unwrap();
            }
            queue.submit([encoder.finish()]);
            block_on(scene.check(&gpu)).unwrap();
            let expected = expected(&gpu, &moved);
            assert_eq!(hits(&gpu, scene.traced()), expected, "{bvh:?}, frame {frame}");
            assert_ne!(before, expected, "{bvh:?}, frame {frame}: the vertices did not move");
        }
    }
}

/// Only the used part of a buffer is bound.
fn a_buffer_above_the_binding_limit_holds_a_small_mesh() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let most = device.limits().max_storage_buffer_binding_size;
    let large = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: most + 65_536,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    // Neither offset is a multiple of what devices require of a binding.
    let (first_vertex, first_index) = (most + 1_004, most + 32_770);
    queue.write_buffer(&large, first_vertex, bytemuck::cast_slice(&vertices(0.0)));
    let mut narrow = vec![7_u16];
    narrow.extend(triangles().iter().flatten().map(|&i| u16::try_from(i).unwrap()));
    narrow.push(7);
    queue.write_buffer(&large, first_index - 2, bytemuck::cast_slice(&narrow));
    let mesh = MeshBuffers {
        vertices: &large,
        first_byte: first_vertex,
        stride: 12,
        n_vertices: (N + 1) * (N + 1),
        indices: Some(IndexBuffer { buffer: &large, format: wgpu::IndexFormat::Uint16, first_byte: first_index }),
        n_triangles: 2 * N * N,
    };
    let scene = block_on(BufferScene::new(&gpu, &[mesh], WideConfig::default())).unwrap();
    assert_eq!(hits(&gpu, scene.traced()), expected(&gpu, &vertices(0.0)));
    let n_vertices = u32::try_from((most + 65_536) / 12).unwrap();
    let whole = MeshBuffers { first_byte: 0, n_vertices, ..mesh };
    let error = block_on(BufferScene::new(&gpu, &[whole], WideConfig::default())).map(|_| ()).unwrap_err().to_string();
    assert!(error.starts_with("mesh 0: the vertices have") && error.contains("a storage binding"), "{error}");
}

fn faults_are_reported_and_hit_nothing() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    let mesh = |vertices: &[[f32; 3]], triangles: &[[u32; 3]]| {
        let positions = buffer(&device, bytemuck::cast_slice(vertices));
        let indices = buffer(&device, bytemuck::cast_slice(triangles));
        (positions, indices, u32::try_from(vertices.len()).unwrap(), u32::try_from(triangles.len()).unwrap())
    };
    let report = |(vertices, indices, n_vertices, n_triangles): &(wgpu::Buffer, wgpu::Buffer, u32, u32)| {
        let indices = Some(IndexBuffer { buffer: indices, format: wgpu::IndexFormat::Uint32, first_byte: 0 });
        let mesh = MeshBuffers {
            vertices,
            first_byte: 0,
            stride: 12,
            n_vertices: *n_vertices,
            indices,
            n_triangles: *n_triangles,
        };
        // No endless loop, whatever the contents.
        for bvh in [DeviceBvh::default(), WideConfig { strategy: Strategy::Combined, ..WideConfig::default() }.into()] {
            let scene =
                block_on(BufferScene::new(&gpu, &[mesh], BufferConfig { is_checked: false, ..bvh.into() })).unwrap();
            let _ = hits(&gpu, scene.traced());
        }
        block_on(BufferScene::new(&gpu, &[mesh], BuildConfig::default())).map(|_| ()).map_err(|error| error.to_string())
    };
    let (good, mut bad) = (vertices(0.0), triangles());
    assert_eq!(report(&mesh(&good, &bad)), Ok(()));
    bad[9][1] = 1 << 30;
    bad[7][2] = (N + 1) * (N + 1);
    let found = report(&mesh(&good, &bad)).unwrap_err();
    assert!(found.contains("mesh 0: triangle 7 has an index out of range"), "{found}");
    for wrong in [f32::NAN, f32::INFINITY, -2e18] {
        let mut vertices = good.clone();
        vertices[triangles()[20][1] as usize][1] = wrong;
        let found = report(&mesh(&vertices, &triangles())).unwrap_err();
        assert!(found.contains("has a vertex that is not finite"), "{found}");
    }
    let everything_wrong = vec![[f32::NAN; 3]; good.len()];
    assert!(report(&mesh(&everything_wrong, &triangles())).unwrap_err().contains("mesh 0: triangle 0 has a vertex"));
}

fn layouts_that_do_not_fit_are_rejected() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    let vertices = buffer(&device, &[0; 36]);
    let good =
        MeshBuffers { vertices: &vertices, first_byte: 0, stride: 12, n_vertices: 3, indices: None, n_triangles: 1 };
    let refused = |mesh: MeshBuffers<'_>| match block_on(BufferScene::new(&gpu, &[mesh], BuildConfig::default())) {
        Ok(_) => panic!("{mesh:?} is accepted"),
        Err(GpuError::Input { message }) => message,
        Err(error) => error.to_string(),
    };
    assert!(block_on(BufferScene::new(&gpu, &[good], BuildConfig::default())).is_ok());
    let hidden = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 36,
        usage: wgpu::BufferUsages::VERTEX,
        mapped_at_creation: false,
    });
    let index = |first_byte| Some(IndexBuffer { buffer: &vertices, format: wgpu::IndexFormat::Uint32, first_byte });
    let cases = [
        (MeshBuffers { stride: 10, ..good }, "stride 10"),
        (MeshBuffers { first_byte: 4, ..good }, "the vertices end at byte 40 of a buffer of 36 bytes"),
        (MeshBuffers { n_triangles: 2, ..good }, "2 triangles without indices need 6 vertices, not 3"),
        (MeshBuffers { indices: index(28), ..good }, "the indices end at byte 40"),
        (MeshBuffers { indices: index(2), ..good }, "must be a multiple of 4"),
        (MeshBuffers { vertices: &hidden, ..good }, "lacks the usage STORAGE"),
    ];
    for (mesh, word) in cases {
        let message = refused(mesh);
        assert!(message.starts_with("mesh 0: ") && message.contains(word), "{message}");
    }
}

fn counts_that_no_buffer_holds_are_errors() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    let vertices = buffer(&device, &[0; 36]);
    let good =
        MeshBuffers { vertices: &vertices, first_byte: 0, stride: 12, n_vertices: 3, indices: None, n_triangles: 1 };
    let half = MeshBuffers { n_triangles: 1 << 31, ..good };
    let far = MeshBuffers { stride: 1 << 33, n_vertices: (1 << 31) + 1, ..good };
    let last = MeshBuffers { first_byte: u64::MAX - 3, ..good };
    for meshes in [&[half, half][..], &[half], &[far], &[last]] {
        for bvh in [DeviceBvh::default(), WideConfig::default().into()] {
            assert!(block_on(BufferScene::new(&gpu, meshes, bvh)).is_err(), "{meshes:?}");
        }
    }
    for n_instances in [u32::MAX, 3_000_000_000] {
        let instances = InstanceBuffer { buffer: &vertices, first_byte: 0, stride: 52, n_instances, has_masks: false };
        assert!(block_on(InstancedScene::new(&gpu, &[good], &instances, WideConfig::default())).is_err());
    }
    for parts in [&[1][..], &[0, 2], &[0, 1, 0]] {
        let error = block_on(BufferScene::new(
            &gpu,
            &[good],
            BufferConfig { parts: Some(parts), ..DeviceBvh::default().into() },
        ))
        .map(drop)
        .unwrap_err();
        assert_eq!(error.to_string(), "parts of 1 triangles must start at 0, in order and before the end");
    }
    assert!(
        block_on(BufferScene::new(
            &gpu,
            &[good],
            BufferConfig { parts: Some(&[0, 0, 1]), ..DeviceBvh::default().into() }
        ))
        .is_ok()
    );
}
