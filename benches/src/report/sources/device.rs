//! Milliseconds of each pass of a device build: the dissertation's table 5, rows of a TITAN Xp.

use anyhow::Result;
use canted_gpu::{
    AdapterKind, Choice, Gpu,
    build::{Passes, Primitives, STRATEGIES},
};
use canted_lbvh::{Bits, Strategy};

use super::orders::{Found, Pairs};
use super::scenes;
use crate::report::{
    effort::Effort,
    model::{Cell, Chapter, Table},
    samples::number,
};

const PASSES: [&str; 4] = ["codes", "nodes", "boxes, PCA bounded", "boxes, quaternion"];

/// The dissertation; its sort runs on the CPU, and its unbounded boxes take more than a minute.
const THEIRS: [(&str, [f64; 4]); 3] = [
    ("dragon_871k", [13.14, 2.08, 50.90, 50.04]),
    ("sponza", [3.81, 0.64, 14.14, 13.40]),
    ("bunny", [1.90, 0.36, 7.67, 7.23]),
];

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
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
        let primitives = Primitives::triangles(&gpu, [&corners[..]])?;
        let Passes { codes, tree, boxes, error, .. } = Passes::measure(&gpu, &primitives, Bits::B63, runs)?;
        chapter.skipped.extend(error.map(|error| format!("Some passes of {name} on the device: {error}.")));
        let of = |wanted: Strategy| STRATEGIES.iter().position(|&strategy| strategy == wanted).and_then(|i| boxes[i]);
        let ours = [codes, tree, of(Strategy::PcaBounded), of(Strategy::Quaternion)];
        let theirs = THEIRS.iter().find(|(scene, _)| *scene == name).map(|(_, passes)| passes);
        let both = |(&their, ms): (&f64, &Option<f64>)| Some([their, (*ms)?]);
        found.compared.extend(theirs.map(|theirs| theirs.iter().zip(&ours).filter_map(both).collect()));
        for (i, (pass, ms)) in PASSES.into_iter().zip(ours).enumerate() {
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
