//! Deforming geometry in a program's own buffers: rebuilt or refitted in each frame, compared with the CPU.

use std::fmt::Write;

use anyhow::Result;
use canted_gpu::{
    BufferScene, Gpu, GpuError, IndexBuffer, MeshBuffers,
    build::{BuildConfig, WideConfig},
    wgpu::{CommandEncoder, IndexFormat},
};
use canted_lbvh::{Bits, Strategy};
use canted_trace::Watertight;
use canted_wide::{Config, Preset, TriangleBvh};

use super::{
    Bench,
    bandwidth::{bytes, least},
};
use crate::models;

/// Bytes of indices and vertices that are read for a triangle, and of its corners.
const GATHERED_BYTES: f64 = 12.0 + 36.0 + 36.0;

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Per frame\n\nVertices and indices in buffers of a program, 63-bit codes; nothing is transferred. Milliseconds of wall time \
         from recording to completion, minimum of {} frames after a warm-up, and in italics what bandwidth allows. CPU: WideBvh of \
         preset dynamic on {} threads, from vertices in memory.\n\n| scene | triangles | rebuild, Aabb | *expected* | rebuild, Dop | \
         refit, Aabb | *expected* | rebuild, wide | refit, wide | CPU, rebuild | CPU, refit |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        bench.rounds,
        rayon::current_num_threads()
    );
    for name in bench.scale.built {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let (positions, triangles) = (&model.mesh.positions, &model.mesh.triangles);
        let gpu = &bench.gpu;
        let vertices = gpu.buffer("vertices", positions)?;
        let indices = gpu.buffer("indices", triangles)?;
        let mesh = MeshBuffers {
            vertices: vertices.wgpu(),
            first_byte: 0,
            stride: 12,
            n_vertices: u32::try_from(positions.len())?,
            indices: Some(IndexBuffer { buffer: indices.wgpu(), format: IndexFormat::Uint32, first_byte: 0 }),
            n_triangles: u32::try_from(triangles.len())?,
        };
        let scene = |strategy| BufferScene::new(gpu, &[mesh], BuildConfig { bits: Bits::B63, strategy });
        let mut aligned = scene(Strategy::Aabb)?;
        let rebuild = least(bench.rounds, || Ok(frame(gpu, |encoder| aligned.rebuild(gpu, encoder, &[mesh]))?))?;
        let refit = least(bench.rounds, || Ok(frame(gpu, |encoder| aligned.refit(gpu, encoder, &[mesh]))?))?;
        let mut dop = scene(Strategy::Dop)?;
        let rebuild_dop = least(bench.rounds, || Ok(frame(gpu, |encoder| dop.rebuild(gpu, encoder, &[mesh]))?))?;
        let config = WideConfig { bits: Bits::B63, ..WideConfig::default() };
        let mut wide = BufferScene::new(gpu, &[mesh], config)?;
        let rebuild_wide = least(bench.rounds, || Ok(frame(gpu, |encoder| wide.rebuild(gpu, encoder, &[mesh]))?))?;
        let refit_wide = least(bench.rounds, || Ok(frame(gpu, |encoder| wide.refit(gpu, encoder, &[mesh]))?))?;
        let config = Config::preset(Preset::Dynamic);
        let mut on_cpu = TriangleBvh::<Watertight>::build(positions, triangles, &config)?;
        let cpu_rebuild = least(bench.rounds, || {
            on_cpu = TriangleBvh::build(positions, triangles, &config)?;
            Ok(())
        })?;
        let cpu_refit = least(bench.rounds, || {
            std::hint::black_box(on_cpu.refit(positions, triangles)?);
            Ok(())
        })?;
        let expected = |bytes_each| bench.bandwidth.milliseconds(bytes_each, triangles.len());
        let boxes = GATHERED_BYTES + bytes::AABB + bytes::ALIGNED_PAIRS;
        let _ = writeln!(
            out,
            "| {name} | {} | {rebuild:.2} | *{:.2}* | {rebuild_dop:.2} | {refit:.2} | *{:.2}* | {rebuild_wide:.2} | \
             {refit_wide:.2} | {cpu_rebuild:.2} | {cpu_refit:.2} |",
            triangles.len(),
            expected(boxes + bytes::DOMAIN + bytes::CODES + bytes::SORT + bytes::NODES),
            expected(boxes)
        );
    }
    Ok(())
}

/// Records, submits and awaits a frame.
fn frame(gpu: &Gpu, record: impl FnOnce(&mut CommandEncoder) -> Result<(), GpuError>) -> Result<(), GpuError> {
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    record(&mut encoder)?;
    gpu.queue().submit([encoder.finish()]);
    gpu.finish()
}
