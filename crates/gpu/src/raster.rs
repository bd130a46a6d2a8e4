//! Raster passes with vertex pulling, into integer render targets.

use std::{collections::VecDeque, ops::Range, time::Duration};

use canted_shaders::{Binding, Shader, ShaderName, Variant};
use wgpu::{
    BindGroup, Color, CompareFunction, DepthStencilState, Extent3d, FragmentState, LoadOp, MultisampleState,
    Operations, PipelineCompilationOptions, PrimitiveState, RenderPassColorAttachment,
    RenderPassDepthStencilAttachment, RenderPassDescriptor, RenderPipelineDescriptor, ShaderModuleDescriptor,
    ShaderSource, StoreOp, SubmissionIndex, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
    TextureView, VertexState,
};

use crate::commands::bind_groups;
use crate::wait::Instant;
use crate::{Buffer, Gpu, GpuError, NamedBinding};

/// Number of render targets.
pub const N_TARGETS: usize = 4;

/// Bytes per pixel over all targets.
const PIXEL_BYTES: u32 = size_of::<[[u32; 4]; N_TARGETS]>() as u32;

/// Alignment of rows in a texture copy.
const ROW_BYTES: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// The stages `vertex` and `fragment` of one file, with [`N_TARGETS`] targets of four words per pixel. The depth test keeps the
/// greatest depth.
pub struct RasterPipeline {
    name: String,
    pipeline: wgpu::RenderPipeline,
    bindings: Vec<Binding>,
}

/// Result of a raster pass.
pub struct RasterOutput {
    /// Texels of each target, row by row; zero where nothing was drawn.
    pub targets: [Vec<[u32; 4]>; N_TARGETS],
    /// From the first submission to the completion of the last batch.
    pub time: Duration,
}

impl Gpu {
    /// Compiles a raster pass.
    ///
    /// # Errors
    /// As for [`Gpu::kernel`], or too few bytes per pixel.
    pub fn raster(&self, name: ShaderName, chosen: &Variant) -> Result<RasterPipeline, GpuError> {
        self.check()?;
        let most = self.limits().max_color_attachment_bytes_per_sample;
        if most < PIXEL_BYTES {
            let (limit, remedy) = ("bytes per pixel over all targets", "trace first hits");
            let what = format!("raster pass '{name}'");
            return Err(GpuError::Limit { what, need: PIXEL_BYTES.into(), limit, most: most.into(), remedy });
        }
        let shader = Shader::new(name, chosen)?;
        let mut bindings: Vec<Binding> = shader.entries.iter().flat_map(|entry| entry.bindings.clone()).collect();
        bindings.sort_by_key(|binding| (binding.group, binding.number));
        bindings.dedup_by_key(|binding| (binding.group, binding.number));
        let module = self.device.create_shader_module(ShaderModuleDescriptor {
            label: Some(name.as_str()),
            source: ShaderSource::Wgsl(shader.source.as_str().into()),
        });
        let options = PipelineCompilationOptions { constants: &shader.overrides, ..Default::default() };
        let targets = [const { Some(TextureFormat::Rgba32Uint) }; N_TARGETS].map(|format| format.map(Into::into));
        let pipeline = self.device.create_render_pipeline(&RenderPipelineDescriptor {
            label: Some(name.as_str()),
            layout: None,
            vertex: VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: options.clone(),
                buffers: &[],
            },
            primitive: PrimitiveState::default(),
            depth_stencil: Some(DepthStencilState {
                format: TextureFormat::Depth32Float,
                depth_write_enabled: Some(true),
                depth_compare: Some(CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: MultisampleState::default(),
            fragment: Some(FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: options,
                targets: &targets,
            }),
            multiview_mask: None,
            cache: self.pipeline_cache(),
        });
        self.check()?;
        Ok(RasterPipeline { name: name.to_string(), pipeline, bindings })
    }

    /// Draws in batches of about 100 ms and reads back the targets.
    ///
    /// # Errors
    /// A variable is missing, the picture exceeds the texture limit, or the device is lost.
    pub async fn draw(
        &self,
        raster: &RasterPipeline,
        bound: &[NamedBinding<'_>],
        [width, height]: [u32; 2],
        draws: &[Draw],
    ) -> Result<RasterOutput, GpuError> {
        let most = self.limits().max_texture_dimension_2d;
        let need = width.max(height);
        if need > most {
            let what = format!("a picture of {width} x {height} pixels");
            let (limit, remedy) = ("pixels per side of a texture", "use a smaller picture");
            return Err(GpuError::Limit { what, need: need.into(), limit, most: most.into(), remedy });
        }
        let size = Extent3d { width, height, depth_or_array_layers: 1 };
        let (colors, depth) = (self.targets(size), self.texture(size, TextureFormat::Depth32Float));
        let groups = bind_groups(self, &raster.name, &raster.bindings, bound, |number| {
            raster.pipeline.get_bind_group_layout(number)
        })?;
        let views = colors.each_ref().map(|color| color.create_view(&Default::default()));
        let depth = depth.create_view(&Default::default());
        let start = Instant::now();
        let mut batches = DrawBatches::new(draws);
        // The targets are cleared even without draws.
        let mut batch = batches.next().unwrap_or_default();
        let mut is_first = true;
        loop {
            let begin = Instant::now();
            self.wait(self.draw_batch(raster, &groups, &views, &depth, &batch, is_first)).await?;
            batches.adapt(begin.elapsed());
            is_first = false;
            let Some(next) = batches.next() else { break };
            batch = next;
        }
        let time = start.elapsed();
        let mut targets = [const { vec![] }; N_TARGETS];
        for (texels, color) in targets.iter_mut().zip(&colors) {
            *texels = self.texels(color, size).await?;
        }
        Ok(RasterOutput { targets, time })
    }

    /// Draws a batch on top of the previous ones; the first batch clears the targets.
    fn draw_batch(
        &self,
        raster: &RasterPipeline,
        groups: &[(u32, BindGroup)],
        colors: &[TextureView; N_TARGETS],
        depth: &TextureView,
        draws: &[Draw],
        is_first: bool,
    ) -> SubmissionIndex {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let load = if is_first { LoadOp::Clear(Color::TRANSPARENT) } else { LoadOp::Load };
        let ops = Operations { load, store: StoreOp::Store };
        let depth_load = if is_first { LoadOp::Clear(0.0) } else { LoadOp::Load };
        let depth_ops = Some(Operations { load: depth_load, store: StoreOp::Store });
        let attachments = colors
            .each_ref()
            .map(|view| Some(RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops }));
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some(&raster.name),
            color_attachments: &attachments,
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops,
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&raster.pipeline);
        for (number, group) in groups {
            pass.set_bind_group(*number, group, &[]);
        }
        for draw in draws {
            pass.draw(draw.vertices.clone(), draw.instances.clone());
        }
        drop(pass);
        self.queue.submit([encoder.finish()])
    }

    fn targets(&self, size: Extent3d) -> [Texture; N_TARGETS] {
        std::array::from_fn(|_| self.texture(size, TextureFormat::Rgba32Uint))
    }

    fn texture(&self, size: Extent3d, format: TextureFormat) -> Texture {
        self.device.create_texture(&TextureDescriptor {
            label: None,
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// Reads back all texels of a target.
    async fn texels(&self, target: &Texture, size: Extent3d) -> Result<Vec<[u32; 4]>, GpuError> {
        let row_bytes = (16 * size.width).next_multiple_of(ROW_BYTES);
        let row = row_bytes as usize / 16;
        let copied: Buffer<[u32; 4]> = self.zeroed("texels of a target", row * size.height as usize)?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &copied.raw, layout };
        encoder.copy_texture_to_buffer(target.as_image_copy(), to, size);
        self.queue.submit([encoder.finish()]);
        let texels = self.read(&copied).await?;
        Ok(texels.chunks_exact(row).flat_map(|texels| &texels[..size.width as usize]).copied().collect())
    }
}

/// Target time of a batch, short enough for a display that waits for it.
const TARGET_TIME: Duration = Duration::from_millis(100);

/// Triangles of the first batch, and minimum.
const FIRST_BATCH: u32 = 1 << 14;
const MIN_BATCH: u32 = 1 << 8;

/// A range of vertices for a range of instances.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Vertex indices, three per triangle.
    pub vertices: Range<u32>,
    /// Instance indices.
    pub instances: Range<u32>,
}

/// Draws split into batches, in order.
pub(crate) struct DrawBatches {
    waiting: VecDeque<Draw>,
    /// Triangles of the next batch.
    n_triangles: u32,
}

impl DrawBatches {
    pub(crate) fn new(draws: &[Draw]) -> Self {
        Self { waiting: draws.iter().cloned().collect(), n_triangles: FIRST_BATCH }
    }

    /// The next batch; `None` after the last.
    pub(crate) fn next(&mut self) -> Option<Vec<Draw>> {
        let mut batch = vec![];
        let mut left = self.n_triangles;
        while left > 0 {
            let Some(draw) = self.waiting.pop_front() else { break };
            let (first, rest) = cut(&draw, left);
            rest.into_iter().rev().for_each(|draw| self.waiting.push_front(draw));
            left = left.saturating_sub(n_triangles(&first));
            batch.push(first);
        }
        (!batch.is_empty()).then_some(batch)
    }

    /// Adjusts the batch size by the time of the last batch.
    pub(crate) fn adapt(&mut self, time: Duration) {
        let times = TARGET_TIME.as_nanos() / time.as_nanos().max(1);
        self.n_triangles = match times {
            0 => (self.n_triangles / 2).max(MIN_BATCH),
            1 => self.n_triangles,
            2 | 3 => self.n_triangles.saturating_mul(2),
            _ => self.n_triangles.saturating_mul(4),
        };
    }
}

fn n_triangles(draw: &Draw) -> u32 {
    let n_vertices = u32::try_from(draw.vertices.len()).unwrap_or(u32::MAX);
    let n_instances = u32::try_from(draw.instances.len()).unwrap_or(u32::MAX);
    (n_vertices / 3).saturating_mul(n_instances)
}

/// Splits off about `most` triangles of a draw. Instances are drawn one after another, so the order is kept.
fn cut(draw: &Draw, most: u32) -> (Draw, Vec<Draw>) {
    let Draw { vertices, instances } = draw.clone();
    let of_one = n_triangles(&Draw { vertices: vertices.clone(), instances: 0..1 });
    if of_one <= most {
        let n = most.checked_div(of_one).unwrap_or(u32::MAX);
        let middle = instances.start.saturating_add(n).min(instances.end);
        let first = Draw { vertices: vertices.clone(), instances: instances.start..middle };
        let rest = (middle < instances.end).then_some(Draw { vertices, instances: middle..instances.end });
        return (first, rest.into_iter().collect());
    }
    let one = instances.start..instances.start + 1;
    let middle = vertices.start + 3 * most;
    let first = Draw { vertices: vertices.start..middle, instances: one.clone() };
    let mut rest = vec![Draw { vertices: middle..vertices.end, instances: one.clone() }];
    if one.end < instances.end {
        rest.push(Draw { vertices, instances: one.end..instances.end });
    }
    (first, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First vertex and instance of each triangle, in drawing order.
    fn triangles(draws: &[Draw]) -> Vec<(u32, u32)> {
        let of_draw = |draw: &Draw| {
            let vertices = draw.vertices.clone().step_by(3);
            let of_instance = move |i: u32| vertices.clone().map(move |v| (v, i));
            draw.instances.clone().flat_map(of_instance).collect::<Vec<_>>()
        };
        draws.iter().flat_map(of_draw).collect()
    }

    #[test]
    fn batches_cover_all_draws_in_order() {
        let draws = [
            Draw { vertices: 0..300, instances: 0..7 },
            Draw { vertices: 0..0, instances: 7..9 },
            Draw { vertices: 30..39, instances: 9..10 },
        ];
        for size in [1, 2, 99, 100, 101, 250, 10_000] {
            let mut batches = DrawBatches { n_triangles: size, ..DrawBatches::new(&draws) };
            let mut found = vec![];
            while let Some(batch) = batches.next() {
                let drawn = triangles(&batch);
                assert!(drawn.len() <= size as usize, "{} in a batch of {size}", drawn.len());
                found.extend(drawn);
            }
            assert_eq!(found, triangles(&draws), "{size}");
        }
    }

    #[test]
    fn batch_size_adapts_to_time() {
        let mut batches = DrawBatches::new(&[]);
        batches.adapt(Duration::from_millis(1));
        assert_eq!(batches.n_triangles, 4 * FIRST_BATCH);
        batches.adapt(Duration::from_millis(250));
        assert_eq!(batches.n_triangles, 2 * FIRST_BATCH);
        (0..20).for_each(|_| batches.adapt(Duration::from_secs(9)));
        assert_eq!(batches.n_triangles, MIN_BATCH);
        assert_eq!(batches.next(), None);
    }
}
