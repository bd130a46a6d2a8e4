//! BVHs built on the device, pass by pass, the sort alone, and rebuilds and refits of each frame, compared with the CPU and the
//! dissertation.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_fixtures::SplitMix64;
use canted_gpu::{
    Buffer, BufferScene, Gpu, GpuError, IndexBuffer, MeshBuffers, block_on,
    build::{BuildConfig, BuildEncoder, Built, Passes, Primitives, STRATEGIES, Sorter, WideConfig},
    wgpu::{CommandEncoder, IndexFormat},
};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Strategy, VolumeConfig};
use canted_obb::Aabb;
use canted_wide::{Config, Preset, TriangleBvh};

use super::{Bench, WARM};
use crate::models;

/// Columns before those of strategies.
const PASSES: [&str; 7] = ["scene", "triangles", "upload", "domain", "codes", "sort", "nodes"];

/// Strategies whose complete builds are measured, on the CPU too.
const COMPLETE: [Strategy; 2] = [Strategy::Aabb, Strategy::Combined];

/// Sabino 2020, table 5, on a TITAN Xp: codes, sort (on the CPU), nodes, boxes of variant 2, of variant 3.
const DISSERTATION: [(&str, [f64; 5]); 3] = [
    ("bunny", [1.90, 12.51, 0.36, 7.67, 7.23]),
    ("sponza", [3.81, 23.62, 0.64, 14.14, 13.40]),
    ("dragon_871k", [13.14, 100.80, 2.08, 50.90, 50.04]),
];

/// Measures and writes the table.
pub(super) fn builds(out: &mut String, bench: &Bench) -> Result<()> {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Build\n\n63-bit codes, one BVH over all triangles; milliseconds per pass. Upload: gathering corners on the CPU and \
         uploading them. Complete: a build from uploaded corners, including submissions and waiting. CPU: a build of the same \
         volumes from gathered corners on {} threads. Both are wall times, minimum of {} runs after a warm-up. Then the CPU's time \
         over the device's: without the upload, and with gathering and upload counted for the device and gathering for the CPU. In \
         italics the dissertation's table 5 on a TITAN Xp, whose sort ran on the CPU.\n",
        rayon::current_num_threads(),
        bench.rounds
    );
    let heads = heads();
    out.push_str(&row(&heads));
    out.push_str(&row(&vec!["---".to_owned(); heads.len()]));
    for name in bench.scale.built {
        let Some(model) = models::load(name)? else {
            out.push_str(&row(&filled(vec![(*name).to_owned(), "not available".to_owned()])));
            continue;
        };
        out.push_str(&row(&measured(name, &model.mesh.positions, &model.mesh.triangles, bench)?));
        if let Some((_, theirs)) = DISSERTATION.iter().find(|(known, _)| known == name) {
            out.push_str(&row(&dissertation(name, *theirs)));
        }
    }
    Ok(())
}

/// Names of all columns.
fn heads() -> Vec<String> {
    let passes = PASSES.iter().map(|&name| name.to_owned());
    let boxes = STRATEGIES.iter().map(|strategy| format!("{strategy:?}"));
    let complete = COMPLETE.iter().flat_map(|s| {
        [
            format!("complete, {s:?}"),
            format!("CPU, {s:?}"),
            format!("CPU over device, {s:?}"),
            format!("with upload, {s:?}"),
        ]
    });
    passes.chain(boxes).chain(complete).collect()
}

fn row(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// A row with dashes after the given cells.
fn filled(mut cells: Vec<String>) -> Vec<String> {
    cells.resize(heads().len(), String::new());
    cells
}

/// The cells of one scene.
fn measured(name: &str, positions: &[[f32; 3]], triangles: &[[u32; 3]], bench: &Bench) -> Result<Vec<String>> {
    let (corners, bounds) = lbvh::triangle_corners(positions, triangles)?;
    let gather = least(bench.rounds, || {
        std::hint::black_box(lbvh::triangle_corners(positions, triangles)?);
        Ok(())
    })?;
    let upload = least(bench.rounds, || {
        let (corners, _) = lbvh::triangle_corners(positions, triangles)?;
        let items = Primitives::triangles(&bench.gpu, [&corners[..]])?;
        block_on(bench.gpu.finish())?;
        drop(items);
        Ok(())
    })?;
    let items = Primitives::triangles(&bench.gpu, [&corners[..]])?;
    let passes = block_on(Passes::measure(&bench.gpu, &items, Bits::B63, bench.rounds))?;
    let mut cells = vec![name.to_owned(), corners.len().to_string(), format!("{upload:.1}")];
    let known = [passes.domain, passes.codes, passes.sort, passes.tree].into_iter().chain(passes.boxes);
    cells.extend(known.map(|ms| ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.2}"))));
    if let Some(error) = passes.error {
        cells.push(error.to_string());
        return Ok(filled(cells));
    }
    for strategy in COMPLETE {
        let complete = CompleteBuild {
            gather,
            upload,
            device: on_device(bench, &corners, strategy)?,
            cpu: least(bench.rounds, || {
                on_cpu(&corners, &bounds, strategy);
                Ok(())
            })?,
        };
        cells.extend(complete.cells());
    }
    Ok(cells)
}

/// Milliseconds of a complete build on device and CPU, and of the steps before it.
struct CompleteBuild {
    gather: f64,
    /// Including gathering.
    upload: f64,
    device: f64,
    cpu: f64,
}

impl CompleteBuild {
    /// The CPU's time over the device's: from uploaded corners, and from the mesh.
    fn ratios(&self) -> [f64; 2] {
        [self.cpu / self.device, (self.gather + self.cpu) / (self.upload + self.device)]
    }

    fn cells(&self) -> [String; 4] {
        let [without, with] = self.ratios();
        [format!("{:.2}", self.device), format!("{:.2}", self.cpu), format!("{without:.2}x"), format!("{with:.2}x")]
    }
}

/// Milliseconds of a build on the device from uploaded corners.
fn on_device(bench: &Bench, corners: &[Corners], strategy: Strategy) -> Result<f64> {
    let once = |gpu: &Gpu| -> Result<f64> {
        let items = Primitives::triangles(gpu, [corners])?;
        block_on(gpu.finish())?;
        let start = Instant::now();
        let built = Built::new(&mut BuildEncoder::new(gpu), items, BuildConfig { bits: Bits::B63, strategy })?;
        block_on(gpu.finish())?;
        drop(built);
        Ok(milliseconds(start))
    };
    (0..bench.rounds).try_fold(f64::MAX, |least, _| Ok(least.min(once(&bench.gpu)?)))
}

/// The device's stages on the CPU.
fn on_cpu(corners: &[Corners], bounds: &Aabb, strategy: Strategy) {
    let codes = lbvh::morton_codes(&Domain::new(bounds, 3, Bits::B63), corners);
    let tree = lbvh::radix(lbvh::sort_by_code(&codes, Bits::B63));
    let sorted = lbvh::in_leaf_order(corners, &tree.leaves);
    std::hint::black_box(lbvh::volumes(&tree, &sorted, &VolumeConfig { strategy, fallback: true }));
}

/// The dissertation's times in our columns.
fn dissertation(name: &str, [codes, sort, nodes, bounded, quaternion]: [f64; 5]) -> Vec<String> {
    let theirs =
        [("codes", codes), ("sort", sort), ("nodes", nodes), ("PcaBounded", bounded), ("Quaternion", quaternion)];
    in_italics(&format!("{name}, 2020"), &theirs.map(|(column, ms)| (column.to_owned(), format!("{ms}"))))
}

/// A row with these values in the columns of these names.
fn in_italics(name: &str, values: &[(String, String)]) -> Vec<String> {
    let mut cells = filled(vec![format!("*{name}*")]);
    for (cell, column) in cells.iter_mut().zip(heads()) {
        if let Some((_, value)) = values.iter().find(|(name, _)| *name == column) {
            *cell = format!("*{value}*");
        }
    }
    cells
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// The minimum wall time in milliseconds of several runs, after runs that let clocks rise.
fn least(rounds: usize, mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut once = || -> Result<f64> {
        let start = Instant::now();
        work()?;
        Ok(milliseconds(start))
    };
    let start = Instant::now();
    while start.elapsed() < WARM {
        once()?;
    }
    (0..rounds).try_fold(f64::MAX, |least, _| Ok(least.min(once()?)))
}

/// Measures and writes the table.
pub(super) fn sort(out: &mut String, bench: &Bench) -> Result<()> {
    out.push_str(
        "\n### Sort\n\nStable sort of random keys with their indices; million pairs per second.\n\n\
         | pairs | keys of 30 bits | keys of 63 bits |\n| --- | --- | --- |\n",
    );
    let sorter = Sorter::new(&bench.gpu);
    for &log2 in bench.scale.sorted {
        let mut rng = SplitMix64::new(u64::from(log2));
        let mut word = || -> Vec<u32> { (0..1u32 << log2).map(|_| rng.below(1 << 32) as u32).collect() };
        let [low, high] = [word(), word()].map(|words| bench.gpu.buffer("keys", &words));
        let (low, high) = (low?, high?);
        let narrow = pairs_rate(bench, &sorter, &[(&low, 30)])?;
        let wide = pairs_rate(bench, &sorter, &[(&low, 32), (&high, 31)])?;
        let _ = writeln!(out, "| 2^{log2} | {narrow:.1} | {wide:.1} |");
    }
    Ok(())
}

/// Million pairs per second.
fn pairs_rate(bench: &Bench, sorter: &Sorter<'_>, words: &[(&Buffer<u32>, u32)]) -> Result<f64> {
    let once = || -> Result<f64> {
        let mut run = BuildEncoder::timed(&bench.gpu);
        sorter.sort(&mut run, words)?;
        Ok(run.times().iter().map(|time| time.milliseconds).sum())
    };
    bench.warm(once)?;
    let least = (0..bench.rounds).try_fold(f64::MAX, |least, _| Ok::<_, anyhow::Error>(least.min(once()?)))?;
    Ok(words[0].0.len() as f64 / (1e3 * least))
}

/// Measures and writes the table.
pub(super) fn frames(out: &mut String, bench: &Bench) -> Result<()> {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Per frame\n\nVertices and indices in buffers of a program, 63-bit codes; nothing is transferred. Milliseconds of wall time \
         from recording to completion, minimum of {} frames after a warm-up. CPU: WideBvh of \
         preset dynamic on {} threads, from vertices in memory.\n\n| scene | triangles | rebuild, Aabb | rebuild, Dop | \
         refit, Aabb | rebuild, wide | refit, wide | CPU, rebuild | CPU, refit |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
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
        let scene = |strategy| block_on(BufferScene::new(gpu, &[mesh], BuildConfig { bits: Bits::B63, strategy }));
        let mut aligned = scene(Strategy::Aabb)?;
        let rebuild = least(bench.rounds, || Ok(frame(gpu, |encoder| aligned.rebuild(gpu, encoder, &[mesh]))?))?;
        let refit = least(bench.rounds, || Ok(frame(gpu, |encoder| aligned.refit(gpu, encoder, &[mesh]))?))?;
        let mut dop = scene(Strategy::Dop)?;
        let rebuild_dop = least(bench.rounds, || Ok(frame(gpu, |encoder| dop.rebuild(gpu, encoder, &[mesh]))?))?;
        let config = WideConfig { bits: Bits::B63, ..WideConfig::default() };
        let mut wide = block_on(BufferScene::new(gpu, &[mesh], config))?;
        let rebuild_wide = least(bench.rounds, || Ok(frame(gpu, |encoder| wide.rebuild(gpu, encoder, &[mesh]))?))?;
        let refit_wide = least(bench.rounds, || Ok(frame(gpu, |encoder| wide.refit(gpu, encoder, &[mesh]))?))?;
        let config = Config::preset(Preset::Dynamic);
        let mut on_cpu = TriangleBvh::build_with(positions, triangles, config)?;
        let cpu_rebuild = least(bench.rounds, || {
            on_cpu = TriangleBvh::build_with(positions, triangles, config)?;
            Ok(())
        })?;
        let cpu_refit = least(bench.rounds, || {
            std::hint::black_box(on_cpu.refit(positions, triangles)?);
            Ok(())
        })?;
        let _ = writeln!(
            out,
            "| {name} | {} | {rebuild:.2} | {rebuild_dop:.2} | {refit:.2} | {rebuild_wide:.2} | {refit_wide:.2} | \
             {cpu_rebuild:.2} | {cpu_refit:.2} |",
            triangles.len()
        );
    }
    Ok(())
}

/// Records, submits and awaits a frame.
fn frame(gpu: &Gpu, record: impl FnOnce(&mut CommandEncoder) -> Result<(), GpuError>) -> Result<(), GpuError> {
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    record(&mut encoder)?;
    gpu.queue().submit([encoder.finish()]);
    block_on(gpu.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_given_without_and_with_the_upload() {
        let complete = CompleteBuild { gather: 2.0, upload: 6.0, device: 4.0, cpu: 18.0 };
        assert_eq!(complete.ratios(), [4.5, 2.0]);
        assert_eq!(complete.cells(), ["4.00", "18.00", "4.50x", "2.00x"]);
    }

    #[test]
    fn dissertation_times_are_in_the_right_columns() {
        let cells = dissertation("bunny", DISSERTATION[0].1);
        let heads = heads();
        assert_eq!(cells.len(), heads.len());
        let at = |head: &str| &cells[heads.iter().position(|known| known == head).unwrap()][..];
        assert_eq!([at("scene"), at("sort"), at("PcaBounded")], ["*bunny, 2020*", "*12.51*", "*7.67*"]);
        assert_eq!(cells.iter().filter(|cell| !cell.is_empty()).count(), 6);
    }
}
