//! Vector instructions compared with scalar code: what survives of Silva's chart.

use anyhow::Result;
use canted_trace::Watertight;
use canted_wide::{Config, Preset, SimdPath, TriangleBvh};

use super::orders::Found;
use super::passes::one_thread;
use super::scenes;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, faster, number},
};
use crate::wide::{closest_seconds, sets};

/// Silva's values: four lanes over a scalar test that the compiler also vectorised, and a GPU over one core.
const THEIRS: [(&str, &str, &str); 4] = [
    ("triangles (Silva)", "SSE, 4 lanes", "1.32"),
    ("boxes (Silva)", "SSE, 4 lanes", "1.5"),
    ("spheres (Silva)", "SSE, 4 lanes", "below 1, no number"),
    ("tests alone (Silva)", "OpenCL, 128 lanes", "about 30"),
];

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Vector instructions (Silva's chart): WideBvh by path",
        &["scene", "path", "camera ray", "over scalar"],
    );
    let mut says = String::new();
    let (mut series, mut gains) = (vec![], vec![]);
    for (name, model) in scenes(effort, effort.pick(&[][..], &["truss"], &["truss", "bunny", "sponza"]), chapter)? {
        let mesh = &model.mesh;
        let paths: Vec<SimdPath> = SimdPath::ALL.into_iter().filter(|path| path.is_available()).collect();
        let tree =
            TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::preset(Preset::Balanced))?;
        let trees = paths.iter().map(|&path| tree.clone().with_path(path)).collect();
        let rays = sets::camera(&model, effort.pick(16, 128, 128));
        let seconds = one_thread(|| closest_seconds(trees, &rays, effort.pick(2, 5, 9)))?;
        #[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
        let ns: Vec<Samples> = seconds.into_iter().map(|s| Samples::from(s).scaled(1e9 / rays.len() as f64)).collect();
        let mut points = vec![];
        for (i, path) in paths.iter().enumerate() {
            let gain = ns[0].median() / ns[i].median();
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(format!("{path:?}")),
                Cell::measured(ns[i].clone(), "ns"),
                Cell::text(number(gain)),
            ]);
            #[expect(clippy::cast_precision_loss, reason = "paths are few")]
            let place = i as f64;
            points.push(Point { label: format!("{path:?}"), x: place.into(), y: ns[i].clone() });
            if i > 0 {
                gains.push(format!("{name} {path:?} {}", number(gain)));
            }
            if i + 1 == paths.len() && says.is_empty() {
                let name_of_path = format!("{path:?}");
                let finding = faster((&name_of_path, &ns[i]), ("the scalar path", &ns[0]));
                says = format!("On {name} {finding}.");
            }
        }
        let order = paths.iter().map(|path| format!("{path:?}")).collect::<Vec<_>>().join(", ");
        series.push(Series { name: format!("{name}: {order}"), points, is_joined: true });
    }
    table.says = format!(
        "Silva's four lanes gain 1.32 on triangles and 1.5 on boxes alone. Here, eight lanes of whole rays gain, relative to the scalar path: {}.",
        gains.join(", ")
    );
    for (what, path, gain) in THEIRS {
        table.rows.push([what, path, "–", gain].map(Cell::text).to_vec());
    }
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: "A camera ray through WideBvh, by path".to_owned(),
        x: Axis::linear("path, in the order of the legend"),
        y: Axis::linear("ns"),
        series,
    });
    Ok(says.into())
}
