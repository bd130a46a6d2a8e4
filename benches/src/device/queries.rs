//! The adapter's own ray queries over acceleration structures of its driver, where `wgpu` offers them.

use std::{fmt::Write, iter, time::Instant};

use anyhow::{Context, Result};
use canted_gpu::{
    DeviceHit, DeviceRay, Gpu,
    wgpu::{
        self, AccelerationStructureFlags, AccelerationStructureGeometryFlags, AccelerationStructureUpdateMode,
        BindGroupEntry, BlasBuildEntry, BlasGeometries, BlasGeometrySizeDescriptors, BlasTriangleGeometry,
        BlasTriangleGeometrySizeDescriptor, BufferUsages, CreateBlasDescriptor, CreateTlasDescriptor, IndexFormat,
        TlasInstance, VertexFormat,
        util::{BufferInitDescriptor, DeviceExt},
    },
};
use canted_peers::ray_queries;
use canted_trace::{Ray, ScaledRay};
use canted_wide::{Config, Preset};

use super::{Bench, bandwidth::least, rays};
use crate::models::{self, Model};

/// The scenes of the section on rays.
const SCENES: [&str; 3] = ["sponza", "eiffel", "truss"];

/// The unrotated transform of an instance, by rows.
const IDENTITY: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Measures and writes the table, or why there is none.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    out.push_str("\n### Ray queries of the driver\n\n");
    let Some(gpu) = opened(bench)? else {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{} has no ray queries.", bench.gpu.info().name);
        return Ok(());
    };
    out.push_str(
        "The driver's acceleration structure, preferring fast traversal, built over vertices and indices that are on the device, and the \
         same rays through it; minimum wall times, milliseconds and million rays per second. The last column counts rays that hit on \
         one side alone, compared with the CPU: drivers do not promise to be watertight.\n\n| scene | triangles | build | camera | diffuse | \
         other |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for name in SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let on_cpu = rays::build(&model, &Config::preset(Preset::Balanced))?;
        let [camera, diffuse, _] = rays::sets(&model, &on_cpu, bench);
        let scene = Scene::new(&gpu, &model)?;
        let build = least(bench.rounds, || scene.build(&gpu))?;
        let mut other = 0;
        let mut rate = |set: &[Ray]| -> Result<f64> {
            let (milliseconds, hits) = scene.cast(&gpu, set, bench.rounds)?;
            let differs = |(ray, hit): (&Ray, &DeviceHit)| on_cpu.closest_hit(ray).is_some() != (hit.instance == 0);
            other += set.iter().zip(&hits).filter(|&pair| differs(pair)).count();
            #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
            Ok(set.len() as f64 / (1e3 * milliseconds))
        };
        let [camera, diffuse] = [rate(&camera)?, rate(&diffuse)?];
        let _ = writeln!(
            out,
            "| {name} | {} | {build:.2} | {camera:.2} | {diffuse:.2} | {other} |",
            model.mesh.triangles.len()
        );
    }
    Ok(())
}

/// The measured adapter, opened again with ray queries; `None` if it has none.
fn opened(bench: &Bench) -> Result<Option<Gpu>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let is_same = |adapter: &&wgpu::Adapter| {
        adapter.get_info().name == bench.gpu.info().name && ray_queries::has_ray_queries(adapter)
    };
    let Some(adapter) = adapters.iter().find(is_same) else { return Ok(None) };
    let (device, queue) = pollster::block_on(ray_queries::open(adapter))?;
    Ok(Some(Gpu::from_wgpu(device, queue)))
}

/// A mesh in an acceleration structure of the driver.
struct Scene {
    size: BlasTriangleGeometrySizeDescriptor,
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    blas: wgpu::Blas,
    tlas: wgpu::Tlas,
    pipeline: wgpu::ComputePipeline,
}

impl Scene {
    fn new(gpu: &Gpu, model: &Model) -> Result<Self> {
        let device = gpu.device();
        let buffer = |contents: &[u8]| {
            let usage = BufferUsages::BLAS_INPUT;
            device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
        };
        let vertices = buffer(bytemuck::cast_slice(&model.mesh.positions));
        let indices = buffer(bytemuck::cast_slice(&model.mesh.triangles));
        let size = BlasTriangleGeometrySizeDescriptor {
            vertex_format: VertexFormat::Float32x3,
            vertex_count: u32::try_from(model.mesh.positions.len())?,
            index_format: Some(IndexFormat::Uint32),
            index_count: Some(u32::try_from(3 * model.mesh.triangles.len())?),
            flags: AccelerationStructureGeometryFlags::OPAQUE,
        };
        let (flags, update_mode) =
            (AccelerationStructureFlags::PREFER_FAST_TRACE, AccelerationStructureUpdateMode::Build);
        let blas = device.create_blas(
            &CreateBlasDescriptor { label: None, flags, update_mode },
            BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] },
        );
        let mut tlas = device.create_tlas(&CreateTlasDescriptor { label: None, max_instances: 1, flags, update_mode });
        *tlas.get_mut_single(0).context("a top level of one instance has none")? =
            Some(TlasInstance::new(&blas, IDENTITY, 0, 0xff));
        let module = device.create_shader_module(wgpu::include_wgsl!("queries.wgsl"));
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("queries"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Ok(Self { size, vertices, indices, blas, tlas, pipeline })
    }

    /// Builds both levels and waits.
    fn build(&self, gpu: &Gpu) -> Result<()> {
        let geometry = BlasTriangleGeometry {
            size: &self.size,
            vertex_buffer: &self.vertices,
            first_vertex: 0,
            vertex_stride: 12,
            index_buffer: Some(&self.indices),
            first_index: Some(0),
            transform_buffer: None,
            transform_buffer_offset: None,
        };
        let entry = BlasBuildEntry { blas: &self.blas, geometry: BlasGeometries::TriangleGeometries(vec![geometry]) };
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        encoder.build_acceleration_structures(iter::once(&entry), iter::once(&self.tlas));
        gpu.queue().submit([encoder.finish()]);
        Ok(gpu.finish()?)
    }

    /// Milliseconds of casting the rays, the least of several rounds, and the hits.
    fn cast(&self, gpu: &Gpu, set: &[Ray], rounds: usize) -> Result<(f64, Vec<DeviceHit>)> {
        let scaled: Vec<DeviceRay> = set.iter().filter_map(ScaledRay::new).map(|ray| DeviceRay::scaled(&ray)).collect();
        let rays = gpu.buffer("rays", &scaled)?;
        let hits = gpu.zeroed::<DeviceHit>("hits", scaled.len())?;
        let entries = [
            BindGroupEntry { binding: 0, resource: self.tlas.as_binding() },
            BindGroupEntry { binding: 1, resource: rays.wgpu().as_entire_binding() },
            BindGroupEntry { binding: 2, resource: hits.wgpu().as_entire_binding() },
        ];
        let layout = self.pipeline.get_bind_group_layout(0);
        let group = gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &entries,
        });
        let n_groups = u32::try_from(scaled.len())?.div_ceil(64);
        let rows = n_groups.div_ceil(65_535).max(1);
        let mut milliseconds = f64::MAX;
        for round in 0..=rounds {
            let mut encoder = gpu.device().create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(n_groups.div_ceil(rows), rows, 1);
            drop(pass);
            let start = Instant::now();
            gpu.queue().submit([encoder.finish()]);
            gpu.finish()?;
            if round > 0 {
                milliseconds = milliseconds.min(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        Ok((milliseconds, gpu.read(&hits)?))
    }
}
