//! Traversal in a program's own kernel.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::build::{BuildConfig, WideConfig};
use canted_gpu::{
    BufferScene, DeviceRay, Gpu, GpuError, InstanceBuffer, InstancedScene, MeshBuffers, ModuleHit, ModuleOptions,
    Options, Source, TracedScene, block_on, wgpu,
};

use super::buffers::{buffer, corners, hits, opened, rays, vertices};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(a_kernel_of_the_program_traces_rays),
        needs_device(two_scenes_are_traced_in_one_kernel_with_a_layout_of_the_program),
        needs_device(a_kernel_has_five_buffers_beside_those_of_instances),
        needs_device(a_layout_of_another_kernel_is_rejected),
        needs_device(rays_that_leave_a_convex_surface_do_not_hit_it_again),
    ]
}

/// A compute pipeline of a text, in a layout that is derived from it.
fn pipeline(device: &wgpu::Device, text: &str) -> wgpu::ComputePipeline {
    pipeline_in(device, text, None)
}

/// A compute pipeline of a text.
fn pipeline_in(device: &wgpu::Device, text: &str, layout: Option<&wgpu::PipelineLayout>) -> wgpu::ComputePipeline {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// A program's device, and the same for this crate.
pub(crate) type On<'a> = (&'a wgpu::Device, &'a wgpu::Queue, &'a Gpu);

/// Runs a kernel that includes the module of a scene, once for each set of its own buffers in bind group 0, in so many work-groups.
pub(crate) fn run<const N: usize>(
    (device, queue, gpu): On<'_>,
    (scene, accepts): (&TracedScene, Option<&str>),
    kernel: &str,
    sets: &[[&wgpu::Buffer; N]],
    n_groups: u32,
) {
    let options = ModuleOptions { group: 1, prefix: "", accepts };
    let pipeline = pipeline(device, &(scene.module(options).unwrap() + kernel));
    let theirs = scene.bind_group(gpu, &pipeline.get_bind_group_layout(1)).unwrap();
    for own in sets {
        let entries: Vec<_> = (0..)
            .zip(own)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = &pipeline.get_bind_group_layout(0);
        let own = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
        dispatch((device, queue), &pipeline, &[&own, &theirs], n_groups);
    }
}

fn dispatch(
    (device, queue): (&wgpu::Device, &wgpu::Queue),
    pipeline: &wgpu::ComputePipeline,
    groups: &[&wgpu::BindGroup],
    n_groups: u32,
) {
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    for (number, group) in (0..).zip(groups) {
        pass.set_bind_group(number, *group, &[]);
    }
    pass.dispatch_workgroups(n_groups, 1, 1);
    drop(pass);
    queue.submit([encoder.finish()]);
}

/// A program's kernel, whose names are also names of the module's inside.
const TRACES: &str = "
@group(0) @binding(0) var<storage, read> nodes: array<Ray>;
@group(0) @binding(1) var<storage, read_write> found: array<Hit>;
fn greatest(hit: Hit) -> Hit { return hit; }
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&nodes) {
        found[id.x] = greatest(closest_hit(nodes[id.x]));
        if (found[id.x].instance != NONE) != occluded(nodes[id.x]) || is_incomplete {
            found[id.x].instance = 77u;
        }
    }
}
";

fn floor(gpu: &Gpu) -> TracedScene {
    block_on(TracedScene::new(
        gpu,
        Source::build([&corners(&vertices(0.0))], BuildConfig::default()),
        Options::default(),
    ))
    .unwrap()
}

/// Rays in the layout of kernels.
fn device_rays() -> Vec<DeviceRay> {
    let of =
        |ray: &canted_trace::Ray| DeviceRay { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: 3e38 };
    rays().iter().map(of).collect()
}

fn a_kernel_of_the_program_traces_rays() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let scene = floor(&gpu);
    let rays = device_rays();
    let rays_there = gpu.buffer("rays", &rays).unwrap();
    let found = gpu.zeroed::<ModuleHit>("hits", rays.len()).unwrap();
    let n_groups = u32::try_from(rays.len()).unwrap().div_ceil(64);
    run((&device, &queue, &gpu), (&scene, None), TRACES, &[[rays_there.wgpu(), found.wgpu()]], n_groups);
    let found = block_on(gpu.read(&found)).unwrap().into_iter().map(|hit| (hit.instance == 0).then_some(hit));
    let found: Vec<_> = found.map(|hit| hit.map(|hit| (hit.t, hit.u, hit.v, hit.primitive))).collect();
    let expected = hits(&gpu, &scene).into_iter().map(|hit| hit.map(|hit| (hit.t, hit.u, hit.v, hit.primitive)));
    assert_eq!(found, expected.collect::<Vec<_>>());
}

/// A program's kernel with types of its own that are called as those of the module, and two scenes.
const TRACES_TWO: &str = "
struct Ray { Hit: f32 }
struct Hit { t: vec2<f32>, instance: vec2<u32> }
@group(0) @binding(0) var<storage, read> rays: array<low_Ray>;
@group(0) @binding(1) var<storage, read_write> found: array<Hit>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&rays) {
        let ray = rays[id.x];
        let low = low_closest_hit(ray);
        let high = high_closest_hit(high_Ray(ray.origin, ray.t_min, ray.direction, ray.t_max));
        found[id.x] = Hit(vec2<f32>(low.t, high.t), vec2<u32>(low.instance, high.instance));
        if low_is_incomplete || high_is_incomplete {
            found[id.x].instance = vec2<u32>(77u);
        }
    }
}
";

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct TwoHits {
    t: [f32; 2],
    instance: [u32; 2],
}

fn two_scenes_are_traced_in_one_kernel_with_a_layout_of_the_program() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let moved = corners(&vertices(1.0));
    let wide = Source::build([&moved], WideConfig::default());
    let scenes = [floor(&gpu), block_on(TracedScene::new(&gpu, wide, Options::default())).unwrap()];
    let [low, high] = [(1, "low_"), (2, "high_")].map(|(group, prefix)| ModuleOptions { group, prefix, accepts: None });
    let text = scenes[0].module(low).unwrap() + &scenes[1].module(high).unwrap() + TRACES_TWO;
    let rays_there = gpu.buffer("rays", &device_rays()).unwrap();
    let found = gpu.zeroed::<TwoHits>("hits", rays_there.len()).unwrap();
    // Layouts of the program's own, before there is a pipeline.
    let storage = |binding, read_only| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let theirs = TracedScene::layout_entries(wgpu::ShaderStages::COMPUTE);
    let all = [vec![storage(0, true), storage(1, false)], theirs.clone(), theirs];
    let layouts = all.map(|entries| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
    });
    let bind_group_layouts = &layouts.each_ref().map(Some);
    let layout =
        device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor { bind_group_layouts, ..Default::default() });
    let entries = [(0, rays_there.wgpu()), (1, found.wgpu())]
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
    let own = wgpu::BindGroupDescriptor { label: None, layout: &layouts[0], entries: &entries };
    let groups = [
        device.create_bind_group(&own),
        scenes[0].bind_group(&gpu, &layouts[1]).unwrap(),
        scenes[1].bind_group(&gpu, &layouts[2]).unwrap(),
    ];
    dispatch((&device, &queue), &pipeline_in(&device, &text, Some(&layout)), &groups.each_ref(), 16);
    let found = block_on(gpu.read(&found)).unwrap();
    for (k, scene) in scenes.iter().enumerate() {
        let found = found.iter().map(|hit| (hit.instance[k] == 0).then_some(hit.t[k]));
        let expected: Vec<_> = hits(&gpu, scene).into_iter().map(|hit| hit.map(|hit| hit.t)).collect();
        assert!(expected.iter().flatten().count() > 500);
        assert_eq!(found.collect::<Vec<_>>(), expected, "scene {k}");
    }
    match scenes[0].module(ModuleOptions { group: 1, prefix: "2_", accepts: None }) {
        Err(GpuError::Shader(error)) => assert!(error.to_string().contains("'2_'"), "{error}"),
        other => panic!("{other:?}"),
    }
}

/// A path tracer's five buffers, beside the module of moving instances.
const FIVE: &str = "
@group(0) @binding(0) var<storage, read> rays: array<Ray>;
@group(0) @binding(1) var<storage, read_write> found: array<Hit>;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> materials: array<f32>;
@group(0) @binding(4) var<storage, read_write> sums: array<f32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&rays) {
        found[id.x] = closest_hit(rays[id.x]);
        sums[id.x] += positions[id.x] * materials[id.x];
    }
}
";

fn a_kernel_has_five_buffers_beside_those_of_instances() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    let most = gpu.limits().max_storage_buffers_per_shader_stage;
    assert_eq!(most, 8);
    assert_eq!(gpu.check_module(5), Ok(()));
    let error = gpu.check_module(6).unwrap_err();
    assert!(error.is_of_scene());
    let expected = "a kernel with 6 storage buffers and the 3 of the module: requires 9 storage buffers per shader stage, the device supports 8; ";
    assert!(error.to_string().starts_with(expected), "{error}");
    assert!(gpu.check_module(u32::MAX).is_err());
    let at =
        |z: f32| canted_obb::Affine { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, z]] };
    let still = canted_tlas::Instance::new(0, at(0.0));
    let moving = canted_tlas::Instance { world_from_object_close: Some(at(1.0)), ..still };
    let mesh = corners(&vertices(0.0));
    for instances in [[still, still], [still, moving]] {
        let input = Source::build([&mesh], WideConfig::default()).with_instances(&instances);
        let scene = block_on(TracedScene::new(&gpu, input, Options::default())).unwrap();
        // Its layout would be an error of the device, which ends the test.
        let pipeline = pipeline(&device, &(scene.module(1).unwrap() + FIVE));
        scene.bind_group(&gpu, &pipeline.get_bind_group_layout(1)).unwrap();
    }
}

fn a_layout_of_another_kernel_is_rejected() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue);
    let other = "@group(0) @binding(0) var<storage, read_write> x: array<f32>;
                 @compute @workgroup_size(1) fn main() { x[0] = 1.0; }";
    let layout = pipeline(&device, other).get_bind_group_layout(0);
    match floor(&gpu).bind_group(&gpu, &layout) {
        Err(GpuError::Input { message }) => assert!(message.contains("does not fit the module"), "{message}"),
        other => panic!("{other:?}"),
    }
}

/// Of rays that leave the hits of a closed, convex surface, counts those that hit it again. They start beside the surface, or at the points of hits.
const LEAVES: &str = "
@group(0) @binding(0) var<storage, read_write> n_hit_again: array<atomic<u32>, 3>;
fn random(seed: ptr<function, u32>) -> f32 {
    *seed = *seed * 747796405u + 2891336453u;
    let word = ((*seed >> ((*seed >> 28u) + 4u)) ^ *seed) * 277803737u;
    return f32(((word >> 22u) ^ word) >> 8u) / 16777216.0;
}
fn on_sphere(seed: ptr<function, u32>) -> vec3f {
    let z = 1.0 - 2.0 * random(seed);
    let angle = 6.2831853 * random(seed);
    return vec3f(sqrt(max(0.0, 1.0 - z * z)) * vec2f(cos(angle), sin(angle)), z);
}
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    var seed = id.x * 9781u + 1u;
    let eye = CENTER + 4.0 * on_sphere(&seed);
    let first = ray(eye, CENTER + 0.8 * on_sphere(&seed) - eye, 3e38);
    var next = first;
    var hit: Hit;
    var surface: Surface;
    // One call, because drivers compile a traversal for each.
    for (var i = 0u; i < 17u; i++) {
        let found = closest_hit(next);
        if i == 0u {
            hit = found;
            if hit.instance == NONE {
                return;
            }
            surface = surface_of(hit, first);
        } else if found.instance != NONE || is_incomplete {
            atomicAdd(&n_hit_again[1], 1u);
        }
        atomicAdd(&n_hit_again[0], 1u);
        var direction = on_sphere(&seed);
        direction *= sign(dot(direction, surface.normal)) * sign(dot(surface.normal, surface.position - CENTER));
        next = ray(surface.position, direction, 3e38);
        if atomicLoad(&n_hit_again[2]) == 1u {
            next.origin = origin_beside(hit, first, direction);
        }
    }
}
";

/// A ball of 2,048 triangles of similar size: an octahedron whose triangles are divided.
fn ball(center: [f32; 3]) -> Vec<[f32; 3]> {
    let axis = |k: usize, sign: f32| std::array::from_fn(|i| if i == k { sign } else { 0.0_f32 });
    let mut faces: Vec<[[f32; 3]; 3]> = vec![];
    for [x, y, z] in (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { -1.0 } else { 1.0 })) {
        faces.push([axis(0, x), axis(1, y), axis(2, z)]);
    }
    let middle = |a: [f32; 3], b: [f32; 3]| {
        let sum: [f32; 3] = std::array::from_fn(|i| a[i] + b[i]);
        let length = sum.iter().map(|x| x * x).sum::<f32>().sqrt();
        sum.map(|x| x / length)
    };
    for _ in 0..4 {
        let divided = |[a, b, c]: [[f32; 3]; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.into_iter().flat_map(divided).collect();
    }
    let moved = |vertex: [f32; 3]| std::array::from_fn(|i| vertex[i] + center[i]);
    faces.into_flattened().into_iter().map(moved).collect()
}

/// Rays that left hits, and those of them that hit the surface again: of rays that start beside the surface, and of rays that start at hits.
fn leave(on: On<'_>, scene: &TracedScene, [x, y, z]: [f32; 3]) -> [[u32; 2]; 2] {
    let kernel = format!("const CENTER = vec3f({x:?}, {y:?}, {z:?}); {LEAVES}");
    let (_, _, gpu) = on;
    let counts = [true, false].map(|is_beside| gpu.buffer("counts", &[0, 0, u32::from(is_beside)]).unwrap());
    run(on, (scene, None), &kernel, &counts.each_ref().map(|counts| [counts.wgpu()]), 16);
    counts.map(|counts| block_on(gpu.read(&counts)).unwrap()).map(|counts| [counts[0], counts[1]])
}

/// Rays that start beside a hit do not meet the convex surface again, and others do.
fn rays_that_leave_a_convex_surface_do_not_hit_it_again() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let on = (&device, &queue, &gpu);
    for center in [[3.0, -2.0, 5.0], [0.0; 3], [1000.0, 0.3, -40.0]] {
        let soup = ball(center);
        let n_vertices = u32::try_from(soup.len()).unwrap();
        let positions = buffer(&device, bytemuck::cast_slice(&soup));
        let mesh = MeshBuffers {
            vertices: &positions,
            first_byte: 0,
            stride: 12,
            n_vertices,
            indices: None,
            n_triangles: n_vertices / 3,
        };
        let scene = block_on(BufferScene::new(&gpu, &[mesh], WideConfig::default())).unwrap();
        let [[n, n_again], at_hits] = leave(on, scene.traced(), center);
        assert!(n > 12_000 && n_again == 0, "{center:?}: {n_again} of {n}");
        assert!(at_hits[1] > 0, "{center:?}: rays may start at hits");
        // A turn about z, a scale of 0.7, and a translation.
        let (sin, cos, shift) = (0.42, 0.56, [0.5, -7.0, 2.0]);
        let rows = [[cos, -sin, 0.0, shift[0]], [sin, cos, 0.0, shift[1]], [0.0, 0.0, 0.7, shift[2]]];
        let mut words: Vec<u32> = rows.iter().flatten().map(|x: &f32| x.to_bits()).collect();
        words.push(0);
        let transforms = buffer(&device, bytemuck::cast_slice(&words));
        let instances =
            InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 52, n_instances: 1, has_masks: false };
        let scene = block_on(InstancedScene::new(&gpu, &[mesh], &instances, WideConfig::default())).unwrap();
        let place = |[x, y, z]: [f32; 3]| rows.map(|row| row[0] * x + row[1] * y + row[2] * z + row[3]);
        let [[n, n_again], at_hits] = leave(on, scene.traced(), place(center));
        assert!(n > 6_000 && n_again == 0, "instance of {center:?}: {n_again} of {n}");
        assert!(at_hits[1] > 0, "instance of {center:?}: rays may start at hits");
    }
}
