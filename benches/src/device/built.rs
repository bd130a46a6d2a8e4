//! BVHs built on the device, pass by pass, compared with the CPU and the dissertation.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_gpu::{
    Gpu,
    build::{BuildConfig, BuildEncoder, Built, Passes, Primitives, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Strategy, VolumeConfig};
use canted_obb::Aabb;

use super::{
    Bench,
    bandwidth::{bytes, least},
};
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
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\n### Build\n\n63-bit codes, one BVH over all triangles; milliseconds per pass. Upload: gathering corners on the CPU and \
         uploading them. Complete: a build from uploaded corners, including submissions and waiting. CPU: a build of the same \
         volumes from gathered corners on {} threads. Both are wall times, minimum of {} runs after a warm-up. Then the CPU's time \
         over the device's: without the upload, and with gathering and upload counted for the device and gathering for the CPU. In \
         italics the time that bandwidth allows, and the dissertation's table 5 on a TITAN Xp, whose sort ran on the CPU.\n",
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
        out.push_str(&row(&expected(name, model.mesh.triangles.len(), bench)));
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
        let primitives = Primitives::triangles(&bench.gpu, [&corners[..]])?;
        bench.gpu.finish()?;
        drop(primitives);
        Ok(())
    })?;
    let primitives = Primitives::triangles(&bench.gpu, [&corners[..]])?;
    let passes = Passes::measure(&bench.gpu, &primitives, Bits::B63, bench.rounds)?;
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
        let primitives = Primitives::triangles(gpu, [corners])?;
        gpu.finish()?;
        let start = Instant::now();
        let built = Built::new(&mut BuildEncoder::new(gpu), primitives, BuildConfig { bits: Bits::B63, strategy })?;
        gpu.finish()?;
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

/// The times that the device's bandwidth allows.
fn expected(name: &str, n_triangles: usize, bench: &Bench) -> Vec<String> {
    let passes = [("domain", bytes::DOMAIN), ("codes", bytes::CODES), ("sort", bytes::SORT), ("nodes", bytes::NODES)];
    let passes = passes.map(|(column, bytes_each)| (column.to_owned(), bytes_each));
    let boxes = STRATEGIES.map(|strategy| (format!("{strategy:?}"), bytes::boxes(strategy)));
    let ms = |bytes_each| format!("{:.2}", bench.bandwidth.milliseconds(bytes_each, n_triangles));
    let all: Vec<_> = passes.into_iter().chain(boxes).map(|(column, bytes_each)| (column, ms(bytes_each))).collect();
    in_italics(&format!("{name}, expected"), &all)
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
