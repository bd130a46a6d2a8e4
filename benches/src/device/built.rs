//! Trees built on the device, pass by pass, beside the dissertation's.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_gpu::{
    Gpu, GpuError,
    build::{BuildConfig, Built, Items, Passes, Run, STRATEGIES},
};
use canted_lbvh::{Bits, Strategy};

use super::Bench;
use crate::models;

/// Sabino 2020, table 5, on a TITAN Xp: codes, sort (on the CPU), nodes, boxes of variant 2, of variant 3.
const DISSERTATION: [(&str, [f64; 5]); 3] = [
    ("bunny", [1.90, 12.51, 0.36, 7.67, 7.23]),
    ("sponza", [3.81, 23.62, 0.64, 14.14, 13.40]),
    ("dragon_871k", [13.14, 100.80, 2.08, 50.90, 50.04]),
];

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    out.push_str(
        "\n### Build\n\nCodes of 63 bits, one tree over all triangles; milliseconds a pass. Upload: gathering corners on the CPU and \
         handing them over, by the clock on the wall. Whole: a build from what was uploaded, by the clock on the wall, submissions \
         and the wait included. In italics the dissertation's table 5 on a TITAN Xp, whose sort ran on the CPU.\n\n\
         | scene | triangles | upload | domain | codes | sort | nodes |",
    );
    for strategy in STRATEGIES {
        let _ = write!(out, " {strategy:?} |");
    }
    out.push_str(" whole, Aabb | whole, Combined |\n");
    let _ = writeln!(out, "|{}", " --- |".repeat(STRATEGIES.len() + 9));
    for name in bench.scale.built {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not at hand |");
            continue;
        };
        let mesh = &model.mesh;
        let start = Instant::now();
        let (corners, _) = canted_lbvh::gather(&mesh.positions, &mesh.triangles)?;
        let items = Items::triangles(&bench.gpu, [&corners[..]])?;
        bench.gpu.finish()?;
        let upload = milliseconds(start);
        let Passes { domain, codes, sort, tree, boxes, refused } =
            Passes::measure(&bench.gpu, &items, Bits::B63, bench.rounds)?;
        let whole = |strategy| whole(bench, &corners, strategy);
        let _ = write!(out, "| {name} | {} | {upload:.1} |", corners.len());
        for ms in [domain, codes, sort, tree].into_iter().chain(boxes) {
            let _ = write!(out, " {} |", ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.2}")));
        }
        if let Some(error) = refused {
            let _ = writeln!(out, " {error} | |");
            continue;
        }
        let _ = writeln!(out, " {:.2} | {:.2} |", whole(Strategy::Aabb)?, whole(Strategy::Combined)?);
        if let Some((_, [codes, sort, nodes, bounded, quaternion])) =
            DISSERTATION.iter().find(|(known, _)| known == name)
        {
            let _ = writeln!(
                out,
                "| *{name}, 2020* | | | | *{codes}* | *{sort}* | *{nodes}* | | *{bounded}* | *{quaternion}* | | | | |"
            );
        }
    }
    Ok(())
}

/// The least milliseconds of a whole build, by the clock on the wall.
fn whole(bench: &Bench, corners: &[canted_lbvh::Corners], strategy: Strategy) -> Result<f64, GpuError> {
    let once = |gpu: &Gpu| -> Result<f64, GpuError> {
        let items = Items::triangles(gpu, [corners])?;
        gpu.finish()?;
        let start = Instant::now();
        let built = Built::new(&mut Run::new(gpu), items, BuildConfig { bits: Bits::B63, strategy })?;
        gpu.finish()?;
        drop(built);
        Ok(milliseconds(start))
    };
    (0..bench.rounds).try_fold(f64::MAX, |least, _| Ok(least.min(once(&bench.gpu)?)))
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
