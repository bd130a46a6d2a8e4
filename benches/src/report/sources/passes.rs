//! Milliseconds of each pass of a build, on the CPU and on a device: the dissertation's table 5 and figure 11.

use anyhow::Result;
use canted_gpu::{
    AdapterKind, Choice, Gpu,
    build::{Passes, Primitives, STRATEGIES},
};
use canted_lbvh::{Bits, Domain, Strategy, VolumeConfig};

use super::orders::{Found, Pairs, scenes};
use crate::{
    models::Model,
    report::{
        model::{Axis, Cell, Chapter, Effort, Plot, Point, Series, Table},
        samples::{Samples, number},
    },
    timing,
};

const CPU_PASSES: [&str; 6] =
    ["codes", "sort", "nodes", "boxes, PCA bounded", "boxes, quaternion", "boxes, PCA unbounded"];

/// The dissertation's CPU milliseconds.
const THEIRS_ON_CPU: [(&str, [f64; 6]); 3] = [
    ("dragon_871k", [14.40, 100.80, 28.42, 316.26, 520.10, 626.26]),
    ("sponza", [4.27, 23.62, 8.52, 756.01, 490.58, 723.99]),
    ("bunny", [2.37, 12.51, 4.36, 51.90, 84.76, 90.27]),
];

pub(super) fn on_cpu(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Passes of a build on the CPU (table 5, figure 11)",
        &["scene", "pass", "theirs", "ours", "ours over theirs"],
    );
    let (mut series, mut found) = (vec![], Found::default());
    for (name, model) in
        scenes(effort, effort.pick(&[][..], &["sponza"], &["dragon_871k", "sponza", "bunny"]), chapter)?
    {
        let ours = one_thread(|| measure_passes(&model, effort.pick(2, 3, 7)))??;
        let theirs = THEIRS_ON_CPU.iter().find(|(scene, _)| *scene == name).map(|(_, passes)| passes);
        let mut points = vec![];
        for (i, (pass, ms)) in CPU_PASSES.iter().zip(&ours).enumerate() {
            let their = theirs.map(|passes| passes[i]);
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(*pass),
                Cell::text(their.map_or("–".to_owned(), |ms| format!("{ms} ms"))),
                Cell::measured(ms.clone(), "ms"),
                Cell::text(their.map_or("–".to_owned(), |their| number(ms.median() / their))),
            ]);
            // A scene that they lack is compared with itself, so that its passes are plotted.
            points.push(Point {
                label: (*pass).to_owned(),
                x: their.unwrap_or_else(|| ms.median()).into(),
                y: ms.clone(),
            });
        }
        if let Some(theirs) = theirs {
            let share = |passes: &[f64]| passes[3] / (passes[0] + passes[1] + passes[2] + passes[3]);
            let medians: Vec<f64> = ours.iter().map(Samples::median).collect();
            found.compared.push(theirs.iter().zip(&medians).map(|(&their, &our)| [their, our]).collect());
            found.says = format!(
                "Boxes by bounded principal axes take {:.0}% of the build of {name} here, {:.0}% in the dissertation.",
                100.0 * share(&medians),
                100.0 * share(theirs)
            );
        }
        series.push(Series { name: name.to_owned(), points, is_joined: false });
    }
    chapter.plots.push(Plot {
        title: "Passes of a build on one thread: ours over the dissertation's".to_owned(),
        x: Axis::log("theirs, ms"),
        y: Axis::log("ours, ms"),
        series,
    });
    let order = Pairs::of(&found.compared);
    table.says = format!(
        "In the dissertation, boxes take most of the time of a build on the CPU, in the order bounded, quaternion, unbounded (but for Sponza). Here, {} of {} pairs \
         of passes have its order.",
        order.n_same, order.n_all
    );
    chapter.tables.push(table);
    Ok(found)
}

/// Runs on a pool of one thread.
pub(super) fn one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(1).build()?.install(work))
}

fn measure_passes(model: &Model, repeats: usize) -> Result<[Samples; 6]> {
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let mut ms: [Vec<f64>; 6] = Default::default();
    for repeat in 0..=repeats {
        let mut keep = |pass: usize, took: timing::Seconds| {
            if repeat > 0 {
                ms[pass].push(took.cpu * 1e3);
            }
        };
        let (codes, took) = timing::time(|| canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners));
        keep(0, took);
        let (sorted, took) = timing::time(|| canted_lbvh::sort_by_code(&codes, Bits::B63));
        keep(1, took);
        let (tree, took) = timing::time(|| canted_lbvh::radix(sorted));
        keep(2, took);
        let leaves = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
        for (i, strategy) in
            [Strategy::PcaBounded, Strategy::Quaternion, Strategy::PcaUnbounded].into_iter().enumerate()
        {
            let config = VolumeConfig { strategy, fallback: true };
            keep(3 + i, timing::time(|| canted_lbvh::volumes(&tree, &leaves, &config)).1);
        }
    }
    Ok(ms.map(Samples::from))
}

const DEVICE_PASSES: [&str; 4] = ["codes", "nodes", "boxes, PCA bounded", "boxes, quaternion"];

/// The dissertation; its sort runs on the CPU, and its unbounded boxes take more than a minute.
const THEIRS_ON_DEVICE: [(&str, [f64; 4]); 3] = [
    ("dragon_871k", [13.14, 2.08, 50.90, 50.04]),
    ("sponza", [3.81, 0.64, 14.14, 13.40]),
    ("bunny", [1.90, 0.36, 7.67, 7.23]),
];

pub(super) fn on_device(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let gpu = match Gpu::open(&Choice::Best) {
        Ok(gpu) => gpu,
        Err(error) => {
            chapter.skipped.push(format!("Passes on a device (table 5): {error}."));
            return Ok(Found::default());
        }
    };
    let runs = effort.pick(1, 2, 5);
    let title = format!(
        "Passes of a build on a device (table 5, figure 11): {} ({}), minimum of {runs} runs",
        gpu.info().name,
        gpu.info().kind
    );
    let mut table = Table::new(title, &["scene", "pass", "TITAN Xp, theirs", "ours", "ours over theirs"]);
    let mut found = Found::default();
    // A software driver takes half a minute per run for the dragon.
    let names =
        if gpu.info().kind == AdapterKind::Software { &["bunny"][..] } else { &["dragon_871k", "sponza", "bunny"] };
    for (name, model) in scenes(effort, names, chapter)? {
        let (corners, _) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
        let items = Primitives::triangles(&gpu, [&corners[..]])?;
        let Passes { codes, tree, boxes, error, .. } = Passes::measure(&gpu, &items, Bits::B63, runs)?;
        chapter.skipped.extend(error.map(|error| format!("Some passes of {name} on the device: {error}.")));
        let of = |wanted: Strategy| STRATEGIES.iter().position(|&strategy| strategy == wanted).and_then(|i| boxes[i]);
        let ours = [codes, tree, of(Strategy::PcaBounded), of(Strategy::Quaternion)];
        let theirs = THEIRS_ON_DEVICE.iter().find(|(scene, _)| *scene == name).map(|(_, passes)| passes);
        let both = |(&their, ms): (&f64, &Option<f64>)| Some([their, (*ms)?]);
        found.compared.extend(theirs.map(|theirs| theirs.iter().zip(&ours).filter_map(both).collect()));
        for (i, (pass, ms)) in DEVICE_PASSES.into_iter().zip(ours).enumerate() {
            let their = theirs.map(|passes| passes[i]);
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(pass),
                Cell::text(or_dash(their.map(|ms| format!("{ms} ms")))),
                Cell::text(or_dash(ms.map(|ms| format!("{} ms", number(ms))))),
                Cell::text(or_dash(their.zip(ms).map(|(their, ms)| number(ms / their)))),
            ]);
        }
    }
    let order = Pairs::of(&found.compared);
    table.says = format!(
        "The dissertation builds 4 to 7 times as fast on a TITAN Xp as on its CPU. This device is {}, so only the order of the passes compares: that of {} of {} \
         pairs is the same.",
        gpu.info().kind,
        order.n_same,
        order.n_all
    );
    chapter.tables.push(table);
    Ok(found)
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "–".to_owned())
}
