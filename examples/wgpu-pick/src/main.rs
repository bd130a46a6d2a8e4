//! Ray picking in a kernel of a wgpu program: which cube, which triangle, how far? The cubes are instances of one mesh.
//!
//! ```text
//! cargo run --release -p wgpu-pick -- 0.1 -0.2      pointer: x and y from -1 to 1
//! ```

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the answer is the output of the program")]

use std::error::Error;

use canted_gpu::build::WideConfig;
use canted_gpu::wgpu::util::{BufferInitDescriptor, DeviceExt};
use canted_gpu::{DeviceHit, Gpu, IndexBuffer, InstanceBuffer, InstancedScene, MeshBuffers, ModuleHit, block_on, wgpu};

/// Corners of a cube by bits, with another vector behind each position, as a program's own vertices have.
fn cube() -> Vec<[f32; 6]> {
    let corner = |i: u32| {
        let at = |k: u32| if i >> k & 1 == 0 { -0.5 } else { 0.5 };
        [at(0), at(1), at(2), 0.0, 1.0, 0.0]
    };
    (0..8).map(corner).collect()
}

/// An instance as the program draws it: rows of its transform, the number of its mesh.
fn placed([x, y, z]: [f32; 3], size: f32) -> [u32; 13] {
    let rows = [[size, 0.0, 0.0, x], [0.0, size, 0.0, y], [0.0, 0.0, size, z]].map(|row| row.map(f32::to_bits));
    let mut words = [0; 13];
    words[..12].copy_from_slice(rows.as_flattened());
    words
}

const CUBE: [[u16; 3]; 12] = [
    [0, 2, 1],
    [1, 2, 3],
    [4, 5, 6],
    [5, 7, 6],
    [0, 1, 4],
    [1, 5, 4],
    [2, 6, 3],
    [3, 6, 7],
    [0, 4, 2],
    [2, 4, 6],
    [1, 3, 5],
    [3, 7, 5],
];

/// `Picked` of `pick.wgsl`.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Picked {
    hit: ModuleHit,
    padding: [u32; 2],
    normal: [f32; 3],
    more_padding: u32,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut pointer = std::env::args().skip(1).map(|word| word.parse::<f32>());
    let (x, y) = (pointer.next().transpose()?.unwrap_or(0.0), pointer.next().transpose()?.unwrap_or(0.0));

    // The program's own device, buffers and pipeline.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    let usage = wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::INDEX | wgpu::BufferUsages::STORAGE;
    let buffer = |contents: &[u8]| device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage });
    let vertices = buffer(bytemuck::cast_slice(&cube()));
    let indices = buffer(bytemuck::cast_slice(&CUBE));
    let cubes = [placed([-1.2, 0.0, 0.0], 1.0), placed([0.0, 0.3, -1.0], 1.5), placed([1.3, -0.2, 0.5], 0.8)];
    let transforms = buffer(bytemuck::cast_slice(&cubes));

    // A BVH over the program's buffers, and its traversal in the program's kernel.
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let mesh = MeshBuffers {
        vertices: &vertices,
        first_byte: 0,
        stride: 24,
        n_vertices: 8,
        indices: Some(IndexBuffer { buffer: &indices, format: wgpu::IndexFormat::Uint16, first_byte: 0 }),
        n_triangles: 12,
    };
    let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 52, n_instances: 3, has_masks: false };
    let scene = block_on(InstancedScene::new(&gpu, &[mesh], &instances, WideConfig::default()))?;
    let text = scene.traced().module(1)? + include_str!("pick.wgsl");
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("pick"),
        source: wgpu::ShaderSource::Wgsl(text.as_str().into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("pick"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });

    // One ray.
    let contents: [f32; 8] = [0.0, 1.0, 6.0, x, 0.0, -0.15, -1.0, y];
    let descriptor = BufferInitDescriptor {
        label: None,
        contents: bytemuck::bytes_of(&contents),
        usage: wgpu::BufferUsages::UNIFORM,
    };
    let pointer = device.create_buffer_init(&descriptor);
    let picked = gpu.zeroed::<Picked>("picked", 1)?;
    let own = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: pointer.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: picked.wgpu().as_entire_binding() },
        ],
    });
    let traversal = scene.traced().bind_group(&gpu, &pipeline.get_bind_group_layout(1))?;
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &own, &[]);
    pass.set_bind_group(1, &traversal, &[]);
    pass.dispatch_workgroups(1, 1, 1);
    drop(pass);
    queue.submit([encoder.finish()]);
    let Picked { hit, normal: [x_of, y_of, z_of], .. } = block_on(gpu.read(&picked))?[0];
    if hit.instance == DeviceHit::NONE {
        println!("nothing at ({x}, {y})");
    } else {
        println!("cube {}, triangle {}, at t = {}", hit.instance, hit.primitive, hit.t);
        println!("its normal is ({x_of}, {y_of}, {z_of})");
    }
    Ok(())
}
