//! Ambient occlusion of a sheet that a compute pass moves and whose BVH is rebuilt in every frame. Only pictures leave the device.
//!
//! ```text
//! cargo run --release -p wgpu-ao -- FOLDER [FRAMES]      writes FOLDER/ao_00.png, ...
//! ```

#![forbid(unsafe_code)]

use std::error::Error;
use std::path::PathBuf;

use canted_gpu::build::BuildConfig;
use canted_gpu::wgpu::util::{BufferInitDescriptor, DeviceExt};
use canted_gpu::{BufferScene, Gpu, IndexBuffer, MeshBuffers, block_on, wgpu};

/// Vertices along a side of the sheet.
const N: u32 = 128;
/// As in `ao.wgsl`.
const SIZE: [u32; 2] = [480, 270];

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = PathBuf::from(args.next().unwrap_or_else(|| ".".to_owned()));
    let n_frames: u16 = args.next().map_or(Ok(3), |word| word.parse())?;

    // The program's own device, buffers and first kernel.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
    let buffer = |contents: &[u8]| device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage });
    let positions = buffer(bytemuck::cast_slice(&vec![0.0_f32; 3 * (N * N) as usize]));
    let square = (0..N - 1).flat_map(|y| (0..N - 1).map(move |x| y * N + x));
    let triangles: Vec<[u32; 3]> = square.flat_map(|i| [[i, i + N, i + 1], [i + 1, i + N, i + N + 1]]).collect();
    let indices = buffer(bytemuck::cast_slice(&triangles));
    let frame = buffer(&[0; 8]);
    let moving = pipeline(&device, include_str!("move.wgsl"));
    let to_move = group(&device, &moving, &[&frame, &positions]);

    // A BVH over the program's buffers, and its traversal in the program's second kernel.
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let mesh = MeshBuffers {
        vertices: &positions,
        first_byte: 0,
        stride: 12,
        n_vertices: N * N,
        indices: Some(IndexBuffer { buffer: &indices, format: wgpu::IndexFormat::Uint32, first_byte: 0 }),
        n_triangles: 2 * (N - 1) * (N - 1),
    };
    let mut scene = block_on(BufferScene::new(&gpu, &[mesh], BuildConfig::default()))?;
    let shading = pipeline(&device, &(scene.traced().module(1)? + include_str!("ao.wgsl")));
    let brightness = gpu.zeroed::<f32>("brightness", (SIZE[0] * SIZE[1]) as usize)?;
    let to_shade = group(&device, &shading, &[brightness.wgpu()]);
    let traversal = scene.traced().bind_group(&gpu, &shading.get_bind_group_layout(1))?;

    for number in 0..n_frames {
        queue.write_buffer(&frame, 0, bytemuck::bytes_of(&(0.4 * f32::from(number))));
        queue.write_buffer(&frame, 4, bytemuck::bytes_of(&N));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        dispatch(&mut encoder, &moving, &[&to_move], [(N * N).div_ceil(64), 1]);
        scene.rebuild(&gpu, &mut encoder, &[mesh])?;
        dispatch(&mut encoder, &shading, &[&to_shade, &traversal], SIZE.map(|n| n.div_ceil(8)));
        queue.submit([encoder.finish()]);
        let brightness = block_on(gpu.read(&brightness))?;
        if brightness.iter().any(|&of_pixel| of_pixel < 0.0) {
            return Err("the rays of a pixel take more steps than this driver allows".into());
        }
        let gray = brightness.into_iter().map(to_srgb).collect();
        let picture = image::GrayImage::from_raw(SIZE[0], SIZE[1], gray).ok_or("a picture of another size")?;
        picture.save(folder.join(format!("ao_{number:02}.png")))?;
    }
    block_on(scene.check(&gpu))?;
    Ok(())
}

fn to_srgb(brightness: f32) -> u8 {
    (255.0 * brightness.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8
}

fn pipeline(device: &wgpu::Device, text: &str) -> wgpu::ComputePipeline {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn group(device: &wgpu::Device, pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
    let entries: Vec<_> = entries.collect();
    let layout = &pipeline.get_bind_group_layout(0);
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn dispatch(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    groups: &[&wgpu::BindGroup],
    [x, y]: [u32; 2],
) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    for (number, &group) in (0..).zip(groups) {
        pass.set_bind_group(number, group, &[]);
    }
    pass.dispatch_workgroups(x, y, 1);
}
